"""What hangs on the whole way of a slide is read as its run ends, so that no frames are kept.

In: measurements that need frames (the toe at given times, a velocity, the duration) and a run. Out:
their readings by content: the measured values, errors and names are no part of the key, so another
survey of the same quantity is read from the same run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from geometry.survey.measured import Deposit, Measured
from geometry.survey.measured_series import SlideDuration, ToeHistory, Velocity
from pipeline.files import content_hash

if TYPE_CHECKING:
    from mpm_taichi.trajectory import Run

#: Fields that decide what is read, by type.
_DECIDING: dict[type[Measured], tuple[str, ...]] = {
    ToeHistory: ("side", "times_s"),
    Velocity: ("x_m", "at_s"),
    SlideDuration: ("between",),
}


@dataclass(frozen=True)
class Reading:
    """A reading of one measurement on one run.

    Attributes:
        values: (m,) in the measurement's unit; NaN where it could not be read.
        trouble: why it could not; else empty.
    """

    values: np.ndarray
    trouble: str = ""


def needs_history(entry: Measured) -> bool:
    """The measurement is read from all frames of a run, not from the last alone."""
    return type(entry) in _DECIDING


def reading_key(entry: Measured, foot: Mapping[str, float]) -> str:
    """Name of a reading among those of a run.

    Args:
        entry: a measurement that needs the history.
        foot: where the section ended before the slide, x [m] by side.
    """
    deciding: dict = {name: getattr(entry, name) for name in _DECIDING[type(entry)]}
    if "side" in deciding:
        deciding["foot"] = float(foot[deciding["side"]])
    return content_hash({"type": type(entry).__name__, **deciding})


@dataclass(frozen=True)
class HistoryReader:
    """Reads measurements on a run as it ends.

    Attributes:
        entries: measurements that need the history.
        foot: where the section ended before the slide, x [m] by side.
    """

    entries: Sequence[Measured]
    foot: Mapping[str, float]

    @cached_property
    def keys(self) -> list[str]:
        """Names of the readings, one for each entry."""
        return [reading_key(entry, self.foot) for entry in self.entries]

    def read(self, run: Run) -> dict[str, Reading]:
        """Readings by name."""
        deposit = Deposit(
            position=run.positions[-1].astype(float),
            initial_position=run.positions[0].astype(float),
            volume=run.bulk_volume,
            spacing=run.scene.spacing,
            foot=self.foot,
            ground=np.asarray(run.scene.ground.points, dtype=float),
            positions=run.positions,
            time=run.time,
            at_rest=run.came_to_rest,
            initial_volume=run.scene.spacing**2,
        )
        return {
            key: _read(entry, deposit, run.reason if run.status == "failed" else "")
            for key, entry in zip(self.keys, self.entries, strict=True)
        }


def history_reader(entries: Sequence[Measured], foot: Mapping[str, float]) -> HistoryReader:
    """The reader of those among `entries` that need the history."""
    return HistoryReader(tuple(entry for entry in entries if needs_history(entry)), foot)


def _read(entry: Measured, deposit: Deposit, failure: str) -> Reading:
    try:
        if failure:
            raise ValueError(failure)
        return Reading(entry.observe(deposit))
    except ValueError as error:
        return Reading(np.full(len(entry.values), np.nan), str(error))
