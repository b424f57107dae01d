"""Sentences of the report of a back-analysis: the answer, misfits, what the data do not determine.

In: a `BackAnalysisData`. Out: sentences. Nothing is said that is not in the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.track_record import worth_of
from diagnosis.verdict.verdict import Verdict
from inversion.back_analysis.result import MeasurementAnswer, ParameterAnswer, Result
from inversion.engines.registry import engine_named
from inversion.problem.changes import WATER_WORDS
from pipeline.ties import largest, largest_place, ranked
from report.data.back_analysis import MANY, BackAnalysisData
from report.numbers import (
    at_least,
    fixed,
    measured_places,
    places_of,
    plus_minus,
    signed,
    span,
    unit_of,
    with_unit,
)
from report.sentences.small_cells import cells_words
from report.two_strengths import diagnosis_in

FAR, FAR_SHARE = 2.0, 0.1
"""Standard deviations beyond which a difference is a misfit; share of a series that may exceed."""

WIDE = 0.2
"""Least width of the range of equally good answers in the first line, as a share of the value."""

ALONE = 0.98
"""Component of a direction, of length 1, from which on it belongs to one parameter."""


#: Standard deviation of the logarithm of a strength by the cells from which the first line says so.
UNSURE = 0.15


def answer_sentence(data: BackAnalysisData) -> str:
    """The answer: strengths with ratios, engine, spacing, water, and whether it fits."""
    result = data.result
    parts = []
    for p in data.answers:
        if p.lower_bound_95 is not None:
            parts.append(_bound(p))
            continue
        ratio = ""
        if p.strength_kpa is not None:
            ratio = f" ({meant_words(p)})"
        elif p.ratio is not None:
            ratio = f" (S_r/σ'_v0 = {p.ratio:.3f} ± {p.ratio_std:.3f})"
        value = plus_minus(p.value, p.std_total, p.unit)
        parts.append(f"{p.label}: {value}{ratio}{_equally_good(p)}")
    engine = engine_named(result.engine).description
    cells = result.answer.small_cells
    taken = ", taken to small cells" if cells is not None and cells.known else ""
    how = f"by {engine} at {result.spacing_m:g} m spacing{taken}{_water(data)}"
    end = "" if result.answer.reached else " NOT FITTED: the search ended with a large loss."
    return f"{'; '.join(parts)}; {how}.{end}"


def first_line(data: BackAnalysisData) -> str:
    """The strengths with the range that the verdict of their diagnosis is worth, and their ratios.

    Without a verdict the range is the 95 % interval. Empty: no strength was fitted to what ran.
    """
    strengths = [p for p in data.answers if p.ratio is not None and p.lower_bound_95 is None]
    if not strengths:
        return ""
    found = diagnosis_in(data.folder.resolve().parent)
    verdict = found if isinstance(found, Verdict) and found.case == data.result.case else None
    worth = None if verdict is None else worth_of(verdict.verdict)
    parts = []
    for p in strengths:
        low, high = p.interval_95 if worth is None else worth.span(p.value)
        ratio = f"; S_r/σ'_v0 {p.ratio:.3f}" if p.strength_kpa is None else ""
        parts.append(f"{p.label}: {with_range(p.value, low, high, p.unit)}{ratio}")
    if worth is None or verdict is None:
        how = "range: 95 % of what was varied; not diagnosed"
    else:
        how = (
            f"range: nine of ten slides with the verdict {verdict.verdict.replace('_', ' ')!r} "
            f"(off by up to {100 * worth.most_off:.0f} %)"
        )
    return f"{'; '.join(parts)}. {how[0].upper()}{how[1:]}."


def with_range(value: float, low: float, high: float, unit: str) -> str:
    """A number and its range: 22.7 (15.4 to 33.5) kPa."""
    places = 3 if not unit else 1
    ends = f"{fixed(low, places)} to {fixed(high, places)}"
    return with_unit(f"{fixed(value, places)} ({ends})", unit)


def doubted(data: BackAnalysisData) -> str:
    """What is to be doubted, for the first line: by hand checks, by the cells; empty: nothing."""
    outside = [check.words for check in data.result.hand_checks if not check.agrees]
    said = [f"DOUBTED BY HAND CHECKS: {'; '.join(outside)}."] if outside else []
    cells = data.result.answer.small_cells
    if cells is not None and cells.log_std > UNSURE:
        said.append(
            f"UNSURE BY {100 * cells.log_std:.0f} % with points {cells.spacing_m:g} m apart: take "
            "a smaller spacing."
        )
    return " ".join(said)


def hand_check_sentences(data: BackAnalysisData) -> list[str]:
    """What can be said of the answer without a simulation."""
    checks = [check.words for check in data.result.hand_checks]
    return [f"Checked by hand: {'; '.join(checks)}."] if checks else []


def answer_words(p: ParameterAnswer) -> str:
    """A parameter and its answer; of a bound the limit of flow that it rests on."""
    of = "" if p.lower_bound_95 is None else ", limit of flow"
    return f"{p.label}{of}: {plus_minus(p.value, p.std_total, p.unit)}"


def meant_words(p: ParameterAnswer) -> str:
    """The mean strength that a strength ratio means."""
    assert p.strength_kpa is not None and p.strength_std_kpa is not None
    mean = plus_minus(p.strength_kpa, p.strength_std_kpa, "kPa")
    return f"mean S_r {mean} at σ'_v0 {p.sigma_v0_kpa:.0f} kPa"


def _bound(p: ParameterAnswer) -> str:
    """A strength of which only a lower bound is known."""
    ratio = ""
    if p.ratio_lower_bound_95 is not None and p.strength_kpa is None:
        ratio = f", S_r/σ'_v0 ≥ {p.ratio_lower_bound_95:.3f}"
    limit = plus_minus(p.value, p.std_total, p.unit)
    return (
        f"{p.label} {at_least(p.lower_bound_95, p.std_total, p.unit)}{ratio}: nothing ran, and "
        f"below {limit} something would"
    )


def _equally_good(parameter: ParameterAnswer) -> str:
    """The range of the equally good answers, where it is wide."""
    if parameter.equally_good_range is None:
        return ""
    low, high = parameter.equally_good_range
    if high - low < WIDE * abs(parameter.value):
        return ""
    return f", equally good from {span(low, high, places_of(parameter.unit))}"


def _water(data: BackAnalysisData) -> str:
    """With or without the reservoir, where that is known."""
    if data.with_water is None:
        return ""
    if not data.with_water:
        return ", without water"
    return f", with the reservoir as {WATER_WORDS[data.run.settings.water]}"


def surrogate_sentences(data: BackAnalysisData) -> list[str]:
    """How far the learned simulator is from the material point method, and its correction.

    Empty for the material point method.
    """
    found = data.result.surrogate
    if found is None:
        return []
    differences = [
        f"{m.name} {signed(found.mean_difference[m.name], 2)} ± {found.std[m.name]:.2f} "
        f"{unit_of(m.unit)}"
        for m in data.few_fitted(6)
        if m.name in found.mean_difference
    ]
    corrected = "The difference at the answer" if found.settled else "The mean difference"
    added = [
        f"{p.label} ± {with_unit(f'{found.answer_std[p.name]:.2g}', p.unit)}" for p in data.answers
    ]
    return [
        f"The simulator is {found.model}, differentiated through the whole rollout. It was "
        f"compared with the material point method at {len(found.pairs)} states around the answer. "
        f"That differs from it by {'; '.join(differences)}. {corrected} corrects every prediction, "
        "and the scatter is part of the covariance of the fit, where it adds "
        f"{'; '.join(added)}.",
        "The section and the film show the material point method at this answer; the iterations "
        "show the learned simulator.",
        *(f"Outside the training range of {found.model}: {line}." for line in found.outside),
    ]


def _and_of_cells(result: Result) -> str:
    cells = result.answer.small_cells
    return " alone" if cells is None else " and of the size of the cells"


def meaning_sentences(data: BackAnalysisData) -> list[str]:
    """Explain the numbers after ± and their basis."""
    result = data.result
    varied = bool(result.sensitivities) or result.noise is not None
    included = (
        "includes the survey and every assumption that was varied"
        if varied
        else f"is that of the survey{_and_of_cells(result)}: no assumption was varied"
    )
    said = [
        f"± is one standard deviation and {included}. "
        "Ratios refer to the mean vertical effective stress of the zone before failure."
    ]
    if data.ratios:
        said.append(
            "A strength ratio gives each point the ratio times its own vertical effective stress "
            "before failure; the mean S_r next to it is that ratio times the mean stress."
        )
    bounds = [p.label for p in data.strengths if p.lower_bound_95 is not None]
    if bounds:
        said.append(
            f"No flow was measured, so of {', '.join(bounds)} only a lower bound is known: at it "
            "something would have run with a probability of 95 %, with the survey's error and "
            "every assumption counted. Nothing says how much stronger the soil is."
        )
    ranges = [
        f"{p.label} {with_unit(str(span(*p.interval_95, places_of(p.unit))), p.unit)}"
        for p in (*data.strengths, *data.ratios)
        if p.lower_bound_95 is None
    ]
    if ranges and result.answer.reached:
        said.append(f"95 % range: {'; '.join(ranges)}.")
    elif ranges:
        said.append(
            "No 95 % range is given: the answer does not meet the data, and ± is what it would be "
            "if it did."
        )
    if data.fitted:
        maps = [one for one in data.series if len(one.lines) > MANY]
        single = [m for m in data.fitted if not any(m in one.lines for one in maps)]
        names = [
            f"{one.name}, {len(one.lines)} numbers ({one.lines[0].confidence})"
            for one in maps
            if one.role == "fitted"
        ] + [
            f"{m.name} {'< ' * m.censored}{m.measured:g} {unit_of(m.unit)} ({m.confidence})"
            for m in single[:6]
        ]
        more = f" and {len(single) - 6} more" if len(single) > 6 else ""
        said.append(
            f"Fitted: {'; '.join(names)}{more}. Set of measurements: '{result.measurement_set}'."
        )
    if result.variants:
        said.append(variant_sentence(data))
    at_bound = [
        f"{p.label} at its {p.at_bound} bound" for p in result.answer.parameters if p.at_bound
    ]
    if at_bound:
        said.append(f"At a bound: {'; '.join(at_bound)}.")
    return said


@dataclass(frozen=True)
class Compared:
    """A surveyed measurement against a prediction of it.

    Attributes:
        name: of the measurement.
        role: fitted, compared or held out.
        far: a misfit: more than `FAR` off, or a series at more than `FAR_SHARE` of its places.
        off: the largest difference, in standard deviations.
        words: measured and predicted.
    """

    name: str
    role: str
    far: bool
    off: float
    words: str


def compared(data: BackAnalysisData, predicted: Mapping[str, float]) -> list[Compared]:
    """Every measurement against predictions (by name of their numbers), the worst first.

    Numbers without a prediction and constructed data are left out.
    """
    found = []
    for group in data.series:
        lines = [
            (m, predicted[m.name])
            for m in group.lines
            if m.name in predicted and m.std and m.role != "constructed"
        ]
        if lines:
            found.append(_compare(group.name, lines))
    return ranked(found, lambda one: abs(one.off))


def _compare(name: str, lines: Sequence[tuple[MeasurementAnswer, float]]) -> Compared:
    off = np.array([_off(m, value) for m, value in lines])
    worst = largest_place(np.abs(off))
    m, value = lines[worst]
    beyond = int((np.abs(off) > FAR).sum())
    words = (
        f"{name} measured {'< ' * m.censored}{m.measured:g} ± {m.std:.3g} {unit_of(m.unit)}, "
        f"predicted {fixed(value, measured_places(m.std))} {unit_of(m.unit)}"
    )
    if len(lines) > 1:
        square = np.sqrt(np.mean([(value - m.measured) ** 2 for m, value in lines]))
        place = m.name.removeprefix(name).strip()
        words = (
            f"{name}, {beyond} of {len(lines)} values off by more than {FAR:g} standard "
            f"deviations, root mean square {square:.1f} {unit_of(m.unit)}, worst {place}"
        )
    return Compared(name, m.role, beyond > FAR_SHARE * len(lines), float(off[worst]), words)


def _off(m: MeasurementAnswer, value: float) -> float:
    """Predicted minus measured in standard deviations; 0 while a limit is kept."""
    off = (value - m.measured) / m.std
    return max(off, 0.0) if m.censored else off


def misfits(data: BackAnalysisData) -> list[Compared]:
    """Surveyed measurements that the answer does not reproduce, the worst first."""
    return [one for one in compared(data, _predicted(data)) if one.far]


def _predicted(data: BackAnalysisData) -> dict[str, float]:
    return {m.name: m.predicted for m in data.result.measurements}


def misfit_sentence(data: BackAnalysisData) -> str:
    """Data that the answer does not reproduce, or that it reproduces all."""
    if far := misfits(data):
        listed = "; ".join(
            f"{one.words} ({signed(one.off)} standard deviations"
            f"{'' if one.role == 'fitted' else f', {one.role}'})"
            for one in far
        )
        return f"Not reproduced: {listed}."
    others = [one for one in compared(data, _predicted(data)) if one.role != "fitted"]
    if not others:
        return "Every measurement was fitted, so none is left to check the answer."
    listed = "; ".join(one.words for one in others)
    return f"Measurements that were not fitted agree within {FAR:g} standard deviations: {listed}."


def variant_sentences(data: BackAnalysisData) -> list[str]:
    """Data that variants of the question miss, and variants that reproduce more than the answer."""
    missed_here = {one.name for one in misfits(data)}
    missed, met = [], []
    for variant in data.result.variants:
        outside = {
            name: value for name, value in variant.predicted.items() if name not in variant.measured
        }
        for one in compared(data, outside):
            if one.far:
                missed.append(f"{variant.name}: {one.words}")
            elif one.name in missed_here:
                met.append(f"{variant.name}: {one.words}")
    sentences = [f"Not reproduced by variants: {'; '.join(missed)}."] if missed else []
    if met:
        sentences.append(f"Reproduced by variants: {'; '.join(met)}.")
    return sentences


def toe_words(data: BackAnalysisData) -> list[str]:
    """Runout of each toe in the slide that is drawn, and as measured.

    The slide is always simulated by the material point method, whichever engine was used. Where
    that has predicted nothing at the answer, nothing is said.
    """
    if data.result.engine == "direct":
        return []
    known = {m.name: m.predicted for m in data.result.measurements}
    if data.result.surrogate is not None:
        answer = {p.name: p.value for p in data.result.answer.parameters}
        rows = [row for row in data.result.engines if row.engine == "mpm"]
        known = next(row.predicted for row in rows if row.values == answer)
    return [
        f"{toe.name}: {fixed(known[toe.name])} m, less than {toe.values[0]:g} m measured"
        if toe.censored
        else f"the {toe.name} moves {fixed(known[toe.name])} m; {toe.values[0]:g} m was measured"
        for toe in data.toes
        if toe.name in known
    ]


def without_steps(data: BackAnalysisData, simulated: Mapping[str, float]) -> str:
    """Whose slide is drawn where the engine has simulated none; empty: it has.

    Args:
        data: of the report.
        simulated: readings of the slide that is drawn, by name.
    """
    if data.result.engine != "direct":
        return ""
    toes = [
        f"its {toe.name} moves {fixed(simulated[toe.name])} m"
        for toe in data.toes
        if np.isfinite(simulated.get(toe.name, np.nan))
    ]
    drawn = "Section and film show the material point method with these strengths, not the model"
    return f"{drawn}: {', '.join(toes)}." if toes else f"{drawn}."


def constructed_sentence(data: BackAnalysisData) -> str:
    """Which data were constructed and not surveyed; empty: none."""
    names = [group.name for group in data.series if group.role == "constructed"]
    if not names:
        return ""
    return (
        f"Constructed, not surveyed: {', '.join(names)}. Drawn (dotted) for orientation only; "
        "part of neither the fit nor the score."
    )


def spacing_sentences(data: BackAnalysisData) -> list[str]:
    """Which numbers come from coarse runs, how these were checked, and the limit of small cells."""
    result = data.result
    said = []
    if result.coarse_spacing_m is not None:
        said.append(
            f"The answer and its predictions are of runs with points every {result.spacing_m:g} m. "
            f"What changes the answer was found with points every {result.coarse_spacing_m:g} m, "
            "by runs moved so that both agree at the answer. " + _checked(data)
        )
    if (cells := result.answer.small_cells) is not None:
        said.append(cells_words(cells))
    return said


def _checked(data: BackAnalysisData) -> str:
    """What the runs at the spacing of the answer gave where coarse ones had been taken."""
    asked = [(p.name, p.std_total) for p in data.answers]
    found = []
    for what, both in (
        (
            "sensitivities",
            [
                (entry.name, side.change, side.coarse_change)
                for entry in data.result.sensitivities
                for side in entry.sides
            ],
        ),
        ("variants", [(one.name, one.values, one.coarse_values) for one in data.result.variants]),
    ):
        off = [
            (abs(fine[name] - coarse[name]) / std, entry)
            for entry, fine, coarse in both
            if coarse is not None
            for name, std in asked
        ]
        if off:
            count = len({entry for _, entry in off})
            most, where = max(off)
            found.append(f"{count} {what} (at most {most:.2f} standard deviations apart: {where})")
    if not found:
        return "Nothing was run at both."
    return f"Run at both, and given as at the smaller one: {' and '.join(found)}."


def undetermined_sentences(data: BackAnalysisData) -> list[str]:
    """The undetermined part: directions, and each number before and after the fit."""
    alone = {p.name for p in data.result.answer.parameters if not p.determined}
    said = []
    for direction in data.result.answer.undetermined:
        name, part = largest(direction.direction.items(), lambda item: abs(item[1]))
        if name not in alone or abs(part) < ALONE:  # else named below
            said.append(
                f"Not determined: {direction.words} (standard deviation {direction.remaining:.2f} "
                "times the prior one)."
            )
    for p in data.result.answer.parameters:
        if p.lower_bound_95 is not None:
            least = with_unit(fixed(p.lower_bound_95, places_of(p.unit)), p.unit)
            said.append(
                f"Of {p.label} the data give a lower bound alone, {least}: any strength above the "
                "limit of flow fits as well."
            )
        elif not p.determined:
            basis = "its prior" if p.has_prior else f"its bounds, {p.low:g} to {p.high:g}"
            after, before = (with_unit(f"± {std:.2g}", p.unit) for std in (p.std_data, p.prior_std))
            said.append(
                f"{p.label[:1].upper()}{p.label[1:]} is not identifiable from these measurements: "
                f"{after} after the fit, {before} before ({basis}). "
                f"The value {fixed(p.value, places_of(p.unit))} is where the search ended."
            )
    if said:
        return said
    if not data.result.answer.reached:
        return ["What the data determine is not known: the answer does not meet them."]
    return ["The data determine every unknown."]


def variant_sentence(data: BackAnalysisData) -> str:
    """The strength as asked, and its range over the variants of the question."""
    shown = [*data.strengths, *data.ratios]
    if not data.result.variants or not shown:
        return ""
    p = shown[0]
    found = [(v.values[p.name], v.name) for v in data.result.variants]
    (low, low_name), (high, high_name) = min(found), max(found)
    places = places_of(p.unit)
    least, most = fixed(low, places), with_unit(fixed(high, places), p.unit)
    asked = f"{p.label}: {with_unit(fixed(p.value, places), p.unit)} as asked"
    if len(found) == 1:
        return f"{asked}, {most} {low_name}."
    return f"{asked}; variants give {least} ({low_name}) to {most} ({high_name})."


def waterfall_sentence(data: BackAnalysisData) -> str:
    """The way from another reading to the answer, and its largest changes."""
    found = data.result.waterfall
    if found is None:
        return ""
    bars = [(bar.name, bar.value) for bar in found.bars]
    if found.stated is not None:
        bars = [(found.stated.name, found.stated.value), *bars]
    (p,) = [p for p in data.result.answer.parameters if p.name == found.parameter]
    unit, places = f" {unit_of(p.unit)}" if p.unit else "", places_of(p.unit)
    changes = [
        (after - before, name) for (_, before), (name, after) in zip(bars, bars[1:], strict=False)
    ]
    most = ranked(changes, lambda one: abs(one[0]))[:3]
    listed = ", ".join(f"{name} ({change:+.{places}f})" for change, name in most)
    first, last = (f"{value:.{places}f}{unit}" for value in (bars[0][1], bars[-1][1]))
    return f"{p.label}: from {first} ({bars[0][0]}) to {last}. The largest changes: {listed}."
