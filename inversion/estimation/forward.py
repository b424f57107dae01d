"""What a forward engine is: a `Request` in, predicted measurements out.

A request is one run of a `Setup`, which is one reading of the question.
`inversion.back_analysis.variants` makes other readings, the diagnosis one for each state of its
effects. What needs the history of a run is read as it ends (`HistoryReader`).

The material point method is one engine (`inversion.engines.mpm_engine`), a learned simulator
another, an analytic formula in the tests a third. Nothing above this file knows which of them runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Protocol, Self

import numpy as np

from geometry.dimensions.family import SectionFamily
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.scenes3d.scene3d import Scene3d, Terrain
from geometry.sides import Side
from geometry.survey.measured import Deposit, Measured, Reading
from inversion.estimation.data import Targets
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import STRENGTH_RATIO
from pipeline.config import SimulationSettings


@dataclass(frozen=True)
class Setup(ABC):
    """One reading of the question, on a section or on a body in three dimensions.

    Attributes:
        scene: what slides, before the values of the parameters are put in.
        settings: of the simulation.
        parameters: what is calibrated.
        targets: what is predicted.
    """

    scene: Scene | Scene3d
    settings: SimulationSettings
    parameters: Parameters
    targets: Targets

    #: Widest finite difference of a logarithm.
    widest_log: ClassVar[float] = 0.15
    #: What slides, in a word.
    kind: ClassVar[str] = "section"

    @abstractmethod
    def scene_at(self, values: np.ndarray) -> Scene | Scene3d:
        """The scene with values (p,) of the parameters put in."""

    @abstractmethod
    def at_spacing(self, spacing: float, source: str) -> Self:
        """The same reading with material points at another spacing [m].

        Args:
            spacing: of the points.
            source: begins messages.

        Raises:
            InputError: a zone would be too thin.
        """

    @abstractmethod
    def jittered(self, jitter: float, seed: int) -> Self:
        """The same reading with its points moved at random.

        Args:
            jitter: farthest move over half a spacing, 0 to 1.
            seed: of the moves.
        """

    @property
    @abstractmethod
    def soil(self) -> Scene | Terrain:
        """What has its zones and materials."""

    @abstractmethod
    def with_soil(self, soil: Scene | Terrain) -> Self:
        """The setup of another section, or of another terrain on the same rasters."""

    @property
    @abstractmethod
    def seed(self) -> int:
        """Of the jitter of its points."""

    @property
    @abstractmethod
    def least_move_m(self) -> float:
        """By how much a fitted number must differ from before the slide, for soil to have moved."""

    @property
    def has_strength_ratio(self) -> bool:
        """Some soil has a strength in proportion to its stress before failure, known or not."""
        soils = self.soil.materials.values()
        return any(spec.property == STRENGTH_RATIO for spec in self.parameters.specs) or any(
            soil.strength_ratio is not None for soil in soils
        )

    def at(self, values: np.ndarray) -> Request:
        """One run of this reading, with values (p,) of its parameters."""
        return Request(self, np.asarray(values, dtype=float))


@dataclass(frozen=True)
class SectionSetup(Setup):
    """A reading of the question on a section.

    Attributes:
        scene: the section.
        foot: where the section ended before the slide, x [m] by side.
        also_read: further measurements that are read as a run ends, which keeps no history.
        height_over_width: H/B of a slide between flanks, for `finite_width`; 0: plane strain.
        family: of the sections that this one is of, where nobody drew it; None: it was drawn.
    """

    scene: Scene
    targets: Targets[Measured]
    foot: Mapping[Side, float]
    also_read: tuple[Measured, ...] = ()
    height_over_width: float = 0.0
    family: SectionFamily | None = None

    def scene_at(self, values: np.ndarray) -> Scene:
        """The section with values (p,) of the parameters put in."""
        return self.parameters.scene(self.scene, values)

    def at_spacing(self, spacing: float, source: str) -> Self:
        """See `Setup`."""
        document = {**self.scene.model_dump(), "spacing": spacing}
        return replace(self, scene=scene_from_mapping(document, source))

    def jittered(self, jitter: float, seed: int) -> Self:
        """See `Setup`."""
        return replace(self, scene=self.scene.changed(jitter=jitter, seed=seed))

    @property
    def soil(self) -> Scene:
        """See `Setup`."""
        return self.scene

    def with_soil(self, soil: Scene | Terrain) -> Self:
        """See `Setup`."""
        assert isinstance(soil, Scene)
        return self.with_scene(soil)

    @property
    def seed(self) -> int:
        """See `Setup`."""
        return self.scene.seed

    @property
    def least_move_m(self) -> float:
        """Two spacings: a toe is read at points."""
        return 2.0 * self.scene.spacing

    def with_scene(self, scene: Scene) -> Self:
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
        setup: the reading of the question: what slides, settings, measurements.
        values: of its parameters in outside units (kPa, degrees, kg/m3), in their order, (p,).
    """

    setup: Setup
    values: np.ndarray

    @property
    def section(self) -> SectionSetup:
        """Its setup, for an engine that simulates sections.

        Raises:
            TypeError: it is a body's.
        """
        if not isinstance(self.setup, SectionSetup):
            raise TypeError("this engine simulates sections")
        return self.setup

    @property
    def scene(self) -> Scene:
        """The section with the values put in."""
        return self.section.scene_at(self.values)


