"""Can it be predicted? The slide that published relations give for the blow counts of the layers.

Nothing is fitted. Each liquefied zone gets the strength that a relation says at its blow count and
at its own vertical effective stress before failure. A relation's scatter is an error of all layers
together, so they rise and fall by one score z:

    S_r of a layer = median exp(z log_std),   z standard normal.

A few runs at chosen scores, made monotone, give every number as a function of z
(`inversion.prediction.response.Monotone`), and so its quantiles and the probability that it exceeds
what was measured, or that a slope flows which did not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from inversion import PHYSICS_VERSION
from inversion.catalogue.correlations import RELATIONS, Relation
from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import RunStore
from inversion.engines.small_cells import InSmallCells
from inversion.estimation.forward import Forward, Prediction, SectionSetup
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.prediction_case import PredictionCase
from inversion.prediction.response import Monotone
from inversion.problem.layers import Layer, layers_of
from inversion.problem.scene_changes import with_properties
from mpm_taichi import PHYSICS_VERSION as SOLVER_VERSION
from pipeline.cli import InputError, WorkFailed

OPTION = "--from-blow-counts"
#: Scores of the runs of one relation.
SCORES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
#: Scores of equal probability at which probabilities are counted.
EVEN = ndtri((np.arange(2000) + 0.5) / 2000)
#: Quantiles of every number, %.
QUANTILES = (5, 50, 95)
DIGITS = 4
#: Strength of a layer before a relation has given it one [kPa].
ANY_KPA = 20.0


def predict_from_blow_counts(
    case: PredictionCase,
    store: RunStore,
    *,
    zones: Sequence[str] = (),
    relations: Sequence[Relation] = tuple(RELATIONS.values()),
    engine: Engine = MPM,
) -> dict[str, Any]:
    """The document (keys: docs/method/prediction.md); lengths in m, strengths in kPa.

    Args:
        case: with blow counts.
        store: of the runs.
        zones: that liquefy, in place of those of the section; empty: these.
        relations: to predict with.
        engine: what predicts.

    Raises:
        InputError: a liquefied zone has no blow count, or none is liquefied.
        WorkFailed: fewer than two runs of a relation finished.
    """
    case = with_liquefied(case, zones)
    zones = liquefied_with_counts(case)
    layered = [KnownStrength((zone,), ANY_KPA, ANY_KPA, "lognormal") for zone in zones]
    setup = case.setup(layered)
    gravity = case.simulation.gravity_m_per_s2
    layers = layers_of(case.scene, case.blow_counts, zones, gravity)
    # The scatter of a relation is ten times what is not known of the cells: it has no part of it.
    logs = [np.log(layer_strengths(relation, layers)[len(SCORES) // 2]) for relation in relations]
    middle = np.exp(np.mean(logs, axis=0)).tolist()
    known = [replace(one, mean=kpa) for one, kpa in zip(layered, middle, strict=True)]
    cells = case.cells_by(engine, store, case.setup(known))
    forward = InSmallCells(engine.made(store), cells)
    document = document_of(case, layers, forward, setup, relations)
    return {**document, "small_cells": cells.model_dump()}


def with_liquefied(case: PredictionCase, zones: Sequence[str]) -> PredictionCase:
    """The case in which these zones have liquefied and no others; empty: as it is.

    Raises:
        InputError: a zone that the scene does not have, or a section that does not hold together.
    """
    if not zones:
        return case
    scene = case.scene
    known = [zone.name for zone in scene.zones]
    for name in zones:
        if name not in known:
            raise InputError(f"--zones: no zone {name!r}; known are {', '.join(known)}")
    for zone in scene.zones:
        if scene.materials[zone.material].liquefied and zone.name not in zones:
            raise InputError(
                f"--zones: zone {zone.name!r} is liquefied in the section and has no other "
                "strength; name it too"
            )
    changes = [
        (name, key, value)
        for name in zones
        for key, value in (("liquefied", True), ("friction_deg", 0.0), ("cohesion_kpa", ANY_KPA))
    ]
    return replace(case, scene=with_properties(scene, changes))


def liquefied_with_counts(case: PredictionCase) -> list[str]:
    """The liquefied zones, each of which must have a blow count.

    Raises:
        InputError: one has none, or no zone is liquefied; one line.
    """
    scene = case.scene
    zones = [zone.name for zone in scene.zones if scene.materials[zone.material].liquefied]
    if not zones:
        raise InputError(f"{OPTION}: no zone of the scene is liquefied")
    missing = [zone for zone in zones if zone not in case.blow_counts]
    if missing:
        raise InputError(
            f"{OPTION}: {case.folder / 'blow_counts.yaml'}: no blow count of liquefied zone "
            f"{', '.join(missing)}"
        )
    return zones


def document_of(
    case: PredictionCase,
    layers: Sequence[Layer],
    engine: Forward,
    setup: SectionSetup,
    relations: Sequence[Relation],
) -> dict[str, Any]:
    """The document from a setup whose parameters are the strengths of the layers, in order."""
    strengths = [layer_strengths(relation, layers) for relation in relations]
    found = engine.predict([setup.at(values) for rows in strengths for values in rows])
    parts = [found[first : first + len(SCORES)] for first in range(0, len(found), len(SCORES))]
    reported = [
        number
        for number, entry in enumerate(case.entries)
        if entry.name in case.known or _runs(found, number, 2.0 * case.scene.spacing)
    ]
    return {
        "case": case.name,
        "title": case.title,
        "spacing_m": case.scene.spacing,
        "physics": {"mpm": SOLVER_VERSION, "inversion": PHYSICS_VERSION},
        "layers": [
            {
                "zone": layer.zone,
                "n1_60": layer.count.n1_60,
                "n1_60cs": layer.count.n1_60cs,
                "confidence": layer.count.confidence,
                "source": layer.count.source,
                "sigma_v0_kpa": _round(layer.sigma_v0_kpa),
                "area_m2": _round(layer.area_m2),
            }
            for layer in layers
        ],
        "relations": [
            _relation(case, relation, layers, rows, predictions, reported)
            for relation, rows, predictions in zip(relations, strengths, parts, strict=True)
        ],
    }


def layer_strengths(relation: Relation, layers: Sequence[Layer]) -> np.ndarray:
    """Strengths of the layers at every score, (scores, layers) [kPa]."""
    pairs = [(layer.count.of_kind(relation.clean_sand), layer.sigma_v0_kpa) for layer in layers]
    median = np.array([relation.strength(*pair) for pair in pairs])
    log_std = np.array([relation.log_std(*pair) for pair in pairs])
    return median * np.exp(SCORES[:, None] * log_std)


def _runs(predictions: Sequence[Prediction], number: int, least: float) -> bool:
    """Some simulation moves a number that nobody measured outward by more than `least` [m]."""
    return any(
        not prediction.failed and prediction.values[number] > prediction.at_start[number] + least
        for prediction in predictions
    )


def _relation(
    case: PredictionCase,
    relation: Relation,
    layers: Sequence[Layer],
    strengths: np.ndarray,
    predictions: Sequence[Prediction],
    reported: Sequence[int],
) -> dict[str, Any]:
    kept = np.array([not prediction.failed for prediction in predictions])
    if kept.sum() < 2:
        reason = next(p.reason for p in predictions if p.failed)
        raise WorkFailed(f"{relation.label}: fewer than two simulations finished: {reason}")
    numbers = np.array([p.values for p, whole in zip(predictions, kept, strict=True) if whole])
    response = Monotone(SCORES[kept], numbers)
    median, even = response(np.zeros((1, 1)))[0], response(EVEN[:, None])
    quantiles = np.percentile(even, QUANTILES, axis=0)
    return {
        "relation": relation.name,
        "label": relation.label,
        "scatter": relation.scatter_words,
        "strengths_kpa": {
            layer.zone: _round(value)
            for layer, value in zip(layers, strengths[len(SCORES) // 2], strict=True)
        },
        "beyond": [
            layer.zone
            for layer in layers
            if relation.beyond(layer.count.of_kind(relation.clean_sand))
        ],
        "other_kind": [
            layer.zone for layer in layers if layer.count.is_other_kind(relation.clean_sand)
        ],
        "runs": [
            {
                "score": float(score),
                "strengths_kpa": [_round(value) for value in row],
                "at_rest": prediction.at_rest,
                "predicted": None
                if prediction.failed
                else {
                    entry.name: _round(value)
                    for entry, value in zip(case.entries, prediction.values, strict=True)
                },
            }
            for score, row, prediction in zip(SCORES, strengths, predictions, strict=True)
        ],
        "quantities": [
            {
                "name": entry.name,
                "type": entry.type,
                "unit": entry.unit,
                "measured": float(entry.values[0]) if entry.name in case.known else None,
                "censored": entry.censored,
                "std": entry.std if entry.name in case.known else None,
                "at_median": _round(median[number]),
                "quantiles": {
                    str(percent): _round(row[number])
                    for percent, row in zip(QUANTILES, quantiles, strict=True)
                },
                "probability_beyond_measured": (
                    _round(np.mean(even[:, number] > entry.values[0]))
                    if entry.name in case.known
                    else None
                ),
            }
            for number, entry in enumerate(case.entries)
            if number in reported
        ],
    }


def _round(value: float) -> float:
    return round(float(value), DIGITS)
