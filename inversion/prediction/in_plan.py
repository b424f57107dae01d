"""Prediction in three dimensions: what is read of the deposit, and where it comes to lie.

The distribution of each reading is that of `inversion.prediction.predict`. The thickness of the
deposit at each place is a function of the strengths as well, joined between the runs; the share of
sampled strengths at which it exceeds a thickness is the exceedance map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from inversion.prediction.known_strength import KnownStrength, strength_parameters
from inversion.prediction.predict import ENVELOPE_SAMPLES, Distribution, predict
from inversion.prediction.prediction_document import distribution_of, head_of
from inversion.prediction.response import Sections
from mpm_taichi.readings3d import named
from pipeline.config import SimulationSettings

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
        *(f"volume_across_{name}_m3" for name in document.lines),
        "largest_speed_m_per_s",
    ]
    entries: list[MapMeasured] = [PlanReading(name=name) for name in names]
    count = len(names)
    targets = Targets(entries, names, np.zeros(count), np.eye(count), ["fitted"] * count)
    return BodySetup(scene, settings, strength_parameters(strengths), targets)


@dataclass(frozen=True)
class BodyPrediction:
    """A prediction in three dimensions.

    Attributes:
        setup: the question.
        strengths: with their zones.
        found: distribution of the readings.
        exceedance: thickness [m] -> probability that the deposit is thicker, at each pixel.
        wall_share: probability that soil reaches a wall of the domain, by wall.
    """

    setup: BodySetup
    strengths: Sequence[KnownStrength]
    found: Distribution
    exceedance: Mapping[float, Raster]
    wall_share: Mapping[str, float]

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
                    **distribution_of(found, number, words, _kind(name), unit),
                    "measured": None,
                    "censored": False,
                    "probability_beyond_measured": None,
                    "probability_at_the_edge": max(self.wall_share.values(), default=0.0),
                }
                for number, name in enumerate(found.names)
                for words, unit in [named(name)]
            ],
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
    return BodyPrediction(setup, strengths, found, maps, _wall_share(found, kept))


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
        sampled = Sections(found.scores, flat[:, block])(scores)
        for row, thickness in enumerate(thicker_than_m):
            shares[row, block] = np.mean(sampled > thickness, axis=0)
    return [share.reshape(thick.shape[1:]) for share in shares]


def _wall_share(found: Distribution, kept: Sequence[KeptMaps]) -> dict[str, float]:
    """Share of the samples that reach each wall that any run reached."""
    names = sorted({name for one in kept for name in one.walls})
    if not names:
        return {}
    reached = np.array([[float(name in one.walls) for name in names] for one in kept])
    sampled = Sections(found.scores, reached)(found.sample_scores[:ENVELOPE_SAMPLES])
    return dict(zip(names, map(float, np.mean(sampled > 0.5, axis=0)), strict=True))


def _kind(reading: str) -> str:
    """Type of a reading; runouts have exceedance curves in the report."""
    return "toe_runout" if reading.startswith(("toe_runout", "runout_")) else "reading"
