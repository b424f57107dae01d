"""Marks of a measurement in a picture of a section: data, drawn by `report`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Line:
    """A line on the section.

    Attributes:
        x: (n,) [m].
        y: (n,) [m].
        label: in the legend, once for all lines of the same label.
        constructed: drawn by hand, not surveyed.
    """

    x: np.ndarray
    y: np.ndarray
    label: str
    constructed: bool


@dataclass(frozen=True)
class Distance:
    """A horizontal distance, shown as a dimension line next to the simulated one.

    Attributes:
        start: where it is measured from, x [m].
        outward: +1 to the right, -1 to the left.
        value: measured, outward positive [m].
        stated_range: lower and upper end of it, where a range is stated [m].
        limit: the distance was not reached; `value` is an upper limit.
    """

    start: float
    outward: float
    value: float
    stated_range: tuple[float, float] | None
    limit: bool = False

    @property
    def end(self) -> float:
        """Where the measured distance ends, x [m]."""
        return self.start + self.outward * self.value


@dataclass(frozen=True)
class Height:
    """A height over the surface before the slide at one place, or a depth below it.

    Attributes:
        x: place [m].
        value: upward positive [m].
        label: in the legend, once for all of the same label.
    """

    x: float
    value: float
    label: str


Mark = Line | Distance | Height
