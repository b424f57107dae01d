"""What the commands print: the numbers of the documents as tables."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.verdict.verdict import (
    CandidateVerdict,
    FittedModelSummary,
    MeasurementVerdict,
    NextMeasurement,
    ParameterWords,
    Verdict,
    WaterfallStep,
)
from pipeline.table import aligned

#: Measured numbers that are listed; the rest stands in the document.
MOST_LINES = 40


def parameters(
    words: Sequence[ParameterWords], stages: Sequence[tuple[str, FittedModelSummary]]
) -> str:
    """Calibrated values, one column for each stage."""
    rows = [["parameter", *(title for title, _ in stages), "unit"]]
    for parameter in words:
        values = [
            f"{stage.values[parameter.name]:.4g} +- {stage.std[parameter.name]:.2g}"
            for _, stage in stages
        ]
        rows.append([parameter.words, *values, parameter.unit])
    return aligned(rows, left=(0, len(rows[0]) - 1))


def groups(stage: FittedModelSummary) -> str:
    """Tests of adequacy, misfit by measurement, the worst stretch, held-out data."""
    rows = [["test", "statistic", "p"]]
    rows += [[test.name, f"{test.statistic:.2f}", f"{test.p:.2g}"] for test in stage.tests]
    rows.append(["all together", "", f"{stage.p_combined:.2g}"])
    parts = [aligned(rows)]
    rows = [["measurement", "numbers", "chi2", "of noise", "z"]]
    rows += [
        [group.name, str(group.n), f"{group.chi2:.1f}", f"{group.expected:.1f}", f"{group.z:+.1f}"]
        for group in stage.groups
    ]
    parts.append(aligned(rows))
    if stage.window is not None:
        window = stage.window
        parts.append(
            f"Worst stretch: {window.first} to {window.last}, chi2 {window.chi2:.1f} of "
            f"{window.n} numbers; noise has one as bad with p {window.p:.2g}."
        )
    if stage.held_out.n:
        p = "" if stage.held_out.p is None else f", p {stage.held_out.p:.2g}"
        parts.append(f"Held out: chi2 {stage.held_out.chi2:.1f} of {stage.held_out.n} numbers{p}.")
    else:
        parts.append("Held out: nothing.")
    return "\n\n".join(parts)


def measurements(lines: Sequence[MeasurementVerdict]) -> str:
    """Measured against predicted, the worst first; constructed data are left out."""
    shown = [line for line in lines if line.role != "constructed"]
    final = any(line.predicted_final is not None for line in shown)
    head = ["measured", "", "std", "of it survey", "base", "off"]
    rows = [[*head, *(["final", "off"] if final else []), "role"]]
    order = sorted(shown, key=lambda line: -abs(line.residual_base or 0.0))
    for line in order[:MOST_LINES]:
        row = [line.name, f"{line.measured:.2f} {line.unit}", f"{line.std_total:.2f}",
               f"{line.std_survey:.2f}", _number(line.predicted_base, ".2f"),
               _number(line.residual_base, "+.1f")]  # fmt: skip
        if final:
            row += [_number(line.predicted_final, ".2f"), _number(line.residual_final, "+.1f")]
        rows.append([*row, line.role])
    text = aligned(rows, left=(0, len(rows[0]) - 1))
    left = len(shown) - MOST_LINES
    return text if left <= 0 else f"{text}\n... and {left} more, which are nearer"


def candidates(lines: Sequence[CandidateVerdict]) -> str:
    """Effects by what they promise, what they achieved, what could be hidden."""
    rows = [["effect", "z", "promised", "p", "amplitude", "seen", "least", "achieved", ""]]
    for line in lines:
        if line.left_out:
            continue
        refit = line.refit
        told = "" if refit is None else "accepted" if refit.accepted else refit.why_not
        if line.resolved is False:
            told = f"not resolved by another jitter; {told}".rstrip("; ")
        unit = f" {line.unit}" if line.unit else ""
        rows.append(
            [
                line.name,
                _number(line.z, "+.1f"),
                _number(line.expected_drop, ".1f"),
                _number(line.p_family, ".2g"),
                f"{_number(line.amplitude_by_score, '.3g')}{unit}",
                _number(line.visible_fraction, ".0%"),
                _number(line.smallest_detectable, ".2g"),
                "" if refit is None else f"{refit.drop:.1f}",
                told,
            ]
        )
    text = aligned(rows, left=(0, 8))
    untested = [f"{line.name}: {line.left_out}" for line in lines if line.left_out]
    return text if not untested else text + "\n\nNot tested:\n  " + "\n  ".join(untested)


def alike(names: Sequence[str], cosine: Sequence[Sequence[float]], least: float) -> str:
    """Pairs of effects that the data can hardly tell apart."""
    pairs = [
        (abs(cosine[i][j]), names[i], names[j])
        for i in range(len(names))
        for j in range(i)
        if abs(cosine[i][j]) >= least
    ]
    if not pairs:
        return "Every pair of effects can be told apart by these data."
    lines = [f"  {one} and {two}: |cos| {size:.2f}" for size, one, two in sorted(pairs)[::-1]]
    return "Hardly to be told apart by these data:\n" + "\n".join(lines[:12])


def answer(verdict: Verdict) -> str:
    """The 90 % set and the amplitudes of the answer."""
    parts = []
    if verdict.answer.effects:
        rows = [["effect", "amplitude", "95 %", ""]]
        for effect in verdict.answer.effects:
            low, high = effect.interval_95
            unit = f" {effect.unit}" if effect.unit else ""
            rows.append([effect.name, f"{effect.amplitude:.3g} +- {effect.std:.2g}{unit}",
                         f"{low:.3g} to {high:.3g}", effect.words])  # fmt: skip
        parts.append(aligned(rows, left=(0, 3)))
    if verdict.answer.set_90:
        rows = [["explanation", "probability"]]
        rows += [
            [" + ".join(one.names) or "none: the base model", f"{one.probability:.0%}"]
            for one in verdict.answer.set_90
        ]
        parts.append(aligned(rows))
    return "\n\n".join(parts)


def steps(lines: Sequence[WaterfallStep], notes: Sequence[str] = ()) -> str:
    """The error of each model, fitted and held out, against the noise."""
    parameters_ = list(lines[0].values) if lines else []
    rows = [["model", "chi2", "noise", "held out", "noise", *parameters_, "effects", ""]]
    for place, step in enumerate(lines):
        effects = ", ".join(f"{name} {amplitude:.3g}" for name, amplitude in step.effects.items())
        rows.append(
            [
                step.hypothesis,
                f"{step.chi2:.1f}",
                str(step.dof),
                _number(step.held_out_chi2, ".1f"),
                str(step.held_out_n or ""),
                *(f"{step.values[name]:.4g}" for name in parameters_),
                effects,
                notes[place] if place < len(notes) else step.note,
            ]
        )
    return aligned(rows, left=(0, len(rows[0]) - 2, len(rows[0]) - 1))


def next_measurements(lines: Sequence[NextMeasurement]) -> str:
    """What to measure next."""
    rows = [["measure next", "gain"]]
    rows += [[line.words or line.name, f"{line.gain:.1f}"] for line in lines]
    return aligned(rows)


def _number(value: float | None, form: str) -> str:
    return "" if value is None else f"{value:{form}}"
