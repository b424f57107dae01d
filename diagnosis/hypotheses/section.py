"""The section as it was drawn, on trial: a boundary between zones, a foot or the surface elsewhere.

Boundaries are those that the question lists among its sensitivities; an amplitude of 1 is one
standard deviation.
"""

from __future__ import annotations

from diagnosis.hypotheses.assumption import (
    Assumption,
    Found,
    Sensitivities,
    possible,
    slug,
)
from diagnosis.hypotheses.model import Candidate
from inversion.back_analysis.deviations import deviating
from inversion.estimation.forward import Setup
from inversion.problem.question import ZoneBoundary

BOUNDARY = "boundary_"

#: Amplitudes that are tried, in standard deviations; the last is the largest that is believed.
RUNGS = (0.5, 1.0, 2.0)


def assumptions(setup: Setup, sensitivities: Sensitivities) -> Found:
    """Boundaries that may lie elsewhere, with the amplitudes for which there is a section.

    Raises:
        InputError: a boundary has a vertex that no zone has.
    """
    found, left_out = [], {}
    for one in sensitivities:
        if not isinstance(one, ZoneBoundary):
            continue
        name = BOUNDARY + slug(one.name)
        wanted = [sign * rung for sign in one.senses for rung in RUNGS]
        tried = _boundary(one, name, wanted)
        deviating(setup, [one], [0.0], one.name)  # its vertices exist
        rungs = [rung for rung in wanted if possible(tried, setup, rung)]
        if rungs:
            found.append(_boundary(one, name, rungs))
        else:
            left_out[name] = f"at {setup.scene.spacing:g} m spacing no section has it moved"
    return found, left_out


def _boundary(one: ZoneBoundary, name: str, rungs: list[float]) -> Assumption:
    candidate = Candidate(
        name=name,
        family="section",
        words=f"{one.name} lies elsewhere",
        unit="std",
        low=min(0.0, *rungs),
        high=max(0.0, *rungs),
        ladder=tuple(sorted(rungs)),
        prior_mean=0.0,
        prior_std=1.0,
    )
    return Assumption(candidate, lambda setup, score: deviating(setup, [one], [score], name))
