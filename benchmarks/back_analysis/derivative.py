"""The derivative of the runout.

The derivative that the search uses (one-sided differences, one batch, common points, steps chosen
from the noise) compared with central differences at the same place, of the same width to either
side, averaged over eight jitters of the points. An angle whose effect is lost in the scatter of
these eight is reported but not judged.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from inversion.engines.mpm_engine import MPMEngine

TITLE = "The derivative of the runout"

SEEDS = 8
LIMIT = 0.15


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Compare at the answer of Lower San Fernando."""
    analysis, result = lab.solved(lab.PAPER, quick=quick)
    case, look = analysis.case, analysis.found.best
    row = analysis.objective.targets.names.index("upstream toe")
    own, steps = look.derivative[row], np.abs(look.steps)
    engine = MPMEngine(analysis.store)
    setups = [case.jittered(case.setup, seed) for seed in range(1, SEEDS + 1)]
    found = []
    for place, step in enumerate(steps):
        change = np.eye(len(steps))[place] * step
        asked = [s.at(look.values + sign * change) for s in setups for sign in (1.0, -1.0)]
        toes = [p.values[row] for p in engine.predict(asked)]
        found.append((np.array(toes[0::2]) - np.array(toes[1::2])) / (2 * step))
    return [
        figure(spec.name, spec.unit, own[place], found[place], steps[place],
               result.answer.derivative_resolved[spec.name])
        for place, spec in enumerate(case.parameters.specs)
    ]  # fmt: skip


def figure(name: str, unit: str, own: float, seeds: np.ndarray, step: float,
           resolved: bool) -> Figure:  # fmt: skip
    """One parameter."""
    mean, error = float(seeds.mean()), float(seeds.std(ddof=1) / np.sqrt(len(seeds)))
    off = own / mean - 1.0
    significant = abs(mean) > 3.0 * error
    return Figure(
        f"d(toe) / d({name})",
        f"{own:.3g} m/{unit}" + (f", {100 * off:+.0f} %" if significant else ""),
        f"{mean:.3g} ± {error:.2g} m/{unit}"
        + (f", within {100 * LIMIT:.0f} %" if significant else ""),
        bool(abs(off) <= LIMIT) if significant else None,
        f"step {step:.2g} {unit}; reported as "
        f"{'resolved' if resolved else 'less than five times the noise'}",
    )
