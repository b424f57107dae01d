"""The observables: figures of a known deposit, symmetries, and derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from geometry.scenes.fill import fill
from geometry.survey.columns import (
    column_grid,
    column_height,
    connected,
    kernel,
    kernel_slope,
    naked_eye_toe,
    toe,
)
from geometry.survey.crest_settlement import CrestSettlement
from geometry.survey.frames import frames_around
from geometry.survey.freeboard import freeboard
from geometry.survey.marker_displacement import MarkerDisplacement
from geometry.survey.measured import Deposit
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_history import ToeHistory
from geometry.survey.toe_runout import toe_runout
from geometry.survey.velocity import Velocity
from tests.budget import examples

POOL, CREST = 35.9, 190.0
ABOUT = {"name": "it", "confidence": "assumed", "source": "a test"}
FEET = {"left": 0.0, "right": 0.0}
few = settings(
    max_examples=examples(40),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def heap(seed: int = 0, size: int = 9) -> np.ndarray:
    """A rough heap of points at about 1 m, slopes of 1 to 2, with its foot at y = 0."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(-2 * size, 2 * size) + 0.5, np.arange(size) + 0.5)
    inside = y < size - 0.5 * np.abs(x)
    points = np.column_stack([x[inside], y[inside]])
    return points + random.uniform(-0.2, 0.2, points.shape)


def slid(position: np.ndarray, before: np.ndarray, volume=1.0, **more) -> Deposit:  # noqa: ANN001
    return Deposit(position, before, volume, 1.0, FEET, **more)


def crest(x: float | None) -> CrestSettlement:
    """At a place, or of the crest's own points."""
    at = "crest_points" if x is None else "initial_crest_x"
    return CrestSettlement(type="crest_settlement", at=at, x_m=x, value_m=0.0, std_m=1.0, **ABOUT)


# --- the constructed profile of Lower San Fernando ---


def test_constructed_profile_gives_the_published_figures(dam, deposit):
    before, after = fill(dam).position, deposit(1.0)
    runout = toe_runout(after, 1.0, spacing=1.0, side="left", initial_toe=dam.foot("left"))
    assert runout == pytest.approx(53.0, abs=0.5)
    surface = [
        float(surface_profile(p, 1.0, CREST, spacing=1.0, ground=2.0)) for p in (before, after)
    ]
    assert surface[0] - surface[1] == pytest.approx(20.0, abs=0.5)
    left = freeboard(after, 1.0, water_level=POOL, spacing=1.0)
    assert left == pytest.approx(1.7, abs=0.1)


def test_crest_settlement_of_the_constructed_profile(dam, deposit):
    # The function follows points, the profile has none in common: two lattices of equal number.
    before, after = fill(dam).position, deposit(1.0)
    number = min(len(before), len(after))
    settled = crest(CREST).observe(slid(after[:number], before[-number:]))
    assert settled == pytest.approx([20.0], abs=0.5)


@pytest.mark.parametrize("spacing", [0.5, 1.0])
def test_constructed_profile_at_two_spacings(deposit, spacing):
    after = deposit(spacing)
    volume = spacing**2
    x = toe(after, volume, spacing=spacing, side="left")
    assert 76.02 - x == pytest.approx(52.93, abs=0.1)
    assert 76.02 - naked_eye_toe(after, volume, spacing=spacing, side="left") == pytest.approx(
        53.0, abs=spacing
    )


def test_toe_is_quiet_under_jitter(deposit):
    places = [
        toe(deposit(1.0, jitter=0.5, seed=seed), 1.0, spacing=1.0, side="left") for seed in range(8)
    ]
    assert np.std(places) < 0.1


def test_other_side_did_not_move(dam, deposit):
    before, after = fill(dam).position, deposit(1.0)
    places = [toe(points, 1.0, spacing=1.0, side="right") for points in (before, after)]
    assert places[0] == pytest.approx(places[1], abs=0.05)


# --- kernel and columns ---


def test_kernel_integrates_to_one_and_its_slope_is_its_derivative():
    x = np.linspace(-7.0, 7.0, 14_001)
    assert kernel(x, 3.0).sum() * 1e-3 == pytest.approx(1.0, abs=1e-6)
    numeric = (kernel(x + 1e-6, 3.0) - kernel(x - 1e-6, 3.0)) / 2e-6
    np.testing.assert_allclose(kernel_slope(x, 3.0), numeric, atol=1e-8)


