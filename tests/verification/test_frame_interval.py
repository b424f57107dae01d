from __future__ import annotations

import numpy as np
import pytest

from benchmarks.studies import frame_interval
from pipeline.config import load_config
from tests.mpm_taichi import ballistic


def falling(*, frames: int = 60) -> ballistic.Run:
    """A run in free fall with the finest interval, faster and faster, nothing else."""
    scene = ballistic.make_scene(3)
    settings = ballistic.FAST.model_copy(update={"frame_interval": frame_interval.FINEST})
    run = ballistic.fly(scene, settings)
    time = run.time[1] * np.arange(frames)
    start = run.positions[0].astype(float)
    fall = np.stack([2.0 * time, -0.5 * 9.81 * time**2], axis=1)
    run.positions = (start[None] + fall[:, None]).astype(np.float32)
    run.time = time
    return run


@pytest.mark.parametrize("every", [1, 2, 5])
def test_free_fall_has_the_second_difference_of_gravity(every):
    row = frame_interval.measure([falling()], every)
    assert row.interval == pytest.approx(0.1 * every)
    # g frame^2 / d with frame = interval sqrt(d / g): the square of the interval.
    assert row.second_difference == pytest.approx(row.interval**2, rel=2e-3)
    assert row.left_by_acceleration < 10 * row.rounding + 1e-6
    assert row.point_noise < 0.02
    assert row.frames == len(range(0, 60, every))


def test_what_neighbours_share_is_not_a_points_own():
    x = np.stack(np.meshgrid(np.arange(14.0), np.arange(14.0)), axis=-1).reshape(-1, 2)
    shared = x @ np.array([[0.1, 0.3], [-0.2, 0.1]]) + [0.5, -1.0]
    moving = np.ones(len(x), bool)
    own, whole = frame_interval.own_part(x, shared, moving)
    assert own < 1e-18 * whole
    noise = np.random.default_rng(0).normal(0.0, 1.0, x.shape)
    own, whole = frame_interval.own_part(x, noise, moving)
    assert own / whole == pytest.approx(1.0, abs=0.2)


def test_the_default_interval_keeps_every_scale_under_the_budget():
    """Two float32 a point and frame, twice: a trajectory is never larger than what is packed."""
    config = load_config(None)
    for name in ("large", "small"):
        scale, settings = config.scale(name), config.simulation_for(name)
        frame = settings.frame_interval * np.sqrt(scale.spacing_m / settings.gravity_m_per_s2)
        points = 3600  # a scene's mean, docs/records/frame-interval.md
        longest = 8 * points * (settings.duration_s / frame + 1) * scale.number_of_scenes / 1e9
        assert 2 * longest < frame_interval.BUDGET_GB
