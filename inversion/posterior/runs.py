"""Simulations of a case at values of its unknowns, coarse or at the spacing of the answer.

The numbers of a run are the measurements of the set that are shown, then the vertical effective
stress before failure of each residual strength's zones, which turns a strength into a ratio, or a
strength ratio into a mean strength.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import Store
from inversion.engines.small_cells import SmallCells, cells_by
from inversion.estimation.forward import Forward, Prediction, SectionSetup, Setup
from inversion.posterior.varied_case import VariedCase
from inversion.problem.question import (
    RESIDUAL_STRENGTH,
    STRENGTH_RATIO,
    OtherSetting,
    TimeStep,
)
from inversion.problem.unknown import Unknown

#: Share of its moves that a section keeps that cannot be drawn, and how often it is tried.
BACK, MOST_BACK = 0.85, 15


class EmulatedModel(Protocol):
    """What is emulated: numbers of runs at values of unknowns."""

    @property
    def unknowns(self) -> Sequence[Unknown]:
        """(q,)."""
        ...

    @property
    def names(self) -> list[str]:
        """Of the numbers, (k,)."""
        ...

    @property
    def two_fidelities(self) -> bool:
        """There are coarse runs in addition to those at the spacing of the answer."""
        ...

    def drawable(self, values: np.ndarray) -> np.ndarray:
        """Values (n, q) moved to where the model can be run; itself where it can."""
        ...

    def run(self, values: np.ndarray, *, coarse: bool) -> np.ndarray:
        """Numbers (n, k) at values (n, q); NaN where a run failed or could not be read."""
        ...

    def simulated_otherwise(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Change of the numbers (k,) at values (q,) with each other way to simulate, by name."""
        ...

    def error_std(self, values: np.ndarray) -> np.ndarray:
        """Standard deviation of the engine's own error of the numbers (k,) at values (q,)."""
        ...

    def cells_at(self, values: np.ndarray) -> SmallCells | None:
        """What the cells make of the strengths at values (q,); None: nothing."""
        ...


