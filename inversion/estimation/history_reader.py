"""Measurements that need the history of a run, read as the run ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from geometry.survey.measured import Deposit, Measured, Reading

if TYPE_CHECKING:
    from mpm_taichi.trajectory import Run


@dataclass(frozen=True)
class HistoryReader:
    """Reads measurements on all frames of a run as it ends, so that no frames are kept.

    Attributes:
        entries: measurements; only those that need the history are read.
        foot: where the section ended before the slide, x [m] by side.
    """

    entries: Sequence[Measured]
    foot: Mapping[str, float]

    @cached_property
    def wanted(self) -> dict[str, Measured]:
        """The measurements that are read, by the name of their reading."""
        return {e.reading_key(self.foot): e for e in self.entries if e.needs_history}

    def read(self, run: Run) -> dict[str, Reading]:
        """Readings by name."""
        if run.status == "failed":
            return {
                key: Reading(np.full(len(entry.values), np.nan), run.reason)
                for key, entry in self.wanted.items()
            }
        deposit = deposit_of_run(run, self.foot)
        return {key: entry.reading(deposit) for key, entry in self.wanted.items()}


def deposit_of_run(run: Run, foot: Mapping[str, float]) -> Deposit:
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
        volume=run.bulk_volume,
        positions=run.positions,
        time=run.time,
        at_rest=run.came_to_rest,
    )
