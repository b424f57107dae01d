"""Base of every measured quantity: numbers with a covariance, and how far they may be trusted.

Nothing here knows what was measured on: sections are read by `geometry.survey.measured`, maps of a
slide in three dimensions by `geometry.survey3d.measured`. What fits a model to measurements
(`inversion.estimation`) needs no more than this.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Document

Confidence = Literal["published", "paper", "secondary", "recalled", "assumed", "constructed"]


@dataclass(frozen=True)
class Along:
    """Where or when the numbers of a measurement were taken.

    Attributes:
        axis: x of the section, or time.
        place: (m,) in m or s.
        series: the numbers follow each other along the axis.
    """

    axis: Literal["x_m", "time_s"]
    place: np.ndarray
    series: bool


@dataclass(frozen=True)
class Datum:
    """How an error of the survey's datum enters the numbers.

    Attributes:
        rise: change of each number if the datum is 1 m too high, (m,).
        x: where it was levelled, (m,) [m]; NaN: nowhere, or not known.
        line: the numbers are levelled, and their standard deviation is that of the datum.
        y: the same across x, of what was levelled in plan; None: on a section.
    """

    rise: np.ndarray
    x: np.ndarray
    line: bool
    y: np.ndarray | None = None


class Quantity(Document):
    """Base of all that is measured.

    A type adds its fields, among them ``type: Literal["its_name"]``.
    """

    unit: ClassVar[str]
    """Of the values, such as "m"."""
    as_one: ClassVar[bool] = False
    """In tables of a run, the root mean square of the differences stands for all values."""
    censored: ClassVar[bool] = False
    """The values are upper limits that were not exceeded; how far below them is not known."""

    if TYPE_CHECKING:
        type: str  # of each type its own literal
    name: str = Field(min_length=1, description="unique in its set")
    std_is: Literal["published", "assumed"] = Field(
        "assumed", description="where the standard deviation comes from"
    )
    confidence: Confidence = Field(description="how far the value may be trusted")
    source: str = Field(min_length=1, description="where the value is written")
    held_out: bool = Field(False, description="true: never enters a fit; it checks the fit instead")

    @property
    @abstractmethod
    def values(self) -> np.ndarray:
        """The measured values, (m,), in `unit`."""

    @abstractmethod
    def with_values(self, values: np.ndarray) -> Self:
        """The same measurement with other values, (m,), in `unit`."""

    @property
    def parts(self) -> list[str]:
        """A few words for each of the m values; empty where there is only one."""
        return [""]

    @property
    def held_out_values(self) -> np.ndarray:
        """Which of the values never enter a fit, (m,) bool."""
        return np.full(len(self.values), self.held_out)

    @property
    def stated_range(self) -> tuple[float, float] | None:
        """Lower and upper end of the range that the source states; None: it states none."""
        return None

    @property
    def is_runout(self) -> bool:
        """A distance that the soil ran: the loss `runout` fits nothing else."""
        return False

    @property
    def along(self) -> Along | None:
        """Where or when the numbers were taken along a line; None: they have no such place."""
        return None

    @property
    def datum(self) -> Datum | None:
        """How the survey's datum enters the numbers; None: not at all."""
        return None

    def correlation(self) -> np.ndarray:
        """Correlation of the errors of the values, (m, m)."""
        return np.eye(len(self.values))

    def without_hold_out(self) -> Self:
        """The same entry without its own statement of what is held out."""
        return self.model_copy(update={"held_out": False})

    # --- what follows from it ---

    @classmethod
    def key(cls, word: str) -> str:
        """Name of a field in the type's unit: `std` -> `std_m`, `std_m_per_s`."""
        return f"{word}_{cls.unit.replace('/', '_per_')}"

    @property
    def std(self) -> float:
        """Standard deviation of the survey, in `unit`."""
        return getattr(self, self.key("std"))

    @property
    def model_std(self) -> float:
        """Model error granted by the user in addition to the survey's error, in `unit`."""
        return getattr(self, self.key("model_std"))

    @property
    def constructed(self) -> bool:
        """True for data drawn by hand: shown, but in no fit and no score unless asked."""
        return self.confidence == "constructed"

    def covariance(self, *, model: bool = True) -> np.ndarray:
        """Covariance of the values, (m, m): the variance times `correlation`.

        Args:
            model: with the variance granted to the model, whose errors correlate as the survey's.
        """
        variance = self.std**2 + (self.model_std**2 if model else 0.0)
        return variance * self.correlation()


class OneNumber(Quantity):
    """A quantity that is one number, in a field `value` in its unit: `value_m`."""

    @property
    def values(self) -> np.ndarray:
        """The measured value, (1,), in `unit`."""
        return np.array([getattr(self, self.key("value"))])

    def with_values(self, values: np.ndarray) -> Self:
        """The same with another value, (1,), in `unit`."""
        return self.model_copy(update={self.key("value"): float(values[0])})
