"""The report of a prediction in three dimensions: page, exceedance maps, curves, GeoTIFFs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from geometry.terrain.raster import write_raster
from inversion.prediction.in_plan import BodyPrediction
from mpm_taichi.readings3d import crossed_to_the_left, paths_of
from pipeline.extras import has
from report import page, style
from report.pictures.exceedance_map import save_exceedance
from report.prediction import (
    PAGE,
    dam_breach_sections,
    dam_breach_words,
    draw_curves,
    exceedance_table,
    quantity_table,
    remarks,
    strength_words,
    toes_of,
)
from report.simulation3d import left_words
from report.table import Table

MAP, CURVES = "exceedance.png", "runout.png"


def summary(document: dict[str, Any]) -> str:
    """The answer for a terminal or a log."""
    lines = [
        f"{document['case']}: {strength_words(document)}",
        "",
        quantity_table(document).text(),
        "",
        area_table(document).text(),
        "",
        exceedance_table(toes_of(document)).text(),
        *doubts(document),
        *dam_breach_words(document),
        f"{len(document['runs'])} simulations, {document['samples']} samples",
    ]
    return "\n".join(lines)


def write_report(found: BodyPrediction, folder: Path) -> Path:
    """Write page, pictures, and a GeoTIFF for each thickness where the extra `terrain` is there."""
    document, scene, maps = found.document, found.setup.scene, found.setup.before
    lines = {name: np.asarray(line) for name, line in scene.document.lines.items()}
    save_exceedance(
        folder / MAP, scene.name, maps, found.exceedance, paths=paths_of(scene, maps), lines=lines
    )
    _save_curves(document, folder / CURVES)
    if has("terrain"):
        for thickness, chance in found.exceedance.items():
            write_raster(chance, folder / raster_name(thickness), origin=scene.origin)
    said = [f"{line[0].upper()}{line[1:]}." for line in doubts(document)]
    sections = [
        page.PageSection(
            "Where it would come to lie",
            [
                *page.shown(
                    folder / MAP,
                    "Plan with the probability that the deposit is thicker than stated",
                    "Dashed: where the soil was as thick before the slide. Probabilities are shown "
                    "where it was thinner; the GeoTIFFs have them everywhere.",
                ),
                *page.tabulated(area_table(document)),
                *page.said(said),
            ],
        ),
        page.PageSection(
            "How far it would run",
            [
                *page.shown(folder / CURVES, "Probability that each runout is exceeded"),
                *page.tabulated(
                    quantity_table(document).without_empty_columns(),
                    exceedance_table(toes_of(document)),
                ),
                *page.said(
                    [
                        f"{len(document['runs'])} simulations, {document['samples']} samples, "
                        f"points every {document['spacing_m']:g} m."
                    ]
                ),
            ],
        ),
        *dam_breach_sections(document, folder),
    ]
    title = f"{document['case'].replace('_', ' ')}: prediction"
    lead = f"Assumed: {strength_words(document)}."
    page.write_page(folder / PAGE, title, sections, lead=lead)
    return folder / PAGE


def doubts(document: dict[str, Any]) -> list[str]:
    """What the numbers do not say by themselves."""
    thin = [
        f"{one['thicker_than_m']:g} m"
        for one in document["inundation"]
        if one["thicker_than_m"] < document["spacing_m"]
    ]
    lines = remarks(document)
    if thin:
        lines.append(
            f"thinner than the spacing of {document['spacing_m']:g} m: {', '.join(thin)}; such a "
            "deposit is scattered points"
        )
    means = {f"{one['name'].replace(' ', '_')}_m3": one["mean"] for one in document["quantities"]}
    back = crossed_to_the_left(means)
    return [*lines, left_words(back)] if back else lines


def raster_name(thickness: float) -> str:
    """File of the exceedance map of a thickness [m]."""
    return f"exceedance_{thickness:g}m.tif"


def area_table(document: dict[str, Any]) -> Table:
    """Area where the soil was thinner before and comes to be thicker, by probability."""
    rows = [
        [
            f"{one['thicker_than_m']:g}",
            f"{one['mean_area_m2']:.0f}",
            *(f"{area:.0f}" for area in one["area_m2"].values()),
        ]
        for one in document["inundation"]
    ]
    shares = document["inundation"][0]["area_m2"]
    header = ["thicker than (m)", "mean area (m²)", *(f"with at least {p} %" for p in shares)]
    return Table(header, rows)


def _save_curves(document: dict[str, Any], path: Path) -> None:
    figure = style.new_figure(3.2, 7.2)
    draw_curves(style.panel(figure, 0.7, 0.55, 6.2, 2.4), document)
    style.save_figure(figure, path)