def test_grid_of_columns_equals_the_sum():
    points = heap()
    volume = np.linspace(0.5, 1.5, len(points))
    places, heights = column_grid(points, volume, length=2.5)
    np.testing.assert_allclose(
        heights, column_height(points, volume, places, length=2.5), atol=1e-12
    )
    assert heights[0] == heights[-1] == 0.0
    assert heights.sum() * (places[1] - places[0]) == pytest.approx(volume.sum())


def test_level_lattice_is_level():
    x, y = np.meshgrid(np.arange(60) + 0.5, np.arange(5) + 0.5)
    points = np.column_stack([x.ravel(), y.ravel()])
    surface = surface_profile(points, 1.0, np.linspace(20, 40, 41), spacing=1.0, ground=3.0)
    np.testing.assert_allclose(surface, 8.0, atol=0.01)


def test_connected_equals_brute_force():
    random = np.random.default_rng(3)
    dam = heap(size=6)
    spray = random.uniform(-30.0, 30.0, (60, 2))
    points = np.concatenate([dam, spray])
    member = connected(points, 1.0, 1.0)
    near = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)) <= 3.0
    linked = np.zeros(len(points), dtype=bool)
    linked[0] = True
    while True:
        grown = near[linked].any(axis=0)
        if (grown == linked).all():
            break
        linked = grown
    np.testing.assert_array_equal(member, linked)
    assert 0 < (~member).sum() < 60


# --- symmetries ---


@few
@given(shift=st.floats(-300, 300), seed=st.integers(0, 50), side=st.sampled_from(["left", "right"]))
def test_toe_moves_with_the_points(shift, seed, side):
    points = heap(seed)
    here = toe(points, 1.0, spacing=1.0, side=side)
    there = toe(points + [shift, 0.0], 1.0, spacing=1.0, side=side)
    assert there - shift == pytest.approx(here, abs=1e-8)


@few
@given(seed=st.integers(0, 50))
def test_mirror_image(seed):
    points = heap(seed)
    mirrored = points * [-1.0, 1.0]
    assert toe(mirrored, 1.0, spacing=1.0, side="left") == pytest.approx(
        -toe(points, 1.0, spacing=1.0, side="right"), abs=1e-9
    )
    assert freeboard(mirrored, 1.0, water_level=2.0, spacing=1.0) == pytest.approx(
        freeboard(points, 1.0, water_level=2.0, spacing=1.0), abs=1e-6
    )
    x = np.linspace(-10, 10, 7)
    np.testing.assert_allclose(
        surface_profile(mirrored, 1.0, x, spacing=1.0),
        surface_profile(points, 1.0, -x, spacing=1.0),
        atol=1e-12,
    )


@few
@given(seed=st.integers(0, 50), lift=st.floats(-20, 20))
def test_freeboard_follows_the_ground_and_the_pool(seed, lift):
    points = heap(seed)
    here = freeboard(points, 1.0, water_level=2.0, spacing=1.0)
    raised = freeboard(points + [0.0, lift], 1.0, water_level=2.0, spacing=1.0)
    assert raised - lift == pytest.approx(here, abs=1e-6)
    assert freeboard(points, 1.0, water_level=3.0, spacing=1.0) == pytest.approx(here - 1.0)


@few
@given(
    x=st.floats(-200, 200),
    y=st.floats(0, 100),
    side=st.sampled_from(["left", "right"]),
)
def test_a_single_stray_point_does_not_matter(x, y, side):
    points = heap(size=12)
    with_stray = np.concatenate([points, [[x, y]]])
    apart = np.hypot(*(points - [x, y]).T).min()
    moved = toe(with_stray, 1.0, spacing=1.0, side=side) - toe(points, 1.0, spacing=1.0, side=side)
    higher = freeboard(with_stray, 1.0, water_level=0.0, spacing=1.0) - freeboard(
        points, 1.0, water_level=0.0, spacing=1.0
    )
    if apart > 3.0:
        assert abs(moved) < 1e-9 and abs(higher) < 1e-9
    else:  # it touches the heap and is then a part of it
        assert abs(moved) < 1.0 and abs(higher) < 0.5


