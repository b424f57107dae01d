"""A section as limit equilibrium sees it: polygons of soil, a base, a water line.

In: a scene, or the zones of a slide on its way. Out: a `ClassicalSection` that answers, for any
places at once, how heavy the column above a point is, how much of it is under water, where its
surface lies and which soil is there. Exact for polygons: along a vertical line the length of a
polygon above y is the sum over its edges of +-max(y_edge - y, 0), plus for upper edges, minus for
lower ones.

Shapes: P places of any shape, E edges of all zones. SI units; per metre of width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from geometry.random_scenes.sketch import signed_area
from geometry.scenes.scene import Material, Scene

GRAVITY = 9.81  # m/s2, the default of the solver
WATER_DENSITY = 1000.0  # kg/m3
WATER_UNIT_WEIGHT = GRAVITY * WATER_DENSITY  # N/m3

#: Number of a place that lies in no zone.
OUTSIDE = -1


@dataclass(frozen=True)
class ClassicalSoil:
    """Properties of one material that the classical methods need; SI units.

    Attributes:
        name: of the material.
        cohesion: [Pa]; of a liquefied soil its residual strength.
        friction: tangent of the friction angle.
        density: [kg/m3], above the water line.
        saturated_density: [kg/m3], below the water line.
        liquefied: its strength is the S_r to be found.
        ratio: S_r over the vertical effective stress before failure, of a soil whose strength grows
            with depth; its cohesion is then the least strength. 0: one strength everywhere.
    """

    name: str
    cohesion: float
    friction: float
    density: float
    saturated_density: float
    liquefied: bool = False
    ratio: float = 0.0


def soil_of(name: str, material: Material, *, unit_weight_factor: float = 1.0) -> ClassicalSoil:
    """The `ClassicalSoil` of a scene's material; both densities are multiplied by the factor."""
    saturated = material.saturated_density or material.density
    return ClassicalSoil(
        name=name,
        cohesion=material.cohesion_pa,
        friction=float(np.tan(material.friction_rad)),
        density=unit_weight_factor * material.density,
        saturated_density=unit_weight_factor * saturated,
        liquefied=material.liquefied,
        ratio=material.strength_ratio or 0.0,
    )


