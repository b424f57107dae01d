"""One measured figure compared with what it must be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A line of the verification table.

    `tolerance` is relative to `reference`, or in the row's unit where `absolute`. A row with
    `bound` passes when `measured` does not exceed `reference` (tolerance is then not used).
    """

    case: str
    quantity: str
    measured: float
    reference: float
    tolerance: float
    unit: str = ""
    absolute: bool = False
    bound: bool = False
    note: str = ""

    @property
    def error(self) -> float:
        """Measured minus reference, relative unless `absolute`."""
        off = self.measured - self.reference
        return off if self.absolute else off / abs(self.reference)

    @property
    def passed(self) -> bool:
        """True where the figure is within its tolerance."""
        if self.bound:
            return self.measured <= self.reference
        return abs(self.error) <= self.tolerance
