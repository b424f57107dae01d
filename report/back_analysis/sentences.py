"""What a report says in words: the answer in a sentence, misfits, what is not determined.

In: a `ReportData`. Out: sentences. Nothing is said that is not in the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inversion.back_analysis.result import MeasurementAnswer, ParameterAnswer
from inversion.engines.registry import engine_named
from report.back_analysis.data import ReportData
from report.charts.measured import groups

FAR, FAR_SHARE = 2.0, 0.1
"""Standard deviations beyond which a difference is called a misfit; share of a series that may."""

WIDE = 0.2
"""Width of the range of equally good answers that the first line tells, as a share of the value."""

ALONE = 0.98
"""Component of a direction, of length 1, from which on it is one parameter's."""

MINUS = "\N{MINUS SIGN}"

SYMBOL = {"kPa": "kPa", "deg": "°", "kg/m3": "kg/m³"}


def unit(parameter: ParameterAnswer) -> str:
    """The unit as it is written after a number."""
    return SYMBOL.get(parameter.unit, parameter.unit)


def number_with_unit(parameter: ParameterAnswer, number: str) -> str:
    """A number with the unit of a parameter, degrees without a space."""
    space = "" if unit(parameter) == "°" else " "
    return f"{number}{space}{unit(parameter)}"


def value(parameter: ParameterAnswer) -> str:
    """Value and standard deviation with the unit."""
    return number_with_unit(parameter, f"{parameter.value:.1f} ± {parameter.std_total:.1f}")


def signed(number: float, digits: int = 1) -> str:
    """A number with its sign, a true minus, and none before nothing."""
    text = f"{number:+.{digits}f}"
    return text[1:] if not float(text) else text.replace("-", MINUS)


def plain(number: float, digits: int = 1) -> str:
    """A number with a true minus."""
    return f"{number:.{digits}f}".replace("-", MINUS)


def answer_sentence(data: ReportData) -> str:
    """The answer: strengths with ratios, engine, spacing, water, and whether it fits."""
    result = data.result
    parts = []
    for p in data.strengths or result.answer.parameters:
        ratio = ""
        if p.ratio is not None:
            ratio = f" (S_r/σ'_v0 = {p.ratio:.3f} ± {p.ratio_std:.3f})"
        parts.append(f"{p.label}: {value(p)}{ratio}{_as_good(p)}")
    engine = engine_named(result.engine).description
    how = f"by {engine} at {result.spacing_m:g} m spacing{water_words(data)}"
    end = (
        "" if result.answer.reached else " NOT FITTED: the search ended before the loss was small."
    )
    return f"{'; '.join(parts)}; {how}.{end}"


def _as_good(parameter: ParameterAnswer) -> str:
    """The range of the equally good answers, where it is a wide one."""
    if parameter.equally_good_range is None:
        return ""
    low, high = parameter.equally_good_range
    if high - low < WIDE * abs(parameter.value):
        return ""
    return f", as good anywhere from {low:.1f} to {high:.1f}"


def water_words(data: ReportData) -> str:
    """With or without the reservoir, where that is known."""
    if data.with_water is None:
        return ""
    if not data.with_water:
        return ", without water"
    return f", with the reservoir ({data.run.settings.water.replace('_', ' ')})"


def surrogate_sentences(data: ReportData) -> list[str]:
    """What the learned simulator is, how far it is from the material point method, what was done.

    Empty for the material point method.
    """
    found = data.result.surrogate
    if found is None:
        return []
    fitted = [m for m in data.result.measurements if m.role == "fitted"][:6]
    told = [
        f"{m.name} {signed(found.mean_difference[m.name], 2)} ± {found.std[m.name]:.2f} {m.unit}"
        for m in fitted
        if m.name in found.mean_difference
    ]
    added = [
        f"{p.label} ± {number_with_unit(p, f'{found.answer_std[p.name]:.2g}')}"
        for p in data.strengths or data.result.answer.parameters
    ]
    said = [
        f"Simulated by the learned simulator {found.model}, differentiated through the whole "
        f"rollout. At {len(found.pairs)} states around the answer the material point method ran "
        f"beside it; it differs by {'; '.join(told)}. The mean is added to every prediction, and "
        f"the scatter is in the covariance of the fit: it adds {'; '.join(added)}.",
        "The section and the film show the material point method at this answer; the iterations "
        "show the learned simulator.",
    ]
    said += [f"Outside the training of {found.model}: {line}." for line in found.outside]
    return said


