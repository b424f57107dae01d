"""`marker_displacement`: how far the soil that was at one place before the slide has moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator
from shapely.geometry import Point, Polygon

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.columns import kernel
from geometry.survey.marks import Mark
from geometry.survey.measured import Along, Datum, Deposit, Length
from geometry.survey.site import NOT_MADE, Site, places_within
from pipeline.cli import InputError

#: Stakes that are proposed along a section.
STAKES = 6


class MarkerDisplacement(Length):
    """How far the soil that was at one place before the slide has moved."""

    history: ClassVar[None] = None

    type: Literal["marker_displacement"]
    x_m: float = Field(description="place before the slide [m]")
    y_m: float = Field(description="elevation before the slide [m]")
    dx_m: float | None = Field(None, description="measured displacement to the right [m]")
    dy_m: float | None = Field(None, description="measured displacement upwards [m]")

    @model_validator(mode="after")
    def _something_was_measured(self) -> MarkerDisplacement:
        if self.dx_m is None and self.dy_m is None:
            raise ValueError("dx_m, dy_m: give at least one of them")
        return self

    @property
    def values(self) -> np.ndarray:
        """Displacement to the right and upwards, as far as measured, (1,) or (2,) [m]."""
        return np.array([value for value in (self.dx_m, self.dy_m) if value is not None])

    def with_values(self, values: np.ndarray) -> MarkerDisplacement:
        """The same with other displacements, in the components measured [m]."""
        keys = [f"{part}_m" for part in self.parts]
        return self.model_copy(update=dict(zip(keys, map(float, values), strict=True)))

    @property
    def parts(self) -> list[str]:
        """`dx`, `dy`, or both."""
        return [("dx", "dy")[number] for number in self._components()]

    def _components(self) -> list[int]:
        return [number for number, value in enumerate((self.dx_m, self.dy_m)) if value is not None]

    @property
    def along(self) -> Along:
        """The marker's place before the slide."""
        return Along("x_m", np.full(len(self.values), self.x_m), series=False)

    @property
    def datum(self) -> Datum:
        """A datum that is too high after the slide raises the marker."""
        upward = np.array([part == "dy" for part in self.parts])
        return Datum(upward.astype(float), np.where(upward, self.x_m, np.nan), line=False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Displacement in the components measured [m].

        A plane is fitted to the displacements of the points that were within three spacings, the
        nearer ones weighing more, and read at the marker: exact where the displacement varies
        linearly.
        """
        offset = (deposit.initial_position - np.array([self.x_m, self.y_m])) / deposit.spacing
        closeness = np.prod(kernel(offset, 1.5), axis=1)
        near = np.flatnonzero(closeness > 0.0)
        if len(near) < 3:
            raise ValueError(
                f"marker ({self.x_m:g}, {self.y_m:g}) lies outside the soil: "
                f"{len(near)} points within 3 spacings, at least 3 are needed"
            )
        plane = np.column_stack([np.ones(len(near)), offset[near]])
        root = np.sqrt(closeness[near])
        # Row 0 of the weighted pseudo-inverse reads the plane at the marker itself.
        share = np.linalg.pinv(plane * root[:, None])[0] * root
        kept = self._components()
        moved = (share @ (deposit.position[near] - deposit.initial_position[near]))[kept]
        if not derivative:
            return moved
        change = np.zeros((len(kept), *deposit.position.shape))
        for row, component in enumerate(kept):
            change[row, near, component] = share
        return moved, change

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A marker in a zone of the section."""
        place = Point(self.x_m, self.y_m)
        if min(place.distance(Polygon(zone.polygon)) for zone in scene.zones) > 0.0:
            raise InputError(
                f"{where}: the marker ({self.x_m:g}, {self.y_m:g}) lies in no zone of the section"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[MarkerDisplacement]:
        """Stakes along the section, away from the markers there were."""
        had = [entry.x_m for entry in site.made_of(cls)]
        std = site.std(cls, 0.007, 0.1)
        return [
            cls(
                type="marker_displacement",
                name=f"stake at x {x:g} m",
                x_m=x,
                y_m=y,
                dx_m=0.0,
                dy_m=0.0,
                std_m=std,
                **NOT_MADE,
            )
            for x, y in _stakes(site)
            if site.apart(x, had)
        ]

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []


def _stakes(site: Site) -> list[tuple[float, float]]:
    """Places just below the surface before the slide."""
    scene, found = site.scene, []
    outlines = [Polygon(zone.polygon) for zone in scene.zones]
    for x in places_within(scene.end("left"), scene.end("right"), STAKES):
        for y in np.arange(site.height + scene.ground.lowest, scene.ground.lowest, -0.25):
            place = Point(x, y - scene.spacing)
            if any(outline.contains(place) for outline in outlines):
                found.append((x, round(float(y) - scene.spacing, 2)))
                break
    return found
