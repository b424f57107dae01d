"""Rollouts: from a scene alone, step by step, stopped with a reason where they go wrong."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gns.data.scene_facts import first_window
from gns.rollout.rollout import Rest, frames_of, rollout, rollout_window
from tests.gns.scenes import simulator, start


@pytest.fixture(scope="module")
def facts_and_start():
    return start()


def test_a_rollout_is_step_after_step(facts_and_start):
    facts, positions = facts_and_start
    model = simulator(torch.float64)
    seen = []
    result = rollout(model, facts, positions, 8, on_frame=seen.append)
    assert result.positions.shape == (8, len(positions), 2) and not result.failed
    assert np.array_equal(result.positions[0], positions.astype(np.float32))
    assert np.allclose(result.time, facts.frame_time * np.arange(8)) and seen == list(range(1, 8))
    window = first_window(positions, facts).astype(np.float64)
    for frame in range(1, 8):
        window = np.concatenate([window[1:], model.step(window, facts)[None]])
        assert np.allclose(window[-1], result.positions[frame], atol=1e-5)
    assert np.abs(result.positions[-1] - result.positions[0]).max() > 0.05


def test_a_rollout_goes_on_from_any_window(facts_and_start):
    facts, positions = facts_and_start
    model = simulator(torch.float64)
    whole = rollout(model, facts, positions, 12)
    rest = rollout_window(model, facts, whole.positions[:6], 7)
    assert np.allclose(rest.positions, whole.positions[5:], atol=1e-4)


def test_a_rollout_does_not_depend_on_where_the_scene_lies():
    """The same scene 3 km away; positions are single precision, so to a millimetre."""
    import dataclasses

    facts, positions = start(walls="open")
    away = np.array([3000.0, 500.0])
    moved = dataclasses.replace(
        facts,
        ground=facts.ground + away,
        phreatic_line=facts.phreatic_line + away,
        numbers={**facts.numbers, "x_min": 3000.0, "x_max": 3030.0, "y_max": 520.0},
    )
    model = simulator(torch.float64)
    here = rollout(model, facts, positions, 5).positions
    there = rollout(model, moved, positions + away, 5).positions
    assert np.allclose(there - away, here, atol=2e-3)


@pytest.mark.parametrize(
    ("value", "reason"), [(float("nan"), "not a finite number"), (1e5, "in one step")]
)
def test_a_rollout_that_goes_wrong_keeps_what_was_right(facts_and_start, value, reason):
    facts, positions = facts_and_start
    model = simulator()
    steps = 0

    class Spoiled(type(model)):
        def advance(self, window, scene, graph=None):
            nonlocal steps
            steps += 1
            after = super().advance(window, scene, graph)
            if steps == 4:
                after = after.clone()
                after[3, 1] = value
            return after

    model.__class__ = Spoiled
    result = rollout(model, facts, positions, 10)
    assert result.failed and len(result.positions) == len(result.time) == 4
    assert np.isfinite(result.positions).all()
    assert reason in result.reason and result.reason.startswith("frame 4, t = 0.51 s")


def test_a_rollout_ends_at_rest(facts_and_start):
    facts, positions = facts_and_start
    model = simulator()

    class Braking(type(model)):
        """Every step is half of the last."""

        def advance(self, window, scene, graph=None):
            return window[-1] + 0.5 * (window[-1] - window[-2])

    model.__class__ = Braking
    rest = Rest(energy_fraction=1e-3, hold_s=4.5 * facts.frame_time)
    result = rollout(model, facts, positions, 100, rest=rest)
    # Energy falls by 4 a frame: below a thousandth of its peak after 5 more, then it must hold.
    assert result.at_rest and len(result.positions) == 1 + 1 + 5 + 4
    assert not rollout(model, facts, positions, 20).at_rest


def test_frames_of_a_duration(facts_and_start):
    facts, _ = facts_and_start
    assert frames_of(40.0, facts) == round(40.0 / facts.frame_time) + 1


def test_a_rollout_says_what_the_model_has_not_seen(facts_and_start):
    facts, positions = facts_and_start
    model = simulator(ranges={"height": (1.0, 3.0)})
    assert "highest point" in rollout(model, facts, positions, 2).outside[0]
