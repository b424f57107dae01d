"""The survey on trial: a shifted datum, a tilted levelling line.

The errors of a survey are not independent: its benchmark may be too high, its levelling line
tilted. Both move what is measured in proportion to their size, so they act on the prediction and
cost no run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypotheses.model import Candidate
from inversion.estimation.data import Targets

DATUM_SHIFT, DATUM_TILT, TILT_ACROSS = "datum_shift", "datum_tilt", "datum_tilt_across"

#: Amplitudes that are tried, in standard deviations; the last is the largest that is believed. By
#: judgement: twice those of a drawing (`assumption.RUNGS`), as their prior holds them back, and no
#: run is spent on them.
RUNGS = (1.0, 2.0, 4.0)
#: A levelling line needs this many elevations: the error of fewer is what their own std is for.
#: Shift and tilt of it leave as many to contradict them as any answer (`Options.spare`).
LEAST_ELEVATIONS = 4


@dataclass(frozen=True)
class SurveyError:
    """An error that moves what is measured in proportion to its amplitude.

    Attributes:
        candidate: its name, bounds, ladder.
        direction: change of all numbers per unit of the amplitude, (m,).
    """

    candidate: Candidate
    direction: np.ndarray


def survey_errors(targets: Targets) -> list[SurveyError]:
    """Shift and tilt of the datum, where a surface was levelled; of a map both tilts in plan."""
    height, x, y, std = _elevations(targets)
    levelled = np.isfinite(x) & targets.shown
    if np.count_nonzero(levelled) < LEAST_ELEVATIONS:
        return []
    ladder = tuple(sign * rung * std for sign in (-1.0, 1.0) for rung in RUNGS)
    # A benchmark or a line that is off by more than the survey's own std is as rare as that.
    shift = Candidate(
        name=DATUM_SHIFT,
        family="survey",
        words="all surveyed elevations are too high by the same amount",
        unit="m",
        low=-RUNGS[-1] * std,
        high=RUNGS[-1] * std,
        ladder=tuple(sorted(ladder)),
        prior_mean=0.0,
        prior_std=std,
        free=True,
    )
    found = [SurveyError(shift, height)]
    in_plan = bool(np.isfinite(y).any())
    words = {
        DATUM_TILT: "the survey is tilted: too high at large x and too low at small x"
        if in_plan
        else "the levelling line is tilted: too high at its right end and too low at its left",
        TILT_ACROSS: "the survey is tilted: too high at large y and too low at small y",
    }
    for (name, what), place in zip(words.items(), (x, y), strict=True):
        if np.isfinite(place).any() and np.ptp(place[levelled]) > 0.0:
            tilt = replace(shift, name=name, words=what)
            found.append(SurveyError(tilt, height * _share(place, levelled)))
    return found


def _share(place: np.ndarray, levelled: np.ndarray) -> np.ndarray:
    """Of the error of a tilted survey at its high end, (m,)."""
    ends = np.min(place[levelled]), np.max(place[levelled])
    middle, half = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])
    # A crest or a marker beyond the levelled line has the error of its end.
    return np.clip((np.where(levelled, place, middle) - middle) / half, -1.0, 1.0)


def _elevations(targets: Targets) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Change of each number by a datum 1 m too high, x and y where it was levelled [m], std.

    The first three are (m,).
    """
    parts, std = [], []
    for entry in targets.entries:
        datum, nowhere = entry.datum, np.full(len(entry.values), np.nan)
        if datum is None:
            parts.append((np.zeros(len(nowhere)), nowhere, nowhere))
            continue
        parts.append((datum.rise, datum.x, nowhere if datum.y is None else datum.y))
        if datum.line:
            std.append(entry.std)
    rise, x, y = (np.concatenate(values) for values in zip(*parts, strict=True))
    return rise, x, y, max(std, default=1.0)
