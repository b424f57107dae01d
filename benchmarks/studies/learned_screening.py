"""What screening by the direct model costs a diagnosis in accuracy, and what it saves in time.

    python -m benchmarks.hidden_effects make --benchmark benchmarks/hidden_effects/screening.yaml \
        --out results/screening
    python -m benchmarks.studies.learned_screening --cases results/screening

A diagnosis runs each screened hypothesis once, at its middle amplitude, and the rest of its ladder
only where that promises that chi2 falls by `PROMISE`. Here the direct model says the same of all
hypotheses that it sees, at the same fit and with the same covariance. What is compared: the fall
that each promises, which hypotheses are kept, and the time of both. A case that was done is kept
in `learned_screening.json`, and shown by `benchmarks.studies.direct_models`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.stats import spearmanr

from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.scoring.records import read_truth
from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.engine_model import EngineModel
from diagnosis.hypotheses.model import Candidate
from diagnosis.selection.explain import tested_candidates
from diagnosis.signatures.signatures import PROMISE, score_all, take_signatures
from geometry.case import load_case
from inversion.engines.registry import engine_named
from inversion.engines.run_store import RunStore
from inversion.estimation.budget import Runs
from pipeline.cli import base_parser, main_exit
from pipeline.config import load_config
from pipeline.files import read_json, write_json

RECORD = Path(__file__).with_suffix(".json")
ENGINE = "direct"
#: Falls of chi2 that count as large.
LARGE = 10.0
#: Ends of the names of hypotheses of parts; least fall that is drawn.
PARTS, LEAST = ("_layer", "_stretch", "_block"), 0.02
SHOWN = """## Screening for a diagnosis

May the direct model do the first run of each screened hypothesis of a diagnosis? It was asked
for those of {cases} blind cases of all families (`benchmarks/hidden_effects/screening.yaml`), at
the fit of the base model and with the covariance of the solver's diagnosis. **No**: it costs more
than it saves. (Asked was the model before this one, off by as much on sections of its kind: it has
not been asked again.)

    plan=benchmarks/hidden_effects/screening.yaml
    python -m benchmarks.hidden_effects make --benchmark $plan --out results/screening
    python -m benchmarks.studies.learned_screening --cases results/screening

- It reads every number of {reads} of the {cases} surveys; the others have markers or velocities.
  Of {on_trial:.0f} hypotheses on trial there {screened:.0f} are screened, and it sees {seen:.0f} of
  these.
- A run of the solver promises that chi2 falls by {promise:g} or more for {kept} of {pairs}; the
  model says so of {both} of these, and of {alone} others. Of {large} that promise {large_min:g} or
  more it would screen out {large_lost}. The rank correlation of both is {rank:.2f}: small
  differences between two slides are within its error, those of parts of a zone above all.
- It takes {learned:.0f} ms where the solver takes {solver:.0f} at the spacing of these cases, and
  so saves {saved:.1f} s of a diagnosis that takes 11 to 76 s.

A diagnosis goes on screening by the solver. By the direct model *alone* (`--engine direct`) its
error is part of the covariance, so that what it cannot see is not named.

