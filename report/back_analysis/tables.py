"""The tables of a report.

In: a `ReportData`. Out: `report.page.Table`s; None where a table would have no rows.
"""

from __future__ import annotations

from inversion.back_analysis.result import MeasurementAnswer, ParameterAnswer
from inversion.back_analysis.result_builder import NOISE_SOURCE
from report.back_analysis.data import ReportData
from report.back_analysis.sentences import MINUS, number_with_unit, signed, unit, value
from report.charts.measured import Group, groups
from report.charts.methods import slides
from report.page import Table

KINDS = {"ours": "this analysis", "engine": "the same question",
         "variant": "this analysis, another reading", "classical": "classical",
         "others": "published elsewhere"}  # fmt: skip

SEARCHES = {"gauss_newton": "Gauss-Newton", "lbfgsb": "L-BFGS-B"}


def answer_table(data: ReportData) -> Table:
    """Every parameter with all its numbers."""
    rows = []
    for p in data.result.answer.parameters:
        ratio = None if p.ratio is None else f"{p.ratio:.3f} ± {p.ratio_std:.3f}"
        stress = None
        if p.sigma_v0_kpa is not None:
            stress = f"{p.sigma_v0_kpa:.0f} (± {p.sigma_v0_std_kpa:.0f} within the zone)"
        notes = [] if p.determined else ["not determined"]
        notes += [f"at its {p.at_bound} bound"] if p.at_bound else []
        rows.append(
            [
                p.label,
                number_with_unit(p, f"{p.value:.1f}"),
                f"{p.std_total:.1f}",
                f"{p.std_data:.1f}",
                f"{p.interval_95[0]:.1f} to {p.interval_95[1]:.1f}",
                None
                if p.equally_good_range is None
                else f"{p.equally_good_range[0]:.1f} to {p.equally_good_range[1]:.1f}",
                ratio,
                stress,
                f"{p.start:g} ({p.low:g} to {p.high:g})",
                "; ".join(notes),
            ]
        )
    header = ["sought", "value", "std", "of which survey", "95 %", "equally good", "S_r/σ'_v0",
              "σ'_v0 (kPa)", "first guess (bounds)", ""]  # fmt: skip
    return Table(header, rows)


def method_tables(data: ReportData) -> list[Table]:
    """The numbers of the picture of methods, one table for each slide."""
    header = ["method", "S_r (kPa)", "range (kPa)", "what it is"]
    return [
        Table(
            header,
            [[r.label, _one(r.value), _span(r.low, r.high), KINDS[r.kind]] for r in panel.rows],
            panel.title,
        )
        for panel in slides(data)
    ]


def engine_table(data: ReportData) -> Table | None:
    """The engines side by side, and under them the classical methods; None: one engine alone."""
    result = data.result
    if not result.engines:
        return None
    parameters = result.answer.parameters
    fitted = [m for m in result.measurements if m.role == "fitted"][:6]
    rows: list[list[str | None]] = []
    for row in result.engines:
        values = [
            f"{row.values[p.name]:.1f}" + (f" ± {row.std[p.name]:.1f}" if row.std else "")
            for p in parameters
        ]
        told = [_one(row.predicted.get(m.name)) for m in fitted]
        loss = "failed" if row.loss is None else f"{row.loss:.2g}"
        rows.append([f"{row.name}, {row.note}", *values, *told, loss, f"{row.spacing_m:g} m"])
    for analysis in result.classical:
        # A classical method knows one strength: that of the slide to its side.
        own = [p for p in data.strengths if data.side(p) == analysis.get("side")]
        own = own or data.strengths
        for method in analysis.get("methods", []):
            value = method["value_kpa"]
            values = [None if p not in own or value is None else _one(value) for p in parameters]
            name = f"{method['title']}, {analysis['name']}"
            rows.append([name, *values, *[None] * len(fitted), None, None])
    header = ["engine", *(f"{p.label} ({unit(p)})" for p in parameters),
              *(f"{m.name}: measured {_one(m.measured)} {m.unit}" for m in fitted), "loss",
              "points every"]  # fmt: skip
    return Table(header, rows)


def classical_notes(data: ReportData) -> list[str]:
    """What is constructed, searched or morphed in the classical analyses, slide by slide."""
    return [
        f"Classical methods, {analysis['name']} slide: {'; '.join(analysis.get('labels', []))}."
        for analysis in data.result.classical
    ]


