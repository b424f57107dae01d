"""Errors of the survey that compete with physics: a shifted datum, a tilt, a boundary elsewhere.

A survey hangs together: its benchmark may be too high, its levelling line tilted. Both move what is
measured in proportion to their size, so they act on the prediction and cost no run. A boundary
between zones that lies elsewhere is another section, and does: such boundaries are those that the
question lists among its sensitivities, an amplitude of 1 being one standard deviation.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.hypotheses.model import Candidate
from geometry.scenes.scene import Scene
from inversion.back_analysis.variants import moved
from inversion.estimation.data import Targets
from inversion.problem.question import ZoneBoundary
from pipeline.cli import InputError

DATUM_SHIFT, DATUM_TILT, BOUNDARY = "datum_shift", "datum_tilt", "boundary_"

#: Amplitudes that are tried, in standard deviations; the last is the largest that is believed.
RUNGS, BOUNDARY_RUNGS = (1.0, 2.0, 4.0), (0.5, 1.0, 2.0)
#: A levelling line needs this many elevations: the error of fewer is what their own std is for.
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


@dataclass(frozen=True)
class Boundary:
    """A boundary between zones that may lie elsewhere; amplitude in standard deviations."""

    candidate: Candidate
    sensitivity: ZoneBoundary

    def scene(self, scene: Scene, amplitude: float) -> Scene:
        """The section with the boundary moved.

        Raises:
            InputError: no section of this kind holds together.
        """
        return moved(scene, self.sensitivity.vertices, amplitude, self.candidate.name)


def survey_errors(targets: Targets) -> list[SurveyError]:
    """Shift and tilt of the datum, where a surface was levelled."""
    height, place, std = _elevations(targets)
    levelled = np.isfinite(place) & targets.shown
    if np.count_nonzero(levelled) < LEAST_ELEVATIONS:
        return []
    ends = np.min(place[levelled]), np.max(place[levelled])
    middle, half = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])
    # A crest or a marker beyond the levelled line has the error of its end.
    share = np.clip((np.where(levelled, place, middle) - middle) / half, -1.0, 1.0)
    ladder = tuple(sign * rung * std for sign in (-1.0, 1.0) for rung in RUNGS)
    # A benchmark or a line that is off by more than the survey's own std is as rare as that.
    wide = {
        "low": -RUNGS[-1] * std,
        "high": RUNGS[-1] * std,
        "ladder": tuple(sorted(ladder)),
        "prior_mean": 0.0,
        "prior_std": std,
    }
    shift = Candidate(
        name=DATUM_SHIFT,
        kind="survey",
        words="all surveyed elevations are too high by the same amount",
        unit="m",
        free=True,
        **wide,
    )
    tilt = Candidate(
        name=DATUM_TILT,
        kind="survey",
        words="the levelling line is tilted: too high at its right end and too low at its left",
        unit="m",
        free=True,
        **wide,
    )
    return [SurveyError(shift, height), SurveyError(tilt, height * share)]


def _elevations(targets: Targets) -> tuple[np.ndarray, np.ndarray, float]:
    """Change of each number by a datum 1 m too high (m,), where it was levelled (m,) [m], std."""
    rise, place, std = [], [], []
    for entry in targets.entries:
        datum = entry.datum
        if datum is None:
            rise.append(np.zeros(len(entry.values)))
            place.append(np.full(len(entry.values), np.nan))
            continue
        rise.append(datum.rise)
        place.append(datum.x)
        if datum.line:
            std.append(entry.std)
    return np.concatenate(rise), np.concatenate(place), max(std, default=1.0)


def boundaries(
    scene: Scene, sensitivities: Sequence[ZoneBoundary]
) -> tuple[list[Boundary], dict[str, str]]:
    """Boundaries that may lie elsewhere, and why others cannot be tried.

    Args:
        scene: the section at the spacing in use.
        sensitivities: of the question, those that move a boundary.

    Returns:
        boundaries with the amplitudes for which there is a section; name -> reason.
    """
    found, left_out = [], {}
    for one in sensitivities:
        name = BOUNDARY + _slug(one.name)
        signs = {"both": (-1.0, 1.0), "plus": (1.0,), "minus": (-1.0,)}[one.sides]
        rungs = [
            sign * rung
            for sign in signs
            for rung in BOUNDARY_RUNGS
            if _holds_together(scene, one, sign * rung)
        ]
        if not rungs:
            left_out[name] = f"at {scene.spacing:g} m spacing no section has it moved"
            continue
        candidate = Candidate(
            name=name,
            kind="survey",
            words=f"{one.name} lies elsewhere",
            unit="std",
            low=min(0.0, *rungs),
            high=max(0.0, *rungs),
            ladder=tuple(sorted(rungs)),
            prior_mean=0.0,
            prior_std=1.0,
        )
        found.append(Boundary(candidate, one))
    return found, left_out


def _holds_together(scene: Scene, one: ZoneBoundary, amplitude: float) -> bool:
    try:
        moved(scene, one.vertices, amplitude, one.name)
    except InputError as error:
        if "no zone has a vertex" in str(error):
            raise
        return False
    return True


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