@dataclass(frozen=True)
class ClassicalSection:
    """Zones of soil above a rigid base, and the line below which pores are full of water.

    Attributes:
        polygons: one (V, 2) array per zone [m], any orientation, not closed.
        soils: the soil of each zone.
        ground: the rigid base, a polyline (G, 2) [m], level beyond its ends.
        water: water line (W, 2) [m], level beyond its ends; None without water. Where it lies above
            the surface there is a pool.
        names: of the zones.
    """

    polygons: Sequence[np.ndarray]
    soils: Sequence[ClassicalSoil]
    ground: np.ndarray
    water: np.ndarray | None = None
    names: Sequence[str] = ()
    _edges: dict[str, np.ndarray] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_edges", _edge_arrays(self.polygons, self.soils))

    @property
    def extent(self) -> tuple[float, float]:
        """Smallest and largest x of the soil [m]."""
        return float(self._edges["x_low"].min()), float(self._edges["x_high"].max())

    @property
    def area(self) -> float:
        """Area of all zones [m2]."""
        return sum(abs(signed_area(polygon.tolist())) for polygon in self.polygons)

    def ground_level(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation of the rigid base [m] at `x` [m]."""
        return np.interp(x, self.ground[:, 0], self.ground[:, 1])

    def water_level(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation of the water line [m] at `x` [m]; -inf without water."""
        if self.water is None:
            return np.full(np.shape(x), -np.inf)
        return np.interp(x, self.water[:, 0], self.water[:, 1])

    def surface(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation of the surface [m] at `x` [m]; the rigid base where there is no soil."""
        x = np.asarray(x, dtype=float)
        left, right = self.extent
        tiny = 1e-9 * (right - left)
        at = np.where((x >= left) & (x <= right), np.clip(x, left + tiny, right - tiny), x)
        height, crosses = self._crossings(at)
        top = np.max(np.where(crosses, height, -np.inf), axis=-1)
        return np.where(np.isfinite(top), top, self.ground_level(x))

    def zone_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Number of the zone in which each point lies, `OUTSIDE` where there is none."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        height, crosses = self._crossings(x)
        over = np.where(crosses & (height > y[..., None]), self._edges["sign"], 0.0)
        found = np.full(x.shape, OUTSIDE)
        for number in range(len(self.polygons)):
            mine = self._edges["zone"] == number
            found[over[..., mine].sum(axis=-1) > 0.5] = number
        return found

    def column(self, x: np.ndarray, base: np.ndarray) -> Column:
        """The column above `base` [m] at `x` [m] (both of one shape)."""
        x, base = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(base, dtype=float))
        height, crosses = self._crossings(x)
        sign = np.where(crosses, self._edges["sign"], 0.0)
        height = np.where(crosses, height, 0.0)
        wet_top = np.maximum(base, self.water_level(x))[..., None]
        low = base[..., None]
        dry = np.maximum(height - wet_top, 0.0)
        wet = np.maximum(height - low, 0.0) - dry
        rho, rho_wet = self._edges["density"], self._edges["saturated_density"]
        middle = 0.5 * (np.maximum(height, low) ** 2 - low**2)
        mass = np.sum(sign * (rho * dry + rho_wet * wet), axis=-1)
        thickness = np.sum(sign * (dry + wet), axis=-1)
        return Column(
            thickness=thickness,
            submerged=np.sum(sign * wet, axis=-1),
            mass=mass,
            first_moment=np.sum(sign * middle, axis=-1),
        )

    def crossings_with(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Where the straight line from `start` to `end` (2,) [m] crosses zone borders: x (K,)."""
        edges = self._edges
        p = np.column_stack([edges["x_start"], edges["y_start"]])
        r = np.column_stack([edges["x_end"], edges["y_end"]]) - p
        d = np.asarray(end, dtype=float) - start
        cross = r[:, 0] * d[1] - r[:, 1] * d[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            offset = np.asarray(start, dtype=float) - p
            along_edge = (offset[:, 0] * d[1] - offset[:, 1] * d[0]) / cross
            along_line = (offset[:, 0] * r[:, 1] - offset[:, 1] * r[:, 0]) / cross
        hit = (np.abs(cross) > 1e-12) & (along_edge >= 0) & (along_edge <= 1)
        hit &= (along_line > 0) & (along_line < 1)
        return np.unique(start[0] + along_line[hit] * d[0])

    def _crossings(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (P, E) at which edges cross verticals at `x`, and whether they do."""
        edges = self._edges
        at = np.asarray(x, dtype=float)[..., None]
        crosses = (at >= edges["x_low"]) & (at < edges["x_high"])
        height = edges["y_start"] + edges["slope"] * (at - edges["x_start"])
        return height, crosses


@dataclass(frozen=True)
class Column:
    """A vertical column of soil above a base; arrays of one shape.

    Attributes:
        thickness: of the soil [m].
        submerged: the part below the water line [m].
        mass: water in the pores included [kg/m2].
        first_moment: integral of y over the thickness [m2]; over the thickness: its mean elevation.
    """

    thickness: np.ndarray
    submerged: np.ndarray
    mass: np.ndarray
    first_moment: np.ndarray

    @property
    def weight(self) -> np.ndarray:
        """Total weight [N/m2]."""
        return GRAVITY * self.mass

    @property
    def buoyant_weight(self) -> np.ndarray:
        """Weight less uplift, w = gamma h - gamma_w h_submerged [N/m2]."""
        return self.weight - WATER_UNIT_WEIGHT * self.submerged


def section_of(
    scene: Scene, *, water: bool = True, unit_weight_factor: float = 1.0
) -> ClassicalSection:
    """The section of a scene.

    Args:
        scene: zones, materials, base, water.
        water: False leaves pool and groundwater out.
        unit_weight_factor: multiplies the density of every soil.
    """
    soils = {
        name: soil_of(name, material, unit_weight_factor=unit_weight_factor)
        for name, material in scene.materials.items()
    }
    line = None
    if water and scene.water_level is not None:
        points = scene.phreatic_line or [(scene.domain.x_min, scene.water_level)]
        line = np.asarray(points, dtype=float)
    return ClassicalSection(
        polygons=[np.asarray(zone.polygon, dtype=float) for zone in scene.zones],
        soils=[soils[zone.material] for zone in scene.zones],
        ground=np.asarray(scene.ground.points, dtype=float),
        water=line,
        names=[zone.name for zone in scene.zones],
    )


def water_line_after(before: ClassicalSection, after: ClassicalSection) -> np.ndarray | None:
    """The water line once the surface has changed: a pool floods the ground that sank below it.

    On either side the pool is followed inwards to the place where the new surface rises above it.
    If that place lies beyond the bend where the old line began to fall, the falling part moves
    inwards by the same distance. A line that meets no sunken ground stays as it was.

    Returns:
        (W, 2) [m], or None without water.
    """
    if before.water is None:
        return None
    line = before.water
    left = min(before.extent[0], after.extent[0])
    right = max(before.extent[1], after.extent[1])
    x = np.unique(np.concatenate([np.linspace(left, right, 2001), line[:, 0]]))
    level = before.water_level(x)
    surface = after.surface(x)
    new = level.copy()
    for inwards in (slice(None), slice(None, None, -1)):
        place, old, filled = x[inwards], level[inwards], new[inwards]
        shore, bend = _shore(old, surface[inwards]), _bend(old)
        if shore <= bend:
            continue
        filled[: shore + 1] = np.maximum(filled[: shore + 1], old[0])
        if shore < len(x):
            moved = before.water_level(place - (place[shore] - place[bend]))
            filled[shore:] = np.maximum(filled[shore:], moved[shore:])
    return np.column_stack([x, new])


def _shore(level: np.ndarray, surface: np.ndarray) -> int:
    """Number of the first place, walking in, where the soil rises above the pool; 0: no pool."""
    if level[0] <= surface[0]:
        return 0
    dry = np.flatnonzero(surface >= level[0])
    return int(dry[0]) if len(dry) else len(level)


def _bend(level: np.ndarray) -> int:
    """Number of the last place, walking in, at which the line is still as high as the pool."""
    lower = np.flatnonzero(np.abs(level - level[0]) > 1e-9)
    return int(lower[0]) - 1 if len(lower) else len(level) - 1


def _edge_arrays(
    polygons: Sequence[np.ndarray], soils: Sequence[ClassicalSoil]
) -> dict[str, np.ndarray]:
    """All edges that are not vertical, with +1 for upper and -1 for lower ones."""
    parts = []
    for number, (polygon, soil) in enumerate(zip(polygons, soils, strict=True)):
        ring = np.asarray(polygon, dtype=float)
        if signed_area(ring.tolist()) < 0:
            ring = ring[::-1]
        start, end = ring, np.roll(ring, -1, axis=0)
        steps = np.abs(end[:, 0] - start[:, 0])
        keep = steps > 1e-12 * max(1.0, np.ptp(ring[:, 0]))
        start, end = start[keep], end[keep]
        # Counter-clockwise: edges that run to the left have the soil below them.
        sign = np.where(end[:, 0] < start[:, 0], 1.0, -1.0)
        one = np.ones(len(start))
        parts.append(
            np.column_stack(
                [start, end, sign, number * one, soil.density * one, soil.saturated_density * one]
            )
        )
    table = np.concatenate(parts)
    x0, y0, x1, y1, sign, zone, rho, rho_wet = table.T
    return {
        "x_start": x0,
        "y_start": y0,
        "x_end": x1,
        "y_end": y1,
        "x_low": np.minimum(x0, x1),
        "x_high": np.maximum(x0, x1),
        "slope": (y1 - y0) / (x1 - x0),
        "sign": sign,
        "zone": zone.astype(int),
        "density": rho,
        "saturated_density": rho_wet,
    }