def measured_tables(data: ReportData) -> list[Table]:
    """Measured against predicted, single values with the toe by the naked eye; and the sources."""
    found = groups(data)
    single = [group.lines[0] for group in found if len(group.lines) == 1]
    known = {m.name for group in found for m in group.lines}
    single += [m for m in data.result.measurements if m.name not in known]
    header = ["measurement", "type", "measured", "std", "range", "predicted", "by the naked eye",
              "before the slide", "in std", "role"]  # fmt: skip
    tables = []
    if single:
        sources = [[m.name, m.confidence, m.source] for m in single]
        tables = [
            Table(header, [_measured_row(m) for m in single]),
            Table(["measurement", "confidence", "source"], sources),
        ]
    return tables


def series_tables(data: ReportData) -> list[Table]:
    """The measurements of several values, value by value."""
    return [_series_table(group) for group in groups(data) if len(group.lines) > 1]


def _measured_row(m: MeasurementAnswer) -> list[str | None]:
    return [
        m.name,
        m.type.replace("_", " "),
        None if m.measured is None else f"{_one(m.measured)} {m.unit}",
        None if m.std is None else f"{m.std:.2g}",
        _span(m.low, m.high),
        f"{_one(m.predicted)} {m.unit}",
        _one(m.by_eye),
        _one(m.predicted_at_start),
        None if m.difference_in_std is None else signed(m.difference_in_std),
        m.role,
    ]


def _series_table(group: Group) -> Table:
    """The values of a profile or a history, and in its caption what they are worth."""
    first = group.lines[0]
    rows = [
        [
            m.name.removeprefix(group.name).strip() or m.name,
            _one(m.measured),
            f"{m.std:.2g}",
            _one(m.predicted),
            signed(m.difference_in_std),
            m.role,
        ]
        for m in group.lines
    ]
    caption = f"{group.name} ({first.type.replace('_', ' ')}, {first.confidence}): {first.source}"
    unit_ = first.unit
    header = ["where", f"measured ({unit_})", "std", f"predicted ({unit_})", "in std", "role"]
    if group.role == "constructed":
        header[1] = f"constructed ({unit_})"
    return Table(header, rows, caption)


def variant_table(data: ReportData) -> Table | None:
    """Other readings of the question, all solved."""
    parameters = data.result.answer.parameters
    labels = {p.name: p.label for p in parameters}
    rows = []
    for variant in data.result.variants:
        ratios = ", ".join(f"{ratio:.3f}" for ratio in variant.ratios.values())
        notes = [] if variant.reached else ["not fitted"]
        notes += [f"{labels[name]} at a bound" for name in variant.at_bound]
        predicted = "; ".join(
            f"{name} {_one(number)}"
            + (f" (target {variant.measured[name]:g})" if name in variant.measured else "")
            for name, number in list(variant.predicted.items())[:6]
        )
        rows.append(
            [
                variant.name,
                *(_one(variant.values[p.name]) for p in parameters),
                ratios,
                predicted,
                f"{variant.loss:.2g}",
                "; ".join([variant.words, *notes]),
            ]
        )
    header = ["reading", *(f"{p.label} ({unit(p)})" for p in parameters), "S_r/σ'_v0", "predicted",
              "loss", ""]  # fmt: skip
    return Table(header, rows) if rows else None


def sensitivity_tables(data: ReportData) -> list[Table]:
    """What each assumption does, and what it adds to the standard deviation; by parameter."""
    if not data.result.sensitivities and data.result.noise is None:
        return []
    determined = [p for p in data.result.answer.parameters if p.determined]
    return [_sensitivity_table(data, p) for p in determined or data.result.answer.parameters]


def _sensitivity_table(data: ReportData, p: ParameterAnswer) -> Table:
    rows: list[list[str | None]] = [
        ["survey", "errors of the fitted measurements", None, f"{p.std_data:.2f}"]
    ]
    for entry in data.result.sensitivities:
        added = "not added" if entry.kind == "target" else f"{entry.std[p.name]:.2f}"
        for number, side in enumerate(entry.sides):
            fit = "" if side.reached else " (not fitted: linear estimate)"
            name, its = (entry.name, added) if number == 0 else ("", "")
            rows.append([name, f"{side.words}{fit}", signed(side.change[p.name], 2), its])
    if data.result.noise is not None:
        seeds = f"{len(data.result.noise.seeds)} jitter seeds"
        std = data.result.noise.answer_std[p.name]
        rows.append([NOISE_SOURCE, seeds, None, f"{std:.2f}"])
    rows.append(["in all", "root of the sum of squares", None, f"{p.std_total:.2f}"])
    header = ["assumption", "what was changed", f"change ({unit(p)})", f"adds ± ({unit(p)})"]
    return Table(header, rows, f"{p.label}: {value(p)}")