def test_a_flying_cloud_is_not_the_toe():
    points = heap(size=12)
    cloud = np.random.default_rng(0).uniform([-60.0, 5.0], [-40.0, 9.0], (100, 2))
    both = np.concatenate([points, cloud])
    assert toe(both, 1.0, spacing=1.0, side="left") == toe(points, 1.0, spacing=1.0, side="left")
    assert naked_eye_toe(both, 1.0, spacing=1.0, side="left") > -30.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_sheet_thinner_than_the_points_is_where_the_slide_ends(side):
    """A tenth of all soil, 3.5 spacings between its points, 50 to 190 m off the heap."""
    outward, points = (-1.0 if side == "left" else 1.0), heap(size=12)
    points[:, 1] -= points[:, 1].min()
    count = len(points) // 9
    sheet = np.stack([outward * np.linspace(50.0, 190.0, count), np.full(count, 0.5)], axis=1)
    reading = {"spacing": 1.0, "side": side, "initial_toe": 0.0, "ground": 0.0}
    alone = toe_runout(points, 1.0, **reading)
    both = np.concatenate([points, sheet])
    found, change = toe_runout(both, 1.0, **reading, derivative=True)
    ahead = outward * both[:, 0]  # a tenth of what is in front of the foot lies farther out
    assert (ahead >= found).sum() == pytest.approx(0.1 * (ahead > 0.0).sum(), abs=1.0)
    assert alone < 40.0 < 50.0 < found < 190.0
    check_derivative(lambda p: toe_runout(p, 1.0, **reading), both, change)
    # What flies does not count, nor do a few points, nor soil off the other foot.
    assert toe_runout(both + [0.0, 5.0], 1.0, **reading) < 40.0
    few = np.concatenate([points, sheet[:: count // 3][:3]])
    assert toe_runout(few, 1.0, **reading) == pytest.approx(alone)
    other = np.concatenate([points, sheet * [-1.0, 1.0]])
    assert toe_runout(other, 1.0, **reading) == pytest.approx(alone)


@few
@given(slope=st.floats(0.7, 3.0), height=st.floats(8.0, 15.0))
def test_front_does_not_depend_on_the_resolution(make_scene, slope, height):
    run = height / slope
    polygon = [(0.0, 0.0), (30.0, 0.0), (30.0, height), (run, height)]
    places = []
    for spacing in (0.5, 0.25):
        points = fill(make_scene([polygon], spacing=spacing))
        places.append(toe(points.position, points.volume, spacing=spacing, side="left"))
    # The same threshold and kernel hold below 0.5 m: only the lattice is left.
    assert places[0] == pytest.approx(places[1], abs=0.15)
    coarse = fill(make_scene([polygon], spacing=1.0))
    x = toe(coarse.position, 1.0, spacing=1.0, side="left")
    assert x == pytest.approx(places[0], abs=1.0)


# --- derivatives ---


def central(function, points: np.ndarray, direction: np.ndarray, step: float = 1e-5):
    return (function(points + step * direction) - function(points - step * direction)) / (2 * step)


def check_derivative(function, points, derivative, seeds=range(4), tolerance=2e-6):
    for seed in seeds:
        direction = np.random.default_rng(seed).standard_normal(points.shape)
        numeric = central(function, points, direction)
        analytic = np.tensordot(derivative, direction, axes=points.ndim)
        np.testing.assert_allclose(analytic, numeric, atol=tolerance, rtol=tolerance)


@pytest.mark.parametrize("side", ["left", "right"])
def test_derivative_of_the_toe(side):
    points = heap(1)
    volume = np.linspace(0.8, 1.2, len(points))

    def runout(p):
        return toe_runout(p, volume, spacing=1.0, side=side, initial_toe=-5.0)

    value, change = toe_runout(
        points, volume, spacing=1.0, side=side, initial_toe=-5.0, derivative=True
    )
    assert value == runout(points)
    check_derivative(runout, points, change)
    # All points moved by one metre move the toe by one metre.
    assert change[:, 0].sum() == pytest.approx(-1.0 if side == "left" else 1.0)
    assert not change[:, 1].any()


def test_derivative_of_columns_and_profile():
    points, x = heap(2), np.array([-6.0, 0.3, 4.0])
    value, change = surface_profile(points, 1.1, x, spacing=1.0, ground=2.0, derivative=True)
    assert change.shape == (3, *points.shape)
    check_derivative(lambda p: surface_profile(p, 1.1, x, spacing=1.0, ground=2.0), points, change)


def test_crest_of_soil_that_has_swollen_is_measured_from_where_it_was():
    before = np.stack(np.meshgrid(np.arange(0.5, 40), np.arange(0.5, 5)), axis=-1).reshape(-1, 2)
    volume = np.full(len(before), 1.1)
    sunk = crest(20.0).observe(slid(before, before, volume, initial_volume=1.0))
    assert sunk == pytest.approx([-0.5], rel=1e-3)


def test_derivative_of_crest_settlement():
    before, points = heap(2), heap(3) - [0.0, 0.5]
    for entry in (crest(0.5), crest(None)):
        value, change = entry.read_points(slid(points, before), derivative=True)
        check_derivative(lambda p, e=entry: e.observe(slid(p, before))[0], points, change)
    top = before[:, 1] > before[:, 1].max() - 1.5
    assert value == pytest.approx(np.mean(before[top, 1] - points[top, 1]))


@pytest.mark.parametrize("seed", range(4))
def test_derivative_of_freeboard(seed):
    points = heap(seed)
    value, change = freeboard(points, 1.0, water_level=3.0, spacing=1.0, derivative=True)
    # The top of a contour is found to about 1e-6 m: a larger step, a looser tolerance.
    for other in range(4):
        direction = np.random.default_rng(other).standard_normal(points.shape)
        numeric = central(
            lambda p: freeboard(p, 1.0, water_level=3.0, spacing=1.0), points, direction, 1e-3
        )
        assert np.tensordot(change, direction) == pytest.approx(numeric, abs=2e-4)
    assert change[:, 1].sum() == pytest.approx(1.0)
    assert change[:, 0].sum() == pytest.approx(0.0, abs=1e-4)


def test_marker_is_exact_in_a_linear_field_and_has_its_derivative():
    before = heap(4)
    strain = np.array([[0.1, -0.3], [0.05, 0.2]])
    points = before + before @ strain.T + [1.0, -2.0]
    for marker in ((0.0, 3.0), (1.0, 8.0), (-8.0, 1.0)):
        moved, change = stake(marker).read_points(slid(points, before), derivative=True)
        np.testing.assert_allclose(moved, strain @ marker + [1.0, -2.0], atol=1e-10)
        check_derivative(
            lambda p, m=marker: stake(m).observe(slid(p, before)),
            points,
            change,
        )
    with pytest.raises(ValueError, match="outside the soil"):
        stake((100.0, 0.0)).observe(slid(points, before))


def stake(place: tuple[float, float]) -> MarkerDisplacement:
    x, y = place
    return MarkerDisplacement(
        type="marker_displacement", x_m=x, y_m=y, dx_m=0.0, dy_m=0.0, std_m=1.0, **ABOUT
    )


def frames() -> tuple[np.ndarray, np.ndarray]:
    base = heap(5)
    time = np.array([0.0, 1.0, 3.0])
    return np.stack([base * [1.0 + 0.1 * t, 1.0] for t in time]), time


def of_run(positions: np.ndarray, time: np.ndarray) -> Deposit:
    return slid(positions[-1], positions[0], positions=positions, time=time)


def test_toe_history_and_its_derivative():
    positions, time = frames()
    entry = ToeHistory(type="toe_history", side="right", times_s=[0.0, 0.5, 2.9],
                       values_m=[0.0] * 3, std_m=1.0, **ABOUT)  # fmt: skip
    value, pair, change = entry.read_points(of_run(positions, time), derivative=True)
    whole = np.zeros((3, *positions.shape))
    for k in range(3):
        whole[k, pair[k, 0]] += change[k, 0]
        whole[k, pair[k, 1]] += change[k, 1]
    check_derivative(lambda p: entry.observe(of_run(p, time)), positions, whole)
    assert value[0] == toe(positions[0], 1.0, spacing=1.0, side="right")
    with pytest.raises(ValueError, match="outside the run"):
        frames_around(time, np.array([4.0]))


def test_column_velocity_and_its_derivative():
    positions, time = frames()
    entry = Velocity(type="velocity", x_m=5.0, at_s=2.0, value_m_per_s=0.0, std_m_per_s=1.0,
                     **ABOUT)  # fmt: skip
    value, pair, change = entry.read_points(of_run(positions, time), derivative=True)
    # A uniform stretch x (1 + 0.1 t): the speed of what is at x = 5 at t = 2 is 0.5/1.2.
    assert value == pytest.approx(5.0 * 0.1 / 1.2, rel=0.06)
    whole = np.zeros(positions.shape)
    whole[pair] = change
    check_derivative(lambda p: entry.observe(of_run(p, time))[0], positions, whole)
    elsewhere = entry.model_copy(update={"x_m": 500.0})
    assert elsewhere.observe(of_run(positions, time)) == [0.0], "no soil moves there"


def test_words_of_wrong_input():
    with pytest.raises(ValueError, match="'left' and 'right'"):
        toe(heap(), 1.0, spacing=1.0, side="upstream")
    with pytest.raises(ValueError, match="no dam at x"):
        toe(heap(), 1.0, spacing=1.0, side="left", anchor_x=-18.0)
