"""The report of a back-analysis on maps: page, map measured against simulated, GeoTIFFs.

The page is that of `report.back_analysis`, which shows the maps in place of the section.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.survey3d.deposit_edge import DepositEdge
from geometry.survey3d.surface_after import SurfaceAfter
from geometry.terrain.raster import write_raster
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.result import Result
from inversion.engines.body_engine import BodyStore
from inversion.engines.body_setup import BodySetup
from mpm_taichi.readings3d import Maps, paths_of
from pipeline.extras import has
from report import back_analysis
from report.data.back_analysis import BackAnalysisData
from report.pictures.body_map import save_map
from report.pictures.measured_map import save_measured_map

RASTERS = ("thickness_after.tif", "surface_after.tif")


def write_report(analysis: BackAnalysis, result: Result, folder: Path) -> Path:
    """Write page and pictures, and rasters where the extra `terrain` is installed."""
    draw_maps(analysis, folder)
    return back_analysis.write_report(BackAnalysisData(folder, result), film=False)


def draw_maps(analysis: BackAnalysis, folder: Path) -> None:
    """The run of the answer in plan, next to what was measured: two pictures, and GeoTIFFs."""
    setup, values, store = analysis.case.setup, analysis.found.values, analysis.store
    assert isinstance(setup, BodySetup) and isinstance(store, BodyStore)
    deposit, scene = setup.deposit_map(values, store.fetch(setup, values)), setup.scene
    entries = setup.targets.entries
    surfaces = [one.raster for one in entries if isinstance(one, SurfaceAfter)]
    measured = surfaces[0] if surfaces else None
    lines = {name: np.asarray(line) for name, line in scene.document.lines.items()}
    maps = Maps(deposit.base, deposit.before, deposit.after, None, deposit.least)
    save_measured_map(
        folder / back_analysis.CHANGE_PICTURE,
        scene.name,
        deposit,
        measured=measured,
        lines=lines,
        edges={one.name: one.places for one in entries if isinstance(one, DepositEdge)},
    )
    save_map(
        folder / back_analysis.MAP_PICTURE,
        scene.name,
        maps,
        paths=paths_of(scene, maps),
        lines=lines,
        water_level=scene.soil.water_level,
        measured=measured,
    )
    if has("terrain"):
        for name, raster in zip(RASTERS, (deposit.after, maps.surface), strict=True):
            write_raster(raster, folder / name, origin=scene.origin)