class Recorded(Protocol):
    """A run with all frames: of the solver, or of what imitates it."""

    @property
    def scene(self) -> Scene:
        """What slid."""
        ...

    @property
    def positions(self) -> np.ndarray:
        """(T, N, 2) [m]."""
        ...

    @property
    def time(self) -> np.ndarray:
        """(T,) [s]."""
        ...

    @property
    def initial_volume(self) -> np.ndarray:
        """Of the points before the slide, (N,) [m2]."""
        ...

    @property
    def bulk_volume(self) -> np.ndarray:
        """Of the points as a survey sees them at the end, (N,) [m2]."""
        ...

    @property
    def came_to_rest(self) -> bool:
        """It stopped by itself."""
        ...

    @property
    def status(self) -> str:
        """Finished or failed."""
        ...

    @property
    def reason(self) -> str:
        """Why it failed."""
        ...


@dataclass(frozen=True)
class HistoryReader:
    """Reads measurements on all frames of a run as it ends, so that no frames are kept.

    Attributes:
        entries: measurements; only those that need the history are read.
        foot: where the section ended before the slide, x [m] by side.
    """

    entries: Sequence[Measured]
    foot: Mapping[Side, float]

    @cached_property
    def wanted(self) -> dict[str, Measured]:
        """The measurements that are read, by the name of their reading."""
        return {e.reading_key(self.foot): e for e in self.entries if e.needs_history}

    def read(self, run: Recorded) -> dict[str, Reading]:
        """Readings by name."""
        if run.status == "failed":
            return {
                key: Reading(np.full(len(entry.values), np.nan), run.reason)
                for key, entry in self.wanted.items()
            }
        deposit = deposit_of_run(run, self.foot)
        return {key: entry.reading(deposit) for key, entry in self.wanted.items()}


def deposit_of_run(run: Recorded, foot: Mapping[Side, float]) -> Deposit:
    """A whole run as a survey sees it.

    Args:
        run: with its frames.
        foot: side -> x of the toe before the slide [m].
    """
    return Deposit.on(
        run.scene,
        foot,
        run.positions[-1].astype(float),
        run.positions[0].astype(float),
        run.initial_volume,
        volume=run.bulk_volume,
        positions=run.positions,
        time=run.time,
        at_rest=run.came_to_rest,
    )


