"""Heave before the toe and depth of the slip: planted ones, and those of an embankment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.columns import kernel, kernel_integral
from geometry.survey.heave import Heave
from geometry.survey.measured import Deposit, Measured
from geometry.survey.measurements import Measurements, check_places
from geometry.survey.registry import measurement_of
from geometry.survey.site import Site
from geometry.survey.slip_depth import SlipDepth
from mpm_taichi.simulate import simulate
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.budget import examples
from tests.geometry.test_far_boundary import SOIL, road

ABOUT = {"confidence": "assumed", "source": "a test", "std_m": 0.3}
DEEP = 10.0
GALLERY = Path(__file__).parents[2] / "docs/examples/gallery"


def heave_of(side="right", value=1.0, **more) -> Heave:
    return measurement_of(
        {"name": "heave", "type": "heave", "side": side, "value_m": value, **ABOUT, **more}
    )


def slip_of(x=10.0, value=5.0) -> SlipDepth:
    return measurement_of(
        {"name": "boring", "type": "slip_depth", "x_m": x, "value_m": value, **ABOUT}
    )


def survey_of(entry: Measured) -> Measurements:
    return Measurements.model_validate(
        {"case": "road", "upstream": "right", "initial": {}, "default_set": "field",
         "sets": {"field": [entry.model_dump(exclude_none=True)]}}
    )  # fmt: skip


def differences(entry: Measured, deposit: Deposit, step: float = 1e-5) -> tuple[float, float]:
    """Change of a reading as the points move: by its derivative, and by differences."""
    way = np.sin(0.3 * deposit.initial_position) + 0.3
    seen = entry.observe_with_derivative(deposit)
    assert seen.values == pytest.approx(entry.observe(deposit), abs=1e-12)
    ends = [
        entry.observe(
            Deposit(**{**deposit.__dict__, "position": deposit.position + sign * step * way})
        )[0]
        for sign in (1.0, -1.0)
    ]
    return float(np.sum(seen.change[0, 0] * way)), float(ends[0] - ends[1]) / (2.0 * step)


# --- depth of the slip ---


def layer(spacing: float, jitter: float = 0.0, wide: float = 20.0) -> np.ndarray:
    """Points of a layer of 10 m on a base at y = 0, shaken by shares of a spacing."""
    x, y = np.meshgrid(
        np.arange(-wide + 0.5 * spacing, wide, spacing), np.arange(0.5 * spacing, DEEP, spacing)
    )
    points = np.column_stack([x.ravel(), y.ravel()])
    return points + spacing * np.random.default_rng(5).uniform(-jitter, jitter, points.shape)


def slipped(spacing: float, moved, jitter: float = 0.0, ground=0.0) -> Deposit:
    """The layer after its points moved by `moved(x, y)`, (n, 2)."""
    before = layer(spacing, jitter)
    after = before + np.column_stack(np.broadcast_arrays(*moved(*before.T)))
    return Deposit(after, before, spacing**2, spacing, {"left": -20.0, "right": 20.0}, ground)


def block(depth: float, slope: float = 0.0, way=(5.0, -1.0)):
    """A body that moved on a plane which lies `depth` below the surface at x = 0."""

    def moved(x, y):
        above = y > DEEP - depth + slope * x
        return way[0] * above, way[1] * above

    return moved


@pytest.mark.parametrize("slope", [0.0, -0.577], ids=["level", "of 30 degrees"])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
@pytest.mark.parametrize("spacing", [1.0, 0.5, 0.25])
def test_a_planted_slip_is_found_within_half_a_spacing(spacing, jitter, slope):
    for depth in (3.15, 5.0, 7.4):
        way = (5.0, 5.0 * slope)
        deposit = slipped(spacing, block(depth, slope, way), jitter)
        assert slip_of(0.0).observe(deposit) == pytest.approx([depth], abs=0.5 * spacing)


@settings(max_examples=examples(30), deadline=None)
@given(
    depth=st.floats(2.5, 8.0),
    band=st.floats(0.2, 3.0),
    far=st.floats(-20.0, 20.0).filter(lambda far: abs(far) > 1.0),
)
def test_the_width_of_the_sheared_band_does_not_move_the_slip(depth, band, far):
    """Half of the displacement lies in the middle of the band, to whichever side the soil ran."""

    def sheared(x, y):
        return far * np.clip((y - (DEEP - depth)) / band + 0.5, 0.0, 1.0), -0.1 * (y > 5.0)

    (found,) = slip_of(0.3).observe(slipped(0.5, sheared))
    assert found == pytest.approx(depth, abs=0.3)


@pytest.mark.parametrize("spacing", [1.0, 0.5])
def test_soil_that_slid_on_its_base_has_its_slip_there(spacing):
    deposit = slipped(spacing, block(2.0 * DEEP))
    assert slip_of(3.0).observe(deposit) == pytest.approx([DEEP], abs=0.05 * spacing)


def test_a_squeezed_layer_under_fill_that_stands_has_its_slip_below():
    def squeezed(x, y):
        return 3.0 * ((y > 2.0) & (y < 5.0)), 0.0 * y

    assert slip_of(0.0).observe(slipped(0.5, squeezed)) == pytest.approx([8.0], abs=0.25)


def test_settlement_alone_and_a_crawl_are_no_slip():
    for way in ((0.0, -0.3), (0.4, 0.0)):
        reading = slip_of(0.0).reading(slipped(0.5, block(5.0, way=way)))
        assert np.isnan(reading.values).all()
        assert "boring: the soil at x 0 m moved sideways by at most" in reading.trouble
        assert reading.trouble.endswith("less than 0.5 m: no slip")
    deposit = slipped(0.5, block(5.0))
    away = slip_of(40.0).reading(deposit)
    assert away.trouble == "boring: no soil stood at x 40 m before the slide"
    unknown = Deposit(**{**deposit.__dict__, "ground": None})
    assert "needs the ground" in slip_of(0.0).reading(unknown).trouble
    fewer = Deposit(**{**deposit.__dict__, "position": deposit.position[1:]})
    assert "needs the same points before and after" in slip_of(0.0).reading(fewer).trouble


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_the_derivative_of_a_slip_depth(jitter):
    def sheared(x, y):
        return -6.0 / (1.0 + np.exp(-(y - 4.0))) * (1.0 - 0.02 * (y - 7.0) ** 2), -0.1 * y

    exact, numeric = differences(slip_of(1.2), slipped(0.5, sheared, jitter))
    assert abs(numeric) > 1e-3 and exact == pytest.approx(numeric, rel=1e-4)


def test_the_integral_of_the_kernel():
    for offset in (-2.5, -1.3, -0.4, 0.0, 0.7, 1.6, 2.0, 3.0):
        whole, _ = quad(kernel, -3.0, offset, args=(1.0,), points=(-2, -1, 0, 1, 2), limit=200)
        assert kernel_integral(offset, 1.0) == pytest.approx(whole, abs=1e-7)


# --- heave ---


def risen(rise, spacing=0.5, ran=0.0, jitter=0.0) -> tuple[Scene, Deposit]:
    """A fill on ground that goes on and rose by `rise(x)`; the fill's right half ran."""
    scene = road(spacing=spacing)
    points = fill(scene)
    before = points.position.astype(float)
    before += spacing * np.random.default_rng(2).uniform(-jitter, jitter, before.shape)
    after, volume = before.copy(), points.volume.astype(float)
    ground = points.zone == 1
    taller = 1.0 + rise(before[:, 0]) / 4.0
    after[ground, 1] = -4.0 + (after[ground, 1] + 4.0) * taller[ground]
    after[~ground & (before[:, 0] > 18.0), 0] += ran
    feet = {"left": 0.0, "right": 36.0}
    return scene, Deposit.on(
        scene, feet, after, before, points.volume, volume=np.where(ground, volume * taller, volume)
    )


