"""`deposit_edge`: the outline of the inundated area, or a part of it, as a line or a raster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from geometry.scenes.scene import Point
from geometry.survey3d.deposit import LEAST_M, samples_along
from geometry.survey3d.measured import DepositMap, MapPlaces
from geometry.terrain.raster import Raster, read_raster
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes3d.scene3d import Scene3d

FINER = 4
"""Parts of a pixel in which the edge of a deposit is looked for."""


def distance_inside(deposit: Raster, least: float) -> Raster:
    """Distance of each place from the edge of a deposit [m]: inside positive, outside negative.

    Args:
        deposit: thickness.
        least: of a deposit [m].
    """
    step = deposit.spacing / FINER
    axes = [axis[0] + step * np.arange(FINER * (len(axis) - 1) + 1) for axis in deposit.axes]
    inside = deposit.at(*np.meshgrid(*axes, indexing="ij")) >= least
    whole = float(np.hypot(*(step * n for n in inside.shape)))
    if inside.all() or not inside.any():
        far = np.full(inside.shape, whole if inside.all() else -whole)
        return Raster(deposit.origin, step, far)
    from scipy.ndimage import distance_transform_edt  # a quarter of a second of every start

    # A place counts as half a step from the edge that it is next to.
    within, beyond = (distance_transform_edt(part) - 0.5 for part in (inside, ~inside))
    return Raster(deposit.origin, step, step * np.where(inside, within, -beyond))


def edge_of(inundated: Raster, every_m: float) -> np.ndarray:
    """Places (m, 2) [m] on the edge of what is inundated, at least `every_m` apart.

    Args:
        inundated: more than 0.5 where it is.
        every_m: [m].
    """
    x, y = np.meshgrid(*inundated.axes, indexing="ij")
    inside = inundated.values > 0.5
    found = []
    for axis in (0, 1):
        change = np.diff(inside.astype(int), axis=axis) != 0
        first, last = (
            np.take(np.stack([x, y], axis=-1), range(k, x.shape[axis] - 1 + k), axis=axis)
            for k in (0, 1)
        )
        found.append(0.5 * (first + last)[change])
    places = np.concatenate(found)
    kept: list[np.ndarray] = []
    for place in places[np.lexsort(places.T)]:
        if all(np.hypot(*(place - other)) >= every_m for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, 2)


class DepositEdge(MapPlaces):
    """The line in plan up to which soil came: how far the simulated deposit reaches beyond it.

    Only where a deposit ends, not where it joins the soil that stayed: of a raster the edge that
    lies on soil is left out.
    """

    type: Literal["deposit_edge"]
    edge: list[Point] | None = Field(
        None, min_length=2, description="(x, y) along the edge, in order [m]; null: that of `file`"
    )
    file: str | None = Field(
        None, description="raster next to this document, more than 0.5 where soil came to lie"
    )
    every_m: float = Field(gt=0, description="distance of the places that are compared [m]")

    _moved: np.ndarray | None = PrivateAttr(None)
    _places: np.ndarray | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.edge is None) == (self.file is None):
            raise ValueError("give either edge or file")
        return self

    def read_files(self, folder: Path, scene: Scene3d, where: str) -> None:
        """The edge of the raster, where no soil lay before the slide."""
        if self.file is None:
            return
        if scene.ground is None:
            raise InputError(f"{where}: file: needs a scene with terrain")
        places = edge_of(
            read_raster(folder / self.file, origin=scene.origin, crs=scene.crs), self.every_m
        )
        soil = scene.ground.surface.at(*places.T) - scene.ground.base.at(*places.T)
        self._places = places[soil < LEAST_M]
        if not len(self._places):
            raise InputError(f"{where}: file: {self.file} has no edge where no soil lay before")

    @property
    def places(self) -> np.ndarray:
        """Where the edge is compared, (m, 2) [m]."""
        if self.edge is not None:
            return samples_along(np.asarray(self.edge, float), self.every_m)[1]
        if self._places is None:
            raise RuntimeError(f"{self.name}: its raster has not been read; see load_survey")
        return self._places

    @property
    def values(self) -> np.ndarray:
        """The edge lies 0 m beyond itself, (m,) [m]."""
        return np.zeros(len(self.places)) if self._moved is None else self._moved

    def with_values(self, values: np.ndarray) -> Self:
        """An edge that lies elsewhere: beyond this one by values (m,) [m]."""
        copy = self.model_copy()
        copy._moved = np.asarray(values, dtype=float)
        return copy

    def check_in(self, scene: Scene3d, where: str) -> None:
        """All of the edge lies on the ground."""
        check_on_ground(self.edge or [], scene, f"{where}: edge")

    def read(self, deposit: DepositMap) -> np.ndarray:
        """How far each place lies inside the simulated deposit, (m,) [m]; outside negative."""
        return distance_inside(deposit.after, deposit.least).at(*self.places.T)


def check_on_ground(places: list[Point], scene: Scene3d, where: str) -> None:
    """Refuse places outside the rasters.

    Raises:
        InputError: the first of them.
    """
    if scene.ground is None:
        return
    for k, axis in enumerate("xy"):
        ends = [raster.axes[k] for raster in (scene.ground.base, scene.ground.surface)]
        low, high = max(end[0] for end in ends), min(end[-1] for end in ends)
        for place in places:
            if not low <= place[k] <= high:
                raise InputError(
                    f"{where}: ({place[0]:g}, {place[1]:g}) lies outside the rasters, {axis} "
                    f"{low:g} to {high:g} m (less `origin`)"
                )
