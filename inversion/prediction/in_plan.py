"""Prediction in three dimensions: what is read of the deposit, and where it comes to lie.

The distribution of each reading is that of `inversion.prediction.predict`. The thickness of the
deposit at each place is a function of the strengths as well, joined between the runs; the share of
sampled strengths at which it exceeds a thickness is the exceedance map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from geometry.scenes3d.scene3d import Scene3d
from geometry.survey.quantity import Confidence
from geometry.survey3d.measured import DepositMap, MapMeasured
from geometry.terrain.raster import Raster
from inversion.engines.body_engine import BodyStore
from inversion.engines.body_setup import BodySetup, KeptMaps
from inversion.engines.run_store import Store
from inversion.engines.small_cells import SmallCells
from inversion.estimation.data import Targets
from inversion.estimation.forward import Forward
from inversion.prediction.hydrograph import discharge, hydrograph
from inversion.prediction.known_strength import KnownStrength, strength_parameters
from inversion.prediction.predict import ENVELOPE_SAMPLES, Distribution, predict
from inversion.prediction.prediction_document import distribution_of, head_of
from inversion.prediction.response import JoinedSurfaces
from mpm_taichi.readings3d import ACROSS, named
from pipeline.config import SimulationSettings

VOLUME_UNIT, DISCHARGE_UNIT = "m3", "m3/s"
#: Pixels that are put through the samples at a time.
BLOCK = 4096
#: Areas with at least this probability are reported, %.
PERCENT = (5, 50, 95)


class PlanReading(MapMeasured):
    """A reading of a simulation that nobody measured."""

    unit: ClassVar[str] = ""

    type: Literal["reading"] = "reading"
    confidence: Confidence = "assumed"
    source: str = "predicted alone"

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (1,)."""
        return np.zeros(1)

    def with_values(self, values: np.ndarray) -> Self:
        """It has none."""
        return self

    def check_in(self, scene: Scene3d, where: str) -> None:
        """Any scene has it."""

    def read(self, deposit: DepositMap) -> np.ndarray:
        """The reading, (1,); a path on which nothing came to lie has been run 0 m along."""
        value = deposit.readings.get(self.name, np.nan)
        return np.array([0.0 if self.name.startswith("runout_") and np.isnan(value) else value])


class LineVolume(PlanReading):
    """Volume that has crossed a line over time, at the times of `BodySetup.times`, (k,) [m3]."""

    unit: ClassVar[str] = VOLUME_UNIT

    line: str
    steps: int

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (k,)."""
        return np.zeros(self.steps)

    def read(self, deposit: DepositMap) -> np.ndarray:
        """The volumes; NaN where they were not kept."""
        return np.array(deposit.across.get(self.line, [np.nan] * self.steps), dtype=float)


class LinePeak(LineVolume):
    """Largest discharge across a line, a mean over two steps, (1,) [m3/s]."""

    unit: ClassVar[str] = DISCHARGE_UNIT

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (1,)."""
        return np.zeros(1)

    def read(self, deposit: DepositMap) -> np.ndarray:
        """The discharge."""
        return np.array([discharge(super().read(deposit)).max()])


def prediction_setup(
    scene: Scene3d, settings: SimulationSettings, strengths: Sequence[KnownStrength]
) -> BodySetup:
    """The question "how far does it run?" on a body.

    Args:
        scene: the body.
        settings: of the simulations.
        strengths: with their zones; they are the parameters, in their order.
    """
    document = scene.document
    names = [
        "toe_runout_m",
        *(f"runout_{name}_m" for name in document.paths or ("middle",)),
        "inundated_area_m2",
        "volume_beyond_foot_m3",
        "volume_moved_m3",
        *(name.join(ACROSS) for name in document.lines),
        "largest_speed_m_per_s",
    ]
    entries: list[MapMeasured] = [PlanReading(name=name) for name in names]
    targets = Targets.unmeasured(entries, names)
    parameters = strength_parameters(strengths)
    return BodySetup(scene, settings, parameters, targets, over_time=bool(document.lines))


def lines_alone(setup: BodySetup) -> BodySetup:
    """A setup whose runs are the same and of which what crosses the lines is predicted.

    First the largest discharge of each line, then the volumes of each over time.
    """
    steps = len(setup.times)
    lines = list(setup.scene.document.lines)
    peaks = [
        LinePeak(name=f"peak_across_{line}_m3_per_s", line=line, steps=steps) for line in lines
    ]
    volumes = [LineVolume(name=f"across {line}", line=line, steps=steps) for line in lines]
    entries: list[MapMeasured] = [*peaks, *volumes]
    names = [entry.name for entry in entries for _ in entry.values]
    return replace(setup, targets=Targets.unmeasured(entries, names))


