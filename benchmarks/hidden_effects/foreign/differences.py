"""How far codes differ on one and the same slide, from nulls of a set that has been opened.

    python -m benchmarks.hidden_effects.foreign.differences --out DIR

A null is simulated by the judge's solver at its true parameters and the spacing of the slide, and
read as it was surveyed. Codes differ first as another strength would: the strength that brings the
judge's solver nearest is a little off, by a share that is `strength`. What is then left, less the
survey's own error, has a size and a mean by type of measurement, and a length over which it is
correlated along the profile. Both are what `strength` and `error` of a source state in the plan of
a set, and so `source_strength` and `source` in `diagnosis.yaml`. For each code.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.foreign.slide import source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places, load_benchmark
from benchmarks.hidden_effects.scoring.records import read_truth
from pipeline.files import write_json

#: Number of runs whose mean is compared; half the change of ln S_r for the derivative.
RUNS, STEP = 3, 0.1


Found = dict[str, float | int | None]


@dataclass
class OfCode:
    """Differences of one code so far.

    Attributes:
        left: type of measurement -> differences of each null [its unit].
        variance: type of measurement -> the survey's own, of each number.
        products: pairs of a distance along the profile [m] and the product of two differences.
        kept: area of each deposit over that of its section.
        strength: ln of the strength that fits over the true one, of each null.
    """

    left: dict[str, list[np.ndarray]] = field(default_factory=lambda: defaultdict(list))
    variance: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    products: list[tuple[float, float]] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    strength: list[float] = field(default_factory=list)

    @property
    def found(self) -> dict[str, Found]:
        """Type of measurement -> std, mean and correlation length, and how many numbers."""
        found: dict[str, Found] = {}
        for name, rows in self.left.items():
            numbers = np.concatenate(rows)
            excess = float(np.mean(numbers**2) - np.mean(self.variance[name]))
            found[name] = {
                "std": round(float(np.sqrt(max(excess, 0.0))), 3),
                "mean": round(float(np.mean(numbers)), 3),
                "n": len(numbers),
            }
        found["surface_profile"]["correlation_length"] = correlation_length(self.products)
        off = np.array(self.strength)
        found["strength"] = {
            "std": round(float(np.sqrt(np.mean(off**2))), 3),
            "mean": round(float(np.mean(off)), 3),
            "n": len(off),
        }
        kept = round(float(np.mean(self.kept)), 4)
        return {**found, "area kept": {"mean": kept, "n": len(self.kept)}}


def differences(benchmark: Benchmark, places: Places) -> dict[str, dict[str, Found]]:
    """Code -> type of measurement -> std, mean and correlation length of the differences.

    Args:
        benchmark: of the set.
        places: of its files, truths among them.
    """
    codes: dict[str, OfCode] = defaultdict(OfCode)
    for path in sorted((places.out / "truths").glob("*.json")):
        truth = read_truth(path)
        if truth.get("skipped") or truth["kind"] != "null":
            continue
        section = benchmark.section(truth)
        values = np.array(list(truth["parameters"].values()))
        spacing = truth["spacing_factor"] * section.scene.spacing
        where = np.array(truth["places"])
        entries = surveys.with_values(section, truth["survey"], where, truth["measured"])

        def reading(shift: float, values=values, section=section, entries=entries, spacing=spacing):  # noqa: ANN202
            """The judge's mean reading with another ln S_r."""
            moved = values * np.where(section.parameters.has_prior, 1.0, np.exp(shift))
            scene = section.parameters.scene(section.scene, moved)
            scene = scene.changed(spacing=round(spacing, 4))  # of the slide: cells are not at stake
            return np.mean([
                source("own")
                .simulate(scene, [], duration_s=benchmark.plan.duration_s, frames=80, seed=seed)
                .reading(entries, scene)
                for seed in range(1, RUNS + 1)
            ], axis=0)  # fmt: skip

        slope = (reading(STEP) - reading(-STEP)) / (2.0 * STEP)
        off = np.array(truth["measured"]) - reading(0.0)
        weight = np.linalg.inv(surveys.covariance_of(entries))
        shift = float(slope @ weight @ off / (slope @ weight @ slope))
        ends = np.cumsum([len(entry.values) for entry in entries])[:-1]
        left = np.split(off - shift * slope, ends)
        code = codes[truth["source"]]
        code.strength.append(shift)
        for entry, own in zip(entries, left, strict=True):
            code.left[entry.type].append(own)
            code.variance[entry.type] += [entry.std**2] * len(own)
        apart = np.abs(where[:, None] - where[None, :])
        code.products += zip(apart.ravel(), np.outer(left[0], left[0]).ravel(), strict=True)
        code.kept.append(truth["area_kept"])
    return {name: code.found for name, code in codes.items()}


def correlation_length(products: Sequence[tuple[float, float]]) -> float | None:
    """Distance [m] at which neighbours' products have fallen to 1/e; None: within all distances.

    Args:
        products: pairs of a distance [m] and the product of two differences there.
    """
    apart, size = np.array(products).T
    edges = np.quantile(apart[apart > 0.0], np.linspace(0.0, 1.0, 13))
    middle = 0.5 * (edges[1:] + edges[:-1])
    mean = np.array([
        size[(apart > low) & (apart <= high)].mean() if np.any((apart > low) & (apart <= high))
        else np.nan
        for low, high in zip(edges[:-1], edges[1:], strict=True)
    ])  # fmt: skip
    below = np.flatnonzero(mean < mean[0] / np.e)
    return None if not len(below) else round(float(middle[below[0]]), 1)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the differences, and write them next to the truths."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--benchmark", default="benchmarks/hidden_effects/foreign_learn.yaml")
    parser.add_argument("--out", required=True, help="folder of the set's files")
    arguments = parser.parse_args(argv)
    places = Places(Path(arguments.out))
    found = differences(load_benchmark(arguments.benchmark), places)
    write_json(places.out / "differences.json", found)
    keys = ("std", "mean", "correlation_length", "n")
    lines = [(code.replace("_", " "), name, *(str(one.get(key, "")) for key in keys))
             for code, types in found.items() for name, one in types.items()]  # fmt: skip
    heads = ("code", "type of measurement", "std", "mean", "correlation length [m]", "numbers")
    print(table(heads, lines))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
