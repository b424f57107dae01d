"""What of a section can be simulated but is hardly meant: a slip of unit, axes, sign or vertex.

In: a scene. Out: a line for each doubt, with what may be meant. Nothing here is a fault: tall thin
sections, small ones and soil that hangs over exist, if rarely.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from shapely import bounds, get_parts, length
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from geometry.scenes.polygon_checks import is_crowded, on_verticals
from geometry.scenes.scene import Scene
from geometry.sides import Side

#: Heights of dams, slopes and experiments [m]: the highest dam has 330 m.
HEIGHTS = 0.03, 400.0
#: Toes are read where soil is 0.5 m high (`geometry.survey.columns`): lower sections are too small
#: for it [m]. A runout of more heights is hardly one of a slide.
LEAST_HEIGHT, FARTHEST = 2.0, 30.0
#: Heights by which a stated foot may lie beside that of the section.
FOOT = 0.25
#: A section taller than this many of its lengths stands on its side.
SLENDER = 1.5
#: A section this long or less may be one whose x is a longitude [deg]: 0.1 are 5 to 11 km.
DEGREES = 0.1
#: Strengths beyond this are of rock or concrete, or in Pa [kPa]; angles below it in radians [deg].
STRONGEST_KPA, SMALLEST_DEG = 1000.0, 1.5
#: Densities of soil [kg/m3]: peat 900, the tailings of heavy ores 3500.
DENSITIES = 800.0, 3500.0
#: Verticals on which soil is looked for.
VERTICALS = 400
#: A liquefied layer has four rows of points or more; with fewer than this it is said. Six are well.
ROWS, FEWEST_ROWS, GOOD_ROWS = 4.0, 3.5, 6.0
#: Cells across what differs so many times in permeability from its neighbour: only from two on is
#: there a row of cells of it alone, which seals or drains (`mpm_taichi.solver.pore_water`).
WATER_CELLS, OTHERWISE = 2.0, 10.0
#: Field of the spacing, which what is thin is about.
SPACING = ("scene", "spacing")
#: The thickness of a layer is that which so many percent of it have at most: necks count.
SHARE = 40.0


class Doubt(str):
    """A line on what is hardly meant.

    Attributes:
        field: part of the case, keys and numbers that lead to what it is about; empty: no field.
    """

    __slots__ = ("field",)
    field: tuple[str | int, ...]

    def __new__(cls, words: str, *field: str | int) -> Doubt:
        """A line on a field."""
        found = super().__new__(cls, words)
        found.field = field
        return found


def doubts(scene: Scene) -> list[Doubt]:
    """Lines on what is hardly meant; empty: nothing."""
    return [*_size(scene), *soil_doubts(scene), *_shape(scene), *water_doubts(scene)]


def far_runouts(scene: Scene, runouts: Iterable[float]) -> list[str]:
    """Lines on runouts [m] that are hardly those of a slide of the section."""
    low, high = scene.extent
    tall, lines = high - low, []
    for one in runouts:
        if one > FARTHEST * tall:
            far = f"is {one / tall:.0f} heights of the section; is its unit right?"
            lines.append(f"a runout of {one:g} m {far}")
        elif one < 0.0:
            lines.append(f"a runout of {one:g} m: a toe that moves outward has a positive one")
    return lines


def far_feet(scene: Scene, feet: Mapping[Side, float]) -> list[Doubt]:
    """Lines on stated feet, side -> x [m], from which no runout of the section is counted."""
    low, high = scene.extent
    room = max(FOOT * (high - low), 2.0 * scene.spacing)
    return [
        Doubt(
            f"the {side} foot was surveyed at x = {x:g} m (initial.toe_{side}_x_m), and that of "
            f"the section is at x = {scene.foot(side):g} m; runouts count from the former"
        )
        for side, x in feet.items()
        if abs(x - scene.foot(side)) > room
    ]


def thin_layers(scene: Scene, fewest: float = FEWEST_ROWS) -> list[Doubt]:
    """Lines on liquefied layers of few rows of points, in which S_r comes out too low.

    Args:
        scene: the section.
        fewest: rows with which nothing is said.
    """
    return [
        Doubt(
            f"few points: what liquefied from x = {left:.4g} to {right:.4g} m is {thick:.3g} m "
            f"thick, {thick / scene.spacing:.2g} rows of points; with fewer than {ROWS:g} S_r "
            f"comes out too low; {GOOD_ROWS:g} rows: spacing {thick / GOOD_ROWS:.3g}",
            *SPACING,
        )
        for left, right, thick in _liquefied_layers(scene)
        if thick / scene.spacing < fewest
    ]


def fewest_rows(scene: Scene) -> float:
    """Rows of points in the thinnest liquefied layer; infinite: nothing liquefied."""
    return min((thick / scene.spacing for *_, thick in _liquefied_layers(scene)), default=np.inf)


def _liquefied_layers(scene: Scene) -> Iterator[tuple[float, float, float]]:
    """Left and right end and thickness [m] of each body of what liquefied."""
    liquefied = [zone for zone in scene.zones if scene.materials[zone.material].liquefied]
    whole = unary_union([Polygon(zone.polygon) for zone in liquefied])
    if is_crowded(whole, scene.spacing):
        return
    for part in getattr(whole, "geoms", [whole] if liquefied else []):
        left, _, right, _ = part.bounds
        places = np.linspace(left, right, VERTICALS + 2)[1:-1]
        yield left, right, float(np.percentile(_thickest(on_verticals(part, places)), SHARE))


def _thickest(cuts: np.ndarray) -> np.ndarray:
    """Length of the longest piece on each vertical, (n,) [m]; seams over each other are several."""
    pieces, vertical = get_parts(cuts, return_index=True)
    longest = np.zeros(len(cuts))
    np.maximum.at(longest, vertical, length(pieces))
    return longest


def _size(scene: Scene) -> Iterator[Doubt]:
    x = [x for zone in scene.zones for x, _ in zone.polygon]
    low, high = scene.extent
    long, tall = max(x) - min(x), high - low
    if not HEIGHTS[0] <= tall <= HEIGHTS[1]:
        yield Doubt(f"the section is {tall:.3g} m high; is the unit of the drawing right (--unit)?")
    elif tall > SLENDER * long:
        degrees = " or is x in degrees" if long < DEGREES else ""
        yield Doubt(
            f"the section is {tall:.3g} m high and {long:.3g} m long; are x and y "
            f"exchanged{degrees}?"
        )
    elif tall < LEAST_HEIGHT:
        yield Doubt(
            f"the section is {tall:.3g} m high; is the unit of the drawing right (--unit)? If so: "
            "toes are read where soil is 0.5 m high, so enlarge it, strengths by the same factor, "
            "times by its root"
        )


def soil_doubts(scene: Scene) -> Iterator[Doubt]:
    """Lines on numbers of soils that are hardly meant."""
    used = {zone.material for zone in scene.zones}
    for name, soil in scene.materials.items():
        if name not in used:
            continue
        if soil.cohesion_kpa > STRONGEST_KPA:
            words = f"a strength of {soil.cohesion_kpa:g} kPa is that of rock; is it in Pa?"
            yield Doubt(f"{name}: {words}", "scene", "materials", name, "cohesion_kpa")
        if not DENSITIES[0] <= soil.density <= DENSITIES[1]:
            words = f"density {soil.density:g} kg/m³; is it in lb/ft³, N/m³ or kN/m³?"
            yield Doubt(f"{name}: {words}", "scene", "materials", name, "density")
        if 0.0 < soil.friction_deg < SMALLEST_DEG:
            words = f"a friction angle of {soil.friction_deg:g}°; is it in radians?"
            yield Doubt(f"{name}: {words}", "scene", "materials", name, "friction_deg")
    if not any(scene.materials[zone.material].liquefied for zone in scene.zones):
        yield Doubt("no zone is marked as liquefied: there is no S_r to be found")


def water_doubts(scene: Scene) -> Iterator[Doubt]:
    """Lines on permeabilities that do nothing or are missing, thin seals and drains, dry r_u."""
    used = {zone.material for zone in scene.zones}
    stated = {name: scene.materials[name].permeability_m_per_s or 0.0 for name in used}
    if not any(stated.values()):  # nor has any soil an excess pressure of its own then
        return
    shapes = {
        name: unary_union([Polygon(one.polygon) for one in scene.zones if one.material == name])
        for name in sorted(used)
    }
    flows = [name for name in shapes if stated[name] and _is_wet(scene, shapes[name])]
    if not flows:
        name = min(name for name in used if stated[name])
        why = "no soil that has one lies below the phreatic line" if scene.has_water else "no water"
        yield Doubt(f"permeability_m_per_s does nothing: {why}", *_of(name, "permeability_m_per_s"))
        return
    yield from _lacking(scene, shapes, flows)
    yield from _thin_in_cells(scene, shapes, stated)
    for name, shape in shapes.items():
        if scene.materials[name].excess_pressure_ratio and not _is_wet(scene, shape):
            words = "excess_pressure_ratio of soil above the water does nothing"
            yield Doubt(f"{name}: {words}", *_of(name, "excess_pressure_ratio"))


def _of(soil: str, field: str) -> tuple[str, ...]:
    """The field of a soil."""
    return "scene", "materials", soil, field


def _is_wet(scene: Scene, shape: BaseGeometry) -> bool:
    """A vertex of the shape lies below the phreatic line."""
    x, y = np.concatenate([p.exterior.xy for p in getattr(shape, "geoms", [shape])], axis=1)
    return scene.has_water and bool((y < scene.phreatic_level(x)).any())


def _lacking(
    scene: Scene, shapes: Mapping[str, BaseGeometry], flows: Sequence[str]
) -> Iterator[Doubt]:
    """Soil that regains no strength, and sand without a permeability beside what has one."""
    for name, shape in shapes.items():
        soil = scene.materials[name]
        if (
            name in flows
            and soil.liquefied
            and not (soil.pre_failure and soil.pre_failure.friction_deg)
        ):
            words = "without pre_failure.friction_deg it keeps S_r, however much water leaves it"
            yield Doubt(f"{name}: {words}", *_of(name, "pre_failure"))
        if soil.permeability_m_per_s is None and (soil.liquefied or soil.friction_deg > 0.0):
            beside = [one for one in flows if shape.distance(shapes[one]) < 0.1 * scene.spacing]
            if beside:
                yield Doubt(
                    f"{name}: without permeability_m_per_s it seals {' and '.join(beside)}, "
                    "wet or dry",
                    *_of(name, "permeability_m_per_s"),
                )


def _thin_in_cells(
    scene: Scene, shapes: Mapping[str, BaseGeometry], stated: Mapping[str, float]
) -> Iterator[Doubt]:
    """Seals and drains thinner than cells of the pore water."""
    least = WATER_CELLS * scene.cell_size
    for name, shape in shapes.items():
        if is_crowded(shape, scene.spacing):
            continue
        for part in getattr(shape, "geoms", [shape]):
            thick = 2.0 * part.area / part.length  # of a seam much longer than thick
            beside = [
                other
                for other in shapes
                if other != name
                and _seals_or_drains(stated[name], stated[other])
                and part.distance(shapes[other]) < 0.1 * scene.spacing
            ]
            if thick < least and beside:
                # Of a cell that it shares with soil in which water flows, that soil alone counts.
                fault = (
                    "a seal may leak and a drain may not drain"
                    if stated[name]
                    else "it leaks: give it a permeability_m_per_s of its own"
                )
                yield Doubt(
                    f"few cells: {name} beside {' and '.join(beside)} is about {thick:.2g} m "
                    f"thick, {thick / scene.cell_size:.2g} cells of the pore water; in fewer than "
                    f"2 {fault}; spacing {0.95 * scene.spacing * thick / least:.2g}",
                    *SPACING,
                )


def _seals_or_drains(own: float, other: float) -> bool:
    """Of two permeabilities one is so much larger that the thinner layer is a seal or a drain."""
    return max(own, other) > OTHERWISE * min(own, other)


def _shape(scene: Scene) -> Iterator[Doubt]:
    """Bodies that do not touch, and air under soil."""
    whole = unary_union([Polygon(zone.polygon) for zone in scene.zones])
    if is_crowded(whole, scene.spacing):
        return
    bodies = getattr(whole.buffer(0.01 * scene.spacing), "geoms", [None])
    if len(bodies) > 1:
        count = len(bodies)
        yield Doubt(f"the section is of {count} bodies that do not touch; is a zone missing?")
    left, _, right, _ = whole.bounds
    x = np.linspace(left, right, VERTICALS + 2)[1:-1]
    cuts = on_verticals(whole, x)
    there, top = length(cuts), bounds(cuts)[:, 3]  # of nothing: nan
    air = top - scene.ground.height(x) - there
    under = np.flatnonzero(air > scene.spacing)
    if len(under) > 1:
        worst = under[np.argmax(air[under])]
        yield Doubt(
            f"there is air under the soil from x = {x[under[0]]:.4g} to {x[under[-1]]:.4g} m, up "
            f"to {air[worst]:.3g} m; is a vertex, a zone or the ground missing, or y a depth?"
        )
