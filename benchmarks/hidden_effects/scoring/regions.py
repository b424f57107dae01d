"""Where and when a model fails: the stretch that the verdict gives against where it is so.

In: judged cases whose truths have `fails`: what the best base model leaves of the slide itself, in
standard deviations of the judge, along each series. It fails there where more than `FAILS` are
left. Out: precision, recall and F1 of the numbers within the stretch, over all cases that state one
(p below `CLAIMED`), by axis: in space along the profile, in time along the toe's history.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.hidden_effects.scoring.score import Judged

#: Standard deviations that are a failure (the slide itself has no noise of a survey); p of a
#: stretch that is stated.
FAILS, CLAIMED = 1.0, 0.05
AXES = {"x_m": "space", "time_s": "time"}


def regions(judged: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """Space and time -> number of cases, precision, recall and F1 (None: no case states one)."""
    found = {}
    for axis, name in AXES.items():
        pairs = [pair for one in judged if (pair := within(one, axis)) is not None]
        nothing = (np.zeros(0, bool), np.zeros(0, bool))
        stated, fails = (np.concatenate(part) for part in zip(nothing, *pairs, strict=True))
        both = int(np.sum(stated & fails))
        found[name] = {
            "cases": len(pairs),
            "precision": _share(both, int(stated.sum())),
            "recall": _share(both, int(fails.sum())),
            "f1": _share(2 * both, int(stated.sum() + fails.sum())),
        }
    return found


def within(one: Judged, axis: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Numbers of the stretch's series: which are within it, which fail; None: none is stated."""
    window = one.digest.window
    if window is None or window.p >= CLAIMED:
        return None
    for series in one.truth.get("fails", []):
        if series["axis"] == axis and series["measurement"] == window.measurement:
            place = np.array(series["place"])
            stated = (place >= window.begin - 1e-6) & (place <= window.end + 1e-6)
            return stated, np.abs(series["left"]) > FAILS
    return None


def _share(part: int, whole: int) -> float | None:
    return round(part / whole, 4) if whole else None
