"""A section under a survey: where it may be measured, and what `Measured.could_be_made` gets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from geometry.scenes.scene import Scene, Zone
from geometry.sides import Side
from geometry.survey.measured import Measured
from pipeline.cli import InputError

#: Source of a measurement that has not been made.
NOT_MADE: dict[str, Any] = {"confidence": "assumed", "source": "not measured yet"}

Kind = TypeVar("Kind", bound=Measured)


@dataclass(frozen=True)
class Site:
    """A section and its measurements.

    Attributes:
        scene: the section before the slide.
        feet: where it ended, x [m] by side.
        made: the measurements that were made.
        gravity: [m/s2].
    """

    scene: Scene
    feet: Mapping[Side, float]
    made: Sequence[Measured]
    gravity: float

    def made_of(self, kind: type[Kind]) -> list[Kind]:
        """The measurements of one type that were made."""
        return [entry for entry in self.made if isinstance(entry, kind)]

    @cached_property
    def height(self) -> float:
        """Height of the section above the lowest ground [m]."""
        top = max(y for zone in self.scene.zones for _, y in zone.polygon)
        return top - self.scene.ground.lowest

    @property
    def fall(self) -> float:
        """Time of a free fall from the section's height [s]."""
        return float(np.sqrt(2.0 * self.height / self.gravity))

    @property
    def sides(self) -> list[Side]:
        """Sides to which the slide ran, as far as is known; else both."""
        known = [entry.slid_to for entry in self.made if entry.slid_to is not None]
        return list(dict.fromkeys(known)) or ["left", "right"]

    @property
    def reach(self) -> tuple[float, float]:
        """Where soil lies before or after the slide, as far as that is known, x from and to [m]."""
        scene, places = self.scene, [self.scene.end("left"), self.scene.end("right")]
        for entry in self.made:
            places += entry.soil_at(self.feet)
        return max(min(places), scene.domain.x_min), min(max(places), scene.domain.x_max)

    def std(self, kind: type[Measured], share: float, least: float) -> float:
        """Smallest std of the measurements of a type that were made; else a usual one.

        Args:
            kind: the type.
            share: of the section's height.
            least: [m].
        """
        own = [entry.std for entry in self.made_of(kind)]
        return min(own) if own else float(f"{max(share * self.height, least):.2g}")

    def apart(self, x: float, others: Sequence[float]) -> bool:
        """A place is more than two spacings from all others [m]."""
        return all(abs(x - other) > 2.0 * self.scene.spacing for other in others)


def places_within(first: float, last: float, count: int) -> list[float]:
    """Evenly spaced places well within a stretch [m]."""
    ends = first + 0.04 * (last - first), last - 0.04 * (last - first)
    return [round(float(x), 1) for x in np.linspace(*ends, count)]


def check_in_domain(x: float, scene: Scene, where: str) -> None:
    """Refuse a place outside the domain.

    Raises:
        InputError: beginning with `where`; one line.
    """
    domain = scene.domain
    if not domain.x_min <= x <= domain.x_max:
        raise InputError(
            f"{where}: {x:g} lies outside the domain, x {domain.x_min:g} to {domain.x_max:g} m"
        )


def check_in_section(x: float, scene: Scene, where: str) -> None:
    """Refuse a place where there was no section before the slide.

    Raises:
        InputError: beginning with `where`; one line.
    """
    left, right = scene.end("left"), scene.end("right")
    if not left <= x <= right:
        raise InputError(f"{where} {x:g} lies outside the section, x {left:g} to {right:g} m")


def surface_at(x: float, scene: Scene, where: str) -> float:
    """Elevation of the surface before the slide at a place [m].

    Raises:
        InputError: no soil stood there; beginning with `where`; one line.
    """
    check_in_section(x, scene, where)
    if not any(low <= x <= high for low, high in map(_reach_of, scene.zones)):
        raise InputError(f"{where} {x:g}: no zone of the section lies there")
    return scene.surface(x)


def _reach_of(zone: Zone) -> tuple[float, float]:
    """Where a zone begins and ends, x [m]."""
    x = [place for place, _ in zone.polygon]
    return min(x), max(x)