def meaning_sentences(data: ReportData) -> list[str]:
    """What the numbers after ± are, and what they rest on."""
    result = data.result
    told = [
        "± is one standard deviation, of the survey and of every assumption that was tried; ratios "
        "are to the mean vertical effective stress of the zone before failure."
    ]
    ranges = [
        f"{p.label} {p.interval_95[0]:.1f} to {p.interval_95[1]:.1f} {unit(p)}"
        for p in data.strengths
    ]
    if ranges:
        told.append(f"95 % range: {'; '.join(ranges)}.")
    fitted = [m for m in result.measurements if m.role == "fitted"]
    if fitted:
        names = "; ".join(f"{m.name} {m.measured:g} {m.unit} ({m.confidence})" for m in fitted[:6])
        more = f" and {len(fitted) - 6} more" if len(fitted) > 6 else ""
        told.append(f"Fitted: {names}{more}. Measurements: set '{result.measurement_set}'.")
    if data.result.variants:
        told.append(variant_sentence(data))
    at_bound = [
        f"{p.label} at its {p.at_bound} bound" for p in result.answer.parameters if p.at_bound
    ]
    if at_bound:
        told.append(f"Resting on a bound: {'; '.join(at_bound)}.")
    return told


@dataclass(frozen=True)
class Judged:
    """A measurement outside what was constructed, against a prediction of it.

    Attributes:
        name: of the measurement.
        role: what the search did with it.
        far: it is missed: by more than `FAR`, or a series at more than `FAR_SHARE` of its places.
        off: the largest difference, in standard deviations.
        words: measured and predicted.
    """

    name: str
    role: str
    far: bool
    off: float
    words: str


def judged(data: ReportData, predicted: Mapping[str, float]) -> list[Judged]:
    """Every measurement against predictions by name of their numbers, the worst first.

    Numbers without a prediction, and what was constructed, are left out.
    """
    found = []
    for group in groups(data):
        lines = [
            (m, predicted[m.name])
            for m in group.lines
            if m.name in predicted and m.std and m.role != "constructed"
        ]
        if lines:
            found.append(_judge(group.name, lines))
    return sorted(found, key=lambda one: -abs(one.off))


def _judge(name: str, lines: Sequence[tuple[MeasurementAnswer, float]]) -> Judged:
    off = np.array([(value - m.measured) / m.std for m, value in lines])
    worst = int(np.argmax(np.abs(off)))
    m, value = lines[worst]
    beyond = int((np.abs(off) > FAR).sum())
    words = (
        f"{name} measured {m.measured:g} ± {m.std:.3g} {m.unit}, predicted {plain(value)} {m.unit}"
    )
    if len(lines) > 1:
        square = np.sqrt(np.mean([(value - m.measured) ** 2 for m, value in lines]))
        place = m.name.removeprefix(name).strip()
        words = (
            f"{name}, {beyond} of {len(lines)} values off by more than {FAR:g} standard "
            f"deviations, root mean square {square:.1f} {m.unit}, worst {place}"
        )
    return Judged(name, m.role, beyond > FAR_SHARE * len(lines), float(off[worst]), words)


def misfits(data: ReportData) -> list[Judged]:
    """Measurements, not constructed, that the answer misses, the worst first."""
    return [one for one in judged(data, _predicted(data)) if one.far]


def _predicted(data: ReportData) -> dict[str, float]:
    return {m.name: m.predicted for m in data.result.measurements}


