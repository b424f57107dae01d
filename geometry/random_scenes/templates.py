"""Scenes drawn at random from the templates (a) to (e) of the paper's Fig. 3 and Table A.1.

A scale may go on with other families (`OTHERS`): dams that stand free, and sections whose ground
goes on beyond their ends.
A scene follows from (configuration, scale, index) alone: the same on every machine, in any order.
The outlines are drawn until they are valid, at most `MOST_DRAWS` times; the number of draws is kept
in the scene.

A new template is one file with a `sketch` function and one line in `TEMPLATES`. A new family is one
file with a function that draws it, one line in `OTHERS`, and its name in `pipeline.config.Family`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.random_scenes import blocks, embankment, random_slope, tailings_dam, zoned_dam
from geometry.random_scenes.embankment_dam import draw_dam
from geometry.random_scenes.embankment_on_foundation import draw_embankment_on_foundation
from geometry.random_scenes.hydraulic_fill_dam import draw_hydraulic_fill_dam
from geometry.random_scenes.impoundment import draw_impoundment
from geometry.random_scenes.materials import draw_material
from geometry.random_scenes.sketch import (
    Frame,
    Outline,
    Sketch,
    Template,
    is_simple,
    perimeter,
    signed_area,
)
from geometry.scenes.fill import lattice_points
from geometry.scenes.scene import Origin, Scene
from pipeline.cli import InputError
from pipeline.random_numbers import Stream, number_of

if TYPE_CHECKING:
    from pipeline.config import Config, Family, GeometrySettings, ScaleSettings

TEMPLATES: dict[str, Template] = {
    "a": embankment.sketch,
    "b": tailings_dam.sketch,
    "c": zoned_dam.sketch,
    "d": random_slope.sketch,
    "e": blocks.sketch,
}

#: Draws a scene from a seed, its number, the spacing [m] and the most points.
Draw = Callable[[int, int, float, int], Scene]


def _of_any_size(draw: Callable[[int, int, float], Scene]) -> Draw:
    """A dam that stands free is short, so that its number of points is not limited."""
    return lambda seed, index, spacing, _: draw(seed, index, spacing)


#: Other families than the templates: letter, kind of its materials, and what draws it.
OTHERS: dict[Family, tuple[str, str, Draw]] = {
    "embankment_dam": ("f", "dam", _of_any_size(draw_dam)),
    "hydraulic_fill_dam": ("g", "dam", _of_any_size(draw_hydraulic_fill_dam)),
    "embankment_on_foundation": ("h", "foundation", draw_embankment_on_foundation),
    "impoundment": ("i", "tailings", draw_impoundment),
}
#: What the scenes from `dams_from`, and from `mixed_from` on are, in turn.
DAMS: tuple[Family, ...] = ("embankment_dam",)
MIXTURE: tuple[Family, ...] = ("template", "embankment_dam", "template", "hydraulic_fill_dam")
#: Least mean thickness of a zone (twice area over perimeter), in spacings: one cell.
LEAST_THICKNESS = 2.0
#: Largest difference between the area of the points and that of the polygons.
AREA_TOLERANCE = 0.01
#: Draws after which the configuration is held to be impossible.
MOST_DRAWS = 1000
#: Coordinates, levels and speeds are rounded to this many decimals (0.1 mm).
DECIMALS = 4
#: A pool stands at this share of the crest's height above the base.
POOL_SHARE = (0.2, 0.9)
#: Share of the dams with a core (template (c)) whose pool stands on the upstream side alone.
SEEPAGE_SHARE = 0.5

# Streams of one scene; each has its own numbers, so that no choice shifts another.
_TEMPLATE, _MATERIALS, _WATER, _JITTER, _OUTLINES, _SIZE = range(6)


@dataclass(frozen=True)
class Rejected:
    """Why a draw was not valid."""

    reason: str


def draw_scene(config: Config, scale: str, index: int) -> Scene:
    """Draw scene number `index` of a scale.

    Args:
        config: the configuration.
        scale: a name in ``config.scales``.
        index: number of the scene, from 0.

    Raises:
        InputError: unknown scale, negative index, or settings that no draw can satisfy.
    """
    settings, size = config.geometry, config.scale(scale)
    if index < 0:
        raise InputError(f"index {index}: scenes are numbered from 0")
    family = _family(size, index)
    if family != "template":
        return _of_family(family, settings, size.spacing_m, scale, index)
    key = (settings.seed, number_of(scale), index)
    size = _size_of(key, size)
    shares = settings.template_shares.model_dump()
    letter = list(shares)[Stream(*key, _TEMPLATE).pick(list(shares.values()))]
    reasons: list[str] = []
    for attempt in range(MOST_DRAWS):
        drawn = _draw_outlines(Stream(*key, _OUTLINES, attempt), letter, settings, size)
        if isinstance(drawn, Sketch):
            return _scene(drawn, letter, len(reasons) + 1, settings, size, scale, index)
        reasons.append(drawn.reason)
    most = max(set(reasons), key=reasons.count)
    raise InputError(
        f"scale {scale}, scene {index}: no valid template ({letter}) in {MOST_DRAWS} draws, "
        f"mostly because {most}; see geometry.max_points, geometry.min_points_per_zone, "
        f"scales.{scale}.spacing_m and the size of the domain"
    )


def _family(size: ScaleSettings, index: int) -> Family:
    """What a scene is: by `turns`, else by `mixed_from`, else by `dams_from`."""
    begun = [one for one in size.turns if one.first <= index]
    if begun:
        start, turns = begun[-1].first, tuple(begun[-1].families)
    elif size.mixed_from is not None and index >= size.mixed_from:
        start, turns = size.mixed_from, MIXTURE
    elif size.dams_from is not None and index >= size.dams_from:
        start, turns = size.dams_from, DAMS
    else:
        return "template"
    return turns[(index - start) % len(turns)]


def _of_family(
    family: Family, settings: GeometrySettings, spacing: float, scale: str, index: int
) -> Scene:
    """A scene of another family than the templates, under the name of its scale."""
    letter, materials, draw = OTHERS[family]
    origin = Origin(template=letter, scale=scale, index=index, draws=1, materials=materials)
    return draw(settings.seed, index, spacing, settings.max_points).changed(
        name=f"{scale}_{index:05d}", origin=origin.model_dump()
    )


def _size_of(key: tuple[int, int, int], size: ScaleSettings) -> ScaleSettings:
    """The size of one scene: that of its scale, or enlarged, domain and all."""
    stream = Stream(*key, _SIZE)
    large, by = stream.unit() < size.enlarged_share, stream.uniform(1.0, size.enlarged_by)
    if not large:
        return size
    lengths = ("scale_factor", "domain_width_m", "domain_height_m")
    return size.model_copy(update={name: by * getattr(size, name) for name in lengths})


def _draw_outlines(
    stream: Stream, letter: str, settings: GeometrySettings, size: ScaleSettings
) -> Sketch | Rejected:
    """One draw of a template, at the size of the scale, or why it cannot be used."""
    factor = size.scale_factor
    frame = Frame(
        width=size.domain_width_m / factor,
        height=size.domain_height_m / factor,
        spacing=size.spacing_m / factor,
        cell=2.0 * size.spacing_m / factor,
        blocks=settings.blocks,
    )
    sketch = _sized(TEMPLATES[letter](stream, frame), factor)
    reason = _fault(sketch, settings, size)
    return Rejected(reason) if reason else sketch


def _sized(sketch: Sketch, factor: float) -> Sketch:
    """Template metres to metres: lengths by the factor, speeds by its square root (Froude)."""

    def length(point: tuple[float, float]) -> tuple[float, float]:
        return round(factor * point[0], DECIMALS), round(factor * point[1], DECIMALS)

    def speed(velocity: tuple[float, float]) -> tuple[float, float]:
        root = factor**0.5
        return round(root * velocity[0], DECIMALS), round(root * velocity[1], DECIMALS)

    return Sketch(
        outlines=[
            Outline(
                o.name, o.soil, _without_repeats([length(p) for p in o.polygon]), speed(o.velocity)
            )
            for o in sketch.outlines
        ],
        ground=[length(point) for point in sketch.ground],
        crest=None if sketch.crest is None else factor * sketch.crest,
        seepage=None
        if sketch.seepage is None
        else (length(sketch.seepage[0]), length(sketch.seepage[1])),
    )


def _without_repeats(polygon: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Drop vertices that rounding has put onto their predecessor."""
    return [point for i, point in enumerate(polygon) if point != polygon[i - 1]]


