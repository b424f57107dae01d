"""What an effect with a hook `between` is given and gives: the host's part of a run in chunks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np

    from geometry.scenes.scene import Material

RENEWED = 5
"""Numbers of a point that are renewed between chunks: `here.renewed`."""


@dataclass(frozen=True)
class SettledPoints:
    """The P moving points of a scene after settling, before anything moves.

    Attributes:
        position: (P, 2) [m].
        volume: (P,) [m2].
        stress: (P, 4) xx, yy, zz, xy [Pa], tension positive.
        row: (P,) row of the soil of each.
        soils: of the rows.
        fixed: (F, 2) points of fixed bodies [m].
        origin: first node of the grid [m].
        cell: [m].
        gravity: [m/s2].
    """

    position: np.ndarray
    volume: np.ndarray
    stress: np.ndarray
    row: np.ndarray
    soils: Sequence[Material]
    fixed: np.ndarray
    origin: tuple[float, float]
    cell: float
    gravity: float


@dataclass(frozen=True)
class PointsNow:
    """The same points after a chunk.

    Attributes:
        position: (P, 2) [m].
        stress: (P, 4) [Pa].
        shear: (P,) plastic shear strain [-].
        passed_s: length of the chunk; 0 before the first.
        coming_s: length of the coming one.
    """

    position: np.ndarray
    stress: np.ndarray
    shear: np.ndarray
    passed_s: float
    coming_s: float


class Between(Protocol):
    """What a hook `between` returns: the state of an effect on the host over a run.

    Attributes:
        fault: why what it gave last cannot be right, which ends the run; else "".
    """

    fault: str

    def renew(self, now: PointsNow) -> np.ndarray:
        """Numbers of the points for the coming chunk, (P, `RENEWED`)."""

    def busy_for(self, left_s: float) -> float:
        """Time for which it will yet weaken soil at rest, at most `left_s` [s]; 0: not at all."""

    def fields(self) -> dict[str, np.ndarray]:
        """What points carry at the end of a run, (P,) each; names end in the unit."""

    def audit(self) -> dict[str, float]:
        """Its accounts at the end of a run."""
