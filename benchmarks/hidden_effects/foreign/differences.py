"""How far codes differ on one and the same slide, from nulls of a set that has been opened.

    python -m benchmarks.hidden_effects.foreign.differences --out DIR

A null is simulated by the judge's solver at its true parameters and the spacing of the slide, and
read as it was surveyed. What is left, less the survey's own error, is how far the codes differ: its
size by type of measurement, its mean, and the length over which it hangs together along the
profile. This is what `source` in `diagnosis.yaml` and `source_error` in the plan of a set state.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.foreign.slide import source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places, load_benchmark
from benchmarks.hidden_effects.scoring.records import read_truth
from pipeline.files import write_json

#: Number of the judge's runs whose mean is compared.
RUNS = 3


def differences(benchmark: Benchmark, places: Places) -> dict[str, dict[str, float | int | None]]:
    """Type of measurement -> std, mean and correlation length of the differences, and their number.

    Args:
        benchmark: of the set.
        places: of its files, truths among them.
    """
    left: dict[str, list[np.ndarray]] = defaultdict(list)
    survey: dict[str, list[float]] = defaultdict(list)
    products: list[tuple[float, float]] = []
    kept: dict[str, list[float]] = defaultdict(list)
    for path in sorted((places.out / "truths").glob("*.json")):
        truth = read_truth(path)
        if truth.get("skipped") or truth["kind"] != "null":
            continue
        section = benchmark.section(truth)
        values = np.array(list(truth["parameters"].values()))
        scene = section.parameters.scene(section.scene, values)
        spacing = truth["spacing_factor"] * section.scene.spacing
        scene = scene.changed(spacing=round(spacing, 4))  # of the slide: cells are not at stake
        where = np.array(truth["places"])
        entries = surveys.with_values(section, truth["survey"], where, truth["measured"])
        rows = [
            source("own")
            .simulate(scene, [], duration_s=benchmark.plan.duration_s, frames=80, seed=seed)
            .reading(entries, scene)
            for seed in range(1, RUNS + 1)
        ]
        off = np.split(
            np.array(truth["measured"]) - np.mean(rows, axis=0),
            np.cumsum([len(entry.values) for entry in entries])[:-1],
        )
        for entry, own in zip(entries, off, strict=True):
            left[entry.type].append(own)
            survey[entry.type] += [entry.std**2] * len(own)
        profile = off[0]
        apart = np.abs(where[:, None] - where[None, :])
        products += zip(apart.ravel(), np.outer(profile, profile).ravel(), strict=True)
        kept[truth["source"]].append(truth["area_kept"])
    found: dict[str, dict[str, float | int | None]] = {}
    for name, rows in left.items():
        numbers = np.concatenate(rows)
        variance = float(np.mean(numbers**2) - np.mean(survey[name]))
        found[name] = {
            "std": round(float(np.sqrt(max(variance, 0.0))), 3),
            "mean": round(float(np.mean(numbers)), 3),
            "n": len(numbers),
        }
    found.get("surface_profile", {})["correlation_length"] = correlation_length(products)
    return {**found, **{f"area kept, {name}": {"mean": round(float(np.mean(own)), 4), "n": len(own)}
                        for name, own in kept.items()}}  # fmt: skip


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
    lines = [(name, *(str(one.get(key, "")) for key in ("std", "mean", "correlation_length", "n")))
             for name, one in found.items()]  # fmt: skip
    print(table(("type of measurement", "std", "mean", "correlation length [m]", "numbers"), lines))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