def _fault(sketch: Sketch, settings: GeometrySettings, size: ScaleSettings) -> str | None:
    """The fault of a sketch, or None. Plain arithmetic: the same answer on every machine.

    All zones of templates (a) to (d) are counter-clockwise and share their inner edges; simple ones
    with a positive area then cannot overlap.
    """
    if not sketch.outlines:
        return "the blocks found no room"
    for outline in sketch.outlines:
        polygon = outline.polygon
        if len(polygon) < 3 or not is_simple(polygon) or signed_area(polygon) <= 0.0:
            return "an outline crosses itself or another"
        if any(
            not (0.0 <= x <= size.domain_width_m and y <= size.domain_height_m) for x, y in polygon
        ):
            return "an outline leaves the domain"
        if 2.0 * signed_area(polygon) < LEAST_THICKNESS * size.spacing_m * perimeter(polygon):
            return "a zone is a sliver"
    polygons = [np.asarray(outline.polygon) for outline in sketch.outlines]
    ground = np.asarray(sketch.ground)
    origin = (0.0, float(ground[:, 1].min()))
    _, zone = lattice_points(polygons, ground, origin, size.spacing_m)
    counts = np.bincount(zone, minlength=len(polygons))
    if counts.sum() > settings.max_points:
        return "there are too many points"
    if counts.min() < settings.min_points_per_zone:
        return "a zone holds too few points"
    area = sum(signed_area(outline.polygon) for outline in sketch.outlines)
    if abs(counts.sum() * size.spacing_m**2 - area) > AREA_TOLERANCE * area:
        return "the points miss the area by more than 1 %"
    return None


