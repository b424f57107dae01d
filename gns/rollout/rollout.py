"""A rollout: step by step from a first window, with no future to look at.

In: a simulator, the facts of a scene and where its points are. Out: a `Rollout` with every frame.
A step that gives a number that is not finite, or a point far outside, ends it; the frames before
are kept and the reason is reported, as in a run of the material point method.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from gns.data.scene_facts import SOIL, SceneFacts, first_window
from gns.network.simulator import Simulator

RUNAWAY = 50.0
"""Speed [sqrt(g d)] that no soil has: five times that of a fall from 45 spacings."""


@dataclass
class Rollout:
    """Frames of a rollout; T frames, N points.

    Attributes:
        positions: (T, N, 2) float32 [m], the first at t = 0.
        time: (T,) float64 [s].
        facts: of the scene.
        status: "finished", or "failed" where a step could not be taken.
        reason: why it failed; else empty.
        at_rest: it ended because nothing moved any more.
        outside: what of the scene lies outside the ranges of the training.
        wall_time_s: time it took [s].
    """

    positions: np.ndarray
    time: np.ndarray
    facts: SceneFacts
    status: str = "finished"
    reason: str = ""
    at_rest: bool = False
    outside: list[str] = field(default_factory=list)
    wall_time_s: float = 0.0

    @property
    def failed(self) -> bool:
        """True where a step could not be taken."""
        return self.status == "failed"


@dataclass(frozen=True)
class Rest:
    """When a rollout has come to rest: as `early_stop` of the material point method.

    Attributes:
        energy_fraction: kinetic energy below this share of its peak ...
        hold_s: ... for this long [s].
    """

    energy_fraction: float = 0.001
    hold_s: float = 1.0


def rollout(
    simulator: Simulator,
    facts: SceneFacts,
    positions: np.ndarray,
    frames: int,
    *,
    rest: Rest | None = None,
    on_frame: Callable[[int], None] | None = None,
) -> Rollout:
    """Simulate a scene from its start (`scene_facts.start_of`).

    Args:
        simulator: the model.
        facts: of the scene.
        positions: at t = 0, (N, 2) [m].
        frames: most frames, the one at t = 0 among them.
        rest: end once nothing moves; None: never.
        on_frame: called with the number of each frame that is there.
    """
    window = first_window(positions, facts, simulator.config.history)
    result = rollout_window(simulator, facts, window, frames, rest=rest, on_frame=on_frame)
    result.outside = simulator.outside(positions, facts)
    return result


def rollout_window(
    simulator: Simulator,
    facts: SceneFacts,
    window: np.ndarray,
    frames: int,
    *,
    rest: Rest | None = None,
    on_frame: Callable[[int], None] | None = None,
) -> Rollout:
    """Simulate on from a window of positions (history, N, 2) [m], whose last frame is the first."""
    started = time.perf_counter()
    scene = simulator.scaled(facts)
    now = scene.to_spacings(window)
    kept = np.empty((frames, facts.points, 2), np.float32)
    kept[0] = window[-1]
    watch = RestWatch(rest, facts)
    done, reason, at_rest = 1, "", False
    with torch.no_grad():
        while done < frames and not at_rest:
            after = simulator.advance(now, scene)
            reason = wrong_step(after, now[-1], scene.frame_interval)
            if reason:
                reason = f"frame {done}, t = {done * facts.frame_time:.2f} s: {reason}"
                break
            kept[done] = scene.to_metres(after)
            at_rest = watch.over(after - now[-1])
            now = torch.cat([now[1:], after[None]])
            done += 1
            if on_frame is not None:
                on_frame(done - 1)
    return Rollout(
        positions=kept[:done].copy() if done < frames else kept,
        time=facts.frame_time * np.arange(done),
        facts=facts,
        status="failed" if reason else "finished",
        reason=reason,
        at_rest=at_rest,
        wall_time_s=time.perf_counter() - started,
    )


def rolled_out(
    simulator: Simulator, positions: np.ndarray, facts: SceneFacts
) -> tuple[Rollout, np.ndarray]:
    """A rollout from the start of a run, and its frames in the shape of the run's.

    Args:
        simulator: the model.
        positions: of the run, (T, N, 2) [m]; only the first frame is shown to the model.
        facts: of its scene.

    Returns:
        the rollout; (T, N, 2) [m], NaN from where it failed.
    """
    result = rollout(simulator, facts, positions[0], len(positions))
    predicted = np.full_like(positions, np.nan)
    predicted[: len(result.positions)] = result.positions
    return result, predicted


def frames_of(duration_s: float, facts: SceneFacts) -> int:
    """Frames of a rollout that lasts a time [s], t = 0 among them."""
    return int(round(duration_s / facts.frame_time)) + 1


def wrong_step(after: Tensor, now: Tensor, frame_interval: float) -> str:
    """The fault of the next positions (N, 2) [spacings]; empty if there is none."""
    step = (after - now).abs().amax(dim=1)
    finite = torch.isfinite(step)
    if not bool(finite.all()):
        return f"the position of {int((~finite).sum())} points is not a finite number"
    if float(step.max()) > RUNAWAY * frame_interval:
        point = int(step.argmax())
        return f"point {point} moved by {float(step.max()):.3g} spacings in one step"
    return ""


class RestWatch:
    """Watches the kinetic energy of the soil.

    Args:
        rest: when it is at rest; None: never.
        facts: of the scene.
    """

    def __init__(self, rest: Rest | None, facts: SceneFacts) -> None:
        self.rest = rest
        self.soil = facts.type == SOIL
        self.density = facts.properties[self.soil, 2].astype(np.float64)
        self.hold = 0 if rest is None else max(int(np.ceil(rest.hold_s / facts.frame_time)), 1)
        self.peak, self.quiet = 0.0, 0

    def over(self, step: Tensor) -> bool:
        """Whether the soil has come to rest, after a step (N, 2) in any unit."""
        if self.rest is None:
            return False
        squares = step.double().square().sum(1).cpu().numpy()[self.soil]
        energy = float(self.density @ squares)
        self.peak = max(self.peak, energy)
        self.quiet = self.quiet + 1 if energy <= self.rest.energy_fraction * self.peak else 0
        return self.quiet >= self.hold