def bump(middle: float, width: float, height: float):
    """Half a wave of the sine."""

    def rise(x):
        inside = np.abs(x - middle) < 0.5 * width
        return np.where(inside, height * np.cos(np.pi * (x - middle) / width), 0.0)

    return rise


@pytest.mark.parametrize("jitter", [0.0, 0.3])
@pytest.mark.parametrize(("spacing", "off"), [(1.0, 0.06), (0.5, 0.03), (0.25, 0.03)])
def test_a_planted_bump_is_read(spacing, off, jitter):
    _, deposit = risen(bump(49.0, 16.0, 1.5), spacing, ran=4.0, jitter=jitter)
    assert heave_of().observe(deposit) == pytest.approx([1.5], rel=off)
    assert heave_of(x_m=49.0).observe(deposit) == pytest.approx([1.5], rel=off)
    assert heave_of(x_m=36.0).observe(deposit) == pytest.approx([0.0], abs=0.15 * spacing)
    assert heave_of("left").observe(deposit) == pytest.approx([0.0], abs=0.05 * spacing)


@settings(max_examples=examples(20), deadline=None)
@given(height=st.floats(-1.0, 2.0), x=st.floats(45.0, 55.0), ran=st.floats(0.0, 10.0))
def test_the_largest_rise_is_no_less_than_that_at_a_place(height, x, ran):
    _, deposit = risen(bump(50.0, 18.0, height), ran=ran)
    (largest,), (there,) = (one.observe(deposit) for one in (heave_of(), heave_of(x_m=x)))
    toe = measurement_of(
        {"name": "t", "type": "toe_runout", "side": "right", "value_m": 1, **ABOUT}
    )
    if x > 36.0 + max(float(toe.observe(deposit)[0]), 0.0):
        assert largest >= there - 1e-6
    assert largest >= -1e-9


