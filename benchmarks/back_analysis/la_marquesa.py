"""La Marquesa: two toes and three strengths.

S_r of materials 1, 2 and 6 from 11 / 12 / 10.5 kPa, where nothing moves, for the two sets of
runouts that the paper gives: `field` (11 m upstream, 6.5 m downstream, its appendix) and `paper`
(2.5 and 10 m, its back-analysis). Two toes cannot fix three strengths: the answer is the triple
nearest to the ratios of the first guesses, with the segment of other triples that fit as well.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from inversion.back_analysis.result import Result

TITLE = "La Marquesa: two toes and three strengths"

NAMES = ("residual_strength_1", "residual_strength_2", "residual_strength_6")
PAPER = (4.2, 4.6, 4.0)
SETS = ("field", "paper")
SETTINGS = ("inversion.noise_seeds=4", "inversion.variants=false", "inversion.sensitivities=false")


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Both sets."""
    results = {
        name: lab.solved(lab.LA_MARQUESA, quick=quick, measurement_set=name, overrides=SETTINGS)[1]
        for name in SETS
    }
    if folder is not None:
        from benchmarks.back_analysis.pictures import triples_picture

        triples_picture(results, folder / "la_marquesa.png")
    return [figure for name, result in results.items() for figure in figures(name, result)]


def figures(name: str, result: Result) -> list[Figure]:
    """Of one set of measurements."""
    answer = result.answer
    toes = ", ".join(
        f"{m.name} {m.predicted:.1f} m of {m.measured:g}"
        for m in result.measurements
        if m.role == "fitted"
    )
    stops = [stop for stop in answer.equally_good]
    kept = np.array([[stop.values[key] for key in NAMES] for stop in stops])
    spans = [
        f"{key[-1]}: {min(kept[:, place].min(), parameter.value):.1f} to "
        f"{max(kept[:, place].max(), parameter.value):.1f}"
        for place, (key, parameter) in enumerate(zip(NAMES, answer.parameters, strict=True))
    ] if len(kept) else []  # fmt: skip
    starts = np.array([[start.answer[key] for key in NAMES] for start in result.starts])
    apart = 100 * float(np.max(np.abs(starts / starts[0] - 1)))
    return [
        Figure(f"`{name}`: S_r of 1 / 2 / 6", triple([p.value for p in answer.parameters]) + " kPa",
               f"solved from 11 / 12 / 10.5; paper {triple(PAPER)}", answer.reached,
               f"{toes}; loss {answer.loss:.2g} m², {result.runs_to_answer} simulations; "
               f"{answer.words}"),
        Figure(f"`{name}`: segment of equally good triples",
               "; ".join(spans) + " kPa" if spans else "none", "at least 2 other triples",
               len(stops) >= 2,
               "; ".join(f"{triple(row)} (loss {stop.loss:.2g})"
                         for row, stop in zip(kept, stops, strict=True))),
        Figure(f"`{name}`: three starts, largest difference", f"{apart:.2g} %",
               note="the data do not determine the triple; among equally good ones the ratios of "
               "the first guesses choose"),
    ]  # fmt: skip


def triple(values) -> str:
    """Three strengths."""
    return " / ".join(f"{value:.1f}" for value in values)
