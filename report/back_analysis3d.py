"""The report of a back-analysis on maps: page, map measured against simulated, GeoTIFFs.

The parts that tell of the answer are those of `report.back_analysis`; the section is replaced by
the map.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.survey3d.deposit_edge import DepositEdge
from geometry.survey3d.surface_after import SurfaceAfter
from geometry.terrain.raster import Raster, has_library, write_raster
from inversion.back_analysis.on_ground import AnalysisOnGround
from inversion.back_analysis.result import Result
from mpm_taichi.readings3d import Maps, paths_of
from report import back_analysis, page
from report.data.back_analysis import BackAnalysisData
from report.pictures.ground_map import save_map
from report.pictures.measured_map import save_measured_map
from report.sentences import back_analysis as words

CHANGE, MAP = "change.png", "map.png"
RASTERS = ("thickness_after.tif", "surface_after.tif")


def summary(result: Result, folder: Path) -> str:
    """The answer for a terminal or a log."""
    return back_analysis.summary(BackAnalysisData(folder, result))


def write_report(analysis: AnalysisOnGround, result: Result, folder: Path) -> Path:
    """Write page and pictures, and rasters where the extra `terrain` is installed."""
    data = BackAnalysisData(folder, result)
    sections = back_analysis.sections(data, None)
    sections.insert(1, _map(analysis, folder))
    lead = f"{words.answer_sentence(data)} {words.misfit_sentence(data)}"
    title = f"{result.title}: back-analysis from a map"
    page.write_page(folder / back_analysis.PAGE, title, sections, lead=lead)
    return folder / back_analysis.PAGE


def _map(analysis: AnalysisOnGround, folder: Path) -> page.Section:
    """The run of the answer in plan, next to what was measured."""
    setup, values = analysis.case.setup, analysis.found.values
    kept = analysis.engine_of().kept_maps(setup.at(values))
    deposit, scene = setup.deposit_map(values, kept), setup.scene
    entries = setup.targets.entries
    surfaces = [one.raster for one in entries if isinstance(one, SurfaceAfter)]
    measured = surfaces[0] if surfaces else None
    lines = {name: np.asarray(line) for name, line in scene.document.lines.items()}
    maps = Maps(deposit.base, deposit.before, deposit.after, None, deposit.least)
    save_measured_map(
        folder / CHANGE, scene.name, deposit, measured=measured, lines=lines,
        edges={one.name: np.asarray(one.edge) for one in entries if isinstance(one, DepositEdge)},
    )  # fmt: skip
    level = None if scene.section is not None else scene.soil.water_level
    save_map(
        folder / MAP, scene.name, maps, paths=paths_of(scene, maps), lines=lines,
        water_level=level, measured=measured,
    )  # fmt: skip
    if has_library():
        rasters: tuple[Raster, ...] = (deposit.after, maps.surface)
        for name, raster in zip(RASTERS, rasters, strict=True):
            write_raster(raster, folder / name, origin=scene.origin)
    walls = ", ".join(kept.walls)
    return page.Section(
        "The map, measured and simulated",
        [
            *page.shown(
                folder / CHANGE,
                "Plans of the change of the surface: measured, simulated, and the difference",
                "Blue sank, red rose. Blue line: edge of the simulated deposit, dashed before the "
                "slide; orange: edge as measured.",
            ),
            *page.shown(
                folder / MAP,
                "Plan with the thickness of the simulated deposit, and sections along the paths",
            ),
            *page.said([f"Soil reached the wall at {walls}: the domain is too small."]
                       if walls else []),
        ],
    )  # fmt: skip
