"""Statistics against a plain two-pass computation over everything at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gns.data.dataset import Windows
from gns.data.metadata import read_metadata
from gns.data.ranges import run_ranges, scene_ranges, widest
from gns.data.scene_facts import SOIL, start_of
from gns.data.statistics import BLOCK, SLOWEST, Moments, merge, run_moments
from pipeline.config import SimulationSettings
from tests.budget import examples
from tests.mpm_taichi.ballistic import make_scene


def plain(positions: np.ndarray, facts) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and accelerations of the moving soil, the obvious way."""
    velocities, accelerations = [], []
    d, g, dt = facts.spacing, facts.gravity, facts.frame_time
    for point in np.flatnonzero(facts.type == SOIL):
        path = positions[:, point].astype(float)
        earlier = np.float32(path[0] - dt * facts.initial_velocity[point].astype(float)).astype(
            float
        )
        path = np.concatenate([[earlier], path])
        for t in range(1, len(path) - 1):
            old, new = (path[t] - path[t - 1]) / dt, (path[t + 1] - path[t]) / dt
            if max(np.hypot(*old), np.hypot(*new)) > SLOWEST * np.sqrt(g * d):
                velocities.append(old / np.sqrt(g * d))
                accelerations.append((new - old) / dt / g)
    return np.array(velocities), np.array(accelerations)


def test_a_run_block_by_block_is_the_run_at_once():
    zones = make_scene().model_dump()["zones"]
    zones.append(
        {**zones[1], "name": "plate", "kinematic": True,
         "polygon": [[40, 2], [48, 2], [48, 8], [40, 8]], "initial_velocity": [50.0, 0.0]}
    )  # fmt: skip
    scene = make_scene(spacing=2.0).changed(zones=zones)
    facts, start = start_of(scene, SimulationSettings())
    generator = np.random.default_rng(0)
    steps = generator.normal(0, 0.02, (2 * BLOCK + 5, *start.shape))
    steps[:, generator.random(len(start)) < 0.5] *= 0.01  # half of the points hardly move
    positions = (start + np.cumsum(steps, axis=0)).astype(np.float32)
    found = run_moments(positions, facts)
    for moments, values in zip(found, plain(positions, facts), strict=True):
        assert moments.count == len(values)
        np.testing.assert_allclose(moments.mean, values.mean(axis=0), atol=1e-10)
        np.testing.assert_allclose(moments.std, values.std(axis=0), rtol=1e-9)
        np.testing.assert_allclose(moments.low, values.min(axis=0), rtol=1e-9)
        np.testing.assert_allclose(moments.high, values.max(axis=0), rtol=1e-9)
    speed = found[0].high[0]
    assert speed < 5, "the plate, at 11 sqrt(g d), counts for nothing"


@settings(max_examples=examples(60), deadline=None)
@given(
    sizes=st.lists(st.integers(0, 30), min_size=1, max_size=12),
    offset=st.sampled_from([0.0, 1e3, -1e6]),
    order=st.randoms(use_true_random=False),
)
def test_any_order_of_merging(sizes, offset, order):
    generator = np.random.default_rng(len(sizes))
    samples = [generator.normal(offset, 1.0, (size, 2)) for size in sizes]
    everything = np.concatenate(samples)
    parts = [Moments.of(sample) for sample in samples]
    order.shuffle(parts)
    while len(parts) > 1:  # merged in pairs, as a tree of any shape
        first = parts.pop(order.randrange(len(parts)))
        place = order.randrange(len(parts))
        parts[place] = parts[place].merged(first)
    merged = parts[0]
    assert merged.count == len(everything)
    if len(everything):
        scale = max(abs(offset), 1.0)
        np.testing.assert_allclose(merged.mean, everything.mean(axis=0), atol=1e-13 * scale)
        np.testing.assert_allclose(merged.std, everything.std(axis=0), atol=1e-9)
        np.testing.assert_array_equal(merged.low, everything.min(axis=0))
    stored = Moments.from_stored(merged.stored())
    np.testing.assert_array_equal(stored.stored(), merged.stored())


def test_nothing_has_no_statistics():
    nothing = merge([])
    assert nothing.count == 0 and nothing.merged(nothing).count == 0
    np.testing.assert_array_equal(nothing.std, 0.0)


def test_the_metadata_hold_the_statistics_of_the_training_runs(packed):
    metadata = read_metadata(packed)
    windows = Windows(packed, "train")
    found = [plain(windows.positions(run), windows.facts(run)) for run in windows.runs]
    velocity, acceleration = (np.concatenate(parts) for parts in zip(*found, strict=True))
    statistics = metadata.statistics
    assert statistics.count == len(velocity)
    np.testing.assert_allclose(statistics.velocity_mean, velocity.mean(axis=0), rtol=1e-9)
    np.testing.assert_allclose(statistics.velocity_std, velocity.std(axis=0), rtol=1e-9)
    np.testing.assert_allclose(statistics.acceleration_mean, acceleration.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(statistics.acceleration_std, acceleration.std(axis=0), rtol=1e-9)


def test_ranges_are_dimensionless_and_of_the_training_runs(packed):
    ranges = read_metadata(packed).ranges
    unit = 1800 * 9.81 * 2.0
    assert ranges["tan_friction"] == pytest.approx((0.0, np.tan(np.radians(20))))
    assert ranges["cohesion"] == pytest.approx((0.0, 18.7e3 / unit), rel=0.02)
    assert ranges["youngs_modulus"][1] == pytest.approx(30e6 / unit)
    assert ranges["height"] == pytest.approx((4.5 - 0.5, 4.5 - 0.5), abs=0.6)
    assert ranges["initial_speed"][1] == pytest.approx(np.hypot(17, 4) / np.sqrt(2 * 9.81))
    assert "ground_friction" not in ranges
    windows = Windows(packed, "train")
    own = []
    for run in windows.runs:
        positions, facts = windows.positions(run), windows.facts(run)
        velocity, _ = run_moments(positions, facts)
        own.append(run_ranges(positions[0], positions[-1], len(positions), facts, velocity))
    assert widest(own) == {name: pytest.approx(value) for name, value in ranges.items()}
    travel = max(
        np.hypot(*(windows.positions(run)[-1] - windows.positions(run)[0]).T).max()
        for run in windows.runs
    )
    assert ranges["travel"][1] == pytest.approx(travel / 2.0)


def test_the_slope_of_ground_and_its_coefficient():
    ground = {"points": [[0, 2], [29, 2], [39, 5], [60, 5]], "contact": "coulomb",
              "friction_coefficient": 0.3}  # fmt: skip
    facts, start = start_of(make_scene().changed(ground=ground), SimulationSettings())
    ranges = scene_ranges(start, facts)
    assert ranges["ground_slope"] == pytest.approx((0.3, 0.3))
    assert ranges["ground_friction"] == (0.3, 0.3)
