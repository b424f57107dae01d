"""Readings of a deposit in plan: thickness, area, toe line, runout along a path, volume beyond.

Thickness is the volume of the points near a pixel over its area, each point spread linearly over
the four pixels around it, so thickness times area sums to the volume. Soil counts as a deposit
where it is thicker than `threshold`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.terrain.raster import Raster

Side = Literal["left", "right"]

LEAST_M = 0.5
"""Thickness below which soil is not seen as a deposit [m], unless points are further apart."""


def threshold(spacing: float) -> float:
    """Thickness [m] from which soil counts as a deposit."""
    return max(LEAST_M, spacing)


@dataclass(frozen=True)
class Plan:
    """The pixels onto which points are read; the last ones may reach beyond the domain."""

    origin: tuple[float, float]  # centre of the first pixel [m]
    spacing: float  # edge of a pixel [m]
    area: np.ndarray  # (nx, ny) [m2], within the domain, that the thickness of a pixel stands for
    crs: str = ""  # coordinate reference system as WKT; empty: none

    @classmethod
    def over(cls, domain: tuple[float, float, float, float], pixel: float, crs: str = "") -> Plan:
        """Pixels over x_min, x_max, y_min, y_max [m]."""
        lengths = []
        for low, high in (domain[:2], domain[2:]):
            count = max(math.ceil((high - low) / pixel - 1e-6), 1)
            samples = 64 * count
            place = ((np.arange(samples) + 0.5) * (high - low) / samples) / pixel - 0.5
            length = np.zeros(count)
            for at, share in _shares(place, count):
                np.add.at(length, at, share * (high - low) / samples)
            lengths.append(length)
        origin = (domain[0] + 0.5 * pixel, domain[2] + 0.5 * pixel)
        return cls(origin, pixel, np.outer(*lengths), crs)

    def thickness(self, position: np.ndarray, volume: np.ndarray) -> Raster:
        """Thickness of the soil [m].

        Args:
            position: (N, 2 or 3) [m]; points outside count at the edge.
            volume: (N,) [m3].
        """
        sums = np.zeros(self.area.shape)
        along, across = (
            _shares((position[:, k] - self.origin[k]) / self.spacing, self.area.shape[k])
            for k in (0, 1)
        )
        for i, u in along:
            for j, v in across:
                np.add.at(sums, (i, j), u * v * volume)
        return self.raster(sums / self.area)

    def largest(self, position: np.ndarray, values: np.ndarray) -> Raster:
        """Largest of the values (N,) of the points of each pixel; NaN where there are none."""
        place = tuple(
            np.clip(np.rint((position[:, k] - self.origin[k]) / self.spacing).astype(int), 0, n - 1)
            for k, n in enumerate(self.area.shape)
        )
        most = np.full(self.area.shape, -np.inf)
        np.maximum.at(most, place, values)
        return self.raster(np.where(np.isfinite(most), most, np.nan))

    def raster(self, values: np.ndarray) -> Raster:
        """Values (nx, ny) at the pixels."""
        return Raster(self.origin, self.spacing, values, self.crs)


def _shares(place: np.ndarray, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """The two pixels next to each place (in pixels), and the share that each has of it."""
    place = np.clip(place, 0.0, count - 1.0)
    first = np.minimum(np.floor(place).astype(int), max(count - 2, 0))
    rest = place - first
    return [(first, 1.0 - rest), (np.minimum(first + 1, count - 1), rest)]


def inundated_area(before: Raster, after: Raster, least: float) -> float:
    """Area [m2] with a deposit after the slide where there was none before it."""
    covered = (after.values >= least) & (before.values < least)
    return float(covered.sum()) * after.spacing**2


def toe_line(deposit: Raster, least: float, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Outermost x [m] of the deposit in each row y on one side; NaN in rows without one.

    Walks inwards from that end to the first place thicker than `least`, linear between places.

    Returns:
        y (ny,) and x (ny,) [m].
    """
    x, y = deposit.axes
    outward = slice(None, None, -1 if side == "left" else 1)
    toe = np.full(len(y), np.nan)
    for row, column in enumerate(deposit.values.T):
        thick = np.flatnonzero(column[outward] >= least)
        if len(thick):
            toe[row] = _crossing(x[outward], column[outward], thick[-1], least)
    return y, toe


def runout_along(deposit: Raster, path: np.ndarray, least: float) -> float:
    """Way [m] along a path to where the deposit ends; NaN where the path meets none.

    Args:
        deposit: thickness.
        path: (P, 2) vertices in plan [m], downstream.
        least: thickness of a deposit [m].
    """
    way, places = samples_along(path, 0.25 * deposit.spacing)
    height = deposit.at(*places.T)
    thick = np.flatnonzero(height >= least)
    return _crossing(way, height, thick[-1], least) if len(thick) else float("nan")


def samples_along(path: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Way (S,) [m] and places (S, 2) [m] along a polyline (P, 2), about `step` [m] apart."""
    legs = np.hypot(*np.diff(path, axis=0).T)
    corners = np.concatenate([[0.0], np.cumsum(legs)])
    way = np.linspace(0.0, corners[-1], max(int(corners[-1] / step), 1) + 1)
    return way, np.stack([np.interp(way, corners, path[:, k]) for k in (0, 1)], axis=1)


def volume_beyond(
    position: np.ndarray, volume: np.ndarray, start: tuple[float, float], end: tuple[float, float]
) -> float:
    """Volume [m3] of the points to the right of the line from `start` to `end` in plan."""
    across = np.subtract(end, start)
    from_start = position[:, :2] - np.asarray(start)
    return float(volume[across[0] * from_start[:, 1] - across[1] * from_start[:, 0] < 0.0].sum())


def _crossing(x: np.ndarray, height: np.ndarray, last: int, least: float) -> float:
    """Where the height falls below `least` behind the place `last`."""
    if last + 1 == len(x):
        return float(x[last])
    share = (height[last] - least) / (height[last] - height[last + 1])
    return float(x[last] + share * (x[last + 1] - x[last]))
