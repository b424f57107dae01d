"""What was measured and not fitted.

Numbers that are held out of the fit or only compared; the report of every back-analysis shows them
as this table does.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from benchmarks.back_analysis.la_marquesa import SETTINGS
from inversion.back_analysis.result import MeasurementAnswer, Result

TITLE = "What was measured and not fitted"


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Measured against predicted, for what was not fitted."""
    _, dam = lab.solved(lab.LSFD, quick=quick)
    _, field = lab.solved(lab.LA_MARQUESA, quick=quick, measurement_set="field", overrides=SETTINGS)
    _, paper = lab.solved(lab.LA_MARQUESA, quick=quick, measurement_set="paper", overrides=SETTINGS)
    return [
        *lines("Lower San Fernando", dam),
        *lines("La Marquesa `field`", field),
        *lines("La Marquesa `paper`", paper),
    ]


def lines(words: str, result: Result) -> list[Figure]:
    """Everything compared or held out that is one number."""
    return [
        figure(words, entry)
        for entry in result.measurements
        if entry.role in ("compared", "held out") and entry.measured is not None
        and entry.name == entry.group
    ]  # fmt: skip


def figure(words: str, entry: MeasurementAnswer) -> Figure:
    """One of them; nothing is asked but that it be shown."""
    return Figure(
        f"{words}: {entry.name} ({entry.role})",
        f"{entry.predicted:.1f} {entry.unit}",
        f"measured {entry.measured:g} ± {entry.std:g} {entry.unit}",
        note=f"{entry.difference_in_std:+.1f} standard deviations of the survey",
    )
