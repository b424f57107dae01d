"""Sentences of the report of a diagnosis.

In: a `DiagnosisData`. Out: sentences. Every statement on effects is about those tested.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from diagnosis.hypotheses.model import FAMILIES
from diagnosis.hypotheses.section import BOUNDARY
from diagnosis.options import Options
from diagnosis.track_record import worth_of
from diagnosis.verdict.verdict import (
    SOLVER_ERRORS,
    CandidateVerdict,
    Check,
    FittedModelSummary,
    MeasurementVerdict,
    NextMeasurement,
    ParameterWords,
    PredictedReading,
    QuotedValue,
    Verdict,
    WaterfallStep,
    Window,
)
from pipeline.ties import largest, ranked, smallest
from report.data.diagnosis import DiagnosisData
from report.data.overview import record_span
from report.numbers import (
    MINUS,
    at_least,
    chance,
    from_to,
    number,
    percent,
    plural,
    plus_minus,
    root_mean_square,
    signed_percent,
    with_unit,
)

VERDICTS = {
    "adequate": "adequate",
    "suspect": "suspect",
    "identified": "identified",
    "ambiguous": "ambiguous",
    "unknown_effect": "unknown effect",
}
#: Verdicts with which a strength that is quoted is a range and no result.
UNEXPLAINED = ("suspect", "unknown_effect")
AMONG = "among the effects tested"
#: Members of a family that are named in a sentence.
FEW = 5
NOT_SEPARABLE, WEAKLY = Options.inseparable, Options.hardly_separable
#: Shares of the variance that are named, and from which the solver's own is the most.
LEAST_SHARE, MOSTLY_OWN = 0.01, 0.5
BY_HAND = "by hand"
"""Start of the note of a step taken by a person."""


def spoken(name: str) -> str:
    """The name of an effect or a model in words; of a boundary, what it bounds."""
    return name.removeprefix(BOUNDARY).replace("_", " ")


def shortened(name: str, width: int) -> str:
    """A name as words, cut after a whole word where it is longer than `width` characters."""
    words = spoken(name)
    if len(words) <= width:
        return words
    return f"{words[: width - 1].rsplit(' ', 1)[0]}\N{HORIZONTAL ELLIPSIS}"


def explanation(names: list[str]) -> str:
    """Effects that act together, in words."""
    return " with ".join(map(spoken, names)) if names else "no effect, the base model"


def reading_words(entry: NextMeasurement, said: PredictedReading) -> str:
    """What a measurement would read, with a standard deviation."""
    numbers = [plus_minus(*pair, entry.unit) for pair in zip(said.values, said.std, strict=True)]
    parts = entry.parts or [""] * len(numbers)
    return ", ".join(f"{part} {text}".strip() for part, text in zip(parts, numbers, strict=True))


def foreseen(found: Verdict | None) -> list[NextMeasurement]:
    """Measurements whose readings are foreseen: the test of the answer, then what to do next."""
    if found is None:
        return []
    test = [] if found.refutation is None else [found.refutation]
    names = [one.name for one in test]
    return [*test, *(one for one in found.next_measurement if one.name not in names)]


def refuted_sentence(found: Verdict | None) -> str:
    """How an answer, or an adequate base model, could be refuted by one measurement."""
    first = next(iter(foreseen(found)), None)
    if found is None or first is None or not first.outcomes:
        return ""
    if found.refutation is None and found.verdict not in ("adequate", "suspect"):
        return ""  # nothing explains: there is nothing to refute
    said = first.outcomes[0]
    claim = explanation(said.names) if said.names else "the base model"
    return (
        f"How this could be refuted: {first.words or first.name}. With {claim} it would read "
        f"{reading_words(first, said)}. A reading more than two of these standard deviations away "
        "is against it."
    )


def off(stage: FittedModelSummary) -> float:
    """Misfit of a model on the fitted data, in standard deviations.

    NaN where there are no more data than parameters: no misfit is possible.
    """
    return root_mean_square(stage.chi2, stage.dof)


def off_held_out(stage: FittedModelSummary) -> float:
    """The same on held-out data; NaN where nothing was held out."""
    return root_mean_square(stage.held_out.chi2, stage.held_out.n)


def tested_sentence(data: DiagnosisData) -> str:
    """The effects that were tested, and those that were ruled out."""
    if data.verdict is None or not data.verdict.tested:
        return ""
    tested = data.verdict.tested
    family = {one.name: one.family for one in data.candidates}
    names: dict[str, list[str]] = {}
    for name in tested:
        names.setdefault(family.get(name, "physics"), []).append(spoken(name))
    groups = [
        f"{name} ({', '.join(names[name])})"
        if len(names[name]) <= FEW
        else f"{name} ({len(names[name])})"
        for name in FAMILIES
        if name in names
    ]
    said = f"{len(tested)} tested, by family: {', '.join(groups)}; all under Scores."
    if data.verdict.forbidden:
        said += f" Excluded beforehand: {', '.join(map(spoken, data.verdict.forbidden))}."
    return said


def answer_sentences(data: DiagnosisData) -> list[str]:
    """The effects of the answer, and the alternatives that explain the data as well."""
    if data.verdict is None:
        return []
    said = []
    unknown = data.verdict.verdict == "unknown_effect"
    for one in data.verdict.answer.effects:
        name = spoken(one.name).capitalize()
        if data.verdict.verdict == "ambiguous":
            name = f"Most probable: {spoken(one.name)}"
        elif data.verdict.answer.would_explain:
            name = f"Would explain the measurements: {spoken(one.name)}"
        elif unknown:
            name = f"Added, but not sufficient: {spoken(one.name)}"
        said.append(
            f"{name} ({one.words}): amplitude "
            f"{plus_minus(one.amplitude, one.std, one.unit)}, 95 % interval "
            f"{from_to(*one.interval_95, one.unit)}."
        )
    rivals = data.verdict.answer.set_90
    if len(rivals) > 1 and not unknown:
        listed = "; ".join(f"{explanation(r.names)} ({percent(r.probability)})" for r in rivals)
        said.append(f"Together 90 % of the probability among those tried: {listed}.")
    elif rivals and rivals[0].names and not unknown:
        said.append(
            f"It has {percent(rivals[0].probability)} of the probability {AMONG}; no alternative "
            "is needed to reach 90 %."
        )
    if data.verdict.verdict == "ambiguous":
        said.append(
            "The strength depends on which of them it is, and its interval spans these alone: if "
            "what happened was none of them, it is outside. Measure what is proposed below before "
            "using it."
        )
    if unknown:
        said.append(
            "The calibrated strength includes the error of the model. It is shown, but it is not a "
            "result."
        )
    return said


def worth_sentence(data: DiagnosisData) -> str:
    """How far the strength was off where the truth was known and the same was said."""
    quoted = {} if data.verdict is None else data.verdict.quoted
    strengths = [p for p in data.parameters if p.strength and p.name in quoted]
    found = worth_of(data.verdict.verdict) if strengths else None
    ends = [record_span(data.verdict, p.name) for p in strengths]
    if found is None or None in ends:
        return ""
    spans = []
    for p, (low, high) in zip(strengths, ends, strict=True):
        of = f" of {spoken(p.name)}" if len(strengths) > 1 else ""
        spans.append(f"{number(low)} to {with_unit(high, p.unit)}{of}")
    plane = " They were plane; of bodies there is no record." if data.of_body else ""
    return (
        f"What this verdict has been worth: of {found.slides} slides made by other codes on which "
        f"it was given, {found.hidden} of them with something hidden, the residual strength was "
        f"off by {percent(found.half_off)} or less in half and by {percent(found.most_off)} or "
        f"less in nine of ten, which here is {', '.join(spans)}; its 95 % interval held it in "
        f"{found.held}.{plane}"
    )


def test_words(name: str) -> str:
    """The name of a test in words."""
    known = {
        "chi2": "the size of all residuals",
        "autocorrelation": "the correlation of neighbours along a series",
        "score": "the best score of a candidate",
        "held_out": "the held-out data",
    }
    return known.get(name) or f"the residuals of {name.removeprefix('group ')}"


def worst_test(stage: FittedModelSummary) -> Check:
    """The test that noise would pass least."""
    return smallest(stage.tests, lambda test: test.p, unit=0.0)


def alarm_sentence(data: DiagnosisData) -> str:
    """Whether the base model is adequate, by which test."""
    stage = data.base
    if not stage.tests:
        return ""
    worst = worst_test(stage)
    return (
        f"Base model: chi² {number(stage.chi2)} on {stage.dof} degrees of freedom. Of "
        f"{len(stage.tests)} tests the most significant is {test_words(worst.name)} "
        f"({chance(worst.p)}); all combined {chance(stage.p_combined)}. Below 0.05 is an alarm, "
        "below 0.20 a suspicion."
    )


def window_sentence(window: Window | None, model: str) -> str:
    """Where a model fails worst."""
    if window is None:
        return ""
    off_by = root_mean_square(window.chi2, window.n)
    return (
        f"Worst stretch of the {model}: {window_words(window)}, {plural(window.n, 'number')}, off "
        f"by {off_by:.1f} standard deviations (root mean square). Probability that noise alone has "
        f"such a stretch: {chance(window.p)}."
    )


def window_words(window: Window) -> str:
    """A stretch of one measurement."""
    if window.axis == "none" or window.x_from is None or window.x_to is None:
        return window.first if window.first == window.last else f"{window.first} to {window.last}"
    axis, unit = ("x ", "m") if window.axis == "x_m" else ("", "s")
    ends = f"{number(window.x_from)} to {number(window.x_to)}"
    return f"{window.measurement} from {axis}{ends} {unit}"


def validation_sentence(data: DiagnosisData) -> str:
    """How the answer performs on a second section or event."""
    check = None if data.verdict is None else data.verdict.validation_case
    if check is None:
        return ""
    ends = [root_mean_square(chi2, check.n) for chi2 in (check.chi2_base, check.chi2_final)]
    return (
        f"On {spoken(check.case)}, which was not fitted ({check.n} numbers, with the parameters "
        f"found here): {ends[0]:.1f} standard deviations for the base model, {ends[1]:.1f} for the "
        "model of the answer."
    )


def role_sentence(data: DiagnosisData) -> str:
    """Which data were held out and which are constructed."""
    said = []
    if held := _of_role(data, "held out"):
        said.append(f"Held out, not fitted: {held}.")
        block = data.base.held_out
        if block.moved is not None:
            verb = "can tell nothing" if block.moved < 1.0 else "can tell"
            said.append(
                f"They {verb}: of the hypotheses {spoken(block.mover)} moves them most, by "
                f"{number(block.moved, 2)} standard deviations."
            )
    if drawn := _of_role(data, "constructed"):
        said.append(f"Constructed, not surveyed: {drawn}; shown only, not part of a fit or score.")
    return " ".join(said)


def _of_role(data: DiagnosisData, role: str) -> str:
    found = []
    for name in dict.fromkeys(m.measurement for m in data.measurements):
        lines = [m for m in data.measurements if m.measurement == name]
        own = [m for m in lines if m.role == role]
        if own and len(own) == len(lines):
            found.append(name)
        elif own:
            found.append(f"{name} {stretch(own)}")
    return ", ".join(found)


def stretch(lines: list[MeasurementVerdict]) -> str:
    """From where to where numbers of one measurement reach."""
    if lines[0].axis == "none" or any(line.place is None for line in lines):
        return ", ".join(line.name.removeprefix(line.measurement).strip() for line in lines)
    places = [line.place for line in lines]
    axis, unit = ("x ", "m") if lines[0].axis == "x_m" else ("", "s")
    if len(places) == 1:
        return f"at {axis}{number(places[0])} {unit}"
    return f"from {axis}{number(min(places))} to {number(max(places))} {unit}"


def confounded(
    data: DiagnosisData, least: float, most: float = 1.01
) -> list[tuple[str, str, float]]:
    """Pairs of candidates whose |cos| lies in [least, most), the closest first."""
    found = data.confounding
    if found is None:
        return []
    pairs = [
        (found.names[i], found.names[j], abs(found.cosine[i][j]))
        for i in range(len(found.names))
        for j in range(i)
    ]
    return ranked((p for p in pairs if least <= p[2] < most), lambda p: p[2])


def confounding_sentences(data: DiagnosisData) -> list[str]:
    """Which candidates these data cannot distinguish."""
    if data.confounding is None:
        return []
    groups = (
        (NOT_SEPARABLE, 1.01, "Not separable with these data"),
        (WEAKLY, NOT_SEPARABLE, "Weakly separable"),
    )
    said = []
    for least, most, words in groups:
        if pairs := confounded(data, least, most):
            listed = ", ".join(f"{spoken(a)} and {spoken(b)}" for a, b, _ in pairs[:6])
            more = f", and {len(pairs) - 6} more pairs" if len(pairs) > 6 else ""
            said.append(f"{words}: {listed}{more}.")
    return said or ["These data can distinguish every pair of candidates."]


def strength_sentences(data: DiagnosisData) -> list[str]:
    """Each parameter before and after."""
    said = []
    for p in data.parameters:
        before = strength_words(data.base, p)
        text = f"{p.words[:1].upper()}{p.words[1:]}: {before} with the base model"
        if data.final is not None and p.name in data.final.values:
            after = strength_words(data.final, p)
            text += f", {after} with the effects of the answer"
        said.append(f"{text}.")
        if used := quoted_words(data, p.name, p.unit):
            said.append(used)
    return said


def bound(p: ParameterWords, stage: FittedModelSummary) -> str:
    """The bound on which a parameter rests in a model, in words; empty: on none."""
    value = stage.values.get(p.name, math.nan)
    low, high = p.low, p.high
    if min(low, value) > 0.0:  # strengths are fitted as logarithms, whose bounds may be far apart
        value, low, high = math.log(value), math.log(low), math.log(high)
    near = 1e-3 * (high - low)
    return "lower" if value <= low + near else "upper" if value >= high - near else ""


def bound_sentence(data: DiagnosisData) -> str:
    """Parameters of the base model that rest on a bound, and what this means for the answer."""
    resting = " and on ".join(
        f"the {side} bound of {p.words}, {with_unit(data.base.values[p.name], p.unit)}"
        for p in data.parameters
        if (side := bound(p, data.base))
    )
    if not resting:
        return ""
    return (
        f"The base model rests on {resting}. There the parameter cannot give way to an "
        "effect, and effects are ranked as if it were known: if the bound is a guess, widen it."
    )


def error_sentence(data: DiagnosisData) -> str:
    """What the uncertainty of the comparison is made of, and what would reduce it."""
    found = getattr(data.document, "fitted_to", None)
    shares = {} if found is None else {k: v for k, v in found.shares.items() if v >= LEAST_SHARE}
    if len(shares) < 2:
        return ""
    parts = [
        f"{error} {percent(share)}" for error, share in ranked(shares.items(), lambda item: item[1])
    ]
    said = f"Of the variance of the fitted numbers {', '.join(parts[:-1])} and {parts[-1]}."
    own = sum(shares.get(name, 0.0) for name in SOLVER_ERRORS)
    if own > MOSTLY_OWN:
        said += (
            " Most of it is the solver's own and shrinks with the spacing of the points: a finer "
            "model (--spacing) says more than another measurement. Half the spacing takes eight "
            "times as long."
        )
    return said


def quoted_value(verdict: Verdict, name: str, unit: str) -> str:
    """The value of a parameter that is quoted; where nothing explains only its 95 % interval.

    Of a slope that did not run it is a lower bound. A standard deviation says nothing of a range
    that ends at the bounds of what is believed.
    """
    used = verdict.quoted[name]
    low, high = used.intervals["95%"]
    if used.at_least is not None:
        return at_least(used.at_least, used.std, unit)
    if verdict.verdict in UNEXPLAINED:
        return f"{number(low)} to {with_unit(high, unit)}"
    return plus_minus(used.value, used.std, unit)


def quoted_words(data: DiagnosisData, name: str, unit: str) -> str:
    """The value of a parameter that is quoted, and what it is made of; empty: not known."""
    used = None if data.verdict is None else data.verdict.quoted.get(name)
    if used is None:
        return ""
    low, high = used.intervals["95%"]
    made = plural(len(used.models), "model")
    value = quoted_value(data.verdict, name, unit)
    if used.at_least is not None:
        limit = plus_minus(used.value, used.std, unit)
        return f"Quoted: {value}; the limit of flow is {limit}. No upper bound follows."
    if data.verdict.verdict in UNEXPLAINED:
        return (
            f"Not a result, only a range: {value} (95 % interval of the base model and all tried "
            f"that fit clearly better, {made}, widened by what they leave{unlisted_words(used)})."
        )
    value = f"{value}, 95 % interval {number(low)} to {number(high)}"
    of = f"all of the answer, {made}" if len(used.models) > 1 else "one model"
    return f"Quoted: {value} ({of}{unlisted_words(used)})."


def unlisted_words(used: QuotedValue) -> str:
    """What a standard deviation holds for causes that no list has; empty: nothing."""
    if not used.beyond:
        return ""
    return f", with {percent(used.beyond)} for causes that are on no list"


def fitted_words(stage: FittedModelSummary, p: ParameterWords) -> str:
    """A parameter with its error; on a bound that says nothing, and the bound is named."""
    if side := bound(p, stage):
        return f"{with_unit(stage.values[p.name], p.unit)}, its {side} bound"
    return plus_minus(stage.values[p.name], stage.std.get(p.name, 0.0), p.unit)


def strength_words(stage: FittedModelSummary, p: ParameterWords) -> str:
    """The same, with what is assumed in its error too where that is known."""
    found, wide = fitted_words(stage, p), stage.std_assumed.get(p.name)
    if wide is None or bound(p, stage):
        return found
    return f"{found} (std {number(wide, 2)} with what is assumed of soils, geometry and survey)"


def hidden_sentence(data: DiagnosisData) -> str:
    """The largest change of a strength that an undetected effect could cause."""
    entries = [(p, *item) for p in data.parameters for item in data.hidden.get(p.name, {}).items()]
    if not entries:
        return ""
    p, name, change = largest(entries, lambda entry: abs(entry[2]))
    return (
        "An effect too weak to be detected here can still shift the result. The largest shift: "
        f"{spoken(name)} changes {p.words} by up to {signed_percent(change)}."
    )


def is_by_hand(step: WaterfallStep, by_hand: Collection[str] = ()) -> bool:
    """This model was added by a person, not by the loop."""
    return step.hypothesis in by_hand or step.note.startswith(BY_HAND)


def follows(number_: int, steps: Sequence[WaterfallStep]) -> bool:
    """A step adds to the one before or removes from it; otherwise it is an alternative to it."""
    if not number_:
        return False
    own, before = set(steps[number_].effects), set(steps[number_ - 1].effects)
    return own >= before or own < before


def step_words(number_: int, steps: Sequence[WaterfallStep], by_hand: Collection[str] = ()) -> str:
    """The name of a row: what this step changed in the one before, or all its effects."""
    step = steps[number_]
    before = steps[number_ - 1].effects if follows(number_, steps) else {}
    added = [f"+ {spoken(name)}" for name in step.effects if name not in before]
    dropped = [f"{MINUS} {spoken(name)}" for name in before if name not in step.effects]
    name = ", ".join([*added, *dropped])
    if not name:
        name = spoken(step.hypothesis.lstrip("0123456789_")) if number_ else "base model"
    elif number_ and not follows(number_, steps):
        name = f"base {name}"
    return f"{name} (by hand)" if is_by_hand(step, by_hand) else name


def achieved(candidate: CandidateVerdict) -> float | None:
    """Reduction of chi² when the effect was refitted; None: it was not."""
    return None if candidate.refit is None else candidate.refit.drop