def _scene(
    sketch: Sketch,
    letter: str,
    draws: int,
    settings: GeometrySettings,
    size: ScaleSettings,
    scale: str,
    index: int,
) -> Scene:
    """Add materials, water and names to a valid sketch."""
    key = (settings.seed, number_of(scale), index)
    stream = Stream(*key, _MATERIALS)
    materials = {
        _material_name(o): draw_material(
            stream,
            o.soil,
            option=settings.materials,
            column=size.material_ranges,
            spacing=size.spacing_m,
        ).model_dump()
        for o in sketch.outlines
    }
    level, line = _water(Stream(*key, _WATER), sketch, settings, size)
    document = {
        "name": f"{scale}_{index:05d}",
        "origin": {
            "template": letter,
            "scale": scale,
            "index": index,
            "draws": draws,
            "materials": settings.materials,
        },
        "domain": {"x_min": 0.0, "x_max": size.domain_width_m, "y_max": size.domain_height_m},
        "ground": {"points": sketch.ground},
        "zones": [
            {
                "name": o.name,
                "polygon": o.polygon,
                "material": _material_name(o),
                "initial_velocity": o.velocity,
            }
            for o in sketch.outlines
        ],
        "materials": materials,
        "water_level": level,
        "phreatic_line": line,
        "spacing": size.spacing_m,
        "jitter": settings.jitter,
        "seed": Stream(*key, _JITTER).seed(),
    }
    return Scene.model_validate(document)


def _material_name(outline: Outline) -> str:
    return f"{outline.name}_soil_{outline.soil}"


def _water(
    stream: Stream, sketch: Sketch, settings: GeometrySettings, size: ScaleSettings
) -> tuple[float | None, list[tuple[float, float]] | None]:
    """Pool level and, for some dams with a core, the water table that falls through it."""
    wet, share = stream.unit() < settings.water_share, stream.uniform(*POOL_SHARE)
    held_back = stream.unit() < SEEPAGE_SHARE
    if sketch.crest is None or not wet:
        return None, None
    base = max(y for _, y in sketch.ground)
    level = round(base + share * (sketch.crest - base), DECIMALS)
    if sketch.seepage is None or not held_back:
        return level, None
    upper, lower = sketch.seepage
    line = [(0.0, level), (upper[0], level), lower, (size.domain_width_m, lower[1])]
    return level, line