def test_fill_that_ran_over_the_ground_is_no_heave():
    _, deposit = risen(lambda x: 0.0 * x, ran=8.0)
    assert heave_of().observe(deposit) == pytest.approx([0.0], abs=1e-9)
    assert heave_of(x_m=40.0).observe(deposit) == pytest.approx([0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("rise", "entry"),
    [
        (bump(49.0, 16.0, 1.5), heave_of()),  # a summit
        (lambda x: 2.0 * np.exp(-(((x - 30.0) / 12.0) ** 2)), heave_of()),  # at the toe
        (bump(49.0, 16.0, 1.5), heave_of(x_m=52.0)),
    ],
    ids=["summit", "at the toe", "at a place"],
)
def test_the_derivative_of_heave(rise, entry):
    _, deposit = risen(rise, ran=6.0)
    exact, numeric = differences(entry, deposit)
    assert abs(numeric) > 1e-3 and exact == pytest.approx(numeric, rel=1e-4)


def test_a_toe_that_ran_to_the_end_of_the_ground_leaves_none_to_heave():
    _, deposit = risen(lambda x: 0.0 * x)
    deposit.position[deposit.front["right"], 0] += 34.0
    reading = heave_of().reading(deposit)
    assert np.isnan(reading.values).all()
    assert reading.trouble.startswith("heave: the right toe ran to the end of the drawn ground")
    bare = Deposit(**{**deposit.__dict__, "front": {}})
    assert "no soil goes on beyond the toe to the right" in heave_of().reading(bare).trouble
    fewer = Deposit(**{**deposit.__dict__, "position": deposit.position[1:]})
    assert "the same points before and after" in heave_of().reading(fewer).trouble


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        (heave_of(x_m=30.0), "x_m 30: the ground beyond the toe begins at the right foot, x 36 m"),
        (heave_of(value=-0.4), "the largest rise is 0 or more; give x_m"),
        (heave_of(x_m=65.5), "draw more of the ground to the right"),
        (heave_of("left", x_m=5.0), "begins at the left foot, x 0 m"),
        (heave_of("left", x_m=-25.0), "read from the foot at x 0 to -2[0-9.]+ m; draw more"),
        (heave_of(value=11.0), "value_m 11 is ground at y 11; the domain has -4 to 10 m"),
        (slip_of(-30.0), "x_m -30 lies outside the section"),
        (slip_of(18.0, 12.0), "value_m 12: the soil at x 18 is 10 m deep"),
    ],
)
def test_what_cannot_have_been_measured_is_refused(entry, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        check_places(survey_of(entry), road(), "m.yaml")
    assert str(caught.value).startswith("m.yaml: ") and "\n" not in str(caught.value)
    for sound in (
        heave_of(),
        heave_of(x_m=45.0),
        heave_of("left", value=-0.5, x_m=-5.0),
        slip_of(18.0, 9.5),
    ):
        check_places(survey_of(sound), road(), "m.yaml")


def test_rigid_ground_does_not_heave():
    free = road(right="free")
    with pytest.raises(InputError, match="no soil goes on to the right beyond the toe"):
        check_places(survey_of(heave_of()), free, "m.yaml")
    check_places(survey_of(heave_of("left")), free, "m.yaml")
    cut = scene_from_mapping(
        {**road().model_dump(),
         "zones": [{"name": "a", "polygon": [[-25.3, -4], [66, -4], [66, 0], [-25.3, 0]],
                    "material": "sand"}],
         "materials": {"sand": SOIL}}
    )  # fmt: skip
    with pytest.raises(InputError, match="goes on to the right, and so does every zone"):
        check_places(survey_of(heave_of()), cut, "m.yaml")


# --- what could be measured, and an embankment ---


@pytest.fixture(scope="module")
def embankment() -> Scene:
    section = read_section(GALLERY / "embankment_on_foundation.csv")
    scene = section_scene(section, source="a.csv", name="embankment", unit="m")
    return scene.changed(spacing=1.0)


def test_what_is_proposed(embankment):
    feet = {"left": 0.0, "right": 35.0}
    (first, second) = Heave.could_be_made(Site(embankment, feet, [], 9.81))
    assert (first.name, second.side) == ("heave before the left toe", "right")
    # It ran to the right, and the largest rise there is known; a rise at one place is another.
    assert not Heave.could_be_made(Site(embankment, feet, [heave_of("right")], 9.81))
    (one,) = Heave.could_be_made(Site(embankment, feet, [heave_of("left", x_m=-9.0)], 9.81))
    assert one.side == "left" and one.std == 0.3, "as well as what was measured"
    names = [entry.name for entry in SlipDepth.could_be_made(Site(embankment, feet, [], 9.81))]
    assert names == ["depth of the slip at x 6 m", "depth of the slip at x 29 m"]
    had = Site(embankment, feet, [slip_of(5.0)], 9.81)
    assert [entry.x_m for entry in SlipDepth.could_be_made(had)] == [29.0]
    firm = road()
    assert not Heave.could_be_made(Site(firm, {"left": 0.0, "right": 36.0}, [], 9.81))


def test_an_embankment_on_a_liquefied_layer_heaves_and_slips_on_its_base(embankment):
    weak = embankment.with_strength("loose", cohesion_kpa=6.0)
    (run,) = simulate([weak], SimulationSettings(), threads=1)
    feet = {"left": 0.0, "right": 35.0}
    before, after = run.positions[0].astype(float), run.positions[-1].astype(float)
    deposit = Deposit.on(weak, feet, after, before, run.initial_volume, volume=run.bulk_volume)
    ground = ~deposit.front["left"]
    for side, outward in (("left", -1.0), ("right", 1.0)):
        (found,) = heave_of(side).observe(deposit)
        beyond = ground & (outward * (after[:, 0] - feet[side]) > 3.0)
        seen = after[beyond, 1].max() + 0.5 * weak.spacing  # the surface was at y = 0
        assert found == pytest.approx(seen, abs=0.35) and 0.5 < found < 3.0
    for x in (6.0, 29.0):
        (found,) = slip_of(x).observe(deposit)
        column = np.abs(before[:, 0] - x) < weak.spacing
        way = np.abs(after[column, 0] - before[column, 0])
        still = before[column, 1][way > 0.5 * way.max()].min() - 0.5 * weak.spacing
        assert found == pytest.approx(weak.surface(x) - still, abs=weak.spacing)
        assert found > weak.surface(x) + 2.0, "below the middle of the weak layer"
