"""Is the posterior of a slide that nobody drew calibrated? Twins whose section is hidden.

    python -m benchmarks.studies.hidden_sections [--twins 100] [--part 0 --of 1] [--redo]

A twin has six stated numbers: height, slope, crest, thickness of what liquefied, pool, runout. Its
true section and strength are drawn from its family and its prior and simulated by the material
point method; the error of the survey is added to the toe. Only twins whose measured runout is at
least `LEAST_RUNOUT` heights count, as nobody would call the others flow slides: a choice by what
was measured leaves a calibrated posterior calibrated. Each twin is then a file like that of a user,
its case is made as `flowslide new --dimensions` does and its posterior found as `flowslide
posterior` does, at the spacing of the truth and so without what the cells make of strengths. What
is found is kept twin by twin in `hidden_sections.json`; the study resumes where it stopped.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import ROOT, renew
from geometry.case import load_case
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.engines.run_store import RunStore
from inversion.engines.small_cells import SmallCells
from inversion.new_case.from_dimensions import case_of_dimensions
from inversion.posterior.calibration import Coverage, coverage, rank_of
from inversion.posterior.infer import Inference, at_shares
from inversion.posterior.runs import CaseModel
from inversion.posterior.unknown import varied_case
from inversion.problem.question import UnknownDimension
from mpm_taichi import PHYSICS_VERSION
from pipeline.config import PosteriorSettings
from pipeline.files import read_json, write_json, write_text, yaml_text

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "method" / "posterior.md"
TWINS, SEED = 100, 45
#: Rows of points over the height: coarser than a new case has them, for time.
ROWS = 12.0
#: Heights that a measured runout must exceed, and standard deviation of the survey, in heights.
LEAST_RUNOUT, SURVEY = 0.3, 0.1
SETTINGS = PosteriorSettings(coarse_runs=48, refined_runs=24, live_points=100, draws=400)
NOMINAL = (0.5, 0.8, 0.9)


@dataclass
class SameCells(CaseModel):
    """Runs with the cells of the truth: the size of the cells changes nothing."""

    def cells_at(self, values: np.ndarray) -> SmallCells | None:
        """None."""
        return None


def stated_numbers(random: np.random.Generator) -> dict[str, Any]:
    """What is stated of a twin, but for its runout."""
    height = float(np.exp(random.uniform(np.log(8.0), np.log(60.0))))

    def stated(low: float, high: float, share: float) -> dict[str, float]:
        value = float(f"{random.uniform(low, high):.3g}")
        return {"value": value, "std": float(f"{share * value:.2g}")}

    return {
        "slid_face": "upstream",
        "height_m": stated(height, height, 0.05),
        "slope_h_per_v": stated(1.5, 3.2, 0.1),
        "crest_width_m": stated(0.1 * height, 0.5 * height, 0.1),
        "liquefied_thickness_m": stated(0.25 * height, 0.5 * height, 0.15),
        "pool_m": stated(0.4 * height, 0.9 * height, 0.05),
    }


def model_of(folder: Path, runs: Path) -> tuple[InversionCase, SameCells]:
    """A twin's case without other ways to simulate, and its runs."""
    case = inversion_case(load_case(folder))
    kept = [one for one in case.question.sensitivities if isinstance(one, UnknownDimension)]
    question = case.question.model_copy(update={"sensitivities": kept, "variants": []})
    case = replace(case, question=question)
    return case, SameCells(varied_case(case), RunStore(runs, threads=1))


def made(folder: Path, stated: dict[str, Any], runout: float) -> Path:
    """The case folder of a twin with a runout [m]."""
    shutil.rmtree(folder, ignore_errors=True)
    height = stated["height_m"]["value"]
    toe = {"value": round(runout, 3), "std": round(SURVEY * height, 3)}
    file = folder.with_suffix(".yaml")
    write_text(file, yaml_text({**stated, "runout_m": toe}))
    case_of_dimensions(str(folder), str(file), float(f"{height / ROWS:.3g}"))
    return folder


def truth_of(number: int, runs: Path) -> dict[str, Any]:
    """The first draw of a twin that ran: what is stated, the truth, the measured runout [m]."""
    random = np.random.default_rng([SEED, number])
    while True:
        stated = stated_numbers(random)
        height = stated["height_m"]["value"]
        folder = made(runs / f"truth_{number:03d}", stated, height)
        _, model = model_of(folder, runs / "truths")
        values = at_shares(model.unknowns, random.random((1, len(model.unknowns))))
        noise = SURVEY * height * random.standard_normal()
        measured = float(model.run(values, coarse=False)[0, 0]) + noise
        if measured > LEAST_RUNOUT * height:  # not where the run failed
            return {"stated": stated, "values": values[0].tolist(), "runout_m": round(measured, 3)}


