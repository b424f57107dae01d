"""Every type of measurement: its values, its covariance, what it reads, and its derivative."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.scenes.fill import fill
from geometry.survey.measured import Deposit
from geometry.survey.measurements import Measurements, check_places
from geometry.survey.profiles import Profile, load_profile
from pipeline.cli import InputError
from tests.budget import examples

ABOUT = {"confidence": "assumed", "source": "a test"}
GROUND = np.array([[-100.0, 2.0], [100.0, 2.0]])

TOE = {"name": "toe", "type": "toe_runout", "side": "left", "value_m": 5.0, "std_m": 1.0}
CREST = {"name": "crest", "type": "crest_settlement", "at": "initial_crest_x", "x_m": 15.0,
         "value_m": 1.0, "std_m": 0.5}  # fmt: skip
CREST_POINTS = {"name": "crest points", "type": "crest_settlement", "at": "crest_points",
                "value_m": 1.0, "std_m": 0.5}  # fmt: skip
FREEBOARD = {"name": "freeboard", "type": "freeboard", "water_level_m": 6.0, "value_m": 1.0,
             "std_m": 0.5}  # fmt: skip
MARKER = {"name": "stake", "type": "marker_displacement", "x_m": 14.0, "y_m": 5.0, "dx_m": -2.0,
          "dy_m": -1.0, "std_m": 0.2}  # fmt: skip
HISTORY = {"name": "film", "type": "toe_history", "side": "left", "times_s": [0.5, 1.0, 2.0],
           "values_m": [1.0, 2.0, 3.0], "std_m": 0.3, "correlation_time_s": 1.0}  # fmt: skip
SPEED = {"name": "speed", "type": "velocity", "x_m": 12.0, "at_s": 1.5, "value_m_per_s": -1.0,
         "std_m_per_s": 0.1}  # fmt: skip
DURATION = {"name": "eyewitness", "type": "slide_duration", "value_s": 2.0, "std_s": 0.5}
PROFILE = {"name": "survey", "type": "surface_profile", "file": "survey.csv", "std_m": 0.4,
           "correlation_length_m": 8.0}  # fmt: skip
STOOD = {"name": "no flow", "type": "no_flow", "side": "left", "limit_m": 1.5, "std_m": 0.5}
SLIP = {"name": "boring", "type": "slip_depth", "x_m": 14.0, "value_m": 6.0, "std_m": 0.5}
SLOPE = {"name": "final slope", "type": "final_slope", "side": "left", "value_deg": 9.0,
         "std_deg": 1.0}  # fmt: skip
EVERY = [
    TOE,
    CREST,
    CREST_POINTS,
    FREEBOARD,
    MARKER,
    HISTORY,
    SPEED,
    DURATION,
    PROFILE,
    STOOD,
    SLIP,
    SLOPE,
]
SURVEY = Profile(np.array([8.0, 12.0, 16.0, 20.0]), np.array([4.0, 6.0, 7.0, 6.0]), ["all"] * 4)


def measurements_of(*entries: dict, **fields) -> Measurements:
    measurements = Measurements.model_validate(
        {
            "case": "test",
            "upstream": "left",
            "initial": {},
            "default_set": "field",
            "sets": {"field": [{**ABOUT, **entry} for entry in entries]},
            **fields,
        }
    )
    for entry in measurements.profiles:
        entry.attach(SURVEY)
    return measurements


def entry_of(entry: dict):
    return measurements_of(entry).chosen()[0]


@pytest.fixture(scope="module")
def section(make_scene):
    """A trapezoid of 30 m by 8 m on a base at y = 2."""
    outline = [(0.0, 2.0), (12.0, 10.0), (18.0, 10.0), (30.0, 2.0)]
    return make_scene([outline], ground=GROUND.tolist(), spacing=0.5)


@pytest.fixture(scope="module")
def slid(section) -> Deposit:
    """Five frames, a second apart, in which the section shears to the left and sinks."""
    before = fill(section).position
    height = before[:, 1] - 2.0
    frames = []
    for share in (0.0, 0.3, 0.7, 1.0, 1.0):
        moved = before.copy()
        moved[:, 0] -= share * (1.0 + 0.35 * height)
        moved[:, 1] -= share * 0.1 * height
        frames.append(moved)
    return Deposit(
        position=frames[-1],
        initial_position=before,
        volume=0.25,
        spacing=0.5,
        foot={"left": 0.0, "right": 30.0},
        ground=GROUND,
        positions=np.array(frames),
        time=np.arange(5.0),
    )


@pytest.mark.parametrize("entry", EVERY, ids=lambda entry: entry["name"])
def test_values_covariance_and_reading_go_together(entry, slid):
    measurement = entry_of(entry)
    values, covariance = measurement.values, measurement.covariance()
    assert measurement.observe(slid).shape == values.shape == (len(measurement.parts),)
    assert covariance.shape == (len(values),) * 2
    assert np.array_equal(covariance, covariance.T)
    assert np.all(np.linalg.eigvalsh(covariance) > 0)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(measurement.std)
    assert measurement.held_out_values.shape == values.shape
    assert not measurement.held_out_values.any()


@pytest.mark.parametrize("entry", EVERY, ids=lambda entry: entry["name"])
def test_the_derivative_is_that_of_the_reading(entry, slid):
    measurement = entry_of(entry)
    observed = measurement.observe_with_derivative(slid)
    assert observed.values == pytest.approx(measurement.observe(slid), abs=1e-12)
    way = np.random.default_rng(3).normal(size=slid.positions.shape)
    # One smooth direction for all frames; the deposit is the last of them.
    way[:] = np.sin(0.2 * slid.initial_position) + 0.3
    step = 1e-5
    moved = []
    for sign in (1.0, -1.0):
        positions = slid.positions + sign * step * way
        changed = Deposit(**{**slid.__dict__, "positions": positions, "position": positions[-1]})
        moved.append(measurement.observe(changed))
    numeric = (moved[0] - moved[1]) / (2.0 * step)
    predicted = [
        sum(
            float(np.sum(observed.change[i, k] * way[observed.frames[i, k]]))
            for k in range(observed.frames.shape[1])
        )
        for i in range(len(observed.values))
    ]
    assert predicted == pytest.approx(numeric, rel=2e-3, abs=1e-6)
    assert np.any(np.abs(numeric) > 1e-3), "the test moves what is measured"


@settings(max_examples=examples(40), deadline=None)
@given(
    places=st.lists(st.floats(0, 1000), min_size=2, max_size=12, unique=True),
    std=st.floats(0.01, 10),
    model=st.floats(0, 10),
    length=st.floats(0.1, 100),
)
def test_covariance_of_a_profile(places, std, model, length):
    entry = entry_of(
        {**PROFILE, "std_m": std, "model_std_m": model, "correlation_length_m": length}
    )
    x = np.sort(np.array(places))
    entry.attach(Profile(x, np.zeros(len(x)), ["a"] * len(x)))
    expected = (std**2 + model**2) * np.exp(-abs(x[0] - x[-1]) / length)
    assert entry.covariance()[0, -1] == pytest.approx(expected)
    assert entry.covariance(model=False)[0, 0] == pytest.approx(std**2)
    assert np.all(np.linalg.eigvalsh(entry.covariance()) > -1e-9 * (std**2 + model**2))


@settings(max_examples=examples(25), deadline=None)
@given(dx=st.floats(-20, 20), dy=st.floats(-5, 5))
def test_moving_everything_moves_the_readings_as_much(section, dx, dy):
    before = fill(section).position
    moved = Deposit(
        before + [dx, dy],
        before,
        0.25,
        0.5,
        {"left": 0.0, "right": 30.0},
        ground=GROUND,
        positions=np.array([before, before + [dx, dy]]),
        time=np.array([0.0, 2.0]),
    )
    still = Deposit(before, before, 0.25, 0.5, moved.foot)
    toe, crest, stake = entry_of(TOE), entry_of(CREST_POINTS), entry_of(MARKER)
    assert toe.observe(moved) == pytest.approx(toe.observe(still) - dx, abs=1e-6)
    assert crest.observe(moved) == pytest.approx([-dy], abs=1e-9)
    assert stake.observe(moved) == pytest.approx([dx, dy], abs=1e-9)
    freeboard = entry_of(FREEBOARD)
    assert freeboard.observe(moved) == pytest.approx(freeboard.observe(still) + dy, abs=1e-3)
    history = entry_of(HISTORY)
    expected = toe.observe(still) - dx * np.array([0.25, 0.5, 1.0])
    assert history.observe(moved) == pytest.approx(expected, abs=1e-6)


def test_a_profile_reads_the_surface_over_its_ground(section, slid):
    before = fill(section).position
    still = Deposit(before, before, 0.25, 0.5, slid.foot, ground=GROUND)
    entry = entry_of(PROFILE)
    # The kernel rounds nothing off on the straight faces; 0.1 m is what the lattice leaves.
    entry.attach(Profile(np.array([4.0, 6.0, 15.0, 24.0]), np.zeros(4), ["a"] * 4))
    assert entry.observe(still) == pytest.approx([4.67, 6.0, 10.0, 6.0], abs=0.12)
    with pytest.raises(ValueError, match="survey: a surface profile needs the ground"):
        entry.observe(Deposit(before, before, 0.25, 0.5, slid.foot))


def test_what_did_not_flow_is_read_from_its_own_toe_and_is_a_limit(slid):
    stood, toe = entry_of(STOOD), entry_of(TOE)
    before = Deposit(**{**slid.__dict__, "position": slid.initial_position})
    assert stood.observe(before) == pytest.approx([0.0])
    assert stood.observe(slid) == pytest.approx(toe.observe(slid) - toe.observe(before))
    assert stood.by_eye(before) == 0.0 and stood.by_eye(slid) > 1.0
    assert stood.censored and not toe.censored
    assert stood.with_values(np.array([3.0])).values == pytest.approx([3.0])
    (mark,) = stood.marks({"left": 0.0, "right": 30.0})
    assert mark.limit and mark.end == pytest.approx(-1.5)


def test_a_marker_may_be_measured_in_one_direction(slid):
    both = entry_of(MARKER).observe(slid)
    only = entry_of({key: value for key, value in MARKER.items() if key != "dx_m"})
    assert only.parts == ["dy"] and only.values == pytest.approx([-1.0])
    assert only.observe(slid) == pytest.approx(both[1:])


def test_after_the_rest_nothing_moves(slid):
    late = entry_of({**HISTORY, "times_s": [3.5, 50.0], "values_m": [1.0, 1.0]})
    toe = entry_of(TOE).observe(slid)[0]
    assert late.observe(slid) == pytest.approx([toe, toe])
    speed = entry_of({**SPEED, "at_s": 50.0})
    assert speed.observe(slid) == pytest.approx([0.0])
    assert not speed.observe_with_derivative(slid).change.any()
    cut = Deposit(**{**slid.__dict__, "at_rest": False})
    with pytest.raises(ValueError, match="film: measured at 50 s, but the run was stopped"):
        late.observe(cut)
    with pytest.raises(ValueError, match="speed: measured at 50 s"):
        speed.observe(cut)


def test_the_duration_is_that_of_the_middle_of_the_way(slid):
    # The way is in proportion to 0, 0.3, 0.7, 1, 1 at 0, 1, 2, 3, 4 s.
    duration = entry_of(DURATION)
    assert duration.observe(slid) == pytest.approx([(2.0 + 0.25 / 0.3) - 0.05 / 0.3])
    all_but = entry_of({**DURATION, "between": [0.3, 0.7]})
    assert all_but.observe(slid) == pytest.approx([1.0])
    # Neither a late start nor a long rest makes a slide longer, and coarse points weigh as fine.
    late = np.concatenate([slid.positions[:1], slid.positions, slid.positions[-1:]])
    waited = Deposit(**{**slid.__dict__, "positions": late, "time": np.arange(7.0)})
    assert duration.observe(waited) == pytest.approx(duration.observe(slid))
    still = np.repeat(slid.positions[:1], 5, axis=0)
    assert entry_of(DURATION).observe(Deposit(**{**slid.__dict__, "positions": still})) == [0.0]
    cut = Deposit(**{**slid.__dict__, "at_rest": False})
    with pytest.raises(ValueError, match="eyewitness: the run was stopped in motion at 4 s"):
        duration.observe(cut)


def test_where_no_soil_is_nothing_moves(slid):
    assert entry_of({**SPEED, "x_m": 90.0}).observe(slid) == pytest.approx([0.0])
    assert entry_of(SPEED).observe(slid)[0] < -0.5
    with pytest.raises(ValueError, match="film: needs all frames of the run"):
        entry_of(HISTORY).observe(Deposit(**{**slid.__dict__, "positions": None}))


def test_what_is_held_out():
    assert entry_of({**TOE, "held_out": True}).held_out_values.tolist() == [True]
    assert entry_of({**MARKER, "held_out": True}).held_out_values.tolist() == [True, True]
    block = entry_of({**PROFILE, "held_out_x_m": [11.0, 17.0]})
    assert block.held_out_values.tolist() == [False, True, True, False]


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ({**MARKER, "dx_m": None, "dy_m": None}, "dx_m, dy_m: give at least one of them"),
        ({**HISTORY, "times_s": [1.0, 1.0, 2.0]}, "times_s: 1 follows 1; times must ascend"),
        ({**HISTORY, "times_s": [-1.0, 1.0, 2.0]}, "times_s begins at -1"),
        ({**HISTORY, "times_s": [1.0]}, "times_s has 1 numbers and values_m 3"),
        ({**SPEED, "std_m_per_s": 0.0}, "greater than 0"),
        ({**SPEED, "at_s": -2.0}, "greater than or equal to 0"),
        ({**STOOD, "limit_m": 0.0}, r"limit_m\s+Input should be greater than 0"),
        ({**DURATION, "between": [0.9, 0.1]}, "between 0.9 and 0.1: shares of the way must ascend"),
        ({**DURATION, "between": [0.0, 0.9]}, "must ascend within 0 and 1"),
    ],
)
def test_entries_that_say_nothing_are_refused(entry, complaint):
    with pytest.raises(ValueError, match=complaint):
        entry_of(entry)


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ({**MARKER, "y_m": 50.0}, "'stake': the marker .14, 50. lies in no zone of the section"),
        ({**CREST, "x_m": 31.0}, "'crest': x_m 31 lies outside the section, x 0 to 30 m"),
        ({**FREEBOARD, "water_level_m": 1.0}, "water_level_m 1 lies outside the domain, y 2 to"),
        ({**SPEED, "x_m": -2000.0}, "x_m: -2000 lies outside the domain, x -1000 to 1000 m"),
        (
            {**CREST, "value_m": 200.0},
            "'crest': value_m 200 is more than the section is high",
        ),
        ({**CREST_POINTS, "value_m": 8.5}, "value_m 8.5 is more than the section is high"),
        ({**FREEBOARD, "value_m": 999.0}, "value_m 999 over water at .* is ground at y 10"),
        ({**FREEBOARD, "value_m": -9.0}, "value_m -9 over water at .* is ground at y -"),
        ({**SLIP, "x_m": -1.0}, "'boring': x_m -1 lies outside the section, x 0 to 30 m"),
        ({**SLIP, "value_m": 9.0}, "value_m 9: the soil at x 14 is 8 m deep; a depth of the slip"),
        ({**SLIP, "value_m": 0.0}, "a depth of the slip lies between 0 and that"),
    ],
)
def test_places_outside_the_section_are_refused(section, entry, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        check_places(measurements_of(entry), section, "m.yaml")
    assert str(caught.value).startswith("m.yaml: ") and "\n" not in str(caught.value)
    check_places(measurements_of(*EVERY), section, "m.yaml")


@pytest.mark.parametrize(
    ("initial", "complaint"),
    [
        ({"crest_x_m": 31.0}, "initial.crest_x_m 31 lies outside the section, x 0 to 30 m"),
        (
            {"toe_left_x_m": 16.0, "crest_x_m": 15.0},
            "toe_left_x_m: 16 lies beyond the crest",
        ),
        ({"toe_right_x_m": 14.0, "crest_x_m": 15.0}, "toe_right_x_m: 14 lies beyond the crest"),
        (
            {"toe_left_x_m": 30.0, "toe_right_x_m": 0.0},
            "toe_left_x_m: 30 must be left of toe",
        ),
        ({"crest_y_m": 1001.0}, "crest_y_m: 1001 lies outside the domain, y 2 to 1000 m"),
        ({"pool_y_m": 500.0}, "initial.pool_y_m 500 m: the section lies between 2 and 10 m"),
    ],
)
def test_an_initial_section_that_is_another_is_refused(section, initial, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        check_places(measurements_of(TOE, initial=initial), section, "m.yaml")
    assert str(caught.value).startswith("m.yaml: ") and "\n" not in str(caught.value)
    whole = {"toe_left_x_m": 0.0, "toe_right_x_m": 30.0, "crest_x_m": 15.0, "crest_y_m": 10.0}
    check_places(measurements_of(TOE, initial={**whole, "pool_y_m": 7.0}), section, "m.yaml")


def test_profiles_and_toes_outside_the_domain_are_refused(section):
    measurements = measurements_of(PROFILE)
    for x, y, complaint in (
        ([0.0, 2000.0], [3.0, 3.0], "survey.csv: x_m: 2000 lies outside"),
        ([0.0, 4.0], [3.0, -7.0], r"\(4, -7\) lies outside the domain, from the ground at y 2"),
    ):
        measurements.profiles[0].attach(Profile(np.array(x), np.array(y), ["a", "a"]))
        with pytest.raises(InputError, match=complaint):
            check_places(measurements, section, "m.yaml")
    far = measurements_of({**TOE, "value_m": 5000.0})
    check_places(far, section, "m.yaml")  # open walls give way
    box = {"x_min": -10.0, "x_max": 40.0, "y_max": 20.0, "walls": "closed"}
    with pytest.raises(InputError, match="'toe': the toe: -5000 lies outside the domain"):
        check_places(far, section.changed(domain=box), "m.yaml")
    with pytest.raises(InputError, match="'no flow': limit_m: -60 lies outside the domain"):
        check_places(
            measurements_of({**STOOD, "limit_m": 60.0}), section.changed(domain=box), "m.yaml"
        )
    feet = measurements_of(TOE, initial={"toe_left_x_m": -3000.0})
    with pytest.raises(InputError, match="initial.toe_left_x_m: -3000 lies outside"):
        check_places(feet, section, "m.yaml")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "column x_m is missing; needed are x_m and y_m"),
        ("x_ft,y_m\n1,2\n3,4\n", r"column x_m is missing \(found 'x_ft'\)"),
        ("x_m,y_m,colour\n1,2,3\n", "unknown column 'colour'; allowed are x_m, y_m, part"),
        ("# nothing\nx_m,y_m\n", "holds 0 points; a profile needs at least 2"),
        ("x_m,y_m\n1,2\n", "holds 1 points"),
        ("# a\nx_m,y_m\n1,2\n\n3,inf\n", "line 5: y_m: 'inf' is not a finite number"),
        ("x_m,y_m\n1,2\n3\n", "line 3: y_m: None is not a finite number"),
        ("x_m,y_m\n3,2\n1,2\n", "line 3: x_m 1 follows 3; x_m must ascend"),
        ("x_m,y_m\n3,2\n3,5\n", "line 3: x_m 3 follows 3"),
    ],
)
def test_profiles_that_cannot_be_read_are_one_line(tmp_path, text, complaint):
    path = tmp_path / "p.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint) as caught:
        load_profile(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_a_profile_of_one_part(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("\ufeffx_m,y_m\n1,2\n3,4\n")
    profile = load_profile(path)
    assert profile.part == ["surveyed", "surveyed"] and profile.only(None) is profile
    mixed = Profile(np.arange(3.0), np.arange(3.0), ["a", "b", "a"])
    assert mixed.only("a").x.tolist() == [0.0, 2.0]
