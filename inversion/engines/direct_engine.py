"""A direct model as a forward engine: the deposit in one pass, without stepping.

In: requests as for every engine, and the model that ships under the engine's name (`models/`). Out:
predictions of what is read on the deposit at the end (toes, surface, settlement of the crest,
freeboard) and on arrival times (duration, history of a toe). What needs single points has no
answer. The toe and the times are the model's own; the others are read, by the definitions of the
survey, on a deposit filled from its thickness.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TypeGuard

import numpy as np

from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene
from geometry.sides import outward_of
from geometry.survey.measured import Measured, Reading
from geometry.survey.no_flow import NoFlow
from geometry.survey.toe_runout import ToeRunout
from gns.data.distance import FARTHEST
from gns.direct.effects import most
from gns.direct.predictor import MODEL_FILE, DirectPredictor, Forecast
from gns.direct.sections import (
    SectionColumns,
    check_settings,
    section_of,
    toes_of,
    with_strengths,
)
from inversion.engines.forecast_times import NORMAL, TIMED, read_times, time_error_std, timed
from inversion.engines.read_run import prediction_of
from inversion.engines.run_store import KeptRun
from inversion.estimation.forward import Forward, Prediction, Request, SectionSetup
from inversion.problem.question import material_key
from pipeline.cli import InputError
from pipeline.places import MODELS
from pipeline.places import shipped as shipped_folder

#: Types of measurement that it predicts.
READ = ("toe_runout", "no_flow", "surface_profile", "crest_settlement", "freeboard", *TIMED)
#: Properties that change the soil but not the section before the slide.
STRENGTHS = ("cohesion_kpa", "friction_deg")
#: Columns thinner than this share of a spacing hold no soil.
THINNEST = 0.25
#: Change of the thickness by which a reading is differentiated, as a share of the derivative's own.
STEP = 1e-4


@dataclass
class Start:
    """A section before the slide: the same for all requests that differ in strengths alone.

    Attributes:
        setup: of the request that it was made for.
        section: its columns; before: toes before the slide, (2,) [heights].
        initial: points before the slide (N, 2) [m]; zone, volume [m2]: of each, (N,).
        read: the measurements on it, (m,); None: not read yet.
    """

    setup: SectionSetup
    section: SectionColumns
    before: np.ndarray
    initial: np.ndarray
    zone: np.ndarray
    volume: np.ndarray
    read: np.ndarray | None = None

    def serves(self, setup: SectionSetup) -> bool:
        """Whether a request of another setup begins on the same section."""
        ours = self.setup
        same = setup.scene is ours.scene and setup.targets is ours.targets
        return same and setup.foot == ours.foot and setup.settings == ours.settings


@dataclass(frozen=True)
class DirectRequest:
    """A request as the model sees it.

    Attributes:
        setup: of the request; scene: with its values put in.
        section: its columns, with its strengths; start: the section before the slide.
    """

    setup: SectionSetup
    scene: Scene
    section: SectionColumns
    start: Start

    @property
    def toes_before(self) -> np.ndarray:
        """Toes before the slide, x (2,) [m]."""
        return self.section.middle + self.section.height * self.start.before


class DirectEngine(Forward):
    """`inversion.estimation.forward.Forward` by a direct model.

    Args:
        predictor: the model.
        anywhere: answer also far outside what the model has learned from.
    """

    def __init__(self, predictor: DirectPredictor, *, anywhere: bool = False) -> None:
        super().__init__()
        self.predictor = predictor
        self.anywhere = anywhere
        self._answers = False  # a question has been within what it knows
        self._start: Start | None = None

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Predictions of all requests; one it has no answer to has failed, as a run may.

        Raises:
            InputError: a section that the model does not know, or one that is far outside its
                training where the question starts; a fitted measurement that it cannot read.
        """
        self.runs += len(requests)
        return [
            self._predicted(one, *self.forecast(one)) if isinstance(one, DirectRequest) else one
            for one in self._asked(requests)
        ]

    def derivative(
        self, request: Request, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Prediction and derivative: exact in strengths.

        See `inversion.estimation.forward.Forward`; columns of other parameters are finite
        differences.
        """
        tangents = _tangents(request)
        if tangents is None:
            return super().derivative(request, steps)
        (asked,) = self._asked([request])
        if not isinstance(asked, DirectRequest):
            return super().derivative(request, steps)
        self.runs += 1
        forecast, seconds = self.forecast(asked)
        prediction = self._predicted(asked, forecast, seconds)
        unit = np.array([asked.section.unit_kpa, 1.0, 1.0])
        found = self.predictor.derivative(asked.section, asked.start.before, tangents / unit)
        columns = []
        for slopes in zip(*found, strict=True):
            ends = [
                self._predicted(asked, _moved(forecast, sign * STEP, *slopes))
                for sign in (1.0, -1.0)
            ]
            columns.append((ends[0].values - ends[1].values) / (2.0 * STEP))
        return prediction, np.stack(columns, axis=1), np.zeros(len(steps))

    def distance(self, request: Request) -> float:
        """Of a request's section to the training; see `DirectPredictor.distance`."""
        return self.predictor.distance(section_of(request.scene))

    def spacings_high(self, request: Request) -> float:
        """Height of a request's section [spacings]."""
        return 1.0 / section_of(request.scene).spacing

    def error_std(self, request: Request) -> np.ndarray:
        """Standard deviation of the model's error of each number, (m,) [m] or [s].

        Of toes and times from their own interval, of elevations from the interval of the columns
        there; as of a normal distribution with the same 90 % interval. NaN where it has no answer.
        """
        (asked,) = self._asked([request])
        if not isinstance(asked, DirectRequest):
            return np.full(len(request.section.targets.names), np.nan)
        forecast, _ = self.forecast(asked)
        return np.concatenate(
            [_std(entry, forecast, asked) for entry in request.section.targets.entries]
        )

    def forecast(self, asked: DirectRequest) -> tuple[Forecast, float]:
        """What the model predicts, and the time that took [s]."""
        began = time.perf_counter()
        forecast = self.predictor.predict(asked.section, asked.start.before)
        return forecast, time.perf_counter() - began

    def _asked(self, requests: Sequence[Request]) -> list[DirectRequest | Prediction]:
        """What the model sees of each request; a failed prediction where it has no answer."""
        return [self._one(request) for request in requests]

    def _one(self, request: Request) -> DirectRequest | Prediction:
        setup, scene = request.section, request.scene
        _check_readable(setup)
        begin = self._start_of(request, scene)
        section = with_strengths(begin.section, scene)
        away = self.predictor.distance(section)
        if away > FARTHEST and not self.anywhere:
            words = (
                f"{scene.name}: lies at {away:.1f} from the training of the direct model (1: as "
                f"far as its outermost sections from each other); beyond {FARTHEST:g} it answers "
                "a back-analysis with inversion.outside_training: true alone; ask the engine mpm"
            )
            if not self._answers and self._start_is_far(setup):
                raise InputError(words)
            return _failed(setup, begin, words)
        self._answers = True
        return DirectRequest(setup, scene, section, begin)

    def _start_is_far(self, setup: SectionSetup) -> bool:
        """Whether the model knows nothing like the section where its question starts."""
        scene = setup.at(setup.parameters.start).scene
        section = section_of(scene, setup.settings.gravity_m_per_s2)
        return self.predictor.distance(section) > FARTHEST

    def _start_of(self, request: Request, scene: Scene) -> Start:
        """The last one, where the request differs from it in strengths alone; else a new one."""
        setup, last = request.section, self._start
        strengths = all(material_key(one.property) in STRENGTHS for one in setup.parameters.specs)
        if last is not None and strengths and last.serves(setup):
            return last
        check_settings(scene, setup.settings)
        section = section_of(scene, setup.settings.gravity_m_per_s2)
        self.predictor.check_learned(section, scene.name)
        points = fill(scene)
        initial = points.position.astype(float)
        before = toes_of(section, initial, points.volume, scene.spacing)
        found = Start(setup, section, before, initial, points.zone, points.volume)
        self._start = found if strengths else None
        return found

    def _predicted(
        self, asked: DirectRequest, forecast: Forecast, seconds: float = 0.0
    ) -> Prediction:
        """Read the measurements on a forecast."""
        setup, spacing = asked.setup, asked.scene.spacing
        final, volume = _filled(asked, forecast.thickness)
        run = KeptRun(
            initial=asked.start.initial,
            final=final,
            zone=asked.start.zone,
            initial_volume=asked.start.volume.astype(np.float32),
            vertical_stress=np.full(len(asked.start.initial), np.nan, np.float32),
            status="finished",
            reason="",
            end_s=0.0,
            at_rest=True,
            wall_time_s=seconds,
            readings=_histories(asked, forecast),
            volume=volume,
        )
        prediction = prediction_of(setup, run, asked.start.read)
        asked.start.read = prediction.at_start
        values, place, before = prediction.values.copy(), 0, asked.toes_before
        for entry in setup.targets.entries:
            if _of_toe(entry):
                number = 0 if entry.side == "left" else 1
                travel = outward_of(entry.side) * (forecast.toes[number] - before[number])
                values[place] = prediction.at_start[place] + travel
            elif not readable(entry):
                values[place : place + len(entry.values)] = np.nan
            place += len(entry.values)
        return replace(prediction, values=values, spacing_m=spacing)


def _failed(setup: SectionSetup, begin: Start, reason: str) -> Prediction:
    """What is predicted where there is no answer."""
    unknown = np.full(len(setup.parameters.specs), np.nan)
    return Prediction(
        values=np.full(len(setup.targets.names), np.nan),
        at_start=np.full(len(setup.targets.names), np.nan) if begin.read is None else begin.read,
        status="failed",
        reason=reason,
        sigma_v0_kpa=unknown,
        sigma_v0_std_kpa=unknown,
        spacing_m=setup.scene.spacing,
    )


def shipped(name: str) -> DirectEngine:
    """The engine of a model that ships under a name."""
    return DirectEngine(_loaded(shipped_folder(MODELS) / name / MODEL_FILE))


def learned_effects(name: str) -> dict[str, float]:
    """Effects that a model that ships under a name has learned, and up to which amplitude."""
    return {one: most(one) for one in shipped(name).predictor.effects}


@cache
def _loaded(path: Path) -> DirectPredictor:
    return DirectPredictor.load(path)


def _of_toe(entry: Measured) -> TypeGuard[ToeRunout | NoFlow]:
    return entry.type in ("toe_runout", "no_flow")


def readable(entry: Measured) -> bool:
    """Whether the model predicts a measurement."""
    if entry.type in TIMED:
        return timed(entry)
    return entry.type in READ and getattr(entry, "at", "") != "crest_points"


def unseen(before: SectionSetup, after: SectionSetup) -> str:
    """Why the models have no answer to a changed setup, or the same one; empty: they have one."""
    sections = []
    try:
        for setup in (before, after):
            check_settings(setup.scene, setup.settings)
            sections.append(section_of(setup.scene, setup.settings.gravity_m_per_s2))
    except InputError as error:
        return str(error).removeprefix(f"{setup.scene.name}: ")
    if before.scene.ground != after.scene.ground:
        return "the direct model has learned from level and evenly sloping ground alone"
    own, other = sections
    try:
        shipped("direct").predictor.check_learned(other, after.scene.name)
    except InputError as error:
        return str(error).removeprefix(f"{after.scene.name}: ")
    if all(np.array_equal(getattr(own, name), getattr(other, name)) for name in vars(own)):
        return "the direct model does not see it"
    return ""


def _check_readable(setup: SectionSetup) -> None:
    place = 0
    for entry in setup.targets.entries:
        count = len(entry.values)
        if setup.targets.fitted[place : place + count].any() and not readable(entry):
            raise InputError(
                f"{entry.name}: {entry.type}: the direct model does not predict it; it can fit "
                f"{', '.join(READ)}, without single points"
            )
        place += count


def _histories(asked: DirectRequest, forecast: Forecast) -> dict[str, Reading]:
    """Readings of what needs a history: from the arrival times, or none."""
    setup = asked.setup
    return {
        entry.reading_key(setup.foot): Reading(
            read_times(entry, forecast, asked.toes_before, setup.foot)
            if timed(entry)
            else np.full(len(entry.values), np.nan)
        )
        for entry in [*setup.targets.entries, *setup.also_read]
        if entry.needs_history
    }


def _tangents(request: Request) -> np.ndarray | None:
    """Change of the zones' values with each parameter (p, Z, 3); None: one is no strength."""
    scene = request.scene
    found = []
    for spec, value in zip(request.section.parameters.specs, request.values, strict=True):
        key = material_key(spec.property)
        if key not in STRENGTHS:
            return None
        column = 0 if key == "cohesion_kpa" else 1
        slope = 1.0 if column == 0 else np.radians(1.0) / np.cos(np.radians(value)) ** 2
        change = np.zeros((len(scene.zones), 3))
        for place, zone in enumerate(scene.zones):
            if zone.name in spec.zones:
                change[place, column] = slope
        found.append(change)
    return np.array(found)


def _filled(asked: DirectRequest, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of a deposit, a spacing apart, and the volume of each."""
    spacing, x = asked.scene.spacing, asked.section.x
    places = np.arange(x[0], x[-1], spacing)
    depth = np.interp(places, x, thickness)
    kept = depth > THINNEST * spacing
    places, depth = places[kept], depth[kept]
    count = np.ceil(depth / spacing).astype(int)
    column = np.repeat(np.arange(len(places)), count)
    number = np.arange(len(column)) - np.repeat(np.cumsum(count) - count, count)
    share = (number + 0.5) / count[column]
    y = asked.scene.ground.height(places)[column] + share * depth[column]
    volume = (spacing * depth / count)[column]
    return np.column_stack([places[column], y]), volume


def _moved(
    forecast: Forecast, step: float, toes: np.ndarray, deposit: np.ndarray, times: np.ndarray
) -> Forecast:
    return replace(
        forecast,
        toes=forecast.toes + step * toes,
        thickness=forecast.thickness + step * deposit,
        times=forecast.times + step * times,
    )


def _std(entry: Measured, forecast: Forecast, asked: DirectRequest) -> np.ndarray:
    """Of the numbers of one measurement, see `DirectEngine.error_std`."""
    count, x = len(entry.values), asked.section.x
    if timed(entry):
        return time_error_std(entry, forecast, asked.toes_before)
    if _of_toe(entry):
        return np.array([forecast.toe_interval[0 if entry.side == "left" else 1] / NORMAL])
    along = entry.along
    if entry.type == "surface_profile" and along is not None:
        return np.interp(along.place, x, forecast.thickness_interval) / NORMAL
    if (place := getattr(entry, "x_m", None)) is not None:
        return np.full(count, np.interp(place, x, forecast.thickness_interval) / NORMAL)
    return np.full(count, np.median(forecast.thickness_interval[forecast.thickness > 0]) / NORMAL)