def infer_twin(number: int, runs: Path) -> dict[str, Any]:
    """What is stated, true and found of a twin."""
    truth = truth_of(number, runs)
    folder = made(runs / f"twin_{number:03d}", truth["stated"], truth["runout_m"])
    case, model = model_of(folder, runs / f"runs_{number:03d}")
    found = Inference(model, case.setup.targets, SETTINGS).run()
    shutil.rmtree(runs / f"runs_{number:03d}", ignore_errors=True)
    names = [one.name for one in model.unknowns]
    strengths = np.percentile(found.values[:, 0], (5, 50, 95))
    return {
        "stated": truth["stated"],
        "runout_m": truth["runout_m"],
        "truth": {n: float(f"{v:.5g}") for n, v in zip(names, truth["values"], strict=True)},
        "strength_kpa": [float(f"{value:.4g}") for value in strengths],
        "ranks": {
            n: round(rank_of(value, found.values[:, place]), 5)
            for place, (n, value) in enumerate(zip(names, truth["values"], strict=True))
        },
    }


def collect(runs: Path, twins: int, part: int, of: int) -> list[dict[str, Any]]:
    """Every `of`-th twin from `part`, simulated and inferred where that is not on record yet."""
    for number in range(part, twins, of):
        path = runs / f"twin_{number:03d}.json"
        if not path.is_file():
            write_json(path, infer_twin(number, runs))
            print("twin", number, flush=True)
    return [read_json(path) for path in _done(runs, twins)]


def _done(runs: Path, twins: int) -> Iterator[Path]:
    paths = (runs / f"twin_{number:03d}.json" for number in range(twins))
    return (path for path in paths if path.is_file())


def table(record: dict[str, Any]) -> str:
    """Coverage of the intervals of S_r and of the hidden dimensions as Markdown."""
    twins = record["twins"]
    lines = [
        f"{len(twins)} twins, {record['runs']} runs each. Share of the truths within the central "
        "interval:",
        "",
        f"| unknown | {' | '.join(f'{100 * one:.0f} %' for one in NOMINAL)} |",
        f"|---|{'---|' * len(NOMINAL)}",
    ]
    bands = [f"*{100 * c.low:.0f} to {100 * c.high:.0f} %*" for c in _covered(twins, _first(twins))]
    lines.append(f"| *calibrated: within* | {' | '.join(bands)} |")
    for name in twins[0]["ranks"]:
        cells = [
            f"{100 * one.covered:.0f} %{'' if one.inside else ' (outside)'}"
            for one in _covered(twins, name)
        ]
        label = "residual strength" if name == _first(twins) else name
        lines.append(f"| {label} | {' | '.join(cells)} |")
    widths = [twin["strength_kpa"][2] / twin["strength_kpa"][0] for twin in twins]
    lines += ["", f"Median ratio of the ends of the 90 % interval of S_r: {np.median(widths):.1f}."]
    return "\n".join(lines)


def _first(twins: list[dict[str, Any]]) -> str:
    return next(iter(twins[0]["ranks"]))


def _covered(twins: list[dict[str, Any]], name: str) -> list[Coverage]:
    return coverage(np.array([twin["ranks"][name] for twin in twins]), NOMINAL)


def main() -> None:
    """Run the study; when every twin is done, write record and page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--twins", type=int, default=TWINS)
    parser.add_argument("--part", type=int, default=0, help="every `of`-th twin from this")
    parser.add_argument("--of", type=int, default=1)
    parser.add_argument("--runs", type=Path, default=ROOT / "results/hidden_sections")
    parser.add_argument("--redo", action="store_true", help="forget what is kept of the twins")
    chosen = parser.parse_args()
    if chosen.redo:
        shutil.rmtree(chosen.runs, ignore_errors=True)
    twins = collect(chosen.runs, chosen.twins, chosen.part, chosen.of)
    if len(twins) == chosen.twins:
        runs = SETTINGS.coarse_runs + SETTINGS.refined_runs
        record = {"physics_version": PHYSICS_VERSION, "runs": runs, "twins": twins}
        write_json(RECORD, record)
        renew(PAGE, hidden_sections=table(record))


if __name__ == "__main__":
    main()
