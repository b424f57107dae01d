"""What the parts share: where runs are kept, and back-analyses solved once for all parts.

Everything goes through the tool's own classes, with runs kept by content: a part that was killed
resumes where it stopped, and a second part that needs the same answer costs nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from geometry.case import load_case
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.back_analysis.result import Result
from inversion.engines.run_store import RunStore
from pipeline.config import Config, load_config

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "results" / "benchmarks" / "back_analysis"
CASES = ROOT / "case_histories"
LSFD, LA_MARQUESA = "lower_san_fernando", "la_marquesa"
PAPER = "lower_san_fernando_paper"
"""The paper's reading of the same dam: its section and materials, no reservoir, its question."""

#: Spacing of material points, m: in full and with --quick.
SPACING = {LSFD: (1.5, 2.0), PAPER: (2.0, 4.0), LA_MARQUESA: (0.5, 0.75)}
THREADS = 2

_solved: dict[tuple, BackAnalysis] = {}
_results: dict[tuple, Result] = {}


def say(line: str) -> None:
    """Progress, on the standard error."""
    print(line, file=sys.stderr, flush=True)


def store(folder: str = "runs") -> RunStore:
    """Runs kept by content below `FOLDER`."""
    return RunStore(FOLDER / folder, threads=THREADS)


def config(*overrides: str) -> Config:
    """The configuration with changes such as `inversion.starts=1`."""
    return load_config(None, list(overrides))


def loaded(
    name: str,
    *,
    quick: bool,
    measurement_set: str | None = None,
    overrides: Sequence[str] = (),
    spacing_m: float | None = None,
) -> InversionCase:
    """A case history at the spacing of this study, or at another."""
    return inversion_case(
        load_case(CASES / name, config(*overrides)),
        measurement_set=measurement_set,
        spacing_m=SPACING[name][quick] if spacing_m is None else spacing_m,
    )


def solved(
    name: str,
    *,
    quick: bool,
    measurement_set: str | None = None,
    overrides: Sequence[str] = (),
    spacing_m: float | None = None,
) -> tuple[BackAnalysis, Result]:
    """A case history back-analysed by the tool, once for all parts of a run.

    Args:
        name: of the case.
        quick: at the coarser spacing.
        measurement_set: None: the file's default.
        overrides: of the configuration.
        spacing_m: of material points; None: that of this study.
    """
    key = (name, quick, measurement_set, tuple(overrides), spacing_m)
    if key not in _solved:
        case = loaded(name, quick=quick, measurement_set=measurement_set, overrides=overrides,
                      spacing_m=spacing_m)  # fmt: skip
        analysis = BackAnalysis(case, store(), say)
        _results[key] = analysis.run()
        _solved[key] = analysis
    return _solved[key], _results[key]