@dataclass
class CaseModel:
    """`EmulatedModel` by a forward engine.

    Attributes:
        varied: the case with its unknowns.
        store: of the runs.
        engine: what predicts.
        unread: runs that failed, or whose section does not hold together.
    """

    varied: VariedCase
    store: Store
    engine: Engine = MPM
    unread: int = 0

    @property
    def unknowns(self) -> Sequence[Unknown]:
        """(q,)."""
        return self.varied.unknowns

    @property
    def shown(self) -> np.ndarray:
        """Places of the measured numbers that are read, in the targets."""
        return np.flatnonzero(self.varied.case.setup.targets.shown)

    @property
    def strengths(self) -> list[int]:
        """Places of the residual strengths and of the strength ratios among the parameters."""
        known = RESIDUAL_STRENGTH, STRENGTH_RATIO
        specs = self.varied.case.parameters.specs
        return [place for place, spec in enumerate(specs) if spec.property in known]

    @property
    def names(self) -> list[str]:
        """See `EmulatedModel`."""
        targets, specs = self.varied.case.setup.targets, self.varied.case.parameters.specs
        return [targets.names[place] for place in self.shown] + [
            stress_name(specs[place].name) for place in self.strengths
        ]

    @property
    def two_fidelities(self) -> bool:
        """See `EmulatedModel`."""
        return self.varied.case.coarse_spacing_m is not None

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Whether the section of a coarse run holds together, (n,) bool at values (n, q)."""
        return np.array([self._setup(row, self.two_fidelities) is not None for row in values])

    def drawable(self, values: np.ndarray) -> np.ndarray:
        """See `EmulatedModel`: several boundaries moved at once may leave a layer too thin.

        All boundaries of such a section are moved back towards the drawn one, together.
        """
        found = np.array(values, dtype=float)
        for row in found:
            back = np.where(self.varied.boundaries, BACK, 1.0)
            for _ in range(MOST_BACK):
                if self.holds(row[None]).all():
                    break
                row *= back
        return found

    def run(self, values: np.ndarray, *, coarse: bool) -> np.ndarray:
        """See `EmulatedModel`."""
        setups = [self._setup(row, coarse) for row in values]
        return self._numbers(setups, values)

    @property
    def other_ways(self) -> list[tuple[str, Setup]]:
        """Other ways to simulate among the sensitivities: name and setup."""
        return self._known_ways[0]

    @property
    def remarks(self) -> list[str]:
        """Other ways to simulate that the engine does not know."""
        return self._known_ways[1]

    @cached_property
    def _known_ways(self) -> tuple[list[tuple[str, Setup]], list[str]]:
        available, _ = self.varied.case.sensitivities_of(self.store.refused)
        known, left_out = [], []
        for sensitivity, sides in available:
            if not isinstance(sensitivity, TimeStep | OtherSetting):
                continue
            for side in sides:
                own, reason = self.varied.case.setup, ""
                if self.engine.unseen is not None and isinstance(own, SectionSetup):
                    reason = self.engine.unseen(own, side.setup)
                if reason:
                    left_out.append(f"{sensitivity.name}: left out: {reason}")
                else:
                    known.append((sensitivity.name, side.setup))
        return known, left_out

    def simulated_otherwise(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """See `EmulatedModel`; by coarse runs."""
        here = self._setup(values, self.two_fidelities)
        setups: list[Setup | None] = []
        for _, change in self.other_ways:
            setups += [here, here and replace(here, settings=change.settings)]
        rows = self._numbers(setups, np.tile(values, (len(setups), 1)))
        names = [name for name, _ in self.other_ways]
        return dict(zip(names, rows[1::2] - rows[0::2], strict=True))

    def error_std(self, values: np.ndarray) -> np.ndarray:
        """See `EmulatedModel`; none where no such section can be drawn, and none of a stress."""
        setup, found = self._setup(values, False), np.zeros(len(self.names))
        if setup is not None:
            request = setup.at(values[: self.varied.parameters])
            own = self._forward.error_std(request)
            found[: len(self.shown)] = own[self.shown]
        return found

    def cells_at(self, values: np.ndarray) -> SmallCells | None:
        """See `EmulatedModel`; none of a limit of flow, which lies higher with smaller cells."""
        case, setup = self.varied.case, self._setup(values, False)
        if setup is None or case.objective().limit or not case.parameters.strengths.any():
            return None
        own = values[: self.varied.parameters]
        return cells_by(self.engine, self.store, setup, own, case.other_cells(setup))

    @cached_property
    def _forward(self) -> Forward:
        """The engine; one that has learned must know the section where the question starts."""
        engine = self.engine.made(self.store)
        if self.engine.unseen is not None:
            setup = self.varied.case.setup
            engine.predict([setup.at(setup.parameters.start)])
        return engine

    def _setup(self, values: np.ndarray, coarse: bool) -> Setup | None:
        try:
            setup = self.varied.setup(values)
        except ValueError:
            return None
        return self.varied.case.coarsened(setup) if coarse else setup

    def _numbers(self, setups: Sequence[Setup | None], values: np.ndarray) -> np.ndarray:
        parameters = self.varied.parameters
        requests = {
            place: setup.at(values[place, :parameters])
            for place, setup in enumerate(setups)
            if setup is not None
        }
        found = np.full((len(values), len(self.names)), np.nan)
        predictions = self._forward.predict(list(requests.values()))
        for place, prediction in zip(requests, predictions, strict=True):
            found[place] = self._read(prediction)
        self.unread += int(np.isnan(found).any(axis=1).sum())
        return found

    def _read(self, prediction: Prediction) -> np.ndarray:
        stress = prediction.sigma_v0_kpa[self.strengths]
        return np.concatenate([prediction.values[self.shown], stress])


def stress_name(parameter: str) -> str:
    """Name of the stress before failure in the zones of a residual strength."""
    return f"sigma_v0 of {parameter}"
