"""Twelve ordinary slides, from the drawing to the strength, with hand checks beside the answer.

    python -m benchmarks.studies.gallery [NAMES ...] [--page]

Each drawing of `docs/examples/gallery` slides with the S_r that it has, its points 0.7 times as far
apart as asked and jittered; the toe that ran farther is surveyed to 5 %. `flowslide new` and
`flowslide invert --quick` then know the drawing, a first guess twice as strong, and that runout.

What is done lies in `results/benchmarks/gallery`, so that a study that was stopped resumes; figures
are kept in `gallery.json` and shown on `docs/how-to/gallery.md`, which `--page` alone renews.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.back_analysis.twin_cases import runout
from benchmarks.generated_pages import ROOT, renew, table
from flowslide import back_analyse
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from inversion.engines.run_store import RunStore
from inversion.new_case.make_case import Given, make_case
from pipeline.config import load_config
from pipeline.files import read_json, read_text, write_json, write_text
from pipeline.random_numbers import Stream, number_of

DRAWINGS = ROOT / "docs/examples/gallery"
FOLDER = ROOT / "results/benchmarks/gallery"
RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs/how-to/gallery.md"
#: Distance of the points [m]: four of them or more in the thickness of what has liquefied.
SPACINGS = {
    "embankment_on_foundation": 0.5, "hydraulic_fill_with_core": 1.0, "levee_thin_sand": 0.375,
    "natural_slope": 0.5, "quay": 0.6, "railway_on_loose_sand": 0.4, "river_bank_under_water": 0.7,
    "road_on_peat_and_sand": 0.5, "stockpile": 0.375, "tailings_downstream": 1.0,
    "tailings_upstream": 1.0, "three_zone_dam_feet": 0.7,
}  # fmt: skip
FINER, JITTER, SURVEY = 0.7, 0.5, 0.05
#: Of the first guess over the truth, which the back-analysis is not told.
GUESS = 2.0

Record = dict[str, Any]


def unit_of(name: str) -> str | None:
    """Unit of a drawing; None: metres."""
    return "ft" if name.endswith("_feet") else None


def drawn(name: str) -> Scene:
    """The slide as it was: the drawing, with points closer together than the question's."""
    path = DRAWINGS / f"{name}.csv"
    scene = section_scene(
        read_section(path),
        source=path.name,
        name=name,
        spacing=round(FINER * SPACINGS[name], 4),
        unit=unit_of(name),
    )
    return scene.changed(jitter=JITTER, seed=Stream(number_of(name)).seed() % 2**31)


def solved(name: str) -> Record:
    """One slide: what was measured, what is found."""
    path = FOLDER / f"{name}.json"
    if path.is_file():
        return read_json(path)
    slide = drawn(name)
    soil = next(one for one in slide.materials.values() if one.liquefied)
    (run,) = RunStore(FOLDER / "slides").fetch([(slide, load_config(None).simulation)])
    far = {side: runout(slide, run, side) for side in SIDES if not _hidden(slide, side)}
    side = max(far, key=lambda one: far[one])
    # The drawing with another first guess, as somebody has it who does not know the answer.
    text = read_text(DRAWINGS / f"{name}.csv")
    guess = f",0,{soil.cohesion_kpa:g},{soil.density:g},true"
    section = FOLDER / "drawings" / f"{name}.csv"
    write_text(section, text.replace(guess, guess.replace(
        f",{soil.cohesion_kpa:g},", f",{GUESS * soil.cohesion_kpa:g},")))  # fmt: skip
    case = FOLDER / "cases" / name
    if not case.is_dir():
        make_case(
            str(case),
            Given(
                section=str(section),
                unit=unit_of(name),
                spacing_m=SPACINGS[name],
                runouts=[f"{side}={far[side]:.2f}+-{max(SURVEY * far[side], 0.2):.2f}"],
                upstream=side,
            ),
        )
    result = back_analyse(case, quick=True, out=FOLDER / "answers" / name)
    (p,) = result.answer.parameters
    record = {
        "true_kpa": soil.cohesion_kpa,
        "side": side,
        "runout_m": round(far[side], 2),
        "at_rest": run.at_rest,
        "spacing_m": SPACINGS[name],
        "found_kpa": round(p.value, 3),
        "std_kpa": round(p.std_total, 3),
        "ratio": p.ratio and round(p.ratio, 4),
        "reached": result.answer.reached,
        "words": result.answer.words,
        "factor": result.answer.small_cells and result.answer.small_cells.factor,
        "checks": [one.model_dump() for one in result.hand_checks],
        "runs": result.runs,
    }
    write_json(path, record)
    return record


def _hidden(scene: Scene, side: Any) -> bool:
    """No toe can be measured on a side: the ground goes on there, and nothing stands on it."""
    return scene.domain.goes_on(side) and not scene.front_zones(side)


def page(records: dict[str, Record]) -> None:
    """Renew the table on the page."""
    rows = []
    for name, one in records.items():
        stability = next((c for c in one["checks"] if c["name"] == "stability"), None)
        ratio = "" if one["ratio"] is None else f"{one['ratio']:.3f}"
        rows.append(
            [
                f"[{name.replace('_', ' ')}](../examples/gallery/{name}.csv)",
                f"{one['runout_m']:.1f} m {one['side']}",
                f"{one['true_kpa']:g}",
                f"{one['found_kpa']:.1f} ± {one['std_kpa']:.1f}"
                + ("" if one["reached"] else ", not fitted"),
                ratio,
                "" if stability is None else f"{stability['value']:.2f}",
            ]
        )
    head = ["slide", "toe ran", "S_r, kPa", "found, kPa", "S_r/σ'_v0", "factor of safety before"]
    renew(PAGE, gallery=table(head, rows))


def main() -> None:
    """The study."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.gallery", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("names", nargs="*", help="of drawings; default: all of them")
    parser.add_argument("--page", action="store_true", help="renew the page from the record alone")
    asked = parser.parse_args()
    if not asked.page:
        for name in asked.names or SPACINGS:
            one = solved(name)
            print(f"{name}: {one['found_kpa']:g} for {one['true_kpa']:g} kPa", flush=True)
        if not asked.names:
            write_json(RECORD, {name: solved(name) for name in SPACINGS})
    if not asked.names:
        page(read_json(RECORD))


if __name__ == "__main__":
    main()
