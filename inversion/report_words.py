"""What a report says in words: the answer in a sentence, misfits, what is not determined.

In: a `ReportData`. Out: sentences. Nothing is said that is not in the result.
"""

from __future__ import annotations

from inversion.draw_measured import groups
from inversion.draw_methods import ENGINES
from inversion.report_data import ReportData
from inversion.result import MeasurementAnswer, ParameterAnswer

FAR = 2.0
"""Standard deviations beyond which a difference is called a misfit."""

WIDE = 0.2
"""Width of the range of equally good answers that the first line tells, as a share of the value."""

ALONE = 0.98
"""Component of a direction, of length 1, from which on it is one parameter's."""

MINUS = "\N{MINUS SIGN}"

ENGINE_WORDS = {"mpm": "the material point method"}
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
    engine = ENGINE_WORDS.get(result.engine, result.engine)
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
    return ", with the reservoir" if data.with_water else ", without water"


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


def misfits(data: ReportData) -> list[MeasurementAnswer]:
    """Measurements, not constructed, that the answer misses by more than `FAR`, worst first."""
    far = [
        m
        for m in data.result.measurements
        if m.role != "constructed"
        and m.difference_in_std is not None
        and abs(m.difference_in_std) > FAR
    ]
    return sorted(far, key=lambda m: -abs(m.difference_in_std))


def misfit_sentence(data: ReportData) -> str:
    """What the answer does not reproduce, or that nothing was found."""
    far = misfits(data)
    if far:
        told = "; ".join(_misfit(m) for m in far[:4])
        more = f"; and {len(far) - 4} more" if len(far) > 4 else ""
        return f"Not reproduced: {told}{more}."
    judges = [m for m in data.result.measurements if m.role in ("held out", "compared")]
    if not judges:
        return "No measurement outside the fit is there to judge the answer by."
    told = "; ".join(
        f"{m.name}, measured {m.measured:g} {m.unit}, predicted {plain(m.predicted)}"
        for m in judges[:4]
    )
    return f"Measurements outside the fit are met within {FAR:g} standard deviations: {told}."


def _misfit(m: MeasurementAnswer) -> str:
    role = "" if m.role == "fitted" else f", {m.role}"
    return (
        f"{m.name} measured {m.measured:g} ± {m.std:g} {m.unit}, predicted "
        f"{plain(m.predicted)} {m.unit} ({signed(m.difference_in_std)} standard deviations{role})"
    )


def variant_sentences(data: ReportData) -> list[str]:
    """What other readings of the question miss, and which of them meet what the answer misses."""
    known = {m.name: m for m in data.result.measurements if m.role != "constructed"}
    missed_here = {m.name for m in misfits(data)}
    missed, met = [], []
    for variant in data.result.variants:
        for name, predicted in variant.predicted.items():
            m = known.get(name)
            if m is None or not m.std or name in variant.measured:
                continue
            told = f"{variant.name}, {name} {plain(predicted)} {m.unit} (measured {m.measured:g})"
            if abs(predicted - m.measured) > FAR * m.std:
                missed.append(told)
            elif name in missed_here:
                met.append(told)
    sentences = [f"Not reproduced under other readings: {'; '.join(missed)}."] if missed else []
    if met:
        sentences.append(f"Met under other readings: {'; '.join(met)}.")
    return sentences


def toe_words(data: ReportData) -> list[str]:
    """Where each toe stands after the simulated slide, and where it was measured."""
    known = {m.name: m for m in data.result.measurements}
    return [
        f"the {toe.name} moves {plain(known[toe.name].predicted)} m; {toe.value_m:g} m was measured"
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
    engine = ENGINES.get(data.result.engine, data.result.engine)
    if len(found) == 1:
        return f"{p.label}: {p.value:.1f} {unit(p)} as asked ({engine}), {low[0]:.1f} {low[1]}."
    return (
        f"{p.label}: {p.value:.1f} {unit(p)} as asked ({engine}); from {low[0]:.1f} ({low[1]}) to "
        f"{high[0]:.1f} {unit(p)} ({high[1]}) under other readings of the question."
    )
