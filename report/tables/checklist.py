"""What a reviewer asks of a result: what was assumed, where from, how sensitive, how checked.

In: the data of a back-analysis or of a diagnosis. Out: one table, and a sentence on what was not
checked. Every row follows from the documents and the files of the case; nothing is filled in by
hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagnosis.hypotheses.model import FAMILIES, FAMILY_WORDS
from diagnosis.verdict.verdict import CandidateVerdict, Verdict
from geometry.case import SCENE_FILE, Case
from geometry.scenes.scene import Material
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey3d.survey import FILE_NAME as BODY_MEASUREMENTS_FILE
from inversion.back_analysis.result import ParameterAnswer, SensitivityAnswer
from inversion.back_analysis.result_builder import NOISE_SOURCE
from inversion.problem.question import FILE_NAME as QUESTION_FILE
from inversion.problem.question import RESIDUAL_STRENGTH
from pipeline.ties import largest, smallest
from report.data.back_analysis import BackAnalysisData, Series
from report.data.diagnosis import DiagnosisData
from report.data.sources import Comments
from report.numbers import (
    chance,
    fixed,
    limited,
    number,
    plural,
    plus_minus,
    root_mean_square,
    signed,
    signed_percent,
    unit_of,
    with_unit,
)
from report.sentences.diagnosis import spoken
from report.sentences.finding import headline
from report.table import Table
from report.two_strengths import diagnosis_in

TITLE = "Reviewer's checklist"
NOT_CHECKED = "not checked"
MOST_STRENGTHS = 3
"""Strengths whose changes are listed."""
MOST_NAMES = 4
"""Names that a cell lists."""
IDLE = "can do nothing here"
"""Start of the reason why a hypothesis was not tested where it could not act."""
LONGEST = 200
"""Characters of a source that a cell shows."""
STRENGTH_KEYS = ("cohesion_kpa", "friction_deg", RESIDUAL_STRENGTH)


@dataclass(frozen=True)
class Row:
    """One thing that was assumed.

    Attributes:
        what: it is.
        value: that it was given.
        source: where that comes from.
        moves: change of each strength, as text; empty or None: not known.
        how: it was checked; begins with `NOT_CHECKED` where nobody did.
    """

    what: str
    value: str = ""
    source: str = ""
    moves: Sequence[str | None] = ()
    how: str = ""


def unchecked(table: Table) -> str:
    """The rows that nobody has checked, in a sentence."""
    names = [str(row[0]) for row in table.rows if str(row[2]).startswith(NOT_CHECKED)]
    if not names:
        return "Every assumption below was varied, tested or judged by data."
    return f"Not checked: {'; '.join(names)}."


# --- a back-analysis ---


def back_analysis_checklist(data: BackAnalysisData) -> Table:
    """Unknowns, measurements, soils, water, outline, numerics and model of a back-analysis."""
    shown = data.answers[:MOST_STRENGTHS]
    rows = [
        *_unknowns(data),
        *_measurements(data, shown),
        *(_of_case(data, data.case) if data.case is not None else ()),
        *_varied(data, shown),
        *_model(data),
    ]
    units = ", ".join(dict.fromkeys(unit_of(p.unit) for p in shown))
    moves = f"moves the answer by ({units})" if units else "moves the answer by"
    return _table("value", moves, [p.label for p in shown], rows)


def _table(value: str, moves: str, strengths: Sequence[str], rows: Sequence[Row]) -> Table:
    cells = [
        [
            row.what,
            row.value or None,
            row.how,
            "; ".join(move or "?" for move in row.moves) if any(row.moves) else None,
            _cut(row.source) or None,
        ]
        for row in rows
    ]
    header = ["what was assumed", value, "how it was checked", moves, "from"]
    return Table(header, cells, f"the answer: {'; '.join(strengths)}" if strengths else "")


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[:LONGEST].rsplit(' ', 1)[0]} ..."


def _question(data: BackAnalysisData) -> Comments:
    return Comments((Path() if data.case is None else data.case.folder) / QUESTION_FILE)


def _unknowns(data: BackAnalysisData) -> Iterator[Row]:
    comments, result = _question(data), data.result
    for p in result.answer.parameters:
        unit = unit_of(p.unit)
        others = [start.answer[p.name] for start in result.starts[1:]]
        how = "one first guess alone"
        if others:
            apart = max(abs(value - p.value) for value in others)
            how = f"from {len(others) + 1} first guesses, answers within {number(apart, 2)} {unit}"
        how += "" if p.determined else "; not determined by the data"
        how += f"; rests on its {p.at_bound} bound" if p.at_bound else ""
        value = f"sought from {p.low:g} to {p.high:g} {unit}, first guess {p.start:g}"
        source = comments.on("parameters", p.name) or QUESTION_FILE
        yield Row(p.label, value, source, how=how)
        spec = next(one for one in result.question.parameters if one.name == p.name)
        if spec.prior is not None and spec.prior.known:
            value = plus_minus(spec.prior.mean, spec.prior.std, p.unit)
            yield Row(
                f"prior of {p.label}",
                value,
                spec.prior.relation or QUESTION_FILE,
                how="enters the fit",
            )


def _measurements(data: BackAnalysisData, shown: Sequence[ParameterAnswer]) -> Iterator[Row]:
    targets = {
        one.measurement: one.name
        for one in data.result.question.sensitivities
        if one.kind == "target"
    }
    entries = {entry.name: entry for entry in data.result.sensitivities}
    for one in data.series:
        entry = entries.get(targets.get(one.name, ""))
        moves = [] if entry is None else [_moved(entry, p) for p in shown]
        first = one.lines[0]
        source = f"{first.confidence}: {first.source}"
        yield Row(one.name, _measured(one), source, moves, _judged(one))
    moves = [f"± {fixed(p.std_data, 2)}" for p in shown]
    yield Row(
        "errors of the survey, all together",
        "the standard deviations above",
        "",
        moves,
        "propagated into the answer",
    )


def _measured(one: Series) -> str:
    first = one.lines[0]
    if len(one.lines) > 1:
        return f"{len(one.lines)} numbers"
    value = with_unit(limited(first.measured, first.censored, first.std) or "", first.unit)
    return value if first.std is None else f"{value} ± {first.std:.2g}"


def _judged(one: Series) -> str:
    if one.role == "constructed":
        return "constructed: takes no part"
    if one.role == "fitted":
        return "fitted: agrees because it was made to"
    off = [line.difference_in_std for line in one.lines]
    size = signed(off[0])
    if len(off) > 1:
        size = fixed(root_mean_square(sum(d * d for d in off), len(off)))
    return f"{one.role}, a test of the answer: off by {size} std"


def _moved(entry: SensitivityAnswer, p: ParameterAnswer) -> str:
    return f"± {fixed(entry.std[p.name], 2)}"


def _verdict(data: BackAnalysisData) -> Verdict | None:
    """The diagnosis of the same case next to the back-analysis; None: there is none."""
    found = diagnosis_in(data.folder.resolve().parent)
    same = isinstance(found, Verdict) and found.case == data.result.case
    return found if same else None


def _of_case(data: BackAnalysisData, case: Case) -> Iterator[Row]:
    """What the section assumes; which sensitivities, variants and hypotheses question it."""
    result, scene, verdict = data.result, case.drawn, _verdict(data)
    question = result.question
    answered = {one.name for one in (*result.sensitivities, *result.variants)}

    def checked(names: Sequence[str], tested: int) -> str:
        return _checked([name for name in names if name in answered], tested)

    comments = Comments(case.folder / SCENE_FILE)
    zones: dict[str, set[str]] = {}
    for zone in scene.zones:
        zones.setdefault(zone.material, set()).add(zone.name)
    sought = {(zone, p.property) for p in question.parameters for zone in p.zones}
    for name, soil in scene.materials.items():
        there = zones.get(name, set())
        left = {zone for zone in there if not any((zone, key) in sought for key in STRENGTH_KEYS)}
        if left:
            source = soil.source or comments.on("materials", name) or SCENE_FILE
            own = _of_property(question, STRENGTH_KEYS, left)
            how = checked(own, _tested(verdict, "soil", f"strength_of_{name}"))
            yield Row(f"strength of the {spoken(name)}", _strength(soil), source, how=how)
    used = {name: soil for name, soil in scene.materials.items() if zones.get(name)}
    every = {zone.name for zone in scene.zones}
    yield Row(
        "densities",
        _span([soil.density for soil in used.values()], "kg/m3"),
        SCENE_FILE,
        how=checked(
            _of_property(question, ("density",), every), _tested(verdict, "soil", "density_of_")
        ),
    )
    moduli = _span([soil.youngs_modulus_mpa for soil in used.values()], "MPa")
    yield Row(
        "stiffnesses (Young's modulus)",
        moduli,
        SCENE_FILE,
        how=checked([], _tested(verdict, "soil", "stiffness_of_")),
    )
    kinds = {one.name: one.kind for one in question.sensitivities}
    wet = [one.name for one in question.variants if one.water or one.pool_level_m is not None]
    wet += [name for name, kind in kinds.items() if kind == "water_level"]
    level, waters = scene.water_level, _tested(verdict, "water")
    words = "none" if level is None else f"pool at {level:g} m"
    yield Row("water", words, comments.on("water_level") or SCENE_FILE, how=checked(wet, waters))
    if scene.phreatic_line is not None:
        source = comments.on("phreatic_line") or SCENE_FILE
        yield Row(
            "phreatic line", f"{len(scene.phreatic_line)} points", source, how=checked(wet, waters)
        )
    moved = [name for name, kind in kinds.items() if kind in ("zone_boundary", "dimension")]
    yield Row(
        "outline of the section and of its zones",
        f"{len(scene.zones)} zones",
        comments.on("zones") or SCENE_FILE,
        how=checked(moved, _tested(verdict, "section")),
    )
    contact = [one.name for one in question.variants if one.contact]
    yield Row(
        "contact with the base",
        scene.ground.contact.replace("_", " "),
        comments.on("ground", "contact") or SCENE_FILE,
        how=checked(contact, _tested(verdict, "ground")),
    )


def _strength(soil: Material) -> str:
    if soil.strength_ratio is not None:
        return f"S_r/σ'_v0 {soil.strength_ratio:g}, at least {soil.cohesion_kpa:g} kPa"
    if soil.friction_deg == 0:
        return f"{soil.cohesion_kpa:g} kPa"
    return f"friction {soil.friction_deg:g}°, cohesion {soil.cohesion_kpa:g} kPa"


def _span(values: Sequence[float], unit: str) -> str:
    low, high = min(values), max(values)
    return with_unit(f"{low:g}" if low == high else f"{low:g} to {high:g}", unit)


def _of_property(question: Any, keys: Sequence[str], zones: set[str]) -> list[str]:
    """Sensitivities and variants that change a property of one of these zones."""
    found = [
        one.name
        for one in question.sensitivities
        if one.kind == "property" and one.property in keys and zones & set(one.zones)
    ]
    for variant in question.variants:
        if any(
            other.property in keys and (not other.zones or zones & set(other.zones))
            for other in variant.properties
        ):
            found.append(variant.name)
    return found


def _tested(verdict: Verdict | None, family: str, prefix: str = "") -> int:
    """How many hypotheses of a family a diagnosis has tested; 0 without one."""
    candidates = [] if verdict is None else verdict.candidates
    own = [c for c in candidates if c.family == family and not c.left_out]
    return sum(c.name.startswith(prefix) for c in own)


def _checked(names: Sequence[str], tested: int) -> str:
    """By what: sensitivities and variants of the back-analysis, hypotheses of a diagnosis."""
    said = []
    if names:
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        said.append(f"varied: {', '.join(names[:MOST_NAMES])}{more}")
    if tested:
        said.append(f"diagnosis: {_hypotheses(tested)} tested")
    return "; ".join(said) or NOT_CHECKED


def _hypotheses(count: int) -> str:
    return f"{count} hypothes{'i' if count == 1 else 'e'}s"


def _varied(data: BackAnalysisData, shown: Sequence[ParameterAnswer]) -> Iterator[Row]:
    """Everything that was changed by one standard deviation, and what it does."""
    comments, result = _question(data), data.result
    asked = {one.name: one for one in result.question.sensitivities}
    for entry in result.sensitivities:
        if entry.kind == "target":
            continue  # with its measurement
        where = ("sensitivities", entry.name)
        source = comments.on(*where) or comments.on(*where, "kind") or QUESTION_FILE
        solved = all(side.reached for side in entry.sides)
        how = "varied by one std, solved again" if solved else "varied by one std, linear estimate"
        value = " or ".join(dict.fromkeys(side.words for side in entry.sides))
        yield Row(entry.name, value, source, [_moved(entry, p) for p in shown], how)
    answered = {entry.name for entry in result.sensitivities}
    for name, one in asked.items():
        if name not in answered:
            yield Row(
                name,
                one.kind.replace("_", " "),
                QUESTION_FILE,
                how=f"{NOT_CHECKED}: asked for, not answered in this run",
            )
    if result.noise is None:
        yield Row(NOISE_SOURCE, how=NOT_CHECKED)
    else:
        moves = [f"± {fixed(result.noise.answer_std[p.name], 2)}" for p in shown]
        seeds = plural(len(result.noise.seeds), "jitter seed")
        yield Row(
            NOISE_SOURCE,
            f"spacing {result.spacing_m:g} m",
            "settings",
            moves,
            f"{seeds}, solved again",
        )


def _model(data: BackAnalysisData) -> Iterator[Row]:
    """What no back-analysis can question: the model itself."""
    found = _verdict(data)
    solid = data.result.engine == "mpm3d"
    how = NOT_CHECKED if solid else f"{NOT_CHECKED} here: flowslide diagnose {data.result.case}"
    if found is not None:
        how = f"diagnosis, {found.verdict.replace('_', ' ')}: {headline(found)}"
    space = "" if solid else "plane strain; "
    yield Row(
        "the model lacks nothing",
        f"{space}S_r constant from the first moment",
        data.result.engine,
        how=how,
    )


# --- a diagnosis ---


def diagnosis_checklist(data: DiagnosisData) -> Table:
    """What a diagnosis has put on trial, what could still hide there, what it left out."""
    verdict = data.verdict
    if verdict is None:
        return Table([], [])
    known = [p for p in data.parameters if p.name in data.hidden]
    shown = ([p for p in known if p.strength] or known)[:MOST_STRENGTHS]
    rows = [
        *(
            Row(
                p.words,
                with_unit(f"sought from {p.low:g} to {p.high:g}", p.unit),
                QUESTION_FILE,
                how="fitted to all measurements together",
            )
            for p in data.parameters
        ),
        *_groups(data, verdict),
        *_covariance(verdict),
        *_families(data, verdict, [p.name for p in shown]),
        *_left_out(data, verdict),
        *_judges(verdict, "another event" if data.of_body else "another section or event"),
    ]
    return _table("tested against", "could hide in the answer", [p.words for p in shown], rows)


def _groups(data: DiagnosisData, verdict: Verdict) -> Iterator[Row]:
    """The measurements; of those that were fitted, how far the model of the answer is from them."""
    found: dict[str, list[str]] = {}
    for line in data.measurements:
        found.setdefault(line.measurement, []).append(line.role)
    off = {group.name: group.z for group in verdict.final.groups}
    file = BODY_MEASUREMENTS_FILE if data.of_body else MEASUREMENTS_FILE
    for name, roles in found.items():
        how = ", ".join(dict.fromkeys(roles))
        if name in off:
            how += f": misfit {signed(off[name])} std beyond noise"
        yield Row(name, plural(len(roles), "number"), file, how=how)


def _covariance(verdict: Verdict) -> Iterator[Row]:
    errors = [] if verdict.fitted_to is None else verdict.fitted_to.covariance
    if errors:
        yield Row("errors of measurements and model", ", ".join(errors), how="in the covariance")


def _families(data: DiagnosisData, verdict: Verdict, names: Sequence[str]) -> Iterator[Row]:
    answer = {one.name for one in verdict.answer.effects}
    words = FAMILY_WORDS | ({"section": "another shape of the body"} if data.of_body else {})
    for family in FAMILIES:
        if data.of_body and family == "dimension":
            continue  # a body has its flanks
        own = [c for c in data.candidates if c.family == family]
        if not own:
            how = f"{NOT_CHECKED}: nothing of this kind was tested"
            yield Row(f"without {words[family]}", how=how)
            continue
        accepted = [c for c in own if c.refit is not None and c.refit.accepted]
        how = f"{_hypotheses(len(own))} tested; "
        if chosen := [spoken(c.name) for c in own if c.name in answer]:
            how += f"in the answer: {', '.join(chosen)}"
        elif accepted:
            how += f"would explain it as well: {_listed(accepted)}"
        else:
            how += f"none is accepted ({_best(own)})"
        moves = [_hidden(data.hidden.get(name, {}), own) for name in names]
        yield Row(f"without {words[family]}", _listed(own), "", moves, how)


def _listed(candidates: Sequence[CandidateVerdict]) -> str:
    names = [spoken(c.name) for c in candidates]
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return f"{', '.join(names[:MOST_NAMES])}{more}"


def _best(own: Sequence[CandidateVerdict]) -> str:
    known = [c for c in own if c.p_family is not None]
    if not known:
        return "no score is known"
    best = smallest(known, lambda c: c.p_family, unit=0.0)
    return f"best score: {spoken(best.name)}, {chance(best.p_family)}"


def _hidden(changes: dict[str, float], own: Sequence[CandidateVerdict]) -> str | None:
    """The largest change that a member could cause while it remains undetected."""
    found = {c.name: changes[c.name] for c in own if c.name in changes}
    if not found:
        return None
    name = largest(found, lambda key: abs(found[key]))
    shown = "under 1 %" if abs(found[name]) < 1.0 else signed_percent(found[name])
    return f"{shown} ({spoken(name)})"


def _left_out(data: DiagnosisData, verdict: Verdict) -> Iterator[Row]:
    idle = [c for c in data.left_out if c.left_out.startswith(IDLE)]
    if idle:
        how = f"{IDLE}; reasons: under Scores"
        yield Row(f"without {plural(len(idle), 'other')}", _listed(idle), how=how)
    for one in data.left_out:
        if one not in idle:
            yield Row(f"without {spoken(one.name)}", how=f"{NOT_CHECKED}: {one.left_out}")
    if verdict.runs.cut_short:
        yield Row(
            "steps of the search",
            ", ".join(verdict.runs.cut_short),
            how=f"{NOT_CHECKED}: the run budget was exhausted",
        )


def _judges(verdict: Verdict, other: str) -> Iterator[Row]:
    """Data that no fit has seen, and an `other` slide."""
    final = verdict.final.held_out
    if final.n:
        yield Row(
            "prediction of data that no fit has seen",
            plural(final.n, "number"),
            how=f"held out: chi² {number(final.chi2)}, noise {final.n}"
            + ("" if final.p is None else f", {chance(final.p)}"),
        )
    else:
        yield Row(
            "prediction of data that no fit has seen", how=f"{NOT_CHECKED}: none was held out"
        )
    check = verdict.validation_case
    if check is None:
        yield Row(other, how=f"{NOT_CHECKED}: none was given")
    else:
        yield Row(
            other,
            spoken(check.case),
            how=f"chi² {number(check.chi2_final)} of {plural(check.n, 'number')}, "
            f"{number(check.chi2_base)} without the effects",
        )
