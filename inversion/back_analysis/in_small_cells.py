"""A result with strengths in small cells, made from one with strengths as the runs had them.

Every answer is told alike, so that they can be compared: variants, sensitivities, starts, jittered
points, other engines. The iterations stay as their runs were, and so do the bars of the waterfall,
which have spacings of their own: the step to small cells becomes its last.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from inversion.back_analysis.result import Answer, ParameterAnswer, Result, WaterfallBar
from inversion.back_analysis.result_builder import meant_strength
from inversion.engines.small_cells import NAME, SmallCells
from inversion.estimation.unknowns import Parameters

#: Name of the last bar of a waterfall.
BAR = "small cells"

Document = TypeVar("Document", bound=BaseModel)


def told(result: Result, cells: SmallCells, parameters: Parameters) -> Result:
    """The result in small cells.

    Args:
        result: with strengths as the runs had them.
        cells: what these are too low by.
        parameters: of the question.
    """
    shares = _known_by_data(result.answer)
    factors = parameters.as_mapping(cells.factors(parameters, shares))
    answer = _answer(result.answer, parameters, cells, factors, shares)
    waterfall = result.waterfall
    if waterfall is not None and cells.known and factors[waterfall.parameter] != 1.0:
        bars = [*waterfall.bars, _last_bar(waterfall.bars[-1], factors[waterfall.parameter])]
        waterfall = waterfall.model_copy(update={"bars": bars})
    noise = result.noise and _times(
        result.noise.model_copy(
            update={"answers": [_times(one, factors, "values") for one in result.noise.answers]}
        ),
        factors,
        "answer_std",
    )
    return result.model_copy(
        update={
            "answer": answer,
            "starts": [_times(one, factors, "start", "answer") for one in result.starts],
            "variants": [
                _times(one, factors, "values", "coarse_values", "ratios") for one in result.variants
            ],
            "sensitivities": [
                _times(one, factors, "change", "std").model_copy(
                    update={
                        "sides": [
                            _times(
                                side, factors, "values", "change", "coarse_change", "ratio_change"
                            )
                            for side in one.sides
                        ]
                    }
                )
                for one in result.sensitivities
            ],
            "noise": noise,
            "waterfall": waterfall,
        }
    )


def told_values(values: Mapping[str, float], answer: Answer) -> dict[str, float]:
    """Strengths of runs, by name, as the parameters of an answer are told."""
    by = {p.name: p.value / p.as_run if p.as_run else 1.0 for p in answer.parameters}
    return {name: value * by[name] for name, value in values.items()}


def _known_by_data(answer: Answer) -> np.ndarray:
    """Share of each prior's variance that the data take off, (p,); 1 without a prior.

    A prior is of the soil and not of the runs, so what it says the cells do not change.
    """
    return np.array(
        [
            np.clip(1.0 - (p.std_data / p.prior_std) ** 2, 0.0, 1.0) if p.has_prior else 1.0
            for p in answer.parameters
        ]
    )


def _answer(
    answer: Answer,
    parameters: Parameters,
    cells: SmallCells,
    factors: Mapping[str, float],
    shares: np.ndarray,
) -> Answer:
    per = {name: 1.0 / factor for name, factor in factors.items()}
    return answer.model_copy(
        update={
            "small_cells": cells,
            "parameters": [
                _parameter(p, factors[p.name], float(shares[place]) * cells.log_std)
                if parameters.strengths[place]
                else p
                for place, p in enumerate(answer.parameters)
            ],
            "equally_good": [_times(one, factors, "values") for one in answer.equally_good],
            "derivative": {number: _product(row, per) for number, row in answer.derivative.items()},
            "steps": _product(answer.steps, factors),
        }
    )


def _parameter(p: ParameterAnswer, factor: float, log_std: float) -> ParameterAnswer:
    """A strength; the cells are one more source of what it may be off by."""
    value = factor * p.value
    own = value * log_std
    total = float(np.hypot(factor * p.std_total, own))
    ends = _interval(p, value, total, factor)
    bound = p.lower_bound_95
    scaled = {
        name: None if (one := getattr(p, name)) is None else factor * one
        for name in ("std_data", "prior_std", "ratio")
    }
    if p.strength_kpa is not None and p.sigma_v0_kpa is not None:
        scaled |= meant_strength(value, total, p.sigma_v0_kpa)
    return p.model_copy(
        update={
            **scaled,
            "value": value,
            "value_of_run": p.value,
            "std_by_source": {
                **{name: factor * std for name, std in p.std_by_source.items()},
                NAME: own,
            },
            "std_total": total,
            "interval_95": ends if bound is None else p.interval_95,
            "equally_good_range": p.equally_good_range
            and tuple(factor * end for end in p.equally_good_range),
            "ratio_std": p.ratio_std
            and float(np.hypot(factor * p.ratio_std, (scaled["ratio"] or 0.0) * own / value)),
        }
    )


def _interval(p: ParameterAnswer, value: float, total: float, factor: float) -> tuple[float, float]:
    """95 % of the logarithm, cut where the bounds of the runs lie."""
    reach = 1.96 * total / value
    low, high = value * np.exp([-reach, reach])
    return float(max(low, factor * p.low)), float(min(high, factor * p.high))


def _last_bar(answer: WaterfallBar, factor: float) -> WaterfallBar:
    return answer.model_copy(
        update={
            "name": BAR,
            "words": "as the strength is where cells no longer matter",
            "value": factor * answer.value,
        }
    )


def _times(document: Document, factors: Mapping[str, float], *fields: str) -> Document:
    """A document with fields of values by parameter times their factors."""
    return document.model_copy(
        update={
            name: _product(values, factors)
            for name in fields
            if (values := getattr(document, name)) is not None
        }
    )


def _product(values: Mapping[str, float], factors: Mapping[str, float]) -> dict[str, float]:
    return {name: value * factors[name] for name, value in values.items()}
