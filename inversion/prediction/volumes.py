"""What a section releases: volumes that are read on its runs and that nobody measured.

Volumes are those of the soil in place, per metre of width. A point that lies across a line counts
with its share beyond it, so that the volume passed rises smoothly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from geometry.scenes.scene import Scene
from geometry.sides import Side, outward_of
from geometry.survey.frames import frames_of
from geometry.survey.marks import Mark
from geometry.survey.measured import Deposit, Measured
from geometry.survey.quantity import Confidence
from geometry.survey.site import Site
from inversion.engines.small_cells import SmallCells
from inversion.estimation.data import Targets
from inversion.estimation.forward import Forward, SectionSetup
from inversion.prediction.hydrograph import STEP_S, discharge, hydrograph
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.predict import Distribution, predict
from inversion.prediction.prediction_case import PredictionCase
from pipeline.cli import InputError

VOLUME_UNIT, DISCHARGE_UNIT = "m3/m", "m3/s per m"
OPTION = "--through"


class SectionReading(Measured):
    """A reading of a run that nobody measured; of one number unless it says otherwise."""

    unit: ClassVar[str] = VOLUME_UNIT
    history: ClassVar[tuple[str, ...] | None] = None
    along: ClassVar[None] = None
    datum: ClassVar[None] = None

    confidence: Confidence = "assumed"
    source: str = "predicted alone"

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (m,)."""
        return np.zeros(1)

    def with_values(self, values: np.ndarray) -> Self:
        """It has none."""
        return self

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """Any section has it."""

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[Measured]:
        """None: it is no survey."""
        return []

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []


class MobilisedVolume(SectionReading):
    """Volume of the points that moved by more than one spacing [m3/m]."""

    type: Literal["mobilised_volume"] = "mobilised_volume"

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """See `Measured`; it has no derivative."""
        _refuse_derivative(derivative, self.name)
        moved = np.linalg.norm(deposit.position - deposit.initial_position, axis=1)
        return float(_in_place(deposit)[moved > deposit.spacing].sum())


class ReleasedVolume(SectionReading):
    """Volume that has passed x = `x_m` to `side`, every `STEP_S` from the start, (m,) [m3/m].

    What returns is taken off again.
    """

    history: ClassVar[tuple[str, ...]] = ("x_m", "side", "steps")

    type: Literal["released_volume"] = "released_volume"
    x_m: float
    side: Side
    steps: int

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (steps + 1,)."""
        return np.zeros(self.steps + 1)

    @property
    def parts(self) -> list[str]:
        """The times."""
        return [f"at {STEP_S * number:g} s" for number in range(self.steps + 1)]

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """See `Measured`; it has no derivative."""
        _refuse_derivative(derivative, self.name)
        return self.passed(deposit)

    def passed(self, deposit: Deposit) -> np.ndarray:
        """The volumes, (steps + 1,) [m3/m]; after the end of a run the last."""
        positions, time = frames_of(deposit, self.name)
        volume, outward = _in_place(deposit), outward_of(self.side)
        beyond = np.array(
            [
                volume
                @ np.clip(outward * (frame[:, 0] - self.x_m) / deposit.spacing + 0.5, 0.0, 1.0)
                for frame in positions.astype(float)
            ]
        )
        return np.interp(STEP_S * np.arange(self.steps + 1), time, beyond - beyond[0])


class PeakDischarge(ReleasedVolume):
    """Largest discharge through the line, a mean over two steps [m3/s per m]."""

    unit: ClassVar[str] = DISCHARGE_UNIT

    type: Literal["peak_discharge"] = "peak_discharge"  # type: ignore[assignment]

    @property
    def values(self) -> np.ndarray:
        """Nothing was measured, (1,)."""
        return np.zeros(1)

    @property
    def parts(self) -> list[str]:
        """One number."""
        return [""]

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """See `Measured`; it has no derivative."""
        _refuse_derivative(derivative, self.name)
        return float(discharge(self.passed(deposit)).max())


@dataclass(frozen=True)
class Released:
    """What a section releases.

    Attributes:
        found: distribution of the mobilised volume, the peak discharge and the released volume.
        units: of the three.
        hydrograph: as `inversion.prediction.hydrograph.hydrograph` makes it.
    """

    found: Distribution
    units: Sequence[str]
    hydrograph: dict[str, Any]


def release(
    engine: Forward,
    setup: SectionSetup,
    strengths: Sequence[KnownStrength],
    *,
    cells: SmallCells | None,
    jittered: Sequence[SectionSetup],
    samples: int,
) -> Released:
    """The distribution of the volumes, on runs that `predict` has asked for already.

    Args:
        engine: simulates.
        setup: its `also_read` are the `volume_entries`.
        strengths: p of them.
        cells: as for `predict`.
        jittered: as for `predict`.
        samples: as for `predict`.
    """
    entries = setup.also_read
    alone = [reading_alone(one) for one in (setup, *jittered)]
    whole = predict(engine, alone[0], strengths, cells=cells, jittered=alone[1:], samples=samples)
    *numbers, line = entries
    assert isinstance(line, ReleasedVolume)
    over_time = whole.response(whole.sample_scores)[:, len(numbers) :]
    found = whole.of([*range(len(numbers)), -1])
    # Noise makes no volume negative.
    found = replace(
        found,
        names=[entry.name for entry in entries],
        samples=np.maximum(found.samples, 0.0),
    )
    drawn = hydrograph(
        f"x {line.x_m:g} m",
        over_time,
        found.samples[:, -1],
        units=(VOLUME_UNIT, DISCHARGE_UNIT),
        x_m=line.x_m,
        side=line.side,
    )
    return Released(found, [entry.unit for entry in entries], drawn)


def volume_entries(case: PredictionCase, through_m: float | None) -> list[SectionReading]:
    """Mobilised volume, peak discharge and released volume of a case.

    Args:
        case: to predict for.
        through_m: x of the line; None: the foot of the side to which it slides. The soil passes it
            towards the foot that is nearer.

    Raises:
        InputError: the line lies outside the domain.
    """
    feet, domain = case.feet, case.scene.domain
    if through_m is None:
        side: Side = next((one.toe_side for one in case.entries if one.toe_side), "left")
        through_m = feet[side]
    elif not domain.x_min < through_m < domain.x_max:
        raise InputError(
            f"{OPTION} {through_m:g}: lies outside the domain, {domain.x_min:g} to "
            f"{domain.x_max:g} m"
        )
    else:
        side = "left" if 2.0 * through_m < feet["left"] + feet["right"] else "right"
    steps = int(np.ceil(case.simulation.duration_s / STEP_S))
    line = {"x_m": through_m, "side": side, "steps": steps}
    return [
        MobilisedVolume(name="mobilised volume"),
        PeakDischarge(name="peak discharge", **line),
        ReleasedVolume(name="released volume", **line),
    ]


def reading_alone(setup: SectionSetup) -> SectionSetup:
    """A setup whose runs are the same and of which what is also read is all that is predicted."""
    entries = setup.also_read
    names = [f"{entry.name} {part}".strip() for entry in entries for part in entry.parts]
    return replace(setup, targets=Targets.unmeasured(entries, names))


def _in_place(deposit: Deposit) -> np.ndarray:
    """Volume of the points before the slide, (N,) [m3/m]."""
    return np.broadcast_to(deposit.before.volume, len(deposit.position)).astype(float)


def _refuse_derivative(derivative: bool, name: str) -> None:
    if derivative:
        raise ValueError(f"{name}: has no derivative")
