"""The answer as text, for a terminal and a log."""

from __future__ import annotations

from inversion.back_analysis.result import ParameterAnswer, Result
from inversion.engines.registry import engine_named
from pipeline.table import aligned


def summary(result: Result) -> str:
    """The whole answer in a few small tables."""
    parts = [
        _heading(result),
        _answer_table(result),
        _measured_table(result),
        _engines_table(result),
        _changes_table(result),
        _others_table(result),
        _undetermined(result),
        "\n".join(result.remarks),
    ]
    return "\n\n".join(part for part in parts if part)


def _heading(result: Result) -> str:
    answer = result.answer
    end = "" if answer.reached else "NOT FITTED: "
    unit = " m2" if answer.loss_unit == "m2" else ""
    iterations = max(line.iteration for line in result.iterations)
    return (
        f"{result.title}: back-analysis by {engine_named(result.engine).label} at "
        f"{result.spacing_m:g} m, measurements {result.measurement_set!r}\n"
        f"{end}{answer.words}; loss {answer.loss:.3g}{unit} after {iterations} iterations and "
        f"{result.runs_to_answer} simulations ({result.runs} in all, "
        f"{result.timings.get('in all', 0):.0f} s)"
    )


def _answer_table(result: Result) -> str:
    rows = [["", "value", "std", "of which survey", "95 %", "start", "bounds", "S_r/sigma'_v0", ""]]
    for p in result.answer.parameters:
        ratio = "" if p.ratio is None else f"{p.ratio:.3f} +- {p.ratio_std:.3f}"
        rows.append(
            [
                p.label,
                f"{p.value:.1f} {p.unit}",
                f"{p.std_total:.1f}",
                f"{p.std_data:.1f}",
                f"{p.interval_95[0]:.1f}-{p.interval_95[1]:.1f}",
                f"{p.start:g}",
                f"{p.low:g}-{p.high:g}",
                ratio,
                _remark(p),
            ]
        )
    lines = [aligned(rows, left={0, 8})]
    for p in result.answer.parameters:
        if p.sigma_v0_kpa is not None:
            lines.append(
                f"sigma'_v0 of {', '.join(p.zones)}: {p.sigma_v0_kpa:.0f} kPa, "
                f"+-{p.sigma_v0_std_kpa:.0f} over the zone"
            )
    return "\n".join(lines)


def _remark(parameter: ParameterAnswer) -> str:
    remarks = []
    if not parameter.determined:
        remarks.append(f"not determined: as wide as before, {parameter.prior_std:.2g}")
    span = parameter.equally_good_range
    if span is not None and span[1] - span[0] > parameter.std_data:
        remarks.append(f"as good: {span[0]:.1f}-{span[1]:.1f}")
    if parameter.at_bound:
        remarks.append(f"at its {parameter.at_bound} bound")
    return "; ".join(remarks)


def _measured_table(result: Result) -> str:
    shown = [m for m in result.measurements if m.role != "constructed"]
    rows = [["", "measured", "range", "std", "predicted", "by eye", "in std", ""]]
    for m in shown:
        rows.append(
            [
                f"{m.group} ({m.type.replace('_', ' ')})" if m.name == m.group else m.name,
                f"{m.measured:.1f} {m.unit}",
                "" if m.low is None else f"{m.low:g}-{m.high:g}",
                f"{m.std:.2g}",
                f"{m.predicted:.1f}",
                "" if m.by_eye is None else f"{m.by_eye:.1f}",
                f"{m.difference_in_std:+.1f}",
                f"{m.role}; {m.confidence}",
            ]
        )
    return aligned(rows, left={0, 7})


def _changes_table(result: Result) -> str:
    """What every other assumption does: variants, sensitivities, seeds, starts."""
    names = [p.name for p in result.answer.parameters]
    rows = [["what else it could be", *names, "", ""]]
    here = {p.name: p.value for p in result.answer.parameters}
    for variant in result.variants:
        note = _fitted(variant.reached, variant.at_bound)
        values = [f"{variant.values[name]:.1f}" for name in names]
        rows.append([variant.name, *values, variant.words, note])
    for entry in result.sensitivities:
        for side in entry.sides:
            values = [f"{side.change[name]:+.1f}" for name in names]
            rows.append([entry.name, *values, side.words, "" if side.reached else "not fitted"])
    if result.noise is not None:
        values = [f"+-{result.noise.answer_std[name]:.2f}" for name in names]
        rows.append([f"{len(result.noise.seeds)} jitter seeds", *values, "", ""])
    for start in result.starts[1:]:
        values = [f"{start.answer[name] - here[name]:+.2f}" for name in names]
        begun = ", ".join(f"{value:.3g}" for value in start.start.values())
        rows.append([f"started at {begun}", *values, "", "" if start.reached else "not fitted"])
    return "" if len(rows) == 1 else aligned(rows, left={0, len(names) + 1, len(names) + 2})


def _engines_table(result: Result) -> str:
    """The same question by the engines that have answered it."""
    if not result.engines:
        return ""
    parameters = result.answer.parameters
    fitted = [m for m in result.measurements if m.role == "fitted"][:4]
    rows = [["engines side by side", "", *(f"{p.name}, {p.unit}" for p in parameters),
             *(f"{m.name} ({m.measured:.1f} {m.unit})" for m in fitted), "loss"]]  # fmt: skip
    for row in result.engines:
        values = [
            f"{row.values[p.name]:.1f}" + (f" +- {row.std[p.name]:.1f}" if row.std else "")
            for p in parameters
        ]
        told = [f"{row.predicted[m.name]:.1f}" if m.name in row.predicted else "" for m in fitted]
        loss = "failed" if row.loss is None else f"{row.loss:.2g}"
        rows.append([row.name, row.note, *values, *told, loss])
    return aligned(rows, left={0, 1})


def _others_table(result: Result) -> str:
    """S_r by the classical methods and as found by others."""
    rows = [["S_r by others, kPa", "value", "range", ""]]
    for analysis in result.classical:
        for method in analysis.get("methods", []):
            value, low, high = (method.get(key) for key in ("value_kpa", "low_kpa", "high_kpa"))
            rows.append(
                [
                    f"{method['title']}, {analysis['name']}",
                    "-" if value is None else f"{value:.1f}",
                    "" if low is None else f"{low:.1f}-{high:.1f}",
                    method.get("reason") or "; ".join(analysis.get("labels", [])[:1]),
                ]
            )
    for name, entry in result.published.items():
        if entry.get("value") is not None:
            low, high = entry.get("low"), entry.get("high")
            span = "" if low is None else f"{low:g}-{high:g}"
            words = [name.replace("_", " "), f"{entry['value']:.1f}", span]
            rows.append([*words, str(entry.get("confidence", ""))])
    return "" if len(rows) == 1 else aligned(rows, left={0, 3})


def _fitted(reached: bool, at_bound: list[str]) -> str:
    parts = [] if reached else ["not fitted"]
    parts += [f"{name} at a bound" for name in at_bound]
    return "; ".join(parts)


def _undetermined(result: Result) -> str:
    lines = []
    names = [p.name for p in result.answer.parameters]
    for number, direction in enumerate(result.answer.undetermined):
        lines.append(f"Not determined: {direction.words}")
        stops = [stop for stop in result.answer.equally_good if stop.along == number]
        if stops:
            told = "; ".join(
                " / ".join(f"{stop.values[name]:.1f}" for name in names) for stop in stops
            )
            lines.append(f"  as good ({' / '.join(names)}): {told}")
    return "\n".join(lines)