@dataclass(frozen=True)
class BodyPrediction:
    """A prediction in three dimensions.

    Attributes:
        setup: the question.
        strengths: with their zones.
        found: distribution of the readings.
        exceedance: thickness [m] -> probability that the deposit is thicker, at each pixel.
        wall_share: probability that soil reaches a wall of the domain, by wall.
        peaks: distribution of the largest discharge across each line; None: there is no line.
        hydrographs: of each line, as `inversion.prediction.hydrograph.hydrograph` makes them.
    """

    setup: BodySetup
    strengths: Sequence[KnownStrength]
    found: Distribution
    exceedance: Mapping[float, Raster]
    wall_share: Mapping[str, float]
    peaks: Distribution | None = None
    hydrographs: Sequence[dict[str, Any]] = ()

    @property
    def document(self) -> dict[str, Any]:
        """`prediction.json` (keys: docs/method/prediction.md)."""
        found = self.found
        pixel = next(iter(self.exceedance.values())).spacing ** 2
        before = self.setup.before.before.values
        return {
            **head_of(self.setup.scene.name, self.setup.scene.spacing, self.strengths, found),
            "quantities": [
                {
                    **distribution_of(one, number, words, _kind(name), unit),
                    "measured": None,
                    "censored": False,
                    "probability_beyond_measured": None,
                    "probability_at_the_edge": max(self.wall_share.values(), default=0.0),
                }
                for one in (found, self.peaks)
                if one is not None
                for number, name in enumerate(one.names)
                for words, unit in [named(name)]
            ],
            "hydrographs": list(self.hydrographs),
            "inundation": [
                {
                    "thicker_than_m": thickness,
                    "area_m2": {
                        str(percent): pixel
                        * float(np.sum((before < thickness) & (chance.values >= percent / 100.0)))
                        for percent in PERCENT
                    },
                    "mean_area_m2": round(
                        pixel * float(chance.values[before < thickness].sum()), 1
                    ),
                }
                for thickness, chance in self.exceedance.items()
            ],
            "walls": {name: round(share, 4) for name, share in self.wall_share.items()},
        }


def predict_in_plan(
    engine: Forward,
    store: Store,
    setup: BodySetup,
    strengths: Sequence[KnownStrength],
    *,
    thicker_than_m: Sequence[float],
    jittered: Sequence[BodySetup] = (),
    samples: int = 20_000,
) -> BodyPrediction:
    """The distribution of the readings and the exceedance maps.

    Args:
        engine: simulates.
        store: of its runs.
        setup: the scene and the zones of the strengths.
        strengths: p of them.
        thicker_than_m: thicknesses [m] of which the probability is mapped.
        jittered: setups that differ in the seed of the jitter alone; fewer than two: no noise.
        samples: strengths that are put through the response.

    Raises:
        WorkFailed: more than a quarter of the runs failed.
    """
    assert isinstance(store, BodyStore)
    cells = SmallCells.unknown(setup.scene, "a second spacing takes hours of a body")
    found = predict(engine, setup, strengths, cells=cells, jittered=jittered, samples=samples)
    kept = [store.fetch(setup, values) for values in found.strengths]
    before = setup.before.before
    maps = {
        thickness: Raster(before.origin, before.spacing, chance, before.crs)
        for thickness, chance in zip(
            thicker_than_m, exceedance(found, kept, thicker_than_m), strict=True
        )
    }
    peaks: Distribution | None = None
    drawn: list[dict[str, Any]] = []
    if setup.scene.document.lines:
        over_time = predict(
            engine,
            lines_alone(setup),
            strengths,
            cells=cells,
            jittered=[lines_alone(one) for one in jittered],
            samples=samples,
        )
        peaks, drawn = _of_lines(setup, found, over_time)
    return BodyPrediction(setup, strengths, found, maps, _wall_share(found, kept), peaks, drawn)


def _of_lines(
    setup: BodySetup, found: Distribution, over_time: Distribution
) -> tuple[Distribution, list[dict[str, Any]]]:
    """Largest discharges and hydrographs of the lines, which end with the volumes of `found`."""
    lines, steps = list(setup.scene.document.lines), len(setup.times)
    smooth = over_time.response(over_time.sample_scores)[:, len(lines) :]
    drawn = [
        hydrograph(
            line,
            smooth[:, place * steps : (place + 1) * steps],
            np.maximum(found.samples[:, found.names.index(line.join(ACROSS))], 0.0),
            units=(VOLUME_UNIT, DISCHARGE_UNIT),
        )
        for place, line in enumerate(lines)
    ]
    return over_time.of(range(len(lines))), drawn


def exceedance(
    found: Distribution, kept: Sequence[KeptMaps], thicker_than_m: Sequence[float]
) -> list[np.ndarray]:
    """Share of the samples whose deposit is thicker than each thickness, (nx, ny) each."""
    thick = np.stack([one.thickness for one in kept])
    flat = thick.reshape(len(kept), -1)
    scores = found.sample_scores[:ENVELOPE_SAMPLES]
    shares = np.empty((len(thicker_than_m), flat.shape[1]))
    for first in range(0, flat.shape[1], BLOCK):
        block = slice(first, first + BLOCK)
        sampled = JoinedSurfaces(found.scores, flat[:, block])(scores)
        for row, thickness in enumerate(thicker_than_m):
            shares[row, block] = np.mean(sampled > thickness, axis=0)
    return [share.reshape(thick.shape[1:]) for share in shares]


def _wall_share(found: Distribution, kept: Sequence[KeptMaps]) -> dict[str, float]:
    """Share of the samples that reach each wall that any run reached."""
    names = sorted({name for one in kept for name in one.walls})
    if not names:
        return {}
    reached = np.array([[float(name in one.walls) for name in names] for one in kept])
    sampled = JoinedSurfaces(found.scores, reached)(found.sample_scores[:ENVELOPE_SAMPLES])
    return dict(zip(names, map(float, np.mean(sampled > 0.5, axis=0)), strict=True))


def _kind(reading: str) -> str:
    """Type of a reading; runouts have exceedance curves in the report."""
    return "toe_runout" if reading.startswith(("toe_runout", "runout_")) else "reading"
