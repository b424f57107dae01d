"""The tables of a diagnosis, and the key numbers at the head of its page.

In: a `DiagnosisData`. Out: `report.table.Table`s, without rows where there is nothing to show.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from diagnosis.verdict.verdict import (
    FittedModelSummary,
    MeasurementVerdict,
    NextMeasurement,
    WaterfallStep,
)
from report.data.diagnosis import DiagnosisData
from report.numbers import (
    chance,
    fixed,
    from_to,
    number,
    percent,
    plus_minus,
    root_mean_square,
    signed,
    signed_percent,
    with_unit,
)
from report.page import KeyNumbers
from report.sentences.diagnosis import (
    AMONG,
    BY_HAND,
    VERDICTS,
    explanation,
    fitted_words,
    off,
    off_held_out,
    quoted_value,
    reading_words,
    spoken,
    step_words,
    test_words,
)
from report.sentences.finding import reason_words
from report.table import Table

NOISE = "standard deviations; noise alone has 1"
FOUND = {"ambiguous": "most probable", "unknown_effect": "added, not sufficient"}
WOULD_EXPLAIN = "would explain it"


def key_numbers(data: DiagnosisData) -> KeyNumbers:
    """Verdict, effect, misfit, strength, runs."""
    document, base, final, verdict = data.document, data.base, data.final, data.verdict
    entries: list[tuple[str, str, str]] = []
    if verdict is not None:
        remark = AMONG if verdict.verdict != "adequate" else f"{len(verdict.tested)} effects tested"
        entries.append(("verdict", VERDICTS[verdict.verdict], remark))
        for one in verdict.answer.effects:
            value = plus_minus(one.amplitude, one.std, one.unit)
            name = FOUND.get(verdict.verdict, "missing effect")
            name = WOULD_EXPLAIN if verdict.answer.would_explain else name
            entries.append((name, spoken(one.name), value))
    elif hasattr(document, "alarm"):
        entries.append(("base model", document.alarm, chance(base.p_combined)))
    entries.append(_fall_of_fit(base, final))
    if base.held_out.n:
        held = None if final is None else off_held_out(final)
        entries.append(_fall("misfit, held-out data", off_held_out(base), held))
    if verdict is not None and (check := verdict.validation_case) is not None:
        ends = [root_mean_square(chi2, check.n) for chi2 in (check.chi2_base, check.chi2_final)]
        entries.append(_fall(f"misfit, {spoken(check.case)}", *ends))
    for p in data.parameters:
        stage = base if final is None or p.name not in final.values else final
        remark = "base model" if stage is base else f"{fitted_words(base, p)} before"
        value = fitted_words(stage, p)
        if verdict is not None and p.name in verdict.quoted:
            value = quoted_value(verdict, p.name, p.unit)
        if verdict is not None and verdict.verdict == "unknown_effect":
            remark = "of all models tried, widened: not a result"
        entries.append((p.words, value, remark))
    runs = document.runs
    return KeyNumbers([*entries, ("forward runs", f"{runs.asked}", f"of {runs.allowed} allowed")])


def _fall_of_fit(
    base: FittedModelSummary, final: FittedModelSummary | None
) -> tuple[str, str, str]:
    """Root mean square misfit before and after; chi² where no degree of freedom is left."""
    name, stages = "misfit, fitted data", [base] if final is None else [base, final]
    if all(stage.dof > 0 for stage in stages):
        return _fall(name, off(base), None if final is None else off(final))
    value = " \N{RIGHTWARDS ARROW} ".join(f"chi² {number(stage.chi2)}" for stage in stages)
    left = ", ".join(str(max(stage.dof, 0)) for stage in stages)
    return name, value, f"degrees of freedom: {left}"


def _fall(name: str, before: float, after: float | None) -> tuple[str, str, str]:
    then = "" if after is None else f" \N{RIGHTWARDS ARROW} {after:.1f}"
    return name, f"{before:.1f}{then}", NOISE


def parameters_table(data: DiagnosisData) -> Table:
    """Calibrated values, one column for each model."""
    rows = []
    for p in data.parameters:
        rows.append([p.words, *(fitted_words(stage, p) for _, stage in data.stages)])
        wide = [stage.std_assumed.get(p.name) for _, stage in data.stages]
        if any(wide):
            rows.append(
                [
                    "std with what is assumed of soils, geometry and survey",
                    *(None if std is None else with_unit(std, p.unit, 2) for std in wide),
                ]
            )
        if data.verdict is not None and p.name in data.verdict.quoted:
            empty = [""] * (len(data.stages) - 1)
            rows.append(["quoted", *empty, quoted_value(data.verdict, p.name, p.unit)])
    return Table(["parameter", *(name for name, _ in data.stages)], rows)


def tests_table(data: DiagnosisData) -> Table:
    """The tests of adequacy, before and after."""
    after = {} if data.final is None else {test.name: test for test in data.final.tests}
    rows = [
        [
            test_words(test.name),
            number(test.statistic),
            chance(test.p),
            chance(after[test.name].p) if test.name in after else None,
        ]
        for test in data.base.tests
    ]
    together = None if data.final is None else chance(data.final.p_combined)
    if rows:
        rows.append(["all together", None, chance(data.base.p_combined), together])
    return Table(["test", "statistic", "base model", "after"], rows, "Tests of adequacy")


def groups_table(data: DiagnosisData) -> Table:
    """The misfit by measurement, before and after."""
    after = {} if data.final is None else {group.name: group for group in data.final.groups}
    rows = [
        [
            g.name,
            g.n,
            number(g.expected),
            number(g.chi2),
            number(after[g.name].chi2) if g.name in after else None,
        ]
        for g in data.base.groups
    ]
    header = ["measurement", "numbers", "chi² of noise", "base model", "after"]
    return Table(header, rows, "Squared residuals by measurement")


def candidates_table(data: DiagnosisData) -> Table:
    """Every candidate with its score."""
    rows = [
        [
            spoken(c.name),
            c.words,
            c.family,
            _short(c.z),
            _short(c.expected_drop),
            None if c.p_family is None else chance(c.p_family),
            None if c.amplitude_by_score is None else with_unit(c.amplitude_by_score, c.unit),
            None if c.smallest_detectable is None else with_unit(c.smallest_detectable, c.unit),
            None if c.visible_fraction is None else percent(c.visible_fraction),
            {True: "yes", False: "no", None: None}[c.resolved],
        ]
        for c in data.candidates
    ]
    header = [
        "effect",
        "what it is",
        "family",
        "z",
        "expected fall",
        "chance of noise",
        "amplitude by score",
        "smallest detectable",
        "visible",
        "resolved",
    ]
    return Table(header, rows, "Scores")


def refits_table(data: DiagnosisData) -> Table:
    """The candidates that were refitted: expected against achieved, and why not accepted."""
    rows = []
    for c in data.candidates:
        if (r := c.refit) is None:
            continue
        values = ", ".join(
            with_unit(r.values[p.name], p.unit) for p in data.parameters if p.name in r.values
        )
        rows.append(
            [
                spoken(c.name),
                plus_minus(r.amplitude, r.std, c.unit),
                number(c.expected_drop or 0),
                number(r.drop),
                _short(r.held_out_chi2),
                number(r.ln_evidence),
                values,
                "accepted" if r.accepted else reason_words(r.why_not),
            ]
        )
    before = number(data.base.held_out.chi2)
    header = [
        "effect",
        "amplitude",
        "expected fall",
        "achieved fall",
        f"held-out chi² ({before} before)",
        "ln evidence gained",
        " / ".join(p.words for p in data.parameters),
        "",
    ]
    return Table(header, rows, "Refitted")


def left_out_table(data: DiagnosisData) -> Table:
    """Candidates that were not tested, and why."""
    rows = [[spoken(c.name), c.words, c.left_out] for c in data.left_out]
    return Table(["effect", "what it is", "why"], rows, "Not tested")


def effects_table(data: DiagnosisData) -> Table:
    """The effects of the answer."""
    effects = [] if data.verdict is None else data.verdict.answer.effects
    rows = [
        [
            spoken(one.name),
            plus_minus(one.amplitude, one.std, one.unit),
            from_to(*one.interval_95, one.unit),
            one.words,
        ]
        for one in effects
    ]
    return Table(["effect", "amplitude", "95 %", "what it is"], rows)


def answers_table(data: DiagnosisData) -> Table:
    """The explanations that share 90 % of the probability, each with its parameters."""
    rows = []
    for one in [] if data.verdict is None else data.verdict.answer.set_90:
        values = one.values
        cells = [
            with_unit(values[p.name], p.unit) if p.name in values else None for p in data.parameters
        ]
        rows.append([explanation(one.names), percent(one.probability), *cells])
    header = ["explanation", "probability", *(p.words for p in data.parameters)]
    return Table(header, rows, "Together 90 % of the probability")


def hidden_table(data: DiagnosisData) -> Table:
    """How far each effect could shift each parameter while undetected."""
    names = list(dict.fromkeys(n for changes in data.hidden.values() for n in changes))
    shifted = [p for p in data.parameters if p.name in data.hidden]
    known = {c.name: c for c in data.candidates}
    rows = []
    for name in names:
        c = known.get(name)
        least = None
        if c is not None and c.smallest_detectable is not None:
            least = with_unit(c.smallest_detectable, c.unit)
        changes = [
            None
            if data.hidden[p.name].get(name) is None
            else signed_percent(data.hidden[p.name][name])
            for p in shifted
        ]
        rows.append([spoken(name), least, *changes])
    return Table(["effect", "smallest detectable", *(p.words for p in shifted)], rows)


def measurements_table(lines: Sequence[MeasurementVerdict]) -> Table:
    """Every number, measured and modelled."""
    rows = [
        [
            m.name,
            m.role,
            "< " * m.censored + with_unit(fixed(m.measured, 2), m.unit),
            fixed(m.std_total, 2),
            fixed(m.std_survey, 2),
            fixed(m.predicted_base, 2),
            signed(m.residual_base),
            fixed(m.predicted_final, 2),
            signed(m.residual_final),
        ]
        for m in lines
    ]
    header = [
        "number",
        "role",
        "measured",
        "std, total",
        "of which survey",
        "base model",
        "residual (std)",
        "after",
        "residual after (std)",
    ]
    return Table(header, rows)


def steps_table(
    steps: Sequence[WaterfallStep],
    by_hand: Collection[str] = (),
    notes: Sequence[str] = (),
    outdated: Collection[str] = (),
) -> Table:
    """Every step in numbers; `notes` replace those of the steps."""
    rows = []
    for place, step in enumerate(steps):
        held = None
        if step.held_out_chi2 is not None and step.held_out_n:
            held = f"{number(step.held_out_chi2)} / {step.held_out_n}"
        note = notes[place] if notes else step.note
        if step.hypothesis in by_hand:
            note = f"{BY_HAND}: {note}"
        if step.hypothesis in outdated:
            note += " (outdated: case or settings have changed since)"
        effects = ", ".join(f"{spoken(n)} {number(a)}" for n, a in step.effects.items())
        values = ", ".join(
            f"{spoken(n)} {plus_minus(v, step.std.get(n, 0.0))}" for n, v in step.values.items()
        )
        rows.append(
            [
                step.hypothesis,
                step_words(place, steps, by_hand),
                effects or None,
                values,
                f"{number(step.chi2)} / {step.dof}",
                held,
                _short(step.ln_evidence),
                note,
            ]
        )
    header = [
        "model",
        "step",
        "effects",
        "parameters",
        "chi² / degrees of freedom",
        "held-out chi² / numbers",
        "ln evidence",
        "note",
    ]
    return Table(header, rows)


def next_table(entries: Sequence[NextMeasurement]) -> Table:
    """Measurements that would best distinguish the remaining explanations."""
    rows = [
        [n.words or n.name, number(n.gain), f"{math.sqrt(max(n.gain, 0.0)):.1f}"] for n in entries
    ]
    return Table(["measure next", "gain, with those above", "expected separation (std)"], rows)


def outcomes_table(entries: Sequence[NextMeasurement]) -> Table:
    """What each explanation says that these measurements would read."""
    rows = [
        ["" if place else n.name, explanation(said.names), reading_words(n, said)]
        for n in entries
        for place, said in enumerate(n.outcomes)
    ]
    return Table(["measurement", "if it is", "it would read"], rows)


def provenance_table(data: DiagnosisData) -> Table:
    """Runs, time, hashes; settings, seeds and machine as the manifest has them."""
    runs = data.document.runs
    now = "" if runs.computed is None else f", {runs.computed} of them simulated now"
    rows: list[list[str]] = [
        ["forward runs", f"{runs.asked} requested{now}; {runs.allowed} allowed"]
    ]
    if runs.cut_short:
        rows.append(["skipped, run budget exhausted", ", ".join(runs.cut_short)])
    if data.verdict is not None:
        if data.verdict.seconds is not None:
            rows.append(["wall time", f"{data.verdict.seconds:.0f} s"])
        rows += [[f"hash of {spoken(name)}", value] for name, value in data.verdict.hashes.items()]
        rows += _flat(data.verdict.manifest)
    return Table(["", ""], rows)


def _flat(entries: dict[str, Any], before: str = "") -> list[list[str]]:
    """Nested settings as rows; short groups on one line."""
    rows: list[list[str]] = []
    for key, value in entries.items():
        name = f"{before}{spoken(str(key))}"
        if not isinstance(value, dict):
            rows.append([name, _listed(value)])
        elif any(isinstance(inner, dict) for inner in value.values()):
            rows += _flat(value, f"{name}: ")
        else:
            listed = ", ".join(f"{spoken(str(k))} {_listed(v)}" for k, v in value.items())
            rows.append([name, listed])
    return rows


def _listed(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _short(value: float | None) -> str | None:
    return None if value is None else number(value)
