"""Twelve ordinary slides, from the drawing to the strength, with hand checks beside the answer.

    python -m benchmarks.studies.gallery [NAMES ...] [--page]

Each drawing of `docs/examples/gallery` slides with the S_r that it has, its points 0.4 times as far
apart as asked and jittered; the toe that ran farther is surveyed to 5 %. `flowslide new` and
`flowslide invert --quick` then know the drawing, a first guess twice as strong, and that runout.

What is done lies in `results/benchmarks/gallery`, so that a study that was stopped resumes; figures
are kept in `gallery.json` and shown on `docs/how-to/gallery.md`, which `--page` alone renews.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.generated_pages import ROOT, renew, table
from flowslide import back_analyse
from geometry.case import load_case
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.scene import Scene
from geometry.sides import Side
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.new_case.make_case import Given, make_case
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.prediction_case import prediction_case
from pipeline.config import load_config
from pipeline.files import read_json, read_text, write_json, write_text
from pipeline.random_numbers import number_of
from report.pictures.scene import save_gallery

DRAWINGS = ROOT / "docs/examples/gallery"
FOLDER = ROOT / "results/benchmarks/gallery"
RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs/how-to/gallery.md"
PICTURE = ROOT / "docs/images/gallery.png"
#: Distance of the points of the question [m]: four of them or more in what has liquefied.
SPACINGS = {
    "embankment_on_foundation": 0.5, "hydraulic_fill_with_core": 1.0, "levee_thin_sand": 0.25,
    "natural_slope": 0.5, "quay": 0.6, "railway_on_loose_sand": 0.4, "river_bank_under_water": 0.7,
    "road_on_peat_and_sand": 0.5, "stockpile": 0.375, "tailings_downstream": 0.6,
    "tailings_upstream": 1.0, "three_zone_dam_feet": 0.7,
}  # fmt: skip
FINER, SURVEY = 0.4, 0.05
#: Of the first guess over the truth, which the back-analysis is not told.
GUESS = 2.0

Record = dict[str, Any]


def unit_of(name: str) -> str | None:
    """Unit of a drawing; None: metres."""
    return "ft" if name.endswith("_feet") else None


def toes(name: str, known: KnownStrength) -> dict[Side, float]:
    """How far each toe runs with the S_r of the drawing, on points closer than the question's."""
    folder = FOLDER / "slides" / name
    if not folder.is_dir():
        section = str(DRAWINGS / f"{name}.csv")
        make_case(str(folder), Given(section=section, unit=unit_of(name)))
    slide = prediction_case(
        load_case(folder, load_config(None)), spacing_m=round(FINER * SPACINGS[name], 4)
    )
    placed = replace(known, zones=tuple(slide.default_zones))
    setup = slide.setup([placed], jitter_seed=1 + number_of(name) % 2**31)
    (found,) = MPMEngine(RunStore(FOLDER / "runs")).predict([setup.at(setup.parameters.start)])
    return {
        entry.toe_side: float(value)
        for entry, value in zip(slide.entries, found.values, strict=True)
        if entry.toe_side
    }


def solved(name: str) -> Record:
    """One slide: what was measured, what is found."""
    path = FOLDER / f"{name}.json"
    if path.is_file():
        return read_json(path)
    properties = read_section(DRAWINGS / f"{name}.csv").properties.values()
    soil = next(one for one in properties if one.get("liquefied"))
    strength, density = soil["cohesion_kpa"], soil["density"]
    far = toes(name, KnownStrength((), strength, strength, "lognormal"))
    side = max(far, key=lambda one: far[one])
    # The drawing with another first guess, as somebody has it who does not know the answer.
    text = read_text(DRAWINGS / f"{name}.csv")
    guess = f",0,{strength:g},{density:g},true"
    section = FOLDER / "drawings" / f"{name}.csv"
    write_text(section, text.replace(guess, guess.replace(
        f",{strength:g},", f",{GUESS * strength:g},")))  # fmt: skip
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
        "true_kpa": strength,
        "side": side,
        "runout_m": round(far[side], 2),
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


def drawn(name: str) -> Scene:
    """The section of a drawing."""
    section = read_section(DRAWINGS / f"{name}.csv")
    unit, spacing = unit_of(name), SPACINGS[name]
    return section_scene(section, source=f"{name}.csv", name=name, unit=unit, spacing=spacing)


def page(records: dict[str, Record]) -> None:
    """Renew the table on the page, and its picture."""
    save_gallery([drawn(name) for name in records], PICTURE, columns=3)
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
