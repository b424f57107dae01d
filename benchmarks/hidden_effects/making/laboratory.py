"""Runs for the benchmark: a section with parameters, effects and numerics -> a deposit."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.hidden_effects.making.sections import Section
from geometry.scenes.scene import Scene
from geometry.survey.measured import Deposit
from pipeline.config import SimulationSettings

if TYPE_CHECKING:
    from mpm_taichi.trajectory import Run


Entry = float | Mapping[str, float]

#: Speed below which soil that was cut off in motion counts as resting [m/s].
CREEP = 0.02


def amplitude_of(entry: Entry) -> float:
    """The amplitude of an effect's entry."""
    return entry["amplitude"] if isinstance(entry, Mapping) else entry


def times(entry: Entry, factor: float) -> Entry:
    """An effect's entry with its amplitude multiplied."""
    changed = float(f"{factor * amplitude_of(entry):.6g}")
    return {**entry, "amplitude": changed} if isinstance(entry, Mapping) else changed


@dataclass(frozen=True)
class Request:
    """One run.

    Attributes:
        values: parameters (p,) in outside units.
        effects: amplitudes by name, or mappings with `amplitude` and parameters, as in a scene.
        spacing_factor: spacing over the section's own.
        jitter: of the points, in spacings; seed: of the jitter.
        transfer: scheme; None: of the settings.
        courant: number; None: of the settings.
    """

    values: tuple[float, ...]
    effects: Mapping[str, Entry] = field(default_factory=dict)
    spacing_factor: float = 1.0
    jitter: float = 0.0
    seed: int = 0
    transfer: str | None = None
    courant: float | None = None

    @property
    def key(self) -> tuple:
        """All of it, hashable."""
        effects = json.dumps(dict(self.effects), sort_keys=True)
        own = (self.values, self.spacing_factor, self.jitter, self.seed)
        return (*own, self.transfer, self.courant, effects)


class Laboratory:
    """Simulates a section.

    Args:
        settings: of the simulation, those of the judge.
        threads: CPU threads; None: all.
    """

    def __init__(self, settings: SimulationSettings, *, threads: int | None = None) -> None:
        self.settings = settings
        self.threads = threads
        self.runs = 0
        self._kept: dict[tuple, Deposit | None] = {}

    def scene(self, section: Section, request: Request) -> Scene:
        """The scene of a request."""
        scene = section.parameters.scene(section.scene, np.array(request.values))
        return scene.changed(
            spacing=round(request.spacing_factor * section.scene.spacing, 4),
            jitter=request.jitter,
            seed=request.seed,
            effects={**section.scene.effects, **request.effects},
        )

    def deposits(self, section: Section, requests: Sequence[Request]) -> list[Deposit | None]:
        """The deposits of requests; None where a run failed or was cut off.

        Runs that share their settings go to the solver as one batch; those of the base model are
        remembered until `forget`.
        """
        keys = [(section.name, *request.key) for request in requests]
        new = {key: one for key, one in zip(keys, requests, strict=True) if key not in self._kept}
        found = dict(zip(new, self._simulate(section, list(new.values())), strict=True))
        self._kept |= {key: found[key] for key, one in new.items() if not one.effects}
        return [found[key] if key in found else self._kept[key] for key in keys]

    def forget(self) -> None:
        """Let go of what was remembered."""
        self._kept.clear()

    def _simulate(self, section: Section, requests: list[Request]) -> list[Deposit | None]:
        from mpm_taichi.simulate import simulate

        found: list[Deposit | None] = [None] * len(requests)
        for transfer, courant in dict.fromkeys((r.transfer, r.courant) for r in requests):
            given = {"transfer": transfer, "courant": courant}
            given = {name: value for name, value in given.items() if value is not None}
            members = [
                place
                for place, r in enumerate(requests)
                if (r.transfer, r.courant) == (transfer, courant)
            ]
            scenes = [self.scene(section, requests[place]) for place in members]
            # Taichi reports its start on the standard output, where results alone belong.
            with redirect_stdout(sys.stderr):
                runs = simulate(
                    scenes, self.settings.model_copy(update=given), threads=self.threads
                )
            self.runs += len(runs)
            for place, run in zip(members, runs, strict=True):
                found[place] = _deposit(section, run)
        return found


def _deposit(section: Section, run: Run) -> Deposit | None:
    if run.status == "failed" or not _rests(run):
        return None
    frames = run.positions.astype(float)
    foot = {side: section.scene.foot(side) for side in ("left", "right")}
    return Deposit.on(
        run.scene, foot, frames[-1], frames[0], run.initial_volume,
        volume=run.bulk_volume, positions=frames, time=run.time,
    )  # fmt: skip


def _rests(run: Run) -> bool:
    """It ended by itself, or creeps too slowly for a survey.

    What never slid has no peak of its energy to fall from, and so never ends by itself.
    """
    if run.came_to_rest:
        return True
    frames = min(10, len(run.time) - 1)
    way = np.abs(run.positions[-1] - run.positions[-1 - frames]).max()
    return bool(way <= CREEP * (run.time[-1] - run.time[-1 - frames]))