def misfit_sentence(data: ReportData) -> str:
    """What the answer does not reproduce, or that nothing was found."""
    if far := misfits(data):
        told = "; ".join(
            f"{one.words} ({signed(one.off)} standard deviations"
            f"{'' if one.role == 'fitted' else f', {one.role}'})"
            for one in far
        )
        return f"Not reproduced: {told}."
    judges = [one for one in judged(data, _predicted(data)) if one.role != "fitted"]
    if not judges:
        return "No measurement outside the fit is there to judge the answer by."
    told = "; ".join(one.words for one in judges)
    return f"Measurements outside the fit are met within {FAR:g} standard deviations: {told}."


def variant_sentences(data: ReportData) -> list[str]:
    """What other readings of the question miss, and which of them meet what the answer misses."""
    missed_here = {one.name for one in misfits(data)}
    missed, met = [], []
    for variant in data.result.variants:
        outside = {
            name: value for name, value in variant.predicted.items() if name not in variant.measured
        }
        for one in judged(data, outside):
            if one.far:
                missed.append(f"{variant.name}: {one.words}")
            elif one.name in missed_here:
                met.append(f"{variant.name}: {one.words}")
    sentences = [f"Not reproduced under other readings: {'; '.join(missed)}."] if missed else []
    if met:
        sentences.append(f"Met under other readings: {'; '.join(met)}.")
    return sentences


def toe_words(data: ReportData) -> list[str]:
    """Where each toe stands after the slide that is drawn, and where it was measured.

    The slide is one of the material point method, whichever engine has found the strengths.
    """
    known = {m.name: m.predicted for m in data.result.measurements}
    if data.result.surrogate is not None:
        answer = {p.name: p.value for p in data.result.answer.parameters}
        judges = [row for row in data.result.engines if row.engine == "mpm"]
        known = next(row.predicted for row in judges if row.values == answer)
    return [
        f"the {toe.name} moves {plain(known[toe.name])} m; {toe.values[0]:g} m was measured"
        for toe in data.toes
        if toe.name in known
    ]


def constructed_sentence(data: ReportData) -> str:
    """Which data were drawn and not surveyed; empty: none."""
    names = [group.name for group in groups(data) if group.role == "constructed"]
    if not names:
        return ""
    return (
        f"Constructed, not surveyed: {', '.join(names)}. It is drawn (dotted) for orientation and "
        "entered neither fit nor score."
    )


def undetermined_sentences(data: ReportData) -> list[str]:
    """What the data say nothing of: directions, and each number before and after."""
    alone = {p.name for p in data.result.answer.parameters if not p.determined}
    told = []
    for direction in data.result.answer.undetermined:
        name, largest = max(direction.direction.items(), key=lambda item: abs(item[1]))
        if name not in alone or abs(largest) < ALONE:  # else told by its own name, below
            told.append(
                f"Not determined: {direction.words} (standard deviation {direction.remaining:.2f} "
                "of the one before)."
            )
    for p in data.result.answer.parameters:
        if not p.determined:
            basis = "its prior" if p.has_prior else f"its bounds, {p.low:g} to {p.high:g}"
            after, before = (
                number_with_unit(p, f"± {std:.2g}") for std in (p.std_data, p.prior_std)
            )
            told.append(
                f"{p.label[:1].upper()}{p.label[1:]} is not identifiable from these measurements: "
                f"{after} after them, {before} before ({basis}). "
                f"The value {p.value:.1f} is only where the search left it."
            )
    if not told:
        told.append("The data determine every number that was sought.")
    return told


def variant_sentence(data: ReportData) -> str:
    """The strengths under the readings without and with water, the widest spread named."""
    if not data.result.variants or not data.strengths:
        return ""
    p = data.strengths[0]
    found = [(v.values[p.name], v.name) for v in data.result.variants]
    low, high = min(found), max(found)
    engine = engine_named(data.result.engine).short
    if len(found) == 1:
        return f"{p.label}: {p.value:.1f} {unit(p)} as asked ({engine}), {low[0]:.1f} {low[1]}."
    return (
        f"{p.label}: {p.value:.1f} {unit(p)} as asked ({engine}); from {low[0]:.1f} ({low[1]}) to "
        f"{high[0]:.1f} {unit(p)} ({high[1]}) under other readings of the question."
    )
