"""How well does a back-analysis find a strength whose slide was made with far smaller cells?

    python -m benchmarks.studies.small_cells [--far] [--twins N] [--page]

Random free-standing dams of 8 to 29 m, a fourth of them with a pool: an embankment of which a lower
layer or one shell has liquefied. Each is simulated with points H/60 apart, H its height, and the
toe surveyed with an error of 5 % of the runout; then `flowslide invert --quick` is asked for the
strength, with points H/20 apart. Errors of a survey are quantiles of the normal distribution in a
random order, so that they cancel in the mean. Twins whose toe hardly notices the strength, or runs
beyond 2.5 H already with points H/20 apart, are drawn again. `--far` asks for weaker dams instead,
whose toes run 4 to 12 H.

What is done lies in `results/benchmarks/small_cells`, a file a twin, so that a study that was
stopped resumes; the figures are kept in `small_cells.json` and shown on
`docs/method/inversion.md`, which `--page` alone renews.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtri

from benchmarks.back_analysis.twin_cases import height_of, runout
from benchmarks.generated_pages import ROOT, renew, table
from flowslide import back_analyse
from geometry.scenes.scene import Scene, save_scene, scene_from_mapping
from geometry.sides import SIDES, Side
from inversion.engines.run_store import RunStore
from inversion.engines.small_cells import ORDER
from inversion.problem.scene_changes import with_properties
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import read_json, write_json, write_text, yaml_text
from pipeline.random_numbers import Stream

FOLDER = ROOT / "results/benchmarks/small_cells"
RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs/method/inversion.md"
#: Heights [m]; crest and slopes over the height; density [kg/m3]; share with a pool.
HEIGHTS, CREST, SLOPE, DENSITY = (8.0, 29.0), (0.2, 1.0), (1.5, 3.0), (1700.0, 2100.0)
POOL_SHARE = 0.25
LIQUEFIED = "liquefied"
#: Points of the slide and of the back-analysis in a height; jitter of the slide's.
FINE, ASKED, JITTER = 60.0, 20.0, 0.5
#: Standard deviation of the survey over the runout; least change of it with 30 % more strength, in
#: heights.
SURVEY, LEAST_EFFECT, STRONGER = 0.05, 0.1, 1.3

Record = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """Which dams are asked for.

    Attributes:
        name: of the record, of its table and of the folder.
        twins: how many there are.
        seed: of the random numbers.
        residual: S_r over rho g H.
        runout: least and largest, in heights.
        room: of the domain beyond the feet, in heights.
    """

    name: str
    twins: int
    seed: int
    residual: tuple[float, float]
    runout: tuple[float, float]
    room: float

    @property
    def folder(self) -> Path:
        """Of what is done."""
        return FOLDER if self is NEAR else FOLDER / self.name


NEAR = Kind("small_cells", 60, 42_600, (0.03, 0.12), (0.3, 2.5), 10.0)
FAR = Kind("far_flows", 40, 43_600, (0.003, 0.04), (4.0, 12.0), 30.0)


def drawn(kind: Kind, stream: Stream) -> tuple[Scene, float]:
    """A dam with points H/20 apart, and S_r of its zone `LIQUEFIED` [kPa]."""
    height = stream.uniform(*HEIGHTS)
    crest, left, right = (stream.uniform(*ends) * height for ends in (CREST, SLOPE, SLOPE))
    outer = [(0.0, 0.0), (left, height), (left + crest, height), (left + crest + right, 0.0)]
    if stream.unit() < 0.5:
        level = stream.uniform(0.3, 0.6)
        inner = [(level * left, level * height), (outer[3][0] - level * right, level * height)]
        liquefied, rest = [outer[0], *inner, outer[3]], [inner[0], *outer[1:3], inner[1]]
    else:
        foot = (left + stream.uniform(0.2, 0.8) * crest, 0.0)
        head = (foot[0], height)
        liquefied, rest = [outer[0], outer[1], head, foot], [foot, head, *outer[2:]]
    density = stream.uniform(*DENSITY)
    strength = stream.uniform(*kind.residual) * density * 9.81e-3 * height
    soils = {
        LIQUEFIED: {"cohesion_kpa": round(strength, 3), "friction_deg": 0.0, "liquefied": True},
        "fill": {"cohesion_kpa": 5.0, "friction_deg": round(stream.uniform(30.0, 38.0), 1)},
    }
    common = {"density": round(density), "youngs_modulus_mpa": 20.0, "poisson_ratio": 0.3}
    room = kind.room * height
    document = {
        "name": "dam",
        "domain": {"x_min": -room, "x_max": outer[3][0] + room, "y_max": 3.0 * height},
        "ground": {"points": [(-room, 0.0), (outer[3][0] + room, 0.0)], "contact": "rough"},
        "zones": [
            {"name": name, "polygon": polygon, "material": name}
            for name, polygon in ((LIQUEFIED, liquefied), ("fill", rest))
        ],
        "materials": {name: {**common, **soil} for name, soil in soils.items()},
        "spacing": round(height / ASKED, 4),
    }
    if stream.unit() < POOL_SHARE:
        document["water_level"] = round(stream.uniform(0.3, 0.8) * height, 2)
    return scene_from_mapping(document, "a twin"), strength


def truth_of(kind: Kind, number: int, store: RunStore) -> tuple[Scene, float, Side, float]:
    """A dam at the spacing of the question, S_r [kPa], side and runout [m] of its slide.

    Raises:
        InputError: no dam in a hundred makes a question.
    """
    settings = load_config(None).simulation
    for attempt in range(100):
        stream = Stream(kind.seed, number, attempt)
        asked, strength = drawn(kind, stream)
        height = height_of(asked)
        fine = asked.changed(
            spacing=round(height / FINE, 4), jitter=JITTER, seed=stream.seed() % 2**31
        )
        stronger = with_properties(asked, [(LIQUEFIED, "cohesion_kpa", STRONGER * strength)])
        runs = store.fetch([(scene, settings) for scene in (asked, stronger)])
        if any(run.status == "failed" or not run.at_rest for run in runs):
            continue
        for side in SIDES:
            here, there = (runout(asked, run, side) for run in runs)
            far_enough = kind.runout[0] * height <= here <= kind.runout[1] * height
            if not far_enough or here - there < LEAST_EFFECT * height:
                continue
            (slide,) = store.fetch([(fine, settings)])
            if slide.status == "failed" or not slide.at_rest:
                break
            return asked, strength, side, runout(fine, slide, side)
    raise InputError(f"twin {number}: no dam makes a question")


def write_case(folder: Path, kind: Kind, number: int, twins: int, store: RunStore) -> Record:
    """The case folder of a twin; what is true of it."""
    scene, strength, side, far = truth_of(kind, number, store)
    order = np.random.default_rng(kind.seed).permutation(twins)
    error = float(ndtri((order[number] + 0.5) / twins))
    toe = far * (1.0 + SURVEY * error)
    first = 0.8 * float(np.mean(kind.residual)) * 2000.0 * 9.81e-3 * height_of(scene)
    folder.mkdir(parents=True, exist_ok=True)
    save_scene(
        with_properties(scene, [(LIQUEFIED, "cohesion_kpa", first)]),
        folder / "scene.yaml",
    )
    entry = {
        "name": "toe", "type": "toe_runout", "side": side, "value_m": round(toe, 4),
        "std_m": round(SURVEY * far, 4), "std_is": "assumed", "confidence": "assumed",
        "source": "simulated, with an error",
    }  # fmt: skip
    measured = {
        "case": folder.name, "upstream": side, "initial": {}, "default_set": "survey",
        "sets": {"survey": [entry]},
    }  # fmt: skip
    unknown = {
        "name": "residual_strength", "zones": [LIQUEFIED], "property": "residual_strength_kpa",
        "start": first, "low": first / 20.0, "high": 20.0 * first,
    }  # fmt: skip
    for name, document in (("measurements", measured), ("inversion", {"parameters": [unknown]})):
        write_text(folder / f"{name}.yaml", yaml_text(document, allow_unicode=True))
    return {"height_m": height_of(scene), "true_kpa": strength, "runout_m": far}


def judged(kind: Kind, number: int, twins: int) -> Record:
    """One twin: what is true and what is found, kept in a file."""
    path = kind.folder / f"twin_{number:03d}.json"
    record: Record = read_json(path) if path.is_file() else {}
    case = kind.folder / "cases" / f"twin_{number:03d}"
    if "true_kpa" not in record:
        with_runs = RunStore(kind.folder / "truths", threads=1)
        record = write_case(case, kind, number, twins, with_runs)
        write_json(path, record)
    if "found_kpa" not in record:
        result = back_analyse(case, quick=True, out=kind.folder / "answers" / case.name, threads=1)
        (p,) = result.answer.parameters
        cells = result.answer.small_cells
        record.update(
            found_kpa=p.value, ran_kpa=p.as_run, std_kpa=p.std_total, interval=p.interval_95,
            other_spacing=cells and cells.other_spacing_m and cells.other_spacing_m
            / cells.spacing_m, log_std=cells and cells.log_std, reached=result.answer.reached,
            runs=result.runs, runs_to_answer=result.runs_to_answer, words=result.answer.words,
        )  # fmt: skip
        write_json(path, record)
    return record


def figures(records: list[Record]) -> Record:
    """What the table shows."""
    true = np.array([one["true_kpa"] for one in records])
    found = np.array([one["found_kpa"] for one in records])
    ran = np.array([one["ran_kpa"] for one in records])
    ends = np.array([one["interval"] for one in records])
    cells = np.array([one["log_std"] for one in records])
    std = np.sqrt(
        np.maximum((np.array([one["std_kpa"] for one in records]) / found) ** 2 - cells**2, 0.0)
    )
    rows = {}
    # The slides have cells too, a third as large, and so needed a strength that is too low.
    limit = true * (found / ran) ** (ASKED / FINE) ** ORDER
    for name, values, truth, covered in (
        ("as the runs have it", ran, true, np.abs(np.log(ran / true)) <= 1.96 * std),
        ("in small cells", found, true, (ends[:, 0] <= true) & (true <= ends[:, 1])),
        (
            "the same, of the slide in small cells",
            found,
            limit,
            (ends[:, 0] <= limit) & (limit <= ends[:, 1]),
        ),
    ):
        off = values / truth - 1.0
        rows[name] = {
            "mean": float(off.mean()),
            "median": float(np.median(off)),
            "scatter": float(np.median(np.abs(off - np.median(off))) * 1.4826),
            "within_95": float(covered.mean()),
        }
    return {
        "twins": len(records),
        "rows": rows,
        "not_fitted": sum(not one["reached"] for one in records),
        "runs_to_answer": float(np.median([one["runs_to_answer"] for one in records])),
        "unknown": sum(one["other_spacing"] is None for one in records),
    }


def page(found: Record) -> None:
    """Renew the tables on the page."""
    head = ["S_r", "mean error", "median error", "scatter", "truth in the 95 % interval"]
    renew(PAGE, **{name: table(head, rows_of(one)) for name, one in found.items()})


def rows_of(found: Record) -> list[list[str]]:
    """Rows of the table of one kind."""
    return [
        [
            name,
            *(f"{100 * row[key]:+.1f} %" for key in ("mean", "median")),
            f"{100 * row['scatter']:.1f} %",
            f"{100 * row['within_95']:.0f} %",
        ]
        for name, row in found["rows"].items()
    ]


def main() -> None:
    """The study."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.small_cells", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--far", action="store_true", help="dams that run 4 to 12 heights")
    parser.add_argument("--twins", type=int, help="how many; default 60, of those that run far 40")
    parser.add_argument("--page", action="store_true", help="renew the page from the record alone")
    asked = parser.parse_args()
    kept: Record = read_json(RECORD)
    if not asked.page:
        kind, records = FAR if asked.far else NEAR, []
        twins = asked.twins or kind.twins
        for number in range(twins):
            records.append(one := judged(kind, number, twins))
            off = 100 * (one["found_kpa"] / one["true_kpa"] - 1.0)
            print(f"twin {number + 1} of {twins}: {off:+.1f} %", flush=True)
        kept[kind.name] = figures(records)
        write_json(RECORD, kept)
    page(kept)


if __name__ == "__main__":
    main()
