"""The document of a prediction: `prediction.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from geometry.dimensions.stated import FILE_NAME as DIMENSIONS_FILE
from inversion import PHYSICS_VERSION
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.predict import ENVELOPE, QUANTILES, Distribution, Envelope
from inversion.prediction.prediction_case import PredictionCase
from inversion.prediction.volumes import Released
from mpm_taichi import PHYSICS_VERSION as SOLVER_VERSION

#: Points of an exceedance curve, and probabilities shown in the table, %.
CURVE_POINTS = 101
DIGITS = 4
#: Of a slide from numbers.
MEDIAN_SECTION = (
    "the section has every dimension at its median (dimensions.yaml); what is not known of it is "
    "in no interval here, and a strength from a posterior, in which sections differ, need not "
    "bring back the measured slide"
)


def document_of(
    case: PredictionCase,
    strengths: Sequence[KnownStrength],
    found: Distribution,
    sections: Envelope | None,
    released: Released | None = None,
) -> dict[str, Any]:
    """The document (keys: docs/method/prediction.md); lengths in m, volumes in m3 per m."""
    head = head_of(case.name, case.scene.spacing, strengths, found)
    if (case.folder / DIMENSIONS_FILE).is_file():
        head["remarks"].append(MEDIAN_SECTION)
    return {
        **head,
        "quantities": [
            _quantity(case, found, number)
            for number in range(len(found.names))
            if _worth_telling(case, found, number)
        ]
        + ([] if released is None else _volumes(released)),
        "hydrographs": [] if released is None else [released.hydrograph],
        "sections": None
        if sections is None
        else {
            "x_m": _rounded(sections.x),
            **{
                f"y_{percent}_m": _rounded(row)
                for percent, row in zip(ENVELOPE, sections.surfaces, strict=True)
            },
        },
    }


def _volumes(released: Released) -> list[dict[str, Any]]:
    """Mobilised volume, peak discharge and released volume."""
    return [
        {
            **distribution_of(released.found, number, name, name.replace(" ", "_"), unit),
            "measured": None,
            "censored": False,
            "probability_beyond_measured": None,
            "probability_at_the_edge": None,
        }
        for number, (name, unit) in enumerate(
            zip(released.found.names, released.units, strict=True)
        )
    ]


def head_of(
    name: str, spacing_m: float, strengths: Sequence[KnownStrength], found: Distribution
) -> dict[str, Any]:
    """What every prediction has: its question and its runs."""
    return {
        "case": name,
        "spacing_m": spacing_m,
        "physics": {"mpm": SOLVER_VERSION, "inversion": PHYSICS_VERSION},
        "strengths": [
            {
                "zones": list(s.zones),
                "property": s.property,
                "mean": s.mean,
                "std": s.std,
                "unit": s.unit,
                "distribution": s.kind,
                "words": s.words,
            }
            for s in strengths
        ],
        "small_cells": found.cells and found.cells.model_dump(),
        "samples": len(found.samples),
        "failed_runs": found.failed,
        "runs_cut_off": sum(not prediction.at_rest for prediction in found.predictions),
        "remarks": _of_the_weakest(strengths, found),
        "runs": [
            {
                "strengths": _rounded(values),
                "predicted": dict(zip(found.names, _rounded(row), strict=True)),
            }
            for values, row in zip(found.strengths, found.runs, strict=True)
        ],
    }


def _of_the_weakest(strengths: Sequence[KnownStrength], found: Distribution) -> list[str]:
    """What a reader should know of the run with the least strength, which goes the farthest."""
    if not len(found.strengths):
        return []
    weakest = int(np.argmin(found.scores.sum(axis=1)))
    values = " and ".join(
        f"{one.symbol} {value:.3g} {one.unit}".rstrip()
        for one, value in zip(strengths, found.strengths[weakest], strict=True)
    )
    return [f"with {values} {line}" for line in found.predictions[weakest].remarks]


def _quantity(case: PredictionCase, found: Distribution, number: int) -> dict[str, Any]:
    entry = case.entries[number]
    known = entry.name in case.known
    value = float(entry.values[0])
    return {
        **distribution_of(found, number, entry.name, entry.type, entry.unit),
        "measured": value if known else None,
        "censored": entry.censored,
        "probability_beyond_measured": (
            _round(float(found.exceedance(number, np.array([value]))[0])) if known else None
        ),
        "probability_at_the_edge": _at_the_edge(case, found, number),
    }


def distribution_of(
    found: Distribution, number: int, name: str, kind: str, unit: str
) -> dict[str, Any]:
    """What every predicted number has."""
    samples = found.samples[:, number]
    low, high = np.percentile(samples, (0.05, 99.95))
    beyond = np.linspace(low, high, CURVE_POINTS)
    return {
        "name": name,
        "type": kind,
        "unit": unit,
        "mean": _round(samples.mean()),
        "std": _round(samples.std()),
        "first_order": {
            "mean": _round(found.first_order.mean[number]),
            "std": _round(found.first_order.std[number]),
        },
        "quantiles": {
            str(percent): _round(q)
            for percent, q in zip(QUANTILES, found.quantiles()[:, number], strict=True)
        },
        "std_numerical": _round(max(found.noise[number], found.missed[number])),
        "exceedance": {
            "beyond": _rounded(beyond),
            "probability": _rounded(found.exceedance(number, beyond)),
        },
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
    if scene.domain.is_open(entry.toe_side):
        return 0.0
    room = abs(scene.domain.wall(entry.toe_side) - case.feet[entry.toe_side])
    return _round(np.mean(found.samples[:, number] > room - 2.0 * scene.spacing))


def _round(value: float | np.floating[Any]) -> float:
    return round(float(value), DIGITS)


def _rounded(values: np.ndarray) -> list[float]:
    return [_round(value) for value in values]