![Promised falls](../images/direct/screening.png)
"""


@dataclass(frozen=True)
class Screened:
    """The screening of one case.

    Attributes:
        case: its name; hidden: what is hidden, empty: nothing; survey: what was measured.
        hypotheses: all on trial, how many; screened: of these; seen: of these, by the direct model.
        solver: hypothesis -> fall of chi2 that a run of the solver promises; learned: likewise.
        runs: of the solver for the fit of the base model.
        seconds_fit: for that; seconds_solver: for the runs of `seen`; seconds_learned: for theirs.
    """

    case: str
    hidden: list[str]
    survey: str
    hypotheses: int
    screened: int
    seen: int
    solver: dict[str, float]
    learned: dict[str, float]
    runs: int
    seconds_fit: float
    seconds_solver: float
    seconds_learned: float


def screened(folder: Path, name: str) -> Screened:
    """Fit the base model of a case, and screen its hypotheses by both."""
    places = Places(folder)
    truth = read_truth(places.truth(name))
    case = diagnosis_case(load_case(places.case(name), load_config(None)))
    began = time.perf_counter()
    model = case.model(RunStore(None, threads=1))
    options = case.options(model)
    comparison = compare(model, options)
    fitted, asked = time.perf_counter(), comparison.base.runs.asked
    other = case.model(RunStore(None, threads=1), engine_named(ENGINE))
    known = {one.name for one in other.candidates}
    on_trial, _ = tested_candidates(model, options)
    all_screened = [one for one in on_trial if one.screened]
    seen = [one for one in all_screened if one.name in known and readable(other)]
    begin = time.perf_counter()
    by_solver = promised(comparison, comparison.base.runs, seen)
    middle = time.perf_counter()
    runs = Runs(other, options.allowance, corrected=comparison.base.cells)
    learned = promised(comparison, runs, seen)
    end = time.perf_counter()
    return Screened(
        name, [one for one, _ in truth["effects"].items()], truth["survey"], len(on_trial),
        len(all_screened), len(seen), by_solver, learned, asked, fitted - began, middle - begin,
        end - middle,
    )  # fmt: skip


def readable(model: EngineModel) -> bool:
    """Whether the engine reads every number of the survey."""
    return all(model.engine.reads(entry) for entry in model.targets.entries)


def promised(
    comparison: Comparison, runs: Runs, candidates: Sequence[Candidate]
) -> dict[str, float]:
    """Fall of chi2 that the first run of each hypothesis promises, up or down."""
    if not candidates:
        return {}
    base = comparison.base
    taken = take_signatures(
        runs, base.surface, comparison.judged.system, candidates, turns=0, found=comparison.judged
    )
    scores = score_all(comparison.judged, taken, candidates)
    return {name: float(scores.best(name).drop) for name in scores.every}


def figures(found: Sequence[Screened]) -> dict[str, float]:
    """Numbers of all cases together."""
    solver, learned = _promises(found)
    kept = solver >= PROMISE
    sizes = [(one.hypotheses, one.screened, one.seen) for one in found if one.seen]
    hypotheses, in_all, seen = np.mean(sizes, axis=0)
    return {
        "cases": len(found),
        "cases that it reads": len(sizes),
        "on trial": hypotheses,
        "screened": in_all,
        "seen": seen,
        "pairs": len(solver),
        "kept by the solver": int(kept.sum()),
        "kept by both": int((kept & (learned >= PROMISE)).sum()),
        "kept by the model alone": int((~kept & (learned >= PROMISE)).sum()),
        "large ones": int((solver >= LARGE).sum()),
        "large ones kept": int(((solver >= LARGE) & (learned >= PROMISE)).sum()),
        "rank correlation": float(spearmanr(solver, learned).statistic),
        "solver, ms": 1e3 * _mean_time(found, "seconds_solver"),
        "learned, ms": 1e3 * _mean_time(found, "seconds_learned"),
    }


def _promises(
    found: Sequence[Screened], of: Callable[[str], bool] = lambda name: True
) -> np.ndarray:
    """Falls (2, n) that the solver and the model promise, of hypotheses of some names."""
    pairs = [
        (one.solver[name], one.learned[name])
        for one in found
        for name in one.solver
        if name in one.learned and of(name)
    ]
    return np.array(pairs).T


def _kept() -> list[Screened]:
    """Cases that were screened."""
    return [Screened(**one) for one in read_json(RECORD)] if RECORD.exists() else []


def _mean_time(found: Sequence[Screened], which: str) -> float:
    return sum(getattr(one, which) for one in found) / max(sum(one.seen for one in found), 1)


def shown() -> str:
    """Section of the record of the direct models; none where nothing was screened."""
    found = _kept()
    if not found:
        return ""
    value = figures(found)
    saved = value["seen"] * (value["solver, ms"] - value["learned, ms"]) / 1000.0
    return SHOWN.format(
        cases=value["cases"], reads=value["cases that it reads"], on_trial=value["on trial"],
        screened=value["screened"], seen=value["seen"], pairs=value["pairs"],
        kept=value["kept by the solver"], both=value["kept by both"],
        alone=value["kept by the model alone"], large=value["large ones"],
        large_min=LARGE, large_lost=value["large ones"] - value["large ones kept"],
        rank=value["rank correlation"], promise=PROMISE,
        solver=value["solver, ms"], learned=value["learned, ms"], saved=saved,
    )  # fmt: skip


def draw(path: Path) -> None:
    """Promised falls by both, of all hypotheses."""
    found = _kept()
    figure, axis = plt.subplots(figsize=(4.6, 4.3))
    for parts, label, colour in (
        (True, "parts of the liquefied soil", "#c26a2d"),
        (False, "soils, water, start", "#3b6ea5"),
    ):
        falls = _promises(found, lambda name, parts=parts: name.endswith(PARTS) == parts)
        axis.plot(*(falls + LEAST), "o", markersize=3.5, color=colour, label=label)
    axis.axhline(PROMISE, color="0.6", linewidth=0.8)
    axis.axvline(PROMISE, color="0.6", linewidth=0.8)
    axis.set(
        xscale="log", yscale="log", xlabel="fall of chi2 that a run promises",
        ylabel="that the direct model promises",
    )  # fmt: skip
    axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(argv: Sequence[str] | None = None) -> int:
    """Screen all cases that are not kept yet."""
    parser = base_parser("python -m benchmarks.studies.learned_screening", __doc__.split("\n")[0])
    parser.add_argument("--cases", default="results/screening", metavar="DIR")
    folder = Path(parser.parse_args(argv).cases)
    found = {one.case: one for one in _kept()}
    for name in sorted(path.name for path in (folder / "cases").iterdir()):
        if name not in found:
            found[name] = screened(folder, name)
            write_json(RECORD, [asdict(one) for one in found.values()])
            print(f"{name}: {found[name].seen} hypotheses screened", flush=True)
    for name, value in figures([*found.values()]).items():
        print(f"{name:24} {value:.4g}")
    return 0


if __name__ == "__main__":
    main_exit(main)
