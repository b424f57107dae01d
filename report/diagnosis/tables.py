"""The tables of the page of a diagnosis, and the few numbers at its head.

In: a `ReportData`. Out: `report.page` parts; an empty list where a table would have no rows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from diagnosis.verdict.verdict import FittedModelSummary, WaterfallStep
from report.charts.error_steps import step_words
from report.diagnosis.data import ReportData
from report.diagnosis.sentences import (
    AMONG,
    VERDICTS,
    explanation,
    off,
    off_held_out,
    spoken,
    test_words,
)
from report.numbers import (
    SPACE,
    chance,
    number,
    plus_minus,
    root_mean_square,
    signed_percent,
    with_unit,
)
from report.page import KeyNumbers, Table

ONE_LINE = 24
"""Characters of a name that are kept on one line."""
NOISE = "standard deviations; noise alone has 1"
FOUND = {"ambiguous": "most probable", "unknown_effect": "added, not enough"}
ALARMS = {"adequate": "adequate", "suspect": "suspect", "alarm": "alarm"}


def key_numbers(data: ReportData) -> KeyNumbers:
    """Verdict, effect, misfit, strength, runs."""
    document, base, final = data.document, data.base, data.final
    entries: list[tuple[str, str, str]] = []
    verdict = data.verdict
    if verdict is not None:
        remark = AMONG if verdict.verdict != "adequate" else f"{len(verdict.tested)} effects tested"
        entries.append(("verdict", VERDICTS[verdict.verdict], remark))
        for one in verdict.answer.effects:
            value = plus_minus(one.amplitude, one.std, one.unit)
            name = FOUND.get(verdict.verdict, "missing effect")
            entries.append((name, spoken(one.name), value))
    elif hasattr(document, "alarm"):
        entries.append(("base model", ALARMS[document.alarm], chance(base.p_combined)))
    entries.append(_fall_of_fit(base, final))
    if base.held_out.n:
        held = None if final is None else off_held_out(final)
        entries.append(_fall("misfit, held-out data", off_held_out(base), held))
    unsure = verdict is not None and verdict.verdict == "unknown_effect"
    for p in data.parameters:
        stage = base if final is None or p.name not in final.values else final
        remark = f"{plus_minus(base.values[p.name], base.std.get(p.name, 0.0), p.unit)} before"
        if unsure:
            remark = "carries the error: no result"
        elif stage is base:
            remark = "base model"
        entries.append((p.words, plus_minus(stage.values[p.name], stage.std.get(p.name, 0.0),
                                            p.unit), remark))  # fmt: skip
    runs = document.runs
    entries.append(("forward runs", f"{runs.asked}", f"of {runs.allowed} allowed"))
    check = None if verdict is None else verdict.validation_case
    if check is not None:
        ends = [root_mean_square(chi2, check.n) for chi2 in (check.chi2_base, check.chi2_final)]
        entries.insert(-1, _fall(f"misfit, {spoken(check.case)}", *ends))
    # Narrow boxes: a value may go over two lines.
    return KeyNumbers([tuple(text.replace(SPACE, " ") for text in entry) for entry in entries])


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
    if after is None:
        return name, f"{before:.1f}", NOISE
    return name, f"{before:.1f} \N{RIGHTWARDS ARROW} {after:.1f}", NOISE


def tests_table(data: ReportData) -> list[Table]:
    """The tests of adequacy, before and after."""
    after = {} if data.final is None else {test.name: test for test in data.final.tests}
    rows = [
        [test_words(test.name), number(test.statistic), chance(test.p),
         chance(after[test.name].p) if test.name in after else None]
        for test in data.base.tests
    ]  # fmt: skip
    if not rows:
        return []
    together = None if data.final is None else chance(data.final.p_combined)
    rows.append(["all together", None, chance(data.base.p_combined), together])
    header = ["test", "statistic", "base model", "after"]
    return [_without_empty(Table(header, rows, "Tests of adequacy"))]


def groups_table(data: ReportData) -> list[Table]:
    """The misfit by measurement, before and after."""
    after = {} if data.final is None else {group.name: group for group in data.final.groups}
    rows = [
        [g.name, g.n, number(g.expected), number(g.chi2),
         number(after[g.name].chi2) if g.name in after else None]
        for g in data.base.groups
    ]  # fmt: skip
    header = ["measurement", "numbers", "chi² of noise", "base model", "after"]
    return [_without_empty(Table(header, rows, "Squared residuals by measurement"))] if rows else []


def candidates_table(data: ReportData) -> list[Table]:
    """Every candidate with its score, and with what came of its refit."""
    rows = [
        [spoken(c.name), c.words, c.kind, None if c.z is None else number(c.z),
         None if c.expected_drop is None else number(c.expected_drop),
         None if c.p_family is None else chance(c.p_family),
         None if c.amplitude_by_score is None else with_unit(c.amplitude_by_score, c.unit),
         None if c.smallest_detectable is None else with_unit(c.smallest_detectable, c.unit),
         None if c.visible_fraction is None else f"{100 * c.visible_fraction:.0f} %",
         {True: "yes", False: "no", None: None}[c.resolved]]
        for c in data.candidates
    ]  # fmt: skip
    header = ["effect", "what it is", "kind", "z", "expected fall", "chance of noise",
              "amplitude by score", "smallest detectable", "visible", "resolved"]  # fmt: skip
    return [_without_empty(Table(header, rows, "Scores"))] if rows else []


def refits_table(data: ReportData) -> list[Table]:
    """The candidates that were refitted: expected against achieved, and why not."""
    rows = []
    for c in data.candidates:
        if c.refit is None:
            continue
        r = c.refit
        values = ", ".join(with_unit(r.values[p.name], p.unit) for p in data.parameters
                           if p.name in r.values)  # fmt: skip
        rows.append(
            [spoken(c.name), plus_minus(r.amplitude, r.std, c.unit), number(c.expected_drop or 0),
             number(r.drop), None if r.held_out_chi2 is None else number(r.held_out_chi2),
             number(r.ln_evidence), values, "accepted" if r.accepted else r.why_not]
        )  # fmt: skip
    if not rows:
        return []
    before = number(data.base.held_out.chi2)
    header = ["effect", "amplitude", "expected fall", "achieved fall",
              f"held-out chi² ({before} before)", "ln evidence gained",
              " / ".join(p.words for p in data.parameters), ""]  # fmt: skip
    return [_without_empty(Table(header, rows, "FittedModel"))]


def left_out_table(data: ReportData) -> list[Table]:
    """Candidates that were not tested, and why."""
    rows = [[spoken(c.name), c.words, c.left_out] for c in data.left_out]
    return [Table(["effect", "what it is", "why"], rows, "Not tested")] if rows else []


def answers_table(data: ReportData) -> list[Table]:
    """The explanations that share 90 % of the probability, each with its parameters."""
    if data.verdict is None or len(data.verdict.answer.set_90) < 2:
        return []
    rows = []
    for one in data.verdict.answer.set_90:
        values = _values_with(data, one.names)
        told = [
            with_unit(values[p.name], p.unit) if p.name in values else None for p in data.parameters
        ]
        rows.append([explanation(one.names), f"{100 * one.probability:.0f} %", *told])
    header = ["explanation", "probability", *(p.words for p in data.parameters)]
    return [_without_empty(Table(header, rows, "Together 90 % of the probability"))]


def _values_with(data: ReportData, names: Sequence[str]) -> dict[str, float]:
    """Parameters calibrated with these effects; empty where the document does not have them."""
    if not names:
        return data.base.values
    if data.final is not None and set(data.final.effects) == set(names):
        return data.final.values
    for c in data.candidates:
        if c.refit is not None and set(c.refit.effects) == set(names):
            return c.refit.values
    return {}


def hidden_table(data: ReportData) -> list[Table]:
    """What each effect could hide in each parameter."""
    names = list(dict.fromkeys(n for changes in data.hidden.values() for n in changes))
    if not names:
        return []
    shown = [p for p in data.parameters if p.name in data.hidden]
    told = {c.name: c for c in data.candidates}
    rows = []
    for name in names:
        c = told.get(name)
        least = None
        if c is not None and c.smallest_detectable is not None:
            least = with_unit(c.smallest_detectable, c.unit)
        changes = [
            None if data.hidden[p.name].get(name) is None
            else signed_percent(data.hidden[p.name][name])
            for p in shown
        ]  # fmt: skip
        rows.append([spoken(name), least, *changes])
    return [Table(["effect", "smallest detectable", *(p.words for p in shown)], rows)]


def measurements_table(data: ReportData) -> list[Table]:
    """Every number, measured and modelled."""
    rows = [
        [_whole(m.name), m.role, _plain(m.measured), f"{m.std_total:.2f}", f"{m.std_survey:.2f}",
         _plain(m.predicted_base), _signed(m.residual_base), _final(data, m.predicted_final),
         _final(data, m.residual_final)]
        for m in data.measurements
    ]  # fmt: skip
    header = ["number", "role", "measured", "std, total", "of which survey", "base model",
              "residual (std)", "after", "residual after (std)"]  # fmt: skip
    return [_without_empty(Table(header, rows))] if rows else []


def singles_table(data: ReportData) -> list[Table]:
    """Single numbers: measured, before, after."""
    rows = [
        [_whole(m.name), m.role, plus_minus(m.measured, m.std_total, m.unit),
         _plain(m.predicted_base), _final(data, m.predicted_final)]
        for m in data.singles
    ]  # fmt: skip
    header = ["measurement", "role", "measured ± std", "base model", "after"]
    return [_without_empty(Table(header, rows))] if rows else []


def steps_table(steps: Sequence[WaterfallStep], by_hand: Collection[str] = ()) -> list[Table]:
    """Every step in numbers."""
    rows = []
    for place, step in enumerate(steps):
        held = None
        if step.held_out_chi2 is not None and step.held_out_n:
            held = f"{number(step.held_out_chi2)} / {step.held_out_n}"
        effects = ", ".join(f"{spoken(n)} {number(a)}" for n, a in step.effects.items())
        values = ", ".join(
            f"{spoken(n)} {plus_minus(v, step.std.get(n, 0.0), '')}" for n, v in step.values.items()
        )
        rows.append(
            [step_words(place, steps, by_hand), effects or None, values,
             f"{number(step.chi2)} / {step.dof}", held,
             None if step.ln_evidence is None else number(step.ln_evidence), step.note]
        )  # fmt: skip
    header = ["step", "effects", "parameters", "chi² / degrees of freedom",
              "held-out chi² / numbers", "ln evidence", "note"]  # fmt: skip
    return [_without_empty(Table(header, rows))] if rows else []


def next_table(data: ReportData) -> list[Table]:
    """Measurements that would tell the surviving explanations apart."""
    if data.verdict is None or not data.verdict.next_measurement:
        return []
    rows = [[n.words, number(n.gain), f"{math.sqrt(max(n.gain, 0.0)):.1f}"]
            for n in data.verdict.next_measurement]  # fmt: skip
    header = ["measure next", "gain", "expected separation (std)"]
    return [Table(header, rows)]


def made_tables(data: ReportData) -> list[Table]:
    """Runs, time, hashes; settings, seeds and machine as the manifest has them."""
    runs = data.document.runs
    now = "" if runs.computed is None else f", {runs.computed} of them simulated now"
    rows: list[list[str]] = [
        ["forward runs", f"{runs.asked} asked for{now}; {runs.allowed} allowed"]
    ]
    if runs.cut_short:
        rows.append(["left out for want of runs", ", ".join(runs.cut_short)])
    if data.verdict is not None:
        if data.verdict.seconds is not None:
            rows.append(["wall time", f"{data.verdict.seconds:.0f} s"])
        rows += [[f"hash of {spoken(name)}", value] for name, value in data.verdict.hashes.items()]
        rows += _flat(data.verdict.manifest)
    return [Table(["", ""], rows)]


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
            rows.append([name, ", ".join(f"{spoken(str(k))} {_listed(v)}"
                                         for k, v in value.items())])  # fmt: skip
    return rows


def _listed(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _whole(name: str) -> str:
    """A name of moderate length on one line."""
    return name.replace(" ", SPACE) if len(name) <= ONE_LINE else name


def _plain(value: float | None) -> str | None:
    return None if value is None else f"{value:.2f}".replace("-", "\N{MINUS SIGN}")


def _signed(value: float | None) -> str | None:
    return None if value is None else f"{value:+.1f}".replace("-", "\N{MINUS SIGN}")


def _final(data: ReportData, value: float | None) -> str | None:
    return None if data.final is None else _plain(value)


def _without_empty(table: Table) -> Table:
    """The table without columns in which nothing stands."""
    kept = [k for k in range(len(table.header)) if any(row[k] is not None for row in table.rows)]
    return Table([table.header[k] for k in kept],
                 [[row[k] for k in kept] for row in table.rows], table.caption)  # fmt: skip
