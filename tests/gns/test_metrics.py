"""Metrics on rollouts whose errors are known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.survey.columns import toe
from gns.data.scene_facts import KINEMATIC, start_of
from gns.evaluation.metrics import (
    energy_history,
    one_step_error,
    position_error,
    profile_error,
    runout,
    score,
    stays_inside,
)
from gns.evaluation.score_tables import by_template, worst
from pipeline.config import SimulationSettings
from tests.mpm_taichi.ballistic import make_scene

D = 0.5
SETTINGS = SimulationSettings()


def heap(run: float = 0.0, *, side: float = 1.0) -> tuple:
    """Facts of a block, and frames in which its points shear outwards, the top first, by `run`."""
    scene = make_scene(spacing=D).changed(
        zones=[{"name": "heap", "polygon": [[20, 2], [30, 2], [30, 8], [20, 8]],
                "material": "shell"}],
        materials={"shell": make_scene().model_dump()["materials"]["shell"]},
    )  # fmt: skip
    facts, start = start_of(scene, SETTINGS)
    outward = np.clip(side * (start[:, 0] - 25) / 5, 0, None)
    path = [start + np.outer(share * run * outward, [side, 0.0]) for share in np.linspace(0, 1, 21)]
    return facts, np.array(path, np.float32)


def test_a_perfect_rollout_has_no_error():
    facts, path = heap(8.0)
    one = score(path.copy(), path, facts, run=7, template="b")
    assert (one.run, one.template, one.side, one.points) == (7, "b", "right", facts.points)
    assert one.travel_m == pytest.approx(8.0, abs=D)
    for name in ("position_error_m", "final_position_error_m", "runout_error_m",
                 "runout_error_spacings", "runout_error_percent", "profile_error_m",
                 "profile_error_share", "kinetic_error", "released_error"):  # fmt: skip
        value = getattr(one, name)
        assert value == 0.0 or (name == "released_error" and math.isnan(value))
    assert one.finite and one.inside


def test_a_rollout_that_is_shifted():
    facts, path = heap(8.0)
    moved = path + np.float32([0.3, 0.4])
    assert position_error(moved, path, facts) == pytest.approx(0.5, rel=1e-5)
    one = score(path + np.float32([1.5, 0.0]), path, facts)
    assert one.runout_error_m == pytest.approx(1.5, abs=1e-4), "signed: too far"
    assert one.runout_error_spacings == pytest.approx(3.0, abs=1e-3)
    assert one.runout_error_percent == pytest.approx(150 / one.travel_m, rel=1e-4)
    assert one.travel_m == pytest.approx(8.0, abs=D), "not what the toe reads at t = 0"
    one = score(path - np.float32([1.5, 0.0]), path, facts)
    assert one.runout_error_m == pytest.approx(-1.5, abs=1e-4), "signed: not far enough"


def test_the_error_of_half_of_the_frames():
    facts, path = heap(8.0)
    moved = path.copy()
    moved[: len(path) // 2] += np.float32([0.0, 2.0])
    share = (len(path) // 2) / len(path)
    assert position_error(moved, path, facts) == pytest.approx(2.0 * math.sqrt(share), rel=1e-5)
    assert score(moved, path, facts).final_position_error_m == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_side_that_ran_out(side):
    facts, path = heap(8.0, side=side)
    name = "right" if side > 0 else "left"
    short = heap(5.0, side=side)[1]
    one = score(short, path, facts)
    assert one.side == name
    foot = 30.0 if side > 0 else 20.0
    for frames, expected in ((path, one.travel_m), (short, one.travel_m + one.runout_error_m)):
        place = toe(frames[-1].astype(float), D**2, spacing=D, side=name)
        at_rest = side * (toe(path[0].astype(float), D**2, spacing=D, side=name) - foot)
        assert side * (place - foot) - at_rest == pytest.approx(expected, abs=1e-6)
    assert one.runout_error_m == pytest.approx(-3.0, abs=1.5 * D)
    assert one.travel_m == pytest.approx(8.0, abs=D)


def test_no_travel_has_no_per_cent():
    facts, path = heap(0.0)
    one = score(path + np.float32([0.2, 0.0]), path, facts)
    assert abs(one.travel_m) < D and math.isnan(one.runout_error_percent)
    assert one.runout_error_m == pytest.approx(0.2, abs=1e-3)
    assert one.kinetic_error != one.kinetic_error, "no peak, no share of it"


def test_the_area_between_two_surfaces():
    facts, path = heap(0.0)
    soil = facts.points * D**2
    # The whole heap 10 m to the right: twice its area lies between the two, over twice its width.
    between, share = profile_error(path[-1] + np.float32([15.0, 0.0]), path[-1], facts)
    assert share == pytest.approx(2.0, rel=1e-3)
    assert between == pytest.approx(2.0 * soil / 20.0, rel=0.5)
    # Its upper half taken off and put next to it.
    high = path[-1][:, 1] > 5
    moved = path[-1].copy()
    moved[high, 0] += 10.0
    moved[high, 1] -= 3.0
    # Columns are smoothed over 2.5 m, so some of both halves cancels where they touch.
    assert profile_error(moved, path[-1], facts)[1] == pytest.approx(2 * high.mean(), rel=0.08)
    assert profile_error(path[-1], path[-1], facts) == (0.0, 0.0)


def test_kinematic_points_count_for_nothing():
    facts, path = heap(4.0)
    fixed = np.arange(facts.points) % 3 == 0
    facts = replace(facts, type=np.where(fixed, KINEMATIC, facts.type).astype(np.int8))
    moved = path.copy()
    moved[:, fixed] += np.float32([0.0, 9.0])
    assert position_error(moved, path, facts) == 0.0
    assert score(moved, path, facts).kinetic_error == 0.0


def test_one_step():
    facts, path = heap(8.0)
    window = path[3:11].copy()
    rests = np.ptp(window, axis=0).max(axis=1) == 0
    assert 0.2 < rests.mean() < 0.8
    predicted = window[-1].copy()
    predicted[~rests, 0] += 0.1
    predicted[rests, 1] += 7.0
    found = one_step_error(predicted, window, facts)
    assert found == pytest.approx(0.1 / D, rel=1e-3), "in spacings, over what moves"
    whole = one_step_error(predicted, window, facts, moving_only=False)
    assert whole == pytest.approx(math.sqrt(rests.mean()) * 7.0 / D, rel=1e-2)
    still = np.repeat(path[:1], 4, axis=0)
    assert math.isnan(one_step_error(predicted, still, facts))


def test_one_frame_and_no_deposit_have_no_error_of_their_own():
    facts, path = heap(8.0)
    one = score(path[:1], path[:1], facts)
    assert one.position_error_m == 0.0 and math.isnan(one.kinetic_error)
    spread = path[-1:] * np.float32([40.0, 1.0])  # no two points hang together
    one = score(np.concatenate([path[:1], spread]), np.concatenate([path[:1], spread]), facts)
    assert one.position_error_m == 0.0 and one.profile_error_share == 0.0


def test_energy_of_a_fall():
    scene = make_scene(spacing=D)
    facts, start = start_of(scene, SETTINGS)
    facts = replace(facts, initial_velocity=np.zeros((facts.points, 2), np.float32))
    time = np.arange(40) * facts.frame_time
    drop = 0.5 * facts.gravity * time**2
    path = start + np.stack([0 * drop, -drop], axis=1)[:, None]
    energy = energy_history(path, facts)
    mass = facts.properties[:, 2].sum() * D**2
    np.testing.assert_allclose(energy.released, mass * 9.81 * drop, rtol=1e-6)
    inner = slice(0, -1)  # the last velocity is a backward difference
    np.testing.assert_allclose(energy.kinetic[inner], energy.released[inner], rtol=1e-4, atol=1e-3)
    slower = start + 0.5 * (path - start)
    one = score(slower.astype(np.float32), path.astype(np.float32), facts)
    assert one.released_error == pytest.approx(-0.5, abs=1e-3)
    found = energy_history(slower, facts).kinetic / energy.kinetic.max()
    expected = np.sqrt(np.mean((found - energy.kinetic / energy.kinetic.max()) ** 2))
    assert one.kinetic_error == pytest.approx(expected, rel=1e-3)


def test_weight_under_water_does_less_work():
    facts, start = start_of(make_scene(spacing=D, water=20.0), SETTINGS)
    path = np.stack([start, start - [0.0, 1.0]])
    mass = facts.properties[:, 2].sum() * D**2
    expected = mass * 9.81 * (1 - 1000 / 1800)
    assert energy_history(path, facts).released[-1] == pytest.approx(expected, rel=1e-6)


def test_a_rollout_that_blows_up_cannot_be_overlooked():
    facts, path = heap(8.0)
    broken = path.copy()
    broken[12:, 5] = np.nan
    one = score(broken, path, facts, template="b")
    assert not one.finite and not one.inside
    for name in ("position_error_m", "final_position_error_m", "profile_error_m", "kinetic_error"):
        assert getattr(one, name) == math.inf, name
    assert one.runout_error_m == math.inf and one.runout_error_spacings == math.inf
    good = score(path, path, facts, template="b")
    table = by_template([one, one, good])
    assert table["all"]["runout, d"] == math.inf and table["all"]["not finite"] == 2
    assert by_template([one, good, good])["all"]["runout, d"] == 0.0


def test_a_rollout_that_is_flung_apart():
    facts, path = heap(8.0)
    dust = path.copy()
    generator = np.random.default_rng(0)
    dust[-1] = generator.uniform(-1e6, 1e6, dust[-1].shape)
    one = score(dust, path, facts)
    assert one.finite and not one.inside
    assert one.runout_error_m == math.inf, "nothing is left that could have a toe"


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        ((59.9, 2.1), True), ((60 + 3 * D, 3.0), False), ((-3 * D, 3.0), False),
        ((30.0, 2 - 1.5 * D), True), ((30.0, 2 - 3 * D), False), ((30.0, 30 + 3 * D), False),
    ],
)  # fmt: skip
def test_inside_the_scene(point, inside):
    facts, path = heap(1.0)
    path[7, 3] = point
    assert stays_inside(path, facts) is inside
    opened = replace(facts, numbers={**facts.numbers, "walls_open": 1.0})
    assert stays_inside(path, opened) is (point[1] > 2 - 2 * D)


def test_runout_counts_from_the_end_of_the_section():
    facts, path = heap(0.0)
    # The smoothed column of a vertical face falls below one spacing a little beyond the face.
    for side in ("left", "right"):
        assert 0 < runout(path[0], path[0], facts, side) < 3 * D


def test_tables_by_template():
    facts, path = heap(8.0)
    errors = {"a": [0.0, 0.5, 3.0], "b": [1.0]}
    scores = [
        score(path + np.float32([error, 0.0]), path, facts, run=10 * place, template=letter)
        for letter, row in errors.items()
        for place, error in enumerate(row)
    ]
    table = by_template(scores)
    assert list(table) == ["all", "a", "b"]
    assert [table[name]["runs"] for name in table] == [4, 3, 1]
    assert table["a"]["runout, m"] == pytest.approx(0.5, abs=1e-3)
    assert table["all"]["runout, d"] == pytest.approx(0.75 / D, abs=1e-2)
    assert table["a"]["90 %, d"] == pytest.approx((0.5 + 0.8 * 2.5) / D, abs=1e-2)
    assert [(one.run, one.template) for one in worst(scores, 2)] == [(20, "a"), (0, "b")]


def test_frames_must_match():
    facts, path = heap(1.0)
    with pytest.raises(ValueError, match="for a simulation of"):
        score(path[:-1], path, facts)
