"""The tables of a back-analysis, for its page and for a terminal.

In: a `BackAnalysisData`. Out: `report.table.Table`s, without rows where there is nothing to show.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from inversion.back_analysis.implied_strengths import implied_strengths
from inversion.back_analysis.result import MeasurementAnswer, ParameterAnswer, RelationAnswer
from inversion.back_analysis.result_builder import NOISE_SOURCE
from inversion.engines.small_cells import NAME as CELLS
from pipeline.ties import largest_place
from report.data.back_analysis import BackAnalysisData, Series
from report.data.methods import slides, undecided
from report.numbers import (
    fixed,
    limited,
    measured_places,
    places_of,
    plus_minus,
    root_mean_square,
    signed,
    span,
    unit_of,
    with_unit,
)
from report.sentences.back_analysis import answer_words, meant_words
from report.sentences.implied_strengths import answer_band, asked_words, label_words
from report.table import Table

KINDS = {
    "ours": "this analysis",
    "engine": "the same question",
    "variant": "this analysis, variant of the question",
    "classical": "classical",
    "relation": "from blow counts",
    "others": "published elsewhere",
}

SEARCHES = {"gauss_newton": "Gauss-Newton", "lbfgsb": "L-BFGS-B"}
MOST_FITTED = 6
"""Fitted measurements that have a column of their own."""


def answer_table(data: BackAnalysisData) -> Table:
    """Every parameter with all its numbers."""
    rows = []
    for p in data.result.answer.parameters:
        stress, places = None, places_of(p.unit)
        if p.sigma_v0_kpa is not None:
            stress = f"{p.sigma_v0_kpa:.0f} (± {p.sigma_v0_std_kpa:.0f} within the zone)"
        # Of what does not meet the data no range is known.
        interval = span(*p.interval_95, places) if data.result.answer.reached else None
        notes = [] if p.determined else [f"not determined (± {p.prior_std:.2g} before)"]
        notes += [f"at its {p.at_bound} bound"] if p.at_bound else []
        bound = p.lower_bound_95 is not None
        notes += ["nothing runs from here on; 95 %: a lower bound"] if bound else []
        notes += [meant_words(p)] if p.strength_kpa is not None else []
        rows.append(
            [
                p.label,
                with_unit(fixed(p.value, places), p.unit),
                fixed(p.std_total, places),
                fixed(p.std_data, places),
                f"≥ {fixed(p.lower_bound_95, places)}" if bound else interval,
                None if p.equally_good_range is None else span(*p.equally_good_range, places),
                _ratio(p),
                stress,
                f"{p.start:g} ({p.low:g} to {p.high:g})",
                "; ".join(notes),
            ]
        )
    header = [
        "unknown",
        "value",
        "std",
        "of which survey",
        "95 %",
        "equally good",
        "S_r/σ'_v0",
        "σ'_v0 (kPa)",
        "first guess (bounds)",
        "",
    ]
    return Table(header, rows)


def _ratio(p: ParameterAnswer) -> str | None:
    if p.ratio_lower_bound_95 is not None:
        return f"≥ {p.ratio_lower_bound_95:.3f}"
    return None if p.ratio is None else f"{p.ratio:.3f} ± {p.ratio_std:.3f}"


def method_tables(data: BackAnalysisData) -> list[Table]:
    """The numbers of the chart of methods, one table for each slide."""
    header = ["method", "S_r (kPa)", "range (kPa)", "what it is"]
    return [
        Table(
            header,
            [
                [
                    r.label,
                    f"≥ {fixed(r.value)}" if r.bound else fixed(r.value),
                    span(r.low, r.high),
                    KINDS[r.kind],
                ]
                for r in panel.rows
            ],
            panel.title,
        )
        for panel in slides(data)
    ]


def implied_tables(data: BackAnalysisData) -> list[Table]:
    """Which measurement asks for which strength, one table for each strength that was sought."""
    return [
        Table(
            ["measurement", "strength that it asks for"],
            [[label_words(one), asked_words(one)] for one in found.each],
            f"{found.parameter.label}: {answer_band(found.parameter)[2]}",
        )
        for found in implied_strengths(data.result)
    ]


def relation_tables(data: BackAnalysisData) -> list[Table]:
    """Each strength next to what published relations give for its blow counts; by parameter."""
    header = [
        "relation",
        "blow count",
        "σ'_v0 (kPa)",
        "S_r (kPa)",
        "± one std",
        "weakest layer",
        "found / relation",
        "scatter",
        "",
    ]
    found = []
    for p in data.strengths:
        ours, at_least = (p.value, "") if p.lower_bound_95 is None else (p.lower_bound_95, "≥ ")
        rows = [
            [
                row.label,
                _count(row),
                f"{row.sigma_v0_kpa:.0f}",
                fixed(row.value_kpa),
                span(row.low_kpa, row.high_kpa),
                fixed(row.weakest_kpa) if len(row.zones) > 1 else None,
                f"{at_least}{ours / row.value_kpa:.2f}",
                row.scatter,
                _doubts(row),
            ]
            for row in data.result.relations
            if row.parameter == p.name
        ]
        found.append(Table(header, rows, f"{p.label}, found {at_least}{fixed(ours)} kPa"))
    return [table for table in found if table.rows]


def _count(row: RelationAnswer) -> str:
    kind = "N1,60cs" if row.clean_sand != row.other_kind else "N1,60"
    counts = sorted(set(row.n1_60_of_zones.values()))
    layers = f" ({counts[0]:g} to {counts[-1]:g})" if len(counts) > 1 else ""
    return f"{kind} {row.n1_60:.3g}{layers}"


def _doubts(row: RelationAnswer) -> str:
    doubts = ["beyond its data, taken at their end"] if row.beyond else []
    if row.other_kind:
        doubts.append(f"asks for {'N1,60cs' if row.clean_sand else 'N1,60'}")
    if row.confidence != ["published"]:
        doubts.append(f"blow count {', '.join(row.confidence)}")
    return "; ".join(doubts)


def engine_table(data: BackAnalysisData) -> Table:
    """The engines side by side, and under them the classical methods; empty: one engine alone."""
    parameters, fitted = _unknowns(data), data.few_fitted(MOST_FITTED)
    header = [
        "engine",
        *_columns(parameters),
        *(f"{m.name}: measured {_measured(m)}" for m in fitted),
        "loss",
        "points every",
    ]
    rows: list[list[str | None]] = []
    for row in data.result.engines:
        values = [
            plus_minus(row.values[p.name], row.std[p.name])
            if row.std
            else fixed(row.values[p.name])
            for p in parameters
        ]
        loss = "failed" if row.loss is None else f"{row.loss:.2g}"
        rows.append(
            [
                f"{row.name}, {row.note}",
                *values,
                *_predicted(row.predicted, fitted),
                loss,
                f"{row.spacing_m:g} m",
            ]
        )
    for analysis in data.result.classical if rows else []:
        # A classical method has one strength: that of the slide to its side.
        own = [p for p in data.strengths if data.side(p) == analysis.get("side")]
        own = own or data.strengths
        for method in analysis.get("methods", []):
            values = [fixed(method["value_kpa"]) if p in own else None for p in parameters]
            name = f"{method['title']}, {analysis['name']}"
            rows.append([name, *values, *[None] * len(fitted), None, None])
    return Table(header, rows)


def classical_notes(data: BackAnalysisData) -> list[str]:
    """Constructed, searched or interpolated values in the classical analyses, by slide."""
    return [
        f"Classical methods, {analysis['name']} slide: {'; '.join(analysis.get('labels', []))}."
        for analysis in data.result.classical
    ]


def left_out_notes(data: BackAnalysisData) -> list[str]:
    """Classical methods that are in no table, and why, by slide."""
    notes = []
    for analysis in data.result.classical:
        methods = [(method["title"], undecided(method)) for method in analysis["methods"]]
        left_out = [f"{title} ({why})" for title, why in methods if why]
        if left_out:
            notes.append(
                f"Left out, {analysis['name']} slide, because they do not say what the strength "
                f"is: {'; '.join(left_out)}; result.json has their numbers."
            )
    return notes


def measured_table(data: BackAnalysisData, lines: Sequence[MeasurementAnswer]) -> Table:
    """Measured against predicted, with the toe read by eye."""
    header = [
        "measurement",
        "type",
        "measured",
        "std",
        "range",
        "predicted",
        "by eye",
        "before the slide",
        "in std",
        "role",
    ]
    rows = [
        [
            m.name,
            m.type.replace("_", " "),
            _measured(m),
            None if m.std is None else f"{m.std:.2g}",
            span(m.low, m.high, measured_places(m.std)),
            with_unit(fixed(m.predicted, measured_places(m.std)), m.unit),
            fixed(m.by_eye, measured_places(m.std)),
            fixed(m.predicted_at_start, measured_places(m.std)),
            signed(m.difference_in_std),
            m.role,
        ]
        for m in lines
    ]
    return Table(header, rows)


def _measured(m: MeasurementAnswer) -> str | None:
    """What was measured, with its unit; None: nothing."""
    value = limited(m.measured, m.censored, m.std)
    return None if value is None else with_unit(value, m.unit)


def source_table(lines: Sequence[MeasurementAnswer]) -> Table:
    """How far the measurements can be trusted, and where they come from."""
    rows = [[m.name, m.confidence, m.source] for m in lines]
    return Table(["measurement", "confidence", "source"], rows)


def singles(data: BackAnalysisData) -> list[MeasurementAnswer]:
    """Measurements of a single number, those without a measured value last."""
    known = {m.name for group in data.series for m in group.lines}
    one = [group.lines[0] for group in data.series if len(group.lines) == 1]
    return one + [m for m in data.result.measurements if m.name not in known]


def series_tables(data: BackAnalysisData) -> list[Table]:
    """The measurements of several numbers, with their source in the caption."""
    return [_series_table(one) for one in data.series if len(one.lines) > 1]


def _series_table(one: Series) -> Table:
    first = one.lines[0]
    rows = [
        [
            m.name.removeprefix(one.name).strip() or m.name,
            fixed(m.measured, measured_places(m.std)),
            f"{m.std:.2g}",
            fixed(m.predicted, measured_places(m.std)),
            signed(m.difference_in_std),
            m.role,
        ]
        for m in one.lines
    ]
    given = "constructed" if one.role == "constructed" else "measured"
    header = [
        "where",
        f"{given} ({unit_of(first.unit)})",
        "std",
        f"predicted ({unit_of(first.unit)})",
        "in std",
        "role",
    ]
    caption = f"{one.name} ({first.type.replace('_', ' ')}, {first.confidence}): {first.source}"
    return Table(header, rows, caption)


def whole_series_table(data: BackAnalysisData, names: Collection[str]) -> Table:
    """Measurements of many numbers, a row for each that is named."""
    rows = []
    for one in data.series:
        if one.name not in names:
            continue
        first, off = one.lines[0], [m.difference_in_std or 0.0 for m in one.lines]
        square = sum((m.predicted - (m.measured or 0.0)) ** 2 for m in one.lines)
        worst = largest_place(map(abs, off))
        rows.append(
            [
                one.name,
                first.type.replace("_", " "),
                str(len(off)),
                with_unit(fixed(root_mean_square(square, len(off))), first.unit),
                fixed(root_mean_square(sum(d * d for d in off), len(off))),
                f"{signed(off[worst])} {one.lines[worst].name.removeprefix(one.name).strip()}",
                one.role,
            ]
        )
    header = [
        "measurement",
        "type",
        "numbers",
        "off by (rms)",
        "in std (rms)",
        "worst, in std",
        "role",
    ]
    return Table(header, rows)


def variant_table(data: BackAnalysisData) -> Table:
    """Variants of the question, all solved."""
    parameters = _unknowns(data)
    lines = {m.name for one in data.series if len(one.lines) > 1 for m in one.lines}
    rows = []
    for variant in data.result.variants:
        shown = [
            name for name in variant.predicted if name in variant.measured or name not in lines
        ]
        notes = [] if variant.reached else ["not fitted"]
        predicted = "; ".join(
            f"{name} {fixed(variant.predicted[name])}"
            + (f" (target {variant.measured[name]:g})" if name in variant.measured else "")
            for name in shown[:MOST_FITTED]
        )
        rows.append(
            [
                variant.name,
                *(fixed(variant.values[p.name], places_of(p.unit)) for p in parameters),
                ", ".join(f"{ratio:.3f}" for ratio in variant.ratios.values()),
                predicted,
                f"{variant.loss:.2g}",
                *_spacing(data, variant.spacing_m),
                "; ".join([variant.words, *notes, *_at_bounds(parameters, variant.at_bound)]),
            ]
        )
    header = [
        "variant",
        *_columns(parameters),
        "S_r/σ'_v0",
        "predicted",
        "loss",
        *_spacing(data),
        "",
    ]
    return Table(header, rows)


def waterfall_table(data: BackAnalysisData) -> Table:
    """The way from another reading to the answer, change by change."""
    found = data.result.waterfall
    if found is None:
        return Table([], [])
    (p,) = [p for p in _unknowns(data) if p.name == found.parameter]
    seen = [m.name for m in singles(data) if m.measured is not None and m.role != "constructed"]
    stated = found.stated
    rows: list[list[str | None]] = []
    if stated is not None:
        rows.append(
            [
                stated.name,
                fixed(stated.value, places_of(p.unit)),
                None,
                *[None] * len(seen),
                *[None for _ in _spacing(data)],
                f"as stated: {stated.source}",
            ]
        )
    before = None if stated is None else stated.value
    for bar in found.bars:
        notes = [] if bar.reached else ["not fitted"]
        notes += [f"at its {bar.at_bound} bound"] if bar.at_bound else []
        change = None if before is None else f"{bar.value - before:+.{places_of(p.unit)}f}"
        rows.append(
            [
                bar.name,
                fixed(bar.value, places_of(p.unit)),
                change,
                *(fixed(bar.predicted.get(name)) for name in seen),
                *_spacing(data, bar.spacing_m),
                "; ".join(notes),
            ]
        )
        before = bar.value
    header = ["change by change", *_columns([p]), "change", *seen, *_spacing(data), ""]
    return Table(header, rows)


def sensitivity_tables(
    data: BackAnalysisData, parameters: Sequence[ParameterAnswer]
) -> list[Table]:
    """The effect of each assumption, and what it adds to the standard deviation; by parameter."""
    if not data.result.sensitivities and data.result.noise is None:
        return []
    return [
        _sensitivity_table(data, p) for p in [p for p in parameters if p.determined] or parameters
    ]


def _sensitivity_table(data: BackAnalysisData, p: ParameterAnswer) -> Table:
    coarse, places = data.result.coarse_spacing_m, places_of(p.unit) + 1
    rows: list[list[str | None]] = [
        [
            "survey",
            "errors of the fitted measurements",
            None,
            f"{p.std_data:.{places}f}",
            *_spacing(data, data.result.spacing_m),
            *([None] if coarse else []),
        ]
    ]
    for entry in data.result.sensitivities:
        added = "not added" if entry.kind == "target" else f"{entry.std[p.name]:.{places}f}"
        for number, side in enumerate(entry.sides):
            fit = "" if side.reached else " (not fitted: linear estimate)"
            name, its = (entry.name, added) if number == 0 else ("", "")
            both = (
                None if side.coarse_change is None else signed(side.coarse_change[p.name], places)
            )
            rows.append(
                [
                    name,
                    f"{side.words}{fit}",
                    signed(side.change[p.name], places),
                    its,
                    *_spacing(data, side.spacing_m),
                    *([both] if coarse else []),
                ]
            )
    cells = data.result.answer.small_cells
    if cells is not None and CELLS in p.std_by_source:
        rows.append(
            [
                CELLS,
                cells.words.removeprefix(f"{CELLS}: "),
                None,
                f"{p.std_by_source[CELLS]:.{places}f}",
                *_spacing(data, cells.spacing_m),
                *([None] if coarse else []),
            ]
        )
    if data.result.noise is not None:
        seeds = f"{len(data.result.noise.seeds)} jitter seeds"
        std = data.result.noise.answer_std[p.name]
        rows.append(
            [
                NOISE_SOURCE,
                seeds,
                None,
                f"{std:.{places}f}",
                *_spacing(data, data.result.noise.spacing_m),
                *([None] if coarse else []),
            ]
        )
    rows.append(
        [
            "total",
            "root of the sum of squares",
            None,
            f"{p.std_total:.{places}f}",
            *([None, None] if coarse else []),
        ]
    )
    unit = f" ({unit_of(p.unit)})" if p.unit else ""
    header = [
        "assumption",
        "what was changed",
        f"change{unit}",
        f"adds ±{unit}",
        *_spacing(data),
        *([f"change at {coarse:g} m"] if coarse else []),
    ]
    return Table(header, rows, answer_words(p))


def equally_good_table(data: BackAnalysisData) -> Table:
    """Equally good answers with what they predict; the answer itself first."""
    answer, fitted = data.result.answer, data.few_fitted(MOST_FITTED)
    parameters = answer.parameters
    header = [
        "",
        *_columns(parameters),
        *(f"{m.name} ({unit_of(m.unit)})" for m in fitted),
        "loss",
        *_spacing(data),
        "",
    ]
    if not answer.equally_good:
        return Table(header, [])
    rows = [
        [
            "this answer",
            *(fixed(p.value) for p in parameters),
            *(fixed(m.predicted) for m in fitted),
            f"{answer.loss:.2g}",
            *_spacing(data, data.result.spacing_m),
            "",
        ]
    ]
    for stop in answer.equally_good:
        rows.append(
            [
                "equally good",
                *(fixed(stop.values[p.name]) for p in parameters),
                *_predicted(stop.predicted, fitted),
                f"{stop.loss:.2g}",
                *_spacing(data, stop.spacing_m),
                "; ".join(_at_bounds(parameters, stop.at_bound)),
            ]
        )
    return Table(header, rows)


def history_table(data: BackAnalysisData) -> Table:
    """Every evaluation of the engine."""
    parameters, fitted = _unknowns(data), data.few_fitted(MOST_FITTED)
    rows = [
        [
            line.iteration,
            SEARCHES.get(line.kind, line.kind) + ("" if line.accepted else ", rejected"),
            *(fixed(line.values[p.name], 2) for p in parameters),
            *_predicted(line.predicted, fitted),
            None if line.loss is None else f"{line.loss:.3g}",
            *_spacing(data, line.spacing_m),
            line.runs_so_far,
        ]
        for line in data.result.iterations
    ]
    header = [
        "iteration",
        "what",
        *_columns(parameters),
        *(f"{m.name} ({unit_of(m.unit)})" for m in fitted),
        "loss",
        *_spacing(data),
        "simulations so far",
    ]
    return Table(header, rows)


def starts_table(data: BackAnalysisData) -> Table:
    """The same question from other first guesses; empty: there was one."""
    parameters = _unknowns(data)
    rows = [
        [
            ", ".join(f"{start.start[p.name]:.3g}" for p in parameters),
            ", ".join(f"{start.answer[p.name]:.2f}" for p in parameters),
            f"{start.loss:.2g}" + ("" if start.reached else " (not fitted)"),
            start.iterations,
            start.runs,
            *_spacing(data, start.spacing_m),
        ]
        for start in data.result.starts
        if len(data.result.starts) > 1
    ]
    names = ", ".join(p.label for p in parameters)
    header = ["first guess", "answer", "loss", "iterations", "simulations", *_spacing(data)]
    return Table(header, rows, names)


def timing_table(data: BackAnalysisData) -> Table:
    """Wall times by stage, and the number of simulations."""
    rows = [[name, f"{seconds:.1f} s"] for name, seconds in data.result.timings.items()]
    return Table(["stage", "wall time"], [*rows, ["simulations", _simulations(data)]])


def provenance_table(data: BackAnalysisData) -> Table:
    """Engine, search, machine, versions and settings."""
    result, manifest = data.result, data.result.manifest
    rows: list[list[str]] = [
        ["engine", f"{result.engine}, points every {result.spacing_m:g} m"],
        ["search", f"{SEARCHES[result.answer.method]}: {result.answer.words}"],
        ["machine", _listed(manifest.get("machine"))],
        *(
            [key.replace("_", " "), str(manifest[key])]
            for key in ("made", "code_version", "config_hash")
            if key in manifest
        ),
        ["versions of the physics", _listed(manifest.get("physics_versions"))],
    ]
    packages = manifest.get("packages", {})
    wanted = {
        name: packages[name] for name in ("python", "numpy", "scipy", "taichi") if name in packages
    }
    rows.append(["packages", _listed(wanted)])
    settings = manifest.get("config", {})
    rows += [
        [f"settings: {group}", _listed(settings.get(group))]
        for group in ("simulation", "inversion")
    ]
    return Table(["", ""], [row for row in rows if row[1]])


def _spacing(data: BackAnalysisData, spacing_m: float | None = None) -> list[str]:
    """Cell of the column of spacings, or its heading; none where all runs have one spacing."""
    if data.result.coarse_spacing_m is None:
        return []
    return ["points every" if spacing_m is None else f"{spacing_m:g} m"]


def _simulations(data: BackAnalysisData) -> str:
    return f"{data.result.runs} in all, {data.result.runs_to_answer} until the answer"


def _listed(entries: object) -> str:
    """A mapping on one line; empty for anything else."""
    if not isinstance(entries, dict):
        return ""
    return ", ".join(f"{key} {value}" for key, value in entries.items())


def _unknowns(data: BackAnalysisData) -> list[ParameterAnswer]:
    return data.result.answer.parameters


def _columns(parameters: Sequence[ParameterAnswer]) -> list[str]:
    return [f"{p.label} ({unit_of(p.unit)})" if p.unit else p.label for p in parameters]


def _predicted(predicted: dict[str, float], fitted: Sequence[MeasurementAnswer]) -> list:
    return [fixed(predicted.get(m.name)) for m in fitted]


def _at_bounds(parameters: Sequence[ParameterAnswer], names: Sequence[str]) -> list[str]:
    return [f"{p.label} at a bound" for p in parameters if p.name in names]
