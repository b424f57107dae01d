"""Is the posterior calibrated? Twins of Lower San Fernando whose truth is known.

    python -m benchmarks.studies.posterior_calibration [--twins 208] [--part 0 --of 2] [--redo]

Truths are drawn from the prior of the case and simulated by the material point method at the coarse
spacing; survey noise is added to the fitted toe; the posterior of each twin is found by an emulator
of other runs, with the sampler of `flowslide posterior`, and the truth is ranked among its draws.
Of prior and posterior alike only sections count that can be drawn at that spacing.
Everything found is kept in `posterior_calibration.json`, twin by twin, so that the study resumes
where it stopped and parts may run side by side. At the end it writes the table between the markers
of `docs/method/posterior.md` and the picture next to it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.generated_pages import ROOT, renew
from flowslide import load_case
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.engines.run_store import RunStore
from inversion.posterior.calibration import Coverage, band, coverage, rank_of
from inversion.posterior.emulator import make_emulator
from inversion.posterior.infer import at_shares, sample, warps
from inversion.posterior.likelihood import Likelihood
from inversion.posterior.runs import CaseModel
from inversion.posterior.varied_case import varied_case
from mpm_taichi import PHYSICS_VERSION
from pipeline.files import read_json, write_json

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "method" / "posterior.md"
PICTURE = ROOT / "docs/images/posterior/calibration.png"
CASE = "lower_san_fernando"
TWINS, DESIGN, SEED = 208, 256, 11
LIVE_POINTS, DRAWS = 100, 200
NOMINAL = (0.5, 0.8, 0.95)
BINS = 16
#: Runs between two savings.
SAVED_EVERY = 16


def twin_model(runs: Path) -> tuple[InversionCase, CaseModel]:
    """The case, and its runs."""
    case = inversion_case(load_case(CASE))
    return case, CaseModel(varied_case(case), RunStore(runs, threads=1))


def truths_of(model: CaseModel, number: int) -> np.ndarray:
    """The first draws of the prior (number, q) whose section can be drawn."""
    random = np.random.default_rng(SEED)
    found = np.zeros((0, len(model.unknowns)))
    while len(found) < number:
        values = at_shares(model.unknowns, random.random((SAVED_EVERY, len(model.unknowns))))
        found = np.concatenate([found, values[model.holds(values)]])
    return found[:number]


def simulated(record: dict, name: str, model: CaseModel, values: np.ndarray) -> None:
    """Simulate what is not on record yet at values (n, q): the numbers of coarse runs."""
    kept = record.setdefault(name, [])
    while len(kept) < len(values):
        part = values[len(kept) : len(kept) + SAVED_EVERY]
        numbers = model.run(part, coarse=True)
        kept += [
            {"values": np.round(row, 6).tolist(), "numbers": [_plain(y) for y in found]}
            for row, found in zip(part, numbers, strict=True)
        ]
        write_json(RECORD, record)
        print(name, len(kept), flush=True)


def infer_twin(record: dict, number: int, model: CaseModel, case: InversionCase) -> list[float]:
    """Ranks of the truth of a twin among the draws of its posterior, (q,)."""
    truth = record["truths"][number]
    targets = case.setup.targets
    (fitted,) = np.flatnonzero(targets.fitted)
    column = model.names.index(targets.names[fitted])
    random = np.random.default_rng([SEED, number])
    noise = np.sqrt(targets.covariance[fitted, fitted]) * random.standard_normal()
    measured = targets.measured.copy()
    measured[fitted] = truth["numbers"][column] + noise
    targets = replace(targets, measured=measured)
    values, numbers = _arrays(record["design"])
    name = [targets.names[fitted]]
    emulator = make_emulator(
        model.unknowns, name, warps(name, targets), values, numbers[:, [column]]
    )
    likelihood = Likelihood(emulator, targets, targets.covariance)
    found = sample(likelihood, draws=DRAWS, live_points=LIVE_POINTS, seed=number)
    draws = at_shares(model.unknowns, found.shares)
    draws = draws[model.holds(draws)]
    return [
        round(rank_of(value, draws[:, place]), 6) for place, value in enumerate(truth["values"])
    ]


def collect(runs: Path, twins: int, part: int, of: int, redo: bool) -> dict:
    """Simulate and infer what is not on record yet."""
    case, model = twin_model(runs)
    record = read_json(RECORD) if RECORD.exists() and not redo else {}
    if record.get("physics_version") != PHYSICS_VERSION:
        record = {
            "physics_version": PHYSICS_VERSION,
            "spacing_m": case.coarse_spacing_m,
            "unknowns": [one.name for one in model.unknowns],
            "numbers": model.names,
        }
    design = at_shares(model.unknowns, _sobol(len(model.unknowns)))
    if len(record.get("design", [])) < len(design):
        simulated(record, "design", model, model.drawable(design))
    if len(record.get("truths", [])) < twins:
        simulated(record, "truths", model, truths_of(model, twins))
    for number in range(part, twins, of):
        path = runs / f"twin_{number:04d}.json"
        if not path.is_file():
            write_json(path, infer_twin(record, number, model, case))
            print("twin", number, flush=True)
    done = {k: runs / f"twin_{k:04d}.json" for k in range(twins)}
    if all(path.is_file() for path in done.values()):
        record["ranks"] = [read_json(path) for path in done.values()]
        write_json(RECORD, record)
    return record


def table(record: dict) -> str:
    """Coverage of the intervals of each unknown as Markdown."""
    ranks = np.array(record["ranks"])
    shown = [f"{100 * nominal:.0f} %" for nominal in NOMINAL]
    bands = [_band(one) for one in coverage(ranks[:, 0], NOMINAL)]
    lines = [
        f"{len(ranks)} twins at {record['spacing_m']:g} m, {len(record['design'])} runs behind the "
        "emulator. Share of the truths within the central interval:",
        "",
        f"| unknown | {' | '.join(shown)} |",
        f"|---|{'---|' * len(NOMINAL)}",
        f"| *calibrated: within* | {' | '.join(bands)} |",
    ]
    found = {
        name.replace("_", " "): coverage(ranks[:, place], NOMINAL)
        for place, name in enumerate(record["unknowns"])
    }
    lines += coverage_rows(found, digits=1)
    every = [one for place in range(ranks.shape[1]) for one in coverage(ranks[:, place], NOMINAL)]
    lines += ["", f"{sum(one.inside for one in every)} of {len(every)} shares lie within their "
              "binomial band of 95 %."]  # fmt: skip
    return "\n".join(lines)


def coverage_rows(found: dict[str, list[Coverage]], *, digits: int) -> list[str]:
    """Rows of the first unknown, of those outside their band, and of the range of all others."""
    first, *others = found
    inside = [name for name in others if all(one.inside for one in found[name])]
    lines = []
    for name in (first, *(name for name in others if name not in inside)):
        cells = [
            f"{100 * one.covered:.{digits}f} %{'' if one.inside else ' (outside)'}"
            for one in found[name]
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    shares = np.array([[100 * one.covered for one in found[name]] for name in inside])
    ranges = [
        f"{low:.{digits}f} to {high:.{digits}f} %"
        for low, high in zip(shares.min(0), shares.max(0), strict=True)
    ]
    return [*lines, f"| {len(inside)} others, least to most | {' | '.join(ranges)} |"]


def draw(record: dict) -> None:
    """Histogram of the ranks of each unknown with the band of a calibrated posterior."""
    from report import style

    ranks = np.array(record["ranks"])
    columns, rows = 3, -(-ranks.shape[1] // 3)
    figure = style.new_figure(1.75 * rows + 0.3, 8.0)
    low, high = band(len(ranks), 1.0 / BINS)
    for place, name in enumerate(record["unknowns"]):
        down, across = divmod(place, columns)
        ax = style.panel(figure, 0.45 + 2.55 * across, 0.45 + 1.75 * (rows - 1 - down), 2.2, 1.1)
        style.quiet(ax, grid="")
        ax.axhspan(low, high, color=style.PALE_BEFORE, linewidth=0, zorder=0)
        ax.axhline(len(ranks) / BINS, color=style.GREY, linewidth=0.8)
        colour = style.OURS if place == 0 else style.CLASSICAL
        ax.hist(ranks[:, place], np.linspace(0, 1, BINS + 1), color=colour, alpha=0.8, rwidth=0.9)
        ax.set(xlim=(0, 1), ylim=(0, 2.1 * len(ranks) / BINS + 5))
        style.title(ax, name.replace("_", " "))
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    style.save_figure(figure, PICTURE)


def _sobol(unknowns: int) -> np.ndarray:
    from scipy.stats import qmc

    return qmc.Sobol(unknowns, seed=0).random(DESIGN)


def _arrays(kept: list[dict]) -> tuple[np.ndarray, np.ndarray]:
    values = np.array([entry["values"] for entry in kept])
    numbers = [[np.nan if y is None else y for y in entry["numbers"]] for entry in kept]
    return values, np.array(numbers)


def _plain(value: float) -> float | None:
    return round(float(value), 4) if np.isfinite(value) else None


def _band(one: Coverage) -> str:
    return f"*{100 * one.low:.1f} to {100 * one.high:.1f} %*"


def main() -> None:
    """Run the study, write page and picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--twins", type=int, default=TWINS)
    parser.add_argument("--part", type=int, default=0, help="infer every `of`-th twin from this")
    parser.add_argument("--of", type=int, default=1)
    parser.add_argument("--runs", type=Path, default=ROOT / "results/posterior_calibration")
    parser.add_argument("--redo", action="store_true")
    chosen = parser.parse_args()
    record = collect(chosen.runs, chosen.twins, chosen.part, chosen.of, chosen.redo)
    if "ranks" in record:
        draw(record)
        renew(PAGE, ranks=table(record))


if __name__ == "__main__":
    main()
