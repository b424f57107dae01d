"""What a three-dimensional simulation leaves: maps, a view, tables, rasters, a page."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.survey3d.deposit import toe_line
from geometry.terrain.raster import write_raster
from mpm_taichi.readings3d import Maps, crossed_to_the_left, named, paths_of
from pipeline.extras import has
from pipeline.files import write_text
from report import page
from report.numbers import unit_of, with_unit
from report.pictures.body_map import save_map
from report.pictures.body_view import save_view
from report.table import Table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from geometry.scenes3d.scene3d import Scene3d

FILES = ("map.png", "view.png", "readings.csv", "toe_line.csv", "report.html")
RASTERS = ("thickness_before.tif", "thickness_after.tif", "surface_after.tif", "largest_speed.tif")


def write_simulation_3d(
    scene: Scene3d,
    maps: Maps,
    readings: Mapping[str, float],
    walls: Sequence[str],
    out: Path,
    film: Path | None = None,
) -> None:
    """Write `FILES` and, where the extra `terrain` is installed, `RASTERS` as GeoTIFF.

    Args:
        scene: what was simulated.
        maps: of the problem and its run.
        readings: name with unit -> number.
        walls: that soil has reached.
        out: folder.
        film: of the slide, which the page shows; None: none.
    """
    assert maps.after is not None and maps.speed is not None
    rows = [(name, f"{value:.6g}") for name, value in readings.items()]
    write_text(out / "readings.csv", _csv(("quantity", "value"), rows))
    _, first = toe_line(maps.before, maps.least, scene.document.side)
    y, last = toe_line(maps.after, maps.least, scene.document.side)
    places = [tuple(f"{value:.6g}" for value in row) for row in zip(y, first, last, strict=True)]
    write_text(out / "toe_line.csv", _csv(("y_m", "x_before_m", "x_after_m"), places))
    if has("terrain"):
        rasters = (maps.before, maps.after, maps.surface, maps.speed)
        for name, raster in zip(RASTERS, rasters, strict=True):
            write_raster(raster, out / name, origin=scene.origin)
    draw_scene_3d(scene, maps, out / "map.png")
    save_view(out / "view.png", scene.name, maps, side=scene.document.side)
    _write_page(scene, readings, walls, out, film)


def draw_scene_3d(scene: Scene3d, maps: Maps, path: str | Path) -> Path:
    """Plan and sections of a scene, after the slide if `maps` have that."""
    terrain = scene.document.terrain
    level = scene.section.water_level if scene.section else terrain and terrain.water_level
    return save_map(
        path,
        scene.name,
        maps,
        paths=paths_of(scene, maps),
        lines={name: np.asarray(line) for name, line in scene.document.lines.items()},
        water_level=level,
        measured=scene.ground.after if scene.ground and maps.after is not None else None,
    )


def warning(walls: Sequence[str], readings: Mapping[str, float]) -> str:
    """What makes readings wrong, a wall that soil has reached or a line the wrong way; else ""."""
    said = []
    if walls:
        where = ", ".join(walls)
        said.append(f"Soil reached the wall at {where}: the domain is too small to read a runout.")
    if lines := crossed_to_the_left(readings):
        words = left_words(lines)
        said.append(f"{words[0].upper()}{words[1:]}.")
    return " ".join(said)


def left_words(lines: Sequence[str]) -> str:
    """That lines are drawn the wrong way round; not empty."""
    return (
        f"soil crossed {', '.join(lines)} to the left, seen from the first end: exchange the two "
        "ends of a line to count what crosses it as positive"
    )


def _write_page(
    scene: Scene3d,
    readings: Mapping[str, float],
    walls: Sequence[str],
    out: Path,
    film: Path | None,
) -> None:
    values = [
        (*named(name), "none" if math.isnan(v) else f"{v:.4g}") for name, v in readings.items()
    ]
    keys = [(words, with_unit(value, unit), "") for words, unit, value in values[1:5]]
    said = warning(walls, readings)
    sections = [
        page.PageSection("In short", [page.KeyNumbers(keys), *page.said([said])]),
        page.PageSection(
            "Map and sections",
            page.shown(
                out / "map.png",
                "Plan of the slide with hillshade, contours and thickness; sections below",
                "Edge of the soil before the slide dashed, after it in blue.",
            ),
        ),
        page.PageSection(
            "In perspective",
            page.shown(out / "view.png", "The surface after the slide in true proportions"),
        ),
        page.PageSection(
            "The slide as a film",
            page.filmed(film, "Film of the slide from above and in perspective"),
        ),
        page.PageSection(
            "Readings",
            page.tabulated(
                Table(
                    ("quantity", "value", "unit"),
                    [(w, value, unit_of(unit)) for w, unit, value in values],
                )
            ),
        ),
    ]
    write_lead = scene.document.description or "A slide simulated in three dimensions."
    page.write_page(out / "report.html", scene.name, sections, lead=write_lead)


def _csv(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