def equally_good_table(data: ReportData) -> Table | None:
    """Answers that fit as well, with what they predict; the answer itself first."""
    answer = data.result.answer
    if not answer.equally_good:
        return None
    fitted = [m for m in data.result.measurements if m.role == "fitted"][:6]
    labels = {p.name: p.label for p in answer.parameters}
    rows = [
        ["this answer", *(f"{p.value:.1f}" for p in answer.parameters),
         *(f"{m.predicted:.1f}" for m in fitted), f"{answer.loss:.2g}", ""]
    ]  # fmt: skip
    for stop in answer.equally_good:
        bounds = "; ".join(f"{labels[name]} at a bound" for name in stop.at_bound)
        rows.append(
            ["as good", *(f"{stop.values[p.name]:.1f}" for p in answer.parameters),
             *(_one(stop.predicted.get(m.name)) for m in fitted), f"{stop.loss:.2g}", bounds]
        )  # fmt: skip
    header = ["", *(f"{p.label} ({unit(p)})" for p in answer.parameters),
              *(f"{m.name} ({m.unit})" for m in fitted), "loss", ""]  # fmt: skip
    return Table(header, rows)


def history_table(data: ReportData) -> Table:
    """Every look at the engine."""
    parameters = data.result.answer.parameters
    fitted = [m for m in data.result.measurements if m.role == "fitted"][:6]
    rows = [
        [
            line.iteration,
            SEARCHES.get(line.kind, line.kind) + ("" if line.accepted else ", taken back"),
            *(f"{line.values[p.name]:.2f}" for p in parameters),
            *(_one(line.predicted.get(m.name)) for m in fitted),
            None if line.loss is None else f"{line.loss:.3g}",
            line.runs_so_far,
        ]
        for line in data.result.iterations
    ]
    header = ["iteration", "what", *(f"{p.label} ({unit(p)})" for p in parameters),
              *(f"{m.name} ({m.unit})" for m in fitted), "loss", "simulations so far"]  # fmt: skip
    return Table(header, rows)


def starts_table(data: ReportData) -> Table | None:
    """The same question from other first guesses; None: there was one."""
    if len(data.result.starts) < 2:
        return None
    parameters = data.result.answer.parameters
    rows = [
        [
            ", ".join(f"{start.start[p.name]:.3g}" for p in parameters),
            ", ".join(f"{start.answer[p.name]:.2f}" for p in parameters),
            f"{start.loss:.2g}" + ("" if start.reached else " (not fitted)"),
            start.iterations,
            start.runs,
        ]
        for start in data.result.starts
    ]
    names = ", ".join(p.label for p in parameters)
    return Table(["first guess", "answer", "loss", "iterations", "simulations"], rows, names)


def made_tables(data: ReportData) -> list[Table]:
    """Timings, and how the result was made."""
    result = data.result
    manifest = result.manifest
    timings = [[name, f"{seconds:.1f} s"] for name, seconds in result.timings.items()]
    rows: list[list[str]] = [
        ["simulations", f"{result.runs} in all, {result.runs_to_answer} until the answer"],
        ["engine", f"{result.engine}, points every {result.spacing_m:g} m"],
        ["search", f"{SEARCHES[result.answer.method]}: {result.answer.words}"],
    ]
    machine = manifest.get("machine", {})
    if isinstance(machine, dict) and machine:
        rows.append(["machine", ", ".join(f"{key} {value}" for key, value in machine.items())])
    for key in ("made", "code_version", "config_hash"):
        if key in manifest:
            rows.append([key.replace("_", " "), str(manifest[key])])
    versions = manifest.get("physics_versions", {})
    if isinstance(versions, dict) and versions:
        told = ", ".join(f"{name} {version}" for name, version in versions.items())
        rows.append(["versions of the physics", told])
    packages = manifest.get("packages", {})
    wanted = [name for name in ("python", "numpy", "scipy", "taichi") if name in packages]
    if wanted:
        rows.append(["packages", ", ".join(f"{name} {packages[name]}" for name in wanted)])
    settings = manifest.get("config", {})
    for group in ("simulation", "inversion"):
        if isinstance(settings, dict) and isinstance(settings.get(group), dict):
            told = ", ".join(f"{key} {value}" for key, value in settings[group].items())
            rows.append([f"settings: {group}", told])
    simulations = ["simulations", rows.pop(0)[1]]
    return [Table(["stage", "wall time"], [*timings, simulations]), Table(["", ""], rows)]


def _one(number: float | None) -> str | None:
    return None if number is None else f"{number:.1f}".replace("-", MINUS)


def _span(low: float | None, high: float | None) -> str | None:
    return None if low is None or high is None else f"{low:.1f} to {high:.1f}"
