"""Lower San Fernando: the paper's question.

S_r of material 1 with the friction of materials 6 and 7, first guess 30 kPa, 30 and 30 degrees,
target 53 m, loss (runout error)^2 < 0.1 m2, no reservoir (the case `lower_san_fernando_paper`), by
Gauss-Newton (default) and L-BFGS-B (the paper's search). Counted are all simulations.

The three starts are the first guess, 0.65 and 1.6 times its strength with other friction angles.
The scatter is that of the answer found again on eight jitters of the points.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure, at_most
from inversion.back_analysis.result import ParameterAnswer, Result

TITLE = "Lower San Fernando: the paper's question"

TOLERANCE, ITERATIONS, RUNS = 0.1, 6, 30
ALONE = (
    "inversion.starts=1", "inversion.noise_seeds=0", "inversion.variants=false",
    "inversion.sensitivities=false",
)  # fmt: skip
#: A finer spacing, m: in full and with --quick.
FINER = (1.0, 3.0)
STRENGTH = "residual_strength_1"


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Search by both methods; starts, scatter, friction angles."""
    _, result = lab.solved(lab.PAPER, quick=quick)
    _, paper = lab.solved(lab.PAPER, quick=quick, overrides=(*ALONE, "inversion.method=lbfgsb"))
    if folder is not None:
        from benchmarks.back_analysis.pictures import history_picture

        history_picture({"Gauss-Newton": result, "L-BFGS-B": paper}, folder / "history.png")
    return [
        *search_figures("Gauss-Newton", result),
        *search_figures("L-BFGS-B", paper),
        *answer_figures(result),
        *finer_figures(quick),
    ]


def finer_figures(quick: bool) -> list[Figure]:
    """The same question on finer points."""
    spacing = FINER[quick]
    _, finer = lab.solved(lab.PAPER, quick=quick, overrides=ALONE, spacing_m=spacing)
    return [
        *search_figures(f"at {spacing:g} m spacing", finer),
        Figure(f"S_r at 53 m, at {spacing:g} m spacing",
               f"{finer.answer.parameters[0].value:.1f} kPa", "paper 18.9 kPa"),
    ]  # fmt: skip


def search_figures(name: str, result: Result) -> list[Figure]:
    """Iterations and simulations until the loss is below the paper's."""
    first = next((i for i in result.iterations if i.loss is not None and i.loss < TOLERANCE), None)
    if first is None:
        return [Figure(f"{name}: loss < 0.1 m²", f"{result.answer.loss:.2g} m² at the end",
                       "< 0.1 m²", False, result.answer.words)]  # fmt: skip
    path = ", ".join(
        f"{i.values[STRENGTH]:.1f} kPa {i.loss:.3g} m²" for i in result.iterations if i.loss
    )
    return [
        at_most(f"{name}: iterations to loss < 0.1 m²", first.iteration, ITERATIONS, note=path),
        at_most(f"{name}: simulations until then", first.runs_so_far, RUNS,
                note=f"{result.runs_to_answer} until the search ended"),
    ]  # fmt: skip


def answer_figures(result: Result) -> list[Figure]:
    """The answer, three starts, scatter, what is not determined."""
    strength, *angles = result.answer.parameters
    starts = np.array([start.answer[STRENGTH] for start in result.starts])
    apart = 100 * float(np.max(np.abs(starts / strength.value - 1)))
    shares = ", ".join(
        f"{name} {std:.2g}" for name, std in
        sorted(strength.std_by_source.items(), key=lambda pair: -pair[1])
    )  # fmt: skip
    scatter = strength.std_by_source.get("place of the material points", float("nan"))
    return [
        Figure("S_r at 53 m", f"{strength.value:.1f} ± {strength.std_total:.1f} kPa",
               "paper 18.9 kPa", note=f"survey {strength.std_data:.2g} kPa; {shares}; at "
               f"{result.spacing_m:g} m spacing; ratio to σ′v0 {strength.ratio:.3f}"),
        at_most("three starts: largest difference of S_r", apart, 1, unit="%",
                note=", ".join(f"{value:.2f}" for value in starts) + " kPa"),
        at_most("scatter of S_r over 8 jitter seeds", scatter, round(strength.std_total, 2),
                unit="kPa", digits=2, note="asked: inside the quoted standard deviation"),
        *(angle_figure(angle) for angle in angles),
    ]  # fmt: skip


def angle_figure(angle: ParameterAnswer) -> Figure:
    """Is a friction angle determined by the runout?"""
    share = angle.std_data / angle.prior_std
    asked = angle.name == "friction_7"
    return Figure(
        f"{angle.name}: standard deviation after / before",
        f"{share:.2f}",
        "≥ 0.9, reported as not determined" if asked else "",
        (share >= 0.9 and not angle.determined) if asked else None,
        f"{angle.std_data:.2f} of {angle.prior_std:.2f} degrees; reported as "
        f"{'determined' if angle.determined else 'not determined'}",
    )