@dataclass(frozen=True)
class Prediction:
    """Prediction from one set of parameters.

    Attributes:
        values: predicted measurements in the order of `Forward.names`, (m,) [m, or m/s]; NaN where
            the run failed before it could be read.
        at_start: the same readings on the section before anything moved, (m,).
        by_eye: toe seen by the naked eye, by name of the toe's measurement [m]; for reports.
        positions: final positions (N, 2) float32 [m]; volume: of these points, (N,) [m2].
        status: "finished"; "failed" where a guard stopped the run or a fitted number is NaN.
        reason: why it failed, or why a number that is not fitted could not be read; else empty.
        sigma_v0_kpa: mean vertical effective stress before failure of each parameter's zones (p,)
            [kPa]; NaN where the engine does not know it.
        sigma_v0_std_kpa: its spread within the zones, (p,) [kPa].
        run_time_s: time the run took, whenever it was [s].
        at_rest: the slide came to rest; False: it was cut off in motion.
        spacing_m: between the material points of its run [m]; 0: it has none.
        remarks: what a reader of an answer should know of its run.
    """

    values: np.ndarray
    at_start: np.ndarray
    by_eye: dict[str, float] = field(default_factory=dict)
    positions: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    volume: np.ndarray = field(default_factory=lambda: np.zeros(0, np.float32))
    status: str = "finished"
    reason: str = ""
    sigma_v0_kpa: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sigma_v0_std_kpa: np.ndarray = field(default_factory=lambda: np.zeros(0))
    run_time_s: float = 0.0
    at_rest: bool = True
    spacing_m: float = 0.0
    remarks: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """True where a guard stopped the run, or any value, fitted or not, could not be read."""
        return self.status == "failed" or not bool(np.all(np.isfinite(self.values)))


class Forward(ABC):
    """A forward engine: whatever predicts the measurements of a reading of a question.

    An engine writes `predict`, and `derivative` if it knows better than finite differences.

    Attributes:
        runs: simulations asked for so far, whether computed now or found in a cache.
    """

    def __init__(self) -> None:
        self.runs = 0

    @abstractmethod
    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Predictions of all requests, in their order, as one batch.

        Requests differ in the values, in the reading of the question, in the seed of the jitter, in
        the effects of their section: all that asks for runs comes to this.
        """

    def error_std(self, request: Request) -> np.ndarray:
        """Standard deviation of the engine's own error of each number, (m,); here none is known."""
        return np.zeros(len(request.setup.targets.names))

    def derivative(
        self, request: Request, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Prediction of a request, and its derivative with respect to the values.

        Here by one batch of 1 + p runs: the point itself and one step each. A run that fails is
        tried again with half its step; a column whose second run fails too is NaN.

        Args:
            request: its values are where the derivative is taken.
            steps: (p,) signed changes of the parameters that an engine of finite differences takes;
                an engine that differentiates exactly ignores them.

        Returns:
            the prediction; the derivative (m, p), per outside unit; the steps that were taken (p,),
            zero where the derivative is exact.
        """
        values, taken = request.values, np.array(steps, dtype=float)
        places = [values, *(values + np.diag(taken))]
        base, *moved = self.predict([replace(request, values=place) for place in places])
        failed = [place for place, other in enumerate(moved) if other.status == "failed"]
        if failed and base.status != "failed":
            taken[failed] *= 0.5
            nearer = (values + np.diag(taken))[failed]
            again = self.predict([replace(request, values=place) for place in nearer])
            for place, other in zip(failed, again, strict=True):
                moved[place] = other
        change = np.stack([other.values - base.values for other in moved], axis=1)
        for place, other in enumerate(moved):
            if other.status == "failed":
                change[:, place] = np.nan
        return base, change / taken[None, :], taken


class WrappedEngine(Forward):
    """An engine around another one.

    Attributes:
        engine: the one inside.
    """

    engine: Forward

    @property
    def runs(self) -> int:
        """Runs asked for so far."""
        return self.engine.runs

    @runs.setter
    def runs(self, count: int) -> None:
        self.engine.runs = count

    def error_std(self, request: Request) -> np.ndarray:
        """That of the engine inside."""
        return self.engine.error_std(request)
