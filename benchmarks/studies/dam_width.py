"""Lower San Fernando over the width of its slide, against plane strain.

    python -m benchmarks.studies.dam_width [--spacing 3] [--page]

The published section is back-analysed from its toe in plane strain, over the published width of
550 m and over narrower ones, between flanks that hold the soil by its own strength; all else is the
same: spacing, closed walls, the water level where it was. Each is read at its own S_r and at that
of plane strain.

The *edge* is the place farthest from the reservoir whose surface sank by more than 1 m, as a
distance behind the middle of the old crest; the *scarp* is how far the surface falls from there
over the next 30 m towards the reservoir. Both are read on the middle section.

Runs are kept in `results/benchmarks/dam_width`, so a study that was stopped resumes; what is found
is kept in `dam_width.json` and shown on `docs/how-to/three-dimensions.md`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from flowslide.api import with_choices
from geometry.case import load_case
from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import read_document
from geometry.survey.columns import column_height, kernel_length
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.back_analysis.in_three_dimensions import AnalysisIn3d
from inversion.engines.run_store import KeptRun, RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.estimation.unknowns import Parameters
from pipeline.config import load_config
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs/how-to/three-dimensions.md"
FOLDER = ROOT / "results/benchmarks/dam_width"
CASE = ROOT / "case_histories/lower_san_fernando"
CREST_X = 190.0
PLANE, WIDTHS = "plane strain", (550.0, 150.0, 86.0)
#: Fall of the surface that is seen [m]; way over which a scarp falls [m].
SEEN, WAY = 1.0, 30.0
#: A level that slopes stays where it was in three dimensions; a run is dear, so there are no seeds.
SETTINGS = ("simulation.water_face=fixed", "inversion.step_seeds=0")

READ = ("upstream toe", "freeboard", "crest", "edge", "scarp")

Record = dict[str, Any]


def analysis_of(case: InversionCase, width: float | None) -> BackAnalysis:
    """The back-analysis over a width; None: in plane strain, between the same walls."""
    document = read_document(CASE / "scene3d.yaml")
    assert document.section is not None
    section = document.section.model_copy(update={"width_m": width or 1.0})
    solid = RunStore3d(section, document.flanks, FOLDER, threads=1)
    if width is not None:
        return AnalysisIn3d(case, solid, say=print)
    walled = case.setup.with_scene(solid.walled(case.scene))
    return BackAnalysis(replace(case, setup=walled), RunStore(FOLDER, threads=1), say=print)


def scarp(scene: Scene, run: KeptRun) -> tuple[float, float]:
    """Distance of the edge behind the crest [m], and height of the scarp below it [m]."""
    x = np.arange(scene.foot("left"), scene.foot("right"), 0.25)
    length = kernel_length(scene.spacing)
    volume = scene.spacing**2 if run.volume is None else run.volume
    before = column_height(run.initial, scene.spacing**2, x, length=length)
    after = column_height(run.final, volume, x, length=length)
    edge = x[np.flatnonzero(before - after > SEEN)[-1]]
    ends = column_height(run.final, volume, np.array([edge, edge - WAY]), length=length)
    return float(edge - CREST_X), float(ends[0] - ends[1])


def read(analysis: BackAnalysis, values: np.ndarray) -> Record:
    """All readings at a strength (1,) [kPa]."""
    request = analysis.case.setup.at(values)
    prediction = analysis.engine.predict([request])[0]
    run = analysis.store.fetch([(request.scene, analysis.case.setup.settings)])[0]
    edge, height = scarp(analysis.case.scene, run)
    named = analysis.objective.targets.named(prediction.values)
    return {"strength_kpa": float(values[0]), **named, "edge": edge, "scarp": height}


def solve(spacing: float) -> Record:
    """Plane strain and all widths, at a spacing [m]."""
    config = load_config(None, list(SETTINGS))
    case = inversion_case(with_choices(load_case(CASE, config), None, True), spacing_m=spacing)
    found: Record = {}
    for width in (None, *WIDTHS):
        print(f"{width or PLANE} at {spacing:g} m", flush=True)
        analysis = analysis_of(case if width is None else from_plane(case, found), width)
        analysis.search()
        assert analysis.found is not None and analysis.spread is not None
        values = analysis.found.values
        found[PLANE if width is None else f"{width:g}"] = {
            "std_kpa": float(analysis.spread.std[0]),
            "own": read(analysis, values),
            "same": read(analysis, np.array([found[PLANE]["own"]["strength_kpa"]]))
            if width else None,
            "points": len(analysis.store.fetch([(analysis.case.setup.at(values).scene,
                                                 analysis.case.setup.settings)])[0].zone)
            * (round(width / spacing) if width else 1),
        }  # fmt: skip
        keep(spacing, found)
    return found


def from_plane(case: InversionCase, found: Record) -> InversionCase:
    """The case with the answer of plane strain as first guess."""
    (spec,) = case.question.parameters
    start = spec.model_copy(update={"start": found[PLANE]["own"]["strength_kpa"]})
    return replace(case, setup=replace(case.setup, parameters=Parameters([start])))


def keep(spacing: float, found: Record) -> None:
    """Keep what is done."""
    record = read_json(RECORD) if RECORD.is_file() else {}
    record[f"{spacing:g}"] = {"code_version": code_version(), "found": found}
    write_json(RECORD, record)


def page(record: Record) -> str:
    """The table of the page."""
    measured = {m.name: f"{m.values[0]:g} ± {m.std:g}" for m in load_case(CASE).measured}
    rows = [["", "measured", "", *(measured.get(name, "-") for name in READ)]]
    for spacing, one in sorted(record.items(), key=lambda pair: -float(pair[0])):
        for width, found in one["found"].items():
            own = found["own"]
            for words, readings in (("", own), ("at the plane S_r", found["same"])):
                if readings is None or (words and readings == own):
                    continue
                strength = (
                    f"{own['strength_kpa']:.1f} ± {found['std_kpa']:.1f}" if not words
                    else f"{readings['strength_kpa']:.1f}"
                )  # fmt: skip
                rows.append([
                    spacing, width if width == PLANE else f"{width} m", strength,
                    *(f"{readings[name]:.1f}" for name in READ),
                ])  # fmt: skip
    header = [
        "spacing (m)", "width", "S_r (kPa)", "toe (m)", "freeboard (m)", "drop of the crest (m)",
        "edge behind the crest (m)", "scarp (m)",
    ]  # fmt: skip
    return table(header, rows)


def main() -> None:
    """Solve, keep, and renew the page."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.dam_width", description=__doc__
    )
    parser.add_argument("--spacing", type=float, default=3.0, help="between points [m]")
    parser.add_argument("--page", action="store_true", help="renew the page from what is kept")
    options = parser.parse_args()
    if not options.page:
        solve(options.spacing)
    renew(PAGE, widths=page(read_json(RECORD)))


if __name__ == "__main__":
    main()
