"""One measured figure compared with what was asked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A line of the table.

    Attributes:
        quantity: the measured quantity, in words.
        measured: the figure, as it is to be read.
        asked: what it must be, or what it is compared with; empty: given for information.
        met: within what was asked; None: nothing was asked, it is a comparison.
        note: what explains it.
    """

    quantity: str
    measured: str
    asked: str = ""
    met: bool | None = None
    note: str = ""

    @property
    def verdict(self) -> str:
        """pass, MISS, or nothing where nothing was asked."""
        return "" if self.met is None else "pass" if self.met else "MISS"


def at_most(quantity: str, value: float, limit: float, *, unit: str = "", digits: int = 3,
            note: str = "") -> Figure:  # fmt: skip
    """A figure that must not exceed a limit."""
    tail = f" {unit}" if unit else ""
    return Figure(
        quantity, f"{value:.{digits}g}{tail}", f"≤ {limit:g}{tail}", bool(value <= limit), note
    )


def at_least(quantity: str, value: float, limit: float, *, unit: str = "", digits: int = 3,
             note: str = "") -> Figure:  # fmt: skip
    """A figure that must not fall below a limit."""
    tail = f" {unit}" if unit else ""
    return Figure(
        quantity, f"{value:.{digits}g}{tail}", f"≥ {limit:g}{tail}", bool(value >= limit), note
    )
