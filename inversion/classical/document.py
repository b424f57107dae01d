"""The results of the classical methods as a document (`classical.json`) and as a table.

In: `Analysis`. Out: plain values with units in the keys (kPa, m, s), and text. What is constructed,
recalled or made by machine says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from geometry.survey.measurements import Measurements
from inversion.classical import imm
from inversion.classical.analysis import METHODS, Analysis, MethodAnswer, Stability
from inversion.classical.kinetics import Motion
from inversion.classical.sections_of_case import CaseSections
from pipeline.table import aligned

SECTIONS_NOTE = "sections in between: morphed by machine, area conserved"


def document(
    case: CaseSections, analyses: Sequence[Analysis], refused: Sequence[str] = ()
) -> dict[str, Any]:
    """`classical.json`: every analysis with all its numbers, and why others could not be made."""
    return {
        "case": case.name,
        "title": case.title,
        "analyses": [_analysis(analysis, case) for analysis in analyses],
        "not_analysed": list(refused),
    }


def _analysis(analysis: Analysis, case: CaseSections) -> dict[str, Any]:
    judgement, slide = analysis.judgement, analysis.slide
    first, last = analysis.forces[0], analysis.forces[-1]
    return {
        "name": judgement.name,
        "side": judgement.side,
        "judgement": judgement.model_dump(mode="json"),
        "labels": labels(analysis),
        "section_after": {"kind": analysis.after.kind, "source": analysis.after.source},
        "sections_between": SECTIONS_NOTE,
        "slip_surface": {
            "source": judgement.slip_surface,
            "confidence": _slip_label(analysis),
            "points_m": _rounded(slide.slip.points.tolist(), 3),
        },
        "slide": {
            "area_before_m2": round(slide.area_before, 2),
            "area_before_over_after": round(slide.area_factor, 4),
            "toe_before_m": round(slide.toe_before, 2),
            "toe_after_m": round(slide.toe_after, 2),
            "head_m": round(slide.head, 2),
            "centre_before_m": _rounded(first.centre.tolist(), 2),
            "centre_after_m": _rounded(last.centre.tolist(), 2),
            "mass_kg_per_m": round(first.mass),
        },
        "energy": _energy(analysis),
        "methods": [_method(answer) for answer in analysis.answers],
        "section_before": _stability(analysis.before),
        "section_final": _stability(analysis.final),
        "critical_circle": _circle(analysis),
        "sections": [
            {
                "share": round(stage.share, 6),
                "driving_kn_per_m": round(forces.driving / 1e3, 2),
                "liquefied_length_m": round(forces.liquefied_length, 3),
                "resistance_kn_per_m": round(forces.resistance / 1e3, 2),
                "weight_kn_per_m": round(forces.weight / 1e3, 1),
                "centre_m": _rounded(forces.centre.tolist(), 3),
                "strength_for_fs_1_kpa": round(forces.static_strength / 1e3, 3),
            }
            for stage, forces in zip(analysis.stages, analysis.forces, strict=True)
        ],
        "published": published(case.measurements, analysis),
    }


def _energy(analysis: Analysis) -> dict[str, float] | None:
    """The work of gravity, and the part of it that the forces of IMM see; for buoyant weights only.

    The difference is what the mass gives off by becoming flatter: no force along its base.
    """
    if analysis.judgement.water == "pore_pressure":
        return None
    stages = analysis.forces
    steps = np.diff(imm.travel_of(stages))
    drops = -np.diff([stage.centre[1] for stage in stages])
    return {
        "gravity_mj_per_m": round(float(_mean([s.weight for s in stages]) @ drops) / 1e6, 2),
        "driving_mj_per_m": round(float(_mean([s.driving for s in stages]) @ steps) / 1e6, 2),
        "others_mj_per_m": round(float(_mean([s.resistance for s in stages]) @ steps) / 1e6, 2),
        "liquefied_length_times_travel_m2": round(
            float(_mean([s.liquefied_length for s in stages]) @ steps), 1
        ),
    }


def _mean(values: Sequence[float]) -> np.ndarray:
    """Means of neighbours."""
    known = np.asarray(values)
    return 0.5 * (known[1:] + known[:-1])


def labels(analysis: Analysis) -> list[str]:
    """Caveats about the data, in words, for every place that shows the numbers."""
    after = {
        "constructed": "surface after the slide: constructed, not surveyed",
        "measured": "surface after the slide: measured",
        "simulated": f"surface after the slide: simulated ({analysis.after.source})",
    }[analysis.after.kind]
    dry = analysis.slide.before.water is None and analysis.judgement.water != "none"
    unused = [f"no water in the section: water: {analysis.judgement.water} says nothing"]
    return [
        after,
        f"slip surface: {_slip_label(analysis)}",
        SECTIONS_NOTE,
        *(unused if dry else []),
    ]


def published(measurements: Measurements, analysis: Analysis) -> dict[str, Any]:
    """Strengths found by others that are about this slide, as the case states them [kPa]."""
    wanted = analysis.judgement.published or list(measurements.strength_published_kpa)
    return {key: dict(measurements.strength_published_kpa[key]) for key in wanted}


def _slip_label(analysis: Analysis) -> str:
    if analysis.judgement.slip_surface == "search":
        return "searched: along the base, the one that needs the highest S_r"
    return analysis.judgement.slip_confidence


def _method(answer: MethodAnswer) -> dict[str, Any]:
    span = answer.range
    return {
        "method": answer.method,
        "title": METHODS[answer.method],
        "value_kpa": _kpa(answer.strength),
        "low_kpa": None if span is None else _kpa(span[0]),
        "high_kpa": None if span is None else _kpa(span[1]),
        "reason": answer.reason,
        "options": [
            {
                "name": each.option.name,
                "words": each.option.words,
                "value_kpa": _kpa(each.strength),
                "reason": each.reason,
                "in_range": each.option.in_range and each.strength is not None,
            }
            for each in answer.options
        ],
        "motion": None if answer.motion is None else _motion(answer.motion),
        "path_m": None if answer.path is None else _rounded(answer.path.tolist(), 3),
    }


def _motion(motion: Motion) -> dict[str, Any]:
    """The history, at most some two hundred rows of it; the last one always."""
    step = max(1, len(motion.time) // 200)
    rows = sorted({*range(0, len(motion.time), step), len(motion.time) - 1})
    balance = motion.zero_inertia_share
    return {
        "duration_s": round(motion.duration, 3),
        "highest_velocity_m_per_s": round(float(motion.velocity.max()), 4),
        "zero_inertia_share": round(balance, 4) if math.isfinite(balance) else None,
        "time_s": _rounded(motion.time[rows].tolist(), 4),
        "travel_m": _rounded(motion.travel[rows].tolist(), 4),
        "velocity_m_per_s": _rounded(motion.velocity[rows].tolist(), 4),
        "share": _rounded(motion.share[rows].tolist(), 5),
    }


def _stability(stability: Stability) -> dict[str, Any]:
    return {
        "factor_of_safety_with_the_scenes_strengths": {
            name: None if value is None else round(value, 4)
            for name, value in stability.factors.items()
        },
        "strength_for_fs_1_kpa": {name: _kpa(value) for name, value in stability.strengths.items()},
    }


def _circle(analysis: Analysis) -> dict[str, Any] | None:
    if analysis.circle is None:
        return None
    circle = analysis.circle.circle
    return {
        "factor_of_safety_bishop": round(analysis.circle.value, 4),
        "centre_m": [round(circle.x, 2), round(circle.y, 2)],
        "radius_m": round(circle.radius, 2),
        "ends_m": [round(circle.left, 2), round(circle.right, 2)],
        "tried": analysis.circle.tried,
    }


def _kpa(strength: float | None) -> float | None:
    return None if strength is None else round(strength / 1e3, 3)


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, list):
        return [_rounded(part, digits) for part in value]
    return round(float(value), digits)


# --- text ---


def table(case: CaseSections, analysis: Analysis, *, every_option: bool = True) -> str:
    """One slide as text: what each method finds, its range, and every option's value."""
    rows = [["S_r, kPa", "value", "range", "time to stop", "highest speed", ""]]
    for answer in analysis.answers:
        span = answer.range
        rows.append(
            [
                METHODS[answer.method],
                "none" if answer.strength is None else f"{answer.strength / 1e3:.1f}",
                "" if span is None else f"{span[0] / 1e3:.1f}-{span[1] / 1e3:.1f}",
                "" if answer.motion is None else f"{answer.motion.duration:.1f} s",
                "" if answer.motion is None else f"{answer.motion.velocity.max():.1f} m/s",
                answer.reason,
            ]
        )
    for key, entry in published(case.measurements, analysis).items():
        stated = f"{entry['low']:g}-{entry['high']:g}" if "low" in entry else ""
        words = f"published elsewhere: {entry.get('confidence', '')}"
        rows.append([key.replace("_", " "), f"{entry['value']:g}", stated, "", "", words])
    parts = [
        f"{case.scene.name.replace('_', ' ').title()}, {analysis.judgement.name} slide "
        f"(to the {analysis.judgement.side})",
        *(f"  {label}" for label in labels(analysis)),
        aligned(rows, left={0, 5}),
        _stability_table(analysis),
    ]
    if every_option:
        parts.append(_option_table(analysis))
    return "\n".join(parts)


