"""How much of what codes differ by is the cells of the judge: nulls of a set that has been opened.

    python -m benchmarks.hidden_effects.foreign.cells --out DIR [--out DIR ...]

The judge's solver simulates every null at its true parameters with the judge's spacing and with
finer ones; b is the difference. Data less prediction less k b, less what another strength would do,
is weighed by the survey's error, that of the code and the noise of the runs. If the codes solve the
same equations there is a k at which nothing but that is left, and the strength is the true one. The
diagnosis adds `finer_share` b to its predictions and doubts `finer_share_std` of it.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places, load_benchmark
from benchmarks.hidden_effects.scoring.records import read_truth
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.engine_model import Numerics
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from inversion.estimation.covariance import covariance, source_covariance
from inversion.problem.state import State
from pipeline.config import Config, load_config

ROOT = Path(__file__).resolve().parents[3]
IMAGE = ROOT / "docs/images/foreign-cells.png"
#: Spacing of the judge over that of the finer runs; multiples of b that are tried.
FINER, SHARES = (1.5, 2.0), (0.0, 0.5, 1.0, 1.5, 2.0)
#: Runs whose mean is compared, with the judge's spacing and finer; change of S_r for a slope.
RUNS, FINER_RUNS, STEP = 6, 3, 1.1


@dataclass(frozen=True)
class Null:
    """One slide in which nothing is hidden.

    Attributes:
        code: that made it.
        left: chi2 over its degrees of freedom, (len(FINER), len(SHARES)).
        strength: ln of the strength that fits over the true one, the same.
        best: multiple of b at which chi2 is least, (len(FINER),).
    """

    code: str
    left: np.ndarray
    strength: np.ndarray
    best: np.ndarray


def nulls(benchmark: Benchmark, places: Places, config: Config) -> list[Null]:
    """All nulls of an opened set.

    Args:
        benchmark: of the set.
        places: of its files, cases and truths among them.
        config: settings; the water is the benchmark's.
    """
    water = config.simulation.model_copy(update={"water": benchmark.plan.water})
    config = config.model_copy(update={"simulation": water})
    found = []
    for path in sorted((places.out / "truths").glob("*.json")):
        truth = read_truth(path)
        if truth.get("skipped") or truth["kind"] != "null":
            continue
        case = diagnosis_case(load_case(places.case(truth["name"]), config))
        found.append(_null(case, truth["source"], tuple(truth["parameters"].values())))
    return found


def _null(case, code: str, values: tuple[float, ...]) -> Null:  # noqa: ANN001 - a DiagnosisCase
    model = case.model(RunStore(None))

    def reading(x: tuple[float, ...], runs: int, **more) -> np.ndarray:
        return model.predict([State(x, seed=seed, **more) for seed in range(runs)])

    own = reading(values, RUNS)
    free = ~model.parameters.has_prior & model.parameters.logarithmic

    def stronger(factor: float) -> tuple[float, ...]:
        return tuple(np.where(free, factor, 1.0) * np.array(values))

    ends = [reading(stronger(factor), FINER_RUNS).mean(axis=0) for factor in (STEP, 1.0 / STEP)]
    slope = (ends[0] - ends[1]) / (2.0 * np.log(STEP))
    errors = source_covariance(model.targets.entries, case.question.source_errors)
    known = covariance(model.targets.covariance, replicates=own, synthetic=True, source=errors)
    weight = np.linalg.inv(known.total)
    off = model.targets.measured - own.mean(axis=0)

    def less_strength(rows: np.ndarray) -> tuple[np.ndarray, float]:
        share = float(slope @ weight @ rows / (slope @ weight @ slope))
        return rows - share * slope, share

    left, strength, best = [], [], []
    for finer in FINER:
        model.numerics = replace(Numerics(), finer=finer)
        b = reading(values, FINER_RUNS, numerics="fine").mean(axis=0) - own.mean(axis=0)
        rows = [less_strength(off - share * b) for share in SHARES]
        left.append([float(row @ weight @ row) / (len(row) - 1) for row, _ in rows])
        strength.append([share for _, share in rows])
        along = less_strength(b)[0]
        best.append(float(along @ weight @ rows[0][0] / (along @ weight @ along)))
    return Null(code, np.array(left), np.array(strength), np.array(best))


def draw(found: dict[str, list[Null]], path: Path) -> None:
    """What is left of every null against the multiple of b, with half the judge's spacing."""
    figure, axes = plt.subplots(
        1, len(found), figsize=(9.0, 3.6), squeeze=False, layout="constrained"
    )
    for axis, (code, rows) in zip(axes[0], found.items(), strict=True):
        for one in rows:
            axis.plot(SHARES, one.left[-1], color="0.75", linewidth=0.8)
        axis.plot(SHARES, np.median([one.left[-1] for one in rows], axis=0), color="C0",
                  label=f"median of {len(rows)}")  # fmt: skip
        axis.axhline(1.0, color="C3", linewidth=0.8, label="noise alone")
        axis.set(title=code.replace("_", " "), xlabel="multiple of the change by finer cells",
                 ylabel="chi² per number", yscale="log")  # fmt: skip
        axis.legend()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--benchmark", default="benchmarks/hidden_effects/foreign.yaml")
    parser.add_argument("--out", required=True, action="append", help="folder of a set's files")
    parser.add_argument("--config", help="YAML file with the settings that differ")
    arguments = parser.parse_args(argv)
    benchmark, config = load_benchmark(arguments.benchmark), load_config(arguments.config)
    by_code: dict[str, list[Null]] = defaultdict(list)
    for folder in arguments.out:
        for one in nulls(benchmark, Places(Path(folder)), config):
            by_code[one.code].append(one)
    lines = []
    for code, rows in by_code.items():
        for k, finer in enumerate(FINER):
            for j, share in enumerate(SHARES):
                left = [one.left[k, j] for one in rows]
                off = 100.0 * np.array([one.strength[k, j] for one in rows])
                sizes = f"{off.mean():+.1f} %", f"{np.sqrt(np.mean(off**2)):.1f} %"
                chi2 = f"{np.median(left):.2f}", f"{np.mean(left):.2f}"
                lines.append((code.replace("_", " "), f"1/{finer:g}", f"{share:g}", *chi2, *sizes))
    heads = ("code", "finer spacing", "times b", "chi2 / n, median", "mean", "ln S_r, mean", "rms")
    print(table(heads, lines))
    for code, rows in by_code.items():
        best = np.quantile([one.best[-1] for one in rows], (0.0, 0.1, 0.5, 0.9, 1.0))
        print(f"{code}: best multiple of b, quantiles 0, 10, 50, 90, 100 %: {np.round(best, 2)}")
    draw(by_code, IMAGE)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
