"""One reading of the question, and one run of it: the input of every engine.

`inversion.back_analysis.variants` makes other readings, the diagnosis one for each state of its
effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.scenes.scene import Scene
from geometry.survey.measured import Measured
from inversion.estimation.data import Targets
from inversion.estimation.history_reader import HistoryReader
from inversion.estimation.unknowns import Parameters
from pipeline.config import SimulationSettings


@dataclass(frozen=True)
class Setup:
    """One reading of the question.

    Attributes:
        scene: the section, before the values of the parameters are put in.
        settings: of the simulation.
        parameters: what is calibrated.
        targets: what is predicted.
        foot: where the section ended before the slide, x [m] by side.
        also_read: further measurements that are read as a run ends, which keeps no history.
        height_over_width: H/B of a slide between flanks, for `finite_width`; 0: plane strain.
    """

    scene: Scene
    settings: SimulationSettings
    parameters: Parameters
    targets: Targets
    foot: Mapping[str, float]
    also_read: tuple[Measured, ...] = ()
    height_over_width: float = 0.0

    def at(self, values: np.ndarray) -> Request:
        """One run of this reading, with values (p,) of its parameters."""
        return Request(self, np.asarray(values, dtype=float))

    def with_scene(self, scene: Scene) -> Setup:
        """The setup of another section; where its foot moves, so does the zero of a runout."""
        own = self.scene
        foot = {
            side: x if scene.foot(side) == own.foot(side) else x + scene.foot(side) - own.foot(side)
            for side, x in self.foot.items()
        }
        return replace(self, scene=scene, foot=foot)

    @cached_property
    def reader(self) -> HistoryReader:
        """Reads what needs the whole history of a run."""
        return HistoryReader([*self.targets.entries, *self.also_read], self.foot)


@dataclass(frozen=True, eq=False)
class Request:
    """One forward run that is asked for.

    Attributes:
        setup: the reading of the question: section, settings, measurements.
        values: of its parameters in outside units (kPa, degrees, kg/m3), in their order, (p,).
    """

    setup: Setup
    values: np.ndarray

    @property
    def scene(self) -> Scene:
        """The section with the values put in."""
        return self.setup.parameters.scene(self.setup.scene, self.values)