def _stability_table(analysis: Analysis) -> str:
    rows = [["section", "FS with the scene's strengths", "S_r for FS = 1, kPa"]]
    for words, stability in (("before", analysis.before), ("after", analysis.final)):
        factors = ", ".join(
            f"{name} {value:.2f}" for name, value in stability.factors.items() if value is not None
        )
        strengths = ", ".join(
            f"{name} {value / 1e3:.1f}"
            for name, value in stability.strengths.items()
            if value is not None
        )
        rows.append([words, factors, strengths])
    if analysis.circle is not None:
        rows.append(["before, critical circle", f"bishop {analysis.circle.value:.2f}", ""])
    return aligned(rows, left={0, 1, 2})


def _option_table(analysis: Analysis) -> str:
    """Every option as a row, every method as a column; brackets: not in the range."""
    names: dict[str, dict[str, str]] = {}
    for answer in analysis.answers:
        for each in answer.options:
            shown = "none" if each.strength is None else f"{each.strength / 1e3:.1f}"
            cell = shown if each.option.in_range else f"({shown})"
            names.setdefault(each.option.name, {})[answer.method] = cell
    rows = [["one other judgement at a time", *METHODS]]
    rows += [
        [name, *(cells.get(method, "") for method in METHODS)] for name, cells in names.items()
    ]
    return f"{aligned(rows)}\nIn brackets: another question, or a known error; not in the range."
