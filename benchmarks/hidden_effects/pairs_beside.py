"""How well the fainter of two hidden effects can be seen, as recorded and as measured now.

    python -m benchmarks.hidden_effects.pairs_beside   # all pairs of the record, 15 minutes
    python -m benchmarks.hidden_effects.pairs_beside case_0033

The record keeps what was recorded when its cases were made. `Sight.beside` has since been
changed to allow for an effect acting differently once the parameters have adapted to it; this
measures the same pairs again, and adds the answer of the diagnosis. Printed: lambda given the
other, recorded and now.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.making.benchmark import load_benchmark
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.make import base_models
from benchmarks.hidden_effects.making.sight import Sight
from benchmarks.hidden_effects.run import METHOD
from pipeline.config import SimulationSettings
from pipeline.files import read_json

FOLDER = Path(__file__).resolve().parent


def main(names: list[str]) -> None:
    """Print a line for each pair, or for those that are named."""
    benchmark = load_benchmark(FOLDER)
    settings = SimulationSettings(duration_s=benchmark.plan.duration_s, water=benchmark.plan.water)
    laboratory = Laboratory(settings)
    base = base_models(laboratory)
    for case in read_json(FOLDER / "results.json"):
        truth, said = case["truth"], case["verdicts"][METHOD]
        if truth["kind"] != "pair" or (names and truth["name"] not in names):
            continue
        laboratory.forget()
        values = np.array(list(truth["parameters"].values()))
        section = benchmark.section(truth)
        now = Sight(laboratory, base(section), truth["survey"], values).beside(truth["effects"])
        print(
            f"{truth['name']}  {' + '.join(truth['effects'])}: recorded {truth['beside']:.0f}, now "
            f"{'-' if now is None else f'{now:.0f}'}; said {' + '.join(said['effects']) or 'none'}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
