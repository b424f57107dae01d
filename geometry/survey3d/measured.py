"""Base of what is measured in plan on a slide: numbers with a covariance, read on maps.

An entry of `measurements3d.yaml` is a vector of one or more values, and `read` predicts the same
vector from a `DepositMap`: one definition for field data and for simulations. What fits a model to
measurements knows no more of an entry than `geometry.survey.quantity` says.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from geometry.survey.quantity import OneNumber, Quantity
from geometry.terrain.raster import Raster

if TYPE_CHECKING:
    from geometry.scenes3d.scene3d import Scene3d


@dataclass(frozen=True)
class DepositMap:
    """A slide in plan.

    Attributes:
        surface: elevation of the surface before the slide, as surveyed [m]; None: a section over a
            width, whose surface follows from its soil.
        base: elevation of the ground that does not move, at the pixels of the thickness [m].
        before: thickness of the soil before the slide, (nx, ny) [m].
        after: the same after it.
        least: thickness from which soil counts as a deposit [m].
        readings: name with unit -> number, as in `readings.csv`.
        across: line -> volume that has crossed it over time, at even steps [m3]; empty: not known.
    """

    surface: Raster | None
    base: Raster
    before: Raster
    after: Raster
    least: float
    readings: Mapping[str, float]
    across: Mapping[str, Sequence[float]] = field(default_factory=dict)

    @property
    def at_start(self) -> DepositMap:
        """The same before anything moved."""
        still = {name: [0.0] * len(volumes) for name, volumes in self.across.items()}
        nothing = dict.fromkeys(self.readings, 0.0)
        return replace(self, after=self.before, readings=nothing, across=still)

    def surface_at(self, places: np.ndarray) -> np.ndarray:
        """Elevation of the surface after the slide at places (m, 2), (m,) [m].

        That before the slide plus the change of thickness, so that it is exact where nothing moved.
        """
        x, y = np.asarray(places, float).T
        old = (
            self.base.at(x, y) + self.before.at(x, y)
            if self.surface is None
            else (self.surface.at(x, y))
        )
        return old + self.after.at(x, y) - self.before.at(x, y)


class MapMeasured(Quantity):
    """Base of all types of measurement in plan."""

    @abstractmethod
    def read(self, deposit: DepositMap) -> np.ndarray:
        """This measurement on a deposit, (m,), in `unit`; NaN where it cannot be read."""

    @abstractmethod
    def check_in(self, scene: Scene3d, where: str) -> None:
        """Refuse what cannot have been measured on a scene.

        Args:
            scene: before the slide.
            where: beginning of the message.

        Raises:
            InputError: one line.
        """

    def read_files(self, folder: Path, scene: Scene3d, where: str) -> None:
        """Read further files of the entry; `where` begins messages.

        Raises:
            InputError: one of them cannot be read or does not fit the entry; one line.
        """


class MapLength(MapMeasured):
    """A measurement in metres."""

    unit: ClassVar[str] = "m"

    std_m: float = Field(gt=0, description="standard deviation of the survey [m]")
    model_std_m: float = Field(
        0.0, ge=0, description="granted to the model in addition to the survey's error [m]"
    )


class MapPlaces(MapLength):
    """A measurement in metres at many places, which tables and pictures show as one."""

    as_one = True

    correlation_length_m: float | None = Field(
        None, gt=0, description="of the errors in plan [m]; null: independent"
    )

    @property
    @abstractmethod
    def places(self) -> np.ndarray:
        """Where the numbers lie, (m, 2) [m]."""

    @property
    def parts(self) -> list[str]:
        """Where each number lies."""
        return [f"at ({x:g}, {y:g})" for x, y in np.round(self.places, 2)]

    def correlation(self) -> np.ndarray:
        """Correlation of the errors, (m, m)."""
        return correlation_in_plan(self.places, self.correlation_length_m)


class MapNumber(OneNumber, MapMeasured):
    """A measurement that is one of the readings of a simulation."""

    @property
    @abstractmethod
    def reading(self) -> str:
        """Name of the reading with its unit."""

    def read(self, deposit: DepositMap) -> np.ndarray:
        """The reading, (1,); a path on which nothing came to lie has been run 0 m along."""
        value = deposit.readings.get(self.reading, np.nan)
        return np.array([0.0 if self.is_runout and np.isnan(value) else value])


def correlation_in_plan(places: np.ndarray, length: float | None) -> np.ndarray:
    """exp(-distance / length) between places (m, 2) -> (m, m); None: independent errors."""
    if length is None:
        return np.eye(len(places))
    apart = np.linalg.norm(places[:, None, :] - places[None, :, :], axis=-1)
    return np.exp(-apart / length)
