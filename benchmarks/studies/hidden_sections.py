"""Is the answer of a slide that nobody drew calibrated? Twins whose section is hidden.

    python -m benchmarks.studies.hidden_sections [--twins 100] [--redo]

Each twin is 20 m high (larger and smaller ones are the same slides at another scale) and has six
stated numbers: height, slope, crest, thickness of what liquefied, pool, runout. Its true section
and strength are drawn from its family and from the prior of S_r, simulated by the material point
method, and the error of the survey is added to the toe. Only twins whose measured runout is at
least `LEAST_RUNOUT_M` count, as nobody would call the others flow slides: a choice by what was
measured leaves a calibrated answer calibrated. The posterior has the priors, the likelihood and the
emulator of `flowslide posterior`; the emulator rests on runs over a family that holds all of the
twins', and weights of prior draws stand for the nested sampler, as there is one number to fit.
What is simulated is kept in `hidden_sections.json`; the study resumes where it stopped.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import ROOT, renew
from benchmarks.studies.posterior_calibration import coverage_rows
from geometry.case import load_case
from geometry.dimensions.family import SectionFamily
from geometry.dimensions.stated import SlideDimensions
from inversion.back_analysis.case import inversion_case
from inversion.engines.run_store import RunStore
from inversion.new_case.from_dimensions import case_of_dimensions
from inversion.posterior.calibration import Coverage, coverage, rank_of
from inversion.posterior.emulator import Emulator, Warp, make_emulator
from inversion.posterior.infer import at_shares, design
from inversion.posterior.runs import CaseModel
from inversion.posterior.sampling import resampled
from inversion.posterior.varied_case import unknown_dimension, varied_case
from inversion.problem.unknown import Unknown
from mpm_taichi import PHYSICS_VERSION
from pipeline.files import read_json, write_json, write_text, yaml_text

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "method" / "posterior.md"
TWINS, DESIGN, SEED = 100, 512, 45
HEIGHT_M, SPACING_M = 20.0, 1.6
#: Runouts that count, and standard deviation of the survey.
LEAST_RUNOUT_M, SURVEY_M = 6.0, 2.0
#: The stated numbers of a twin lie between these, with standard deviations of such a share.
STATED = {
    "slope_h_per_v": (1.5, 3.2, 0.1),
    "crest_width_m": (2.0, 10.0, 0.1),
    "liquefied_thickness_m": (5.0, 10.0, 0.15),
    "pool_m": (8.0, 18.0, 0.05),
}
HEIGHT_SHARE = 0.05
NOMINAL = (0.5, 0.8, 0.9)
PRIOR_DRAWS, DRAWS = 2**13, 2000
#: Runs between two savings.
SAVED_EVERY = 32


def family_of_all() -> dict[str, Any]:
    """What is stated of a slide whose family holds those of all twins: ranges."""
    ranges = {
        key: {"low": low * np.exp(-3.0 * share), "high": high * np.exp(3.0 * share)}
        for key, (low, high, share) in STATED.items()
    }
    ranges["liquefied_thickness_m"]["high"] = ranges["pool_m"]["high"] = 0.98 * HEIGHT_M
    return {**_height(), **ranges, "runout_m": {"value": HEIGHT_M, "std": SURVEY_M}}


def _height() -> dict[str, Any]:
    height = {"value": HEIGHT_M, "std": HEIGHT_SHARE * HEIGHT_M}
    return {"slid_face": "upstream", "height_m": height}


def model_of_all(runs: Path) -> CaseModel:
    """Runs over the family that holds all of the twins'."""
    folder, file = runs / "all_twins", runs / "all_twins.yaml"
    shutil.rmtree(folder, ignore_errors=True)
    write_text(file, yaml_text(_plain(family_of_all())))
    case_of_dimensions(str(folder), str(file), SPACING_M)
    return CaseModel(varied_case(inversion_case(load_case(folder))), RunStore(runs, threads=1))


def twin(number: int, model: CaseModel) -> tuple[dict[str, Any], list[Unknown]]:
    """What is stated of a twin, and its unknowns in the order of the model's."""
    random = np.random.default_rng([SEED, number])
    stated = _height()
    for key, (low, high, share) in STATED.items():
        value = random.uniform(low, high)
        stated[key] = {"value": round(value, 3), "std": round(share * value, 3)}
    dummy = {"runout_m": {"value": HEIGHT_M, "std": SURVEY_M}}
    family = SectionFamily(SlideDimensions.model_validate({**stated, **dummy}))
    strength, *others = model.unknowns
    labels = {one.label: one for one in family.dimensions}
    return stated, [strength, *(unknown_dimension(o.name, labels[o.name]) for o in others)]


def simulated(model: CaseModel, values: np.ndarray) -> list[dict[str, Any]]:
    """Values (n, q) with the toe of each run [m]; null: it failed."""
    toes = model.run(values, coarse=False)[:, 0]
    return [
        {"values": [float(f"{v:.8g}") for v in row], "toe_m": _number(toe)}
        for row, toe in zip(values, toes, strict=True)
    ]


def add_design(record: dict[str, Any], model: CaseModel) -> None:
    """The runs of the emulator that are not on record yet."""
    values = design(model.unknowns, DESIGN, SEED)
    kept = record.setdefault("design", [])
    while len(kept) < DESIGN:
        kept += simulated(model, values[len(kept) : len(kept) + SAVED_EVERY])
        write_json(RECORD, record)
        print("design", len(kept), flush=True)


