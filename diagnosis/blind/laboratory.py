"""Runs for the benchmark: a section with parameters, effects and numerics -> a deposit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.blind.sections import Section
from geometry.measured import Deposit
from geometry.scene import Scene
from inversion.run_store import KeptRun, RunStore
from pipeline.config import SimulationSettings


@dataclass(frozen=True)
class Request:
    """One run.

    Attributes:
        values: parameters (p,) in outside units.
        effects: amplitudes by name.
        spacing_factor: spacing over the section's own.
        jitter: of the points, in spacings; seed: of the jitter.
        transfer: scheme; None: of the settings.
        courant: number; None: of the settings.
    """

    values: tuple[float, ...]
    effects: Mapping[str, float] = field(default_factory=dict)
    spacing_factor: float = 1.0
    jitter: float = 0.0
    seed: int = 0
    transfer: str | None = None
    courant: float | None = None


class Laboratory:
    """Simulates a section and keeps what it has simulated.

    Args:
        store: of the runs.
        settings: of the simulation, of the diagnosing model.
    """

    def __init__(self, store: RunStore, settings: SimulationSettings) -> None:
        self.store = store
        self.settings = settings

    def scene(self, section: Section, request: Request) -> Scene:
        """The scene of a request."""
        scene = section.parameters.scene(section.scene, np.array(request.values))
        return scene.changed(
            spacing=round(request.spacing_factor * section.scene.spacing, 4),
            jitter=request.jitter,
            seed=request.seed,
            effects={name: a for name, a in request.effects.items() if a != 0.0},
        )

    def deposits(self, section: Section, requests: Sequence[Request]) -> list[Deposit | None]:
        """The deposits of requests, one batch; None where a run failed or was cut off."""
        wanted = []
        for request in requests:
            changes = {"transfer": request.transfer, "courant": request.courant}
            given = {name: value for name, value in changes.items() if value is not None}
            wanted.append((self.scene(section, request), self.settings.model_copy(update=given)))
        runs = self.store.fetch(wanted, frames=True)
        return [_deposit(section, scene, run) for (scene, _), run in zip(wanted, runs, strict=True)]


def _deposit(section: Section, scene: Scene, run: KeptRun) -> Deposit | None:
    if run.status == "failed" or not run.at_rest:
        return None
    return Deposit(
        position=run.final.astype(float),
        initial_position=run.initial.astype(float),
        volume=scene.spacing**2,
        spacing=scene.spacing,
        foot={side: section.scene.foot(side) for side in ("left", "right")},
        ground=np.asarray(scene.ground.points, dtype=float),
        positions=run.frames.astype(float),
        time=run.time,
        at_rest=run.at_rest,
    )
