"""`surface_after`: the surface after the slide, a raster, as its means over squares in plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr

from geometry.scenes.fill import contains
from geometry.scenes.scene import Point
from geometry.survey.quantity import Datum
from geometry.survey3d.measured import DepositMap, MapPlaces
from geometry.terrain.raster import Raster, read_raster
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes3d.scene3d import Scene3d

MOST_PLACES = 2000
"""Squares of one entry; their covariance is a full matrix."""
SAMPLES = 8
"""Places along an edge of a square at which it is read."""


class SurfaceAfter(MapPlaces):
    """Mean elevation of the surface after the slide over squares of `every_m`.

    Means know of volumes what single places know by chance: where exactly the points of a
    simulation lie moves its surface at a place by a good part of their spacing.
    """

    type: Literal["surface_after"]
    file: str | None = Field(
        None, description="raster next to this document; null = `after` of the scene"
    )
    every_m: float = Field(gt=0, description="edge of the squares whose means are compared [m]")
    plan: list[Point] | None = Field(
        None,
        min_length=3,
        description="(x, y): squares whose middle is inside [m]; null = all",
    )

    _raster: Raster | None = PrivateAttr(None)
    _places: np.ndarray | None = PrivateAttr(None)
    _values: np.ndarray | None = PrivateAttr(None)

    def read_files(self, folder: Path, scene: Scene3d, where: str) -> None:
        """Read the raster, and choose the squares that it, the base and the surface cover."""
        ground = scene.ground
        if ground is None:
            raise InputError(f"{where}: surface_after needs a scene with terrain")
        if self.file is not None:
            raster = read_raster(folder / self.file, origin=scene.origin, crs=scene.crs)
        elif ground.after is not None:
            raster = ground.after
        else:
            raise InputError(f"{where}: file: none is named, and the terrain has no `after`")
        places = self._grid([ground.base, ground.surface, raster])
        if not 0 < len(places) <= MOST_PLACES:
            raise InputError(
                f"{where}: every_m: {self.every_m:g} m gives {len(places)} squares inside the "
                f"rasters and `plan`; 1 to {MOST_PLACES} are allowed"
            )
        self._raster = raster
        self._attach(places, self._mean(places, lambda inside: raster.at(*inside.T)))

    @property
    def raster(self) -> Raster:
        """The whole surface, for pictures [m]."""
        if self._raster is None:
            raise RuntimeError(f"{self.name}: its raster has not been read; see load_survey")
        return self._raster

    def _grid(self, rasters: list[Raster]) -> np.ndarray:
        """Middles (m, 2) of the squares that all rasters cover [m]."""
        axes = []
        for k in (0, 1):
            low = max(raster.axes[k][0] for raster in rasters)
            high = min(raster.axes[k][-1] for raster in rasters)
            count = max(int((high - low) / self.every_m), 0)
            axes.append(low + self.every_m * (np.arange(count) + 0.5))
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        if self.plan is not None and len(places):
            places = places[contains(np.asarray(self.plan, float), places)]
        return places

    def _attach(self, places: np.ndarray, values: np.ndarray) -> None:
        self._places, self._values = places, np.asarray(values, dtype=float)

    @property
    def places(self) -> np.ndarray:
        """Middles of the squares, (m, 2) [m]."""
        if self._places is None:
            raise RuntimeError(f"{self.name}: its raster has not been read; see load_survey")
        return self._places

    @property
    def values(self) -> np.ndarray:
        """Mean elevations, (m,) [m]."""
        if self._values is None:
            raise RuntimeError(f"{self.name}: its raster has not been read; see load_survey")
        return self._values

    @property
    def datum(self) -> Datum:
        """All of it was levelled."""
        x, y = self.places.T
        return Datum(np.ones(len(x)), x, line=True, y=y)

    def with_values(self, values: np.ndarray) -> Self:
        """The same squares at other elevations, (m,) [m]."""
        copy = self.model_copy()
        copy._attach(self.places, values)
        return copy

    def check_in(self, scene: Scene3d, where: str) -> None:
        """Its squares were chosen inside the scene."""

    def read(self, deposit: DepositMap) -> np.ndarray:
        """Means of the simulated surface, (m,) [m]."""
        return self._mean(self.places, deposit.surface_at)

    def _mean(self, places: np.ndarray, read: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Mean over the square around each place (m, 2) of what is read at places (n, 2), (m,)."""
        along = self.every_m * ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5)
        offsets = np.stack(np.meshgrid(along, along), axis=-1).reshape(1, -1, 2)
        inside = places[:, None, :] + offsets
        return read(inside.reshape(-1, 2)).reshape(len(places), -1).mean(axis=1)