def add_twins(record: dict[str, Any], model: CaseModel, number: int) -> None:
    """The twins that are not on record yet: the first draw of each that ran."""
    kept = record.setdefault("twins", [])
    while len(kept) < number:
        random = np.random.default_rng([SEED, len(kept), 1])
        stated, unknowns = twin(len(kept), model)
        while True:
            (run,) = simulated(model, at_shares(unknowns, random.random((1, len(unknowns)))))
            noise = SURVEY_M * random.standard_normal()
            if run["toe_m"] is not None and run["toe_m"] + noise > LEAST_RUNOUT_M:
                break
        kept.append({"stated": stated, **run, "runout_m": round(run["toe_m"] + noise, 3)})
        write_json(RECORD, record)
        print("twin", len(kept), flush=True)


def emulator_of(record: dict[str, Any], model: CaseModel) -> Emulator:
    """The toe over the family that holds all of the twins'."""
    values = np.array([run["values"] for run in record["design"]])
    toes = np.array(
        [[np.nan if run["toe_m"] is None else run["toe_m"]] for run in record["design"]]
    )
    warp = Warp(HEIGHT_M, 5.0 * SURVEY_M)
    return make_emulator(model.unknowns, model.names[:1], [warp], values, toes)


def infer(number: int, one: dict[str, Any], model: CaseModel, emulator: Emulator) -> None:
    """Put 5, 50 and 95 % of S_r [kPa] and the ranks of the truth into a twin."""
    _, unknowns = twin(number, model)
    prior = design(unknowns, PRIOR_DRAWS, number)
    mean, std = (part[:, 0] for part in emulator.predict(prior))
    total = np.hypot(std, SURVEY_M)
    log = -0.5 * ((one["runout_m"] - mean) / total) ** 2 - np.log(total)
    chosen = resampled(np.exp(log - log.max()), DRAWS, np.random.default_rng([SEED, number, 2]))
    draws = prior[chosen]
    one["strength_kpa"] = [float(f"{v:.4g}") for v in np.percentile(draws[:, 0], (5, 50, 95))]
    one["ranks"] = {
        unknown.name: round(rank_of(value, draws[:, place]), 5)
        for place, (unknown, value) in enumerate(zip(unknowns, one["values"], strict=True))
    }


def table(record: dict[str, Any]) -> str:
    """Coverage of the intervals of S_r and of the dimensions as Markdown."""
    twins = record["twins"]
    bands = [f"*{100 * c.low:.0f} to {100 * c.high:.0f} %*" for c in _covered(twins, STRENGTH)]
    lines = [
        f"{len(twins)} twins at {SPACING_M:g} m, {len(record['design'])} runs behind the emulator. "
        "Share of the truths within the central interval:",
        "",
        f"| unknown | {' | '.join(f'{100 * one:.0f} %' for one in NOMINAL)} |",
        f"|---|{'---|' * len(NOMINAL)}",
        f"| *calibrated: within* | {' | '.join(bands)} |",
    ]
    found = {
        "S_r" if name == STRENGTH else name: _covered(twins, name) for name in twins[0]["ranks"]
    }
    lines += coverage_rows(found, digits=0)
    low, middle, high = np.array([one["strength_kpa"] for one in twins]).T
    off = np.abs(np.log(middle / [one["values"][0] for one in twins]))
    lines += [
        "",
        f"In half of the twins the 90 % interval of S_r ends at {np.median(low / middle):.2f} and "
        f"{np.median(high / middle):.2f} times its median or nearer, and the median is within a "
        f"factor of {np.exp(np.median(off)):.2f} of the truth.",
    ]
    return "\n".join(lines)


STRENGTH = "residual_strength_liquefied_soil"


def _covered(twins: list[dict[str, Any]], name: str) -> list[Coverage]:
    return coverage(np.array([one["ranks"][name] for one in twins]), NOMINAL)


def _number(value: float) -> float | None:
    return round(float(value), 4) if np.isfinite(value) else None


def _plain(document: dict[str, Any]) -> dict[str, Any]:
    """Numbers of numpy as those of YAML."""
    return {
        key: {name: round(float(v), 4) for name, v in value.items()}
        if isinstance(value, dict)
        else value
        for key, value in document.items()
    }


def main() -> None:
    """Run the study, write record and page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--twins", type=int, default=TWINS)
    parser.add_argument("--runs", type=Path, default=ROOT / "results/hidden_sections")
    parser.add_argument("--redo", action="store_true", help="forget what is on record")
    chosen = parser.parse_args()
    model = model_of_all(chosen.runs)
    record = read_json(RECORD) if RECORD.exists() and not chosen.redo else {}
    if record.get("physics_version") != PHYSICS_VERSION:
        record = {"physics_version": PHYSICS_VERSION}
    add_design(record, model)
    add_twins(record, model, chosen.twins)
    emulator = emulator_of(record, model)
    for number, one in enumerate(record["twins"]):
        infer(number, one, model, emulator)
    write_json(RECORD, record)
    renew(PAGE, hidden_sections=table(record))


if __name__ == "__main__":
    main()
