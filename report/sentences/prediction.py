"""Sentences of a prediction: where first order and samples differ, and what passes a line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: Means differ from this share of the standard deviation on, standard deviations from this ratio.
MEAN_OFF, STD_RATIO = 0.25, 1.25


def bends(entry: Mapping[str, Any]) -> bool:
    """First order and samples differ: the number is not linear over the range of strengths."""
    std, linear = entry["std"], entry["first_order"]
    if std <= 0.0:
        return False
    ratio = linear["std"] / std
    shift = abs(linear["mean"] - entry["mean"]) / std
    return shift > MEAN_OFF or not 1.0 / STD_RATIO < ratio < STD_RATIO


def first_order_words(document: Mapping[str, Any]) -> list[str]:
    """Whether first order will do."""
    names = [entry["name"] for entry in document["quantities"] if bends(entry)]
    if not names:
        return []
    return [
        f"not linear over the range of strengths: {', '.join(names)}; the first-order figures "
        "differ from those of the samples, which count"
    ]


def line_words(document: Mapping[str, Any]) -> list[str]:
    """Where the released volume passes, and what its ordinates are."""
    found = document["hydrographs"]
    if not found:
        return []
    places = [
        f"x = {one['x_m']:g} m to the {one['side']}" if "x_m" in one else f"line {one['line']}"
        for one in found
    ]
    step = f"{found[0]['step_s']:g} s"
    return [f"discharge every {step} through {', '.join(places)}: hydrograph.csv"]
