"""What a prediction leaves: `prediction.json`, and the table on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from inversion import PHYSICS_VERSION
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.predict import ENVELOPE, QUANTILES, Distribution, Envelope
from inversion.prediction.prediction_case import PredictionCase
from mpm_taichi import PHYSICS_VERSION as SOLVER_VERSION
from pipeline.table import aligned

#: Points of an exceedance curve, and probabilities told in the table, %.
CURVE_POINTS = 101
DIGITS = 4
#: A larger share of slides at the edge of the domain is reported.
EDGE_TOLD = 1e-3


def document_of(
    case: PredictionCase,
    strengths: Sequence[KnownStrength],
    found: Distribution,
    sections: Envelope | None,
) -> dict[str, Any]:
    """The document (keys: docs/method/prediction.md); lengths in m, strengths in kPa."""
    return {
        "case": case.name,
        "spacing_m": case.scene.spacing,
        "physics": {"mpm": SOLVER_VERSION, "inversion": PHYSICS_VERSION},
        "strengths": [
            {"zones": list(s.zones), "mean_kpa": s.mean_kpa, "std_kpa": s.std_kpa,
             "distribution": s.kind, "words": s.words}
            for s in strengths
        ],
        "samples": len(found.samples),
        "failed_runs": found.failed,
        "runs_cut_off": sum(not prediction.at_rest for prediction in found.predictions),
        "runs": [
            {"strengths_kpa": _rounded(kpa), "predicted": dict(zip(found.names, _rounded(row),
                                                                   strict=True))}
            for kpa, row in zip(found.strengths, found.runs, strict=True)
        ],
        "quantities": [
            _quantity(case, found, number)
            for number in range(len(found.names))
            if _worth_telling(case, found, number)
        ],
        "sections": None if sections is None else {
            "x_m": _rounded(sections.x),
            **{f"y_{percent}_m": _rounded(row)
               for percent, row in zip(ENVELOPE, sections.surfaces, strict=True)},
        },
    }  # fmt: skip


def _quantity(case: PredictionCase, found: Distribution, number: int) -> dict[str, Any]:
    entry, samples = case.entries[number], found.samples[:, number]
    low, high = np.percentile(samples, (0.05, 99.95))
    beyond = np.linspace(low, high, CURVE_POINTS)
    known = entry.name in case.known
    value = float(entry.values[0])
    return {
        "name": entry.name,
        "type": entry.type,
        "unit": entry.unit,
        "mean": _round(samples.mean()),
        "std": _round(samples.std()),
        "quantiles": {
            str(percent): _round(q)
            for percent, q in zip(QUANTILES, found.quantiles()[:, number], strict=True)
        },
        "std_numerical": _round(max(found.noise[number], found.missed[number])),
        "exceedance": {
            "beyond": _rounded(beyond),
            "probability": _rounded(found.exceedance(number, beyond)),
        },
        "measured": value if known else None,
        "probability_beyond_measured": (
            _round(float(found.exceedance(number, np.array([value]))[0])) if known else None
        ),
        "probability_at_the_edge": _at_the_edge(case, found, number),
    }


def _worth_telling(case: PredictionCase, found: Distribution, number: int) -> bool:
    """Measured, or a toe that moves outward in some run."""
    if case.entries[number].name in case.known:
        return True
    before = max(prediction.at_start[number] for prediction in found.predictions)
    return bool(found.runs[:, number].max() > before + 2.0 * case.scene.spacing)


def _at_the_edge(case: PredictionCase, found: Distribution, number: int) -> float | None:
    """Share of the slides that end at the edge of the domain: they would have run farther."""
    entry, scene = case.entries[number], case.scene
    if entry.toe_side is None:
        return None
    if scene.domain.walls == "open":
        return 0.0
    edge = scene.domain.x_min if entry.toe_side == "left" else scene.domain.x_max
    room = abs(edge - case.feet[entry.toe_side])
    return _round(np.mean(found.samples[:, number] > room - 2.0 * scene.spacing))


def summary(document: dict[str, Any]) -> str:
    """The answer in a table, for people."""
    lines = [f"{document['case']}: " + "; ".join(s["words"] for s in document["strengths"])]
    heading = ["", "mean", "std", *(f"{percent} %" for percent in QUANTILES), "measured",
               "P(beyond it)"]  # fmt: skip
    rows = [heading]
    for entry in document["quantities"]:
        measured, probability = entry["measured"], entry["probability_beyond_measured"]
        rows.append(
            [f"{entry['name']} ({entry['unit']})", f"{entry['mean']:.1f}", f"{entry['std']:.1f}"]
            + [f"{value:.1f}" for value in entry["quantiles"].values()]
            + ["" if measured is None else f"{measured:g}",
               "" if probability is None else f"{100 * probability:.1f} %"]
        )  # fmt: skip
    lines += ["", aligned(rows)]
    toes = [entry for entry in document["quantities"] if entry["type"] == "toe_runout"]
    if toes:
        lines += ["", "probability that the toe runs farther than", aligned(_exceedances(toes))]
    else:
        lines.append("no toe moves")
    for entry in toes:
        if entry["probability_at_the_edge"] > EDGE_TOLD:
            lines.append(
                f"{entry['name']}: {100 * entry['probability_at_the_edge']:.1f} % of the slides "
                "reach the edge of the domain and would run farther; give the scene a wider domain"
            )
    if document["failed_runs"]:
        lines.append(f"{document['failed_runs']} simulations failed and are left out")
    if document["runs_cut_off"]:
        lines.append(
            f"{document['runs_cut_off']} simulations were cut off in motion and would run farther; "
            "give them longer: duration_s of inversion.yaml, or --set simulation.duration_s"
        )
    lines.append(f"{len(document['runs'])} simulations, {document['samples']} samples")
    return "\n".join(lines)


def _exceedances(toes: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Round distances, and the probability of each toe to run farther."""
    last = max(max(entry["exceedance"]["beyond"]) for entry in toes)
    step = _round_step(max(last, 1e-6) / 8.0)
    places = np.arange(0.0, last + step, step)
    rows = [[f"{place:g} m" for place in places]]
    rows[0].insert(0, "")
    for entry in toes:
        curve = entry["exceedance"]
        chance = np.interp(places, curve["beyond"], curve["probability"], left=1.0, right=0.0)
        rows.append([entry["name"], *(f"{100 * p:.1f} %" for p in chance)])
    return rows


def _round_step(step: float) -> float:
    """The next of 1, 2, 5, 10, ..."""
    power = 10.0 ** np.floor(np.log10(step))
    return float(next(m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= step * 0.999) * power)


def _round(value: float) -> float:
    return round(float(value), DIGITS)


def _rounded(values: np.ndarray) -> list[float]:
    return [_round(value) for value in values]
