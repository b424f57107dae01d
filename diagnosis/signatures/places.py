"""Step 5, where: the place of a thing that may lie anywhere, such as a part of another strength.

A few places are given names and stand among the candidates from the beginning. Where one of them
promises something, others are sought: what a thing does at each place is one run, or the sum of
runs. What a part of the soil changes is, as far as its strength differs little, the sum of what its
cells change, so every rectangle of a grid of 24 cells is scored for 24 runs. The best place becomes
a candidate like any other, with a ladder of its own, by runs and not by sums.

A place that was sought among many is found by chance more easily than one that was given. So every
place stands in the null distribution of the scores, and the evidence of a model pays the logarithm
of their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.adequacy.adequacy import ProjectedFit
from diagnosis.hypotheses.model import Candidate, Seeking
from diagnosis.signatures.signatures import PROMISE, promise, run_moved
from inversion.estimation.budget import Runs
from inversion.estimation.response_surface import Surface


@dataclass(frozen=True)
class Sought:
    """A thing whose place was sought.

    Attributes:
        candidate: at the best place.
        elsewhere: an amplitude, and what it changes at every place that was tried, (n, m).
    """

    candidate: Candidate
    elsewhere: tuple[float, np.ndarray]


def seek_place(
    model: Seeking, runs: Runs, surface: Surface, found: ProjectedFit, given: Sequence[Candidate],
    promised: float,
) -> Sought | None:  # fmt: skip
    """Seek the place at which a thing would explain a residual best.

    Args:
        model: that knows the places.
        runs: of the model.
        surface: its anchor is where they are run.
        found: the fit there, with its residual.
        given: candidates of the same kind at given places.
        promised: fall of the sum of squares that the best of them promises, by one run.

    Returns:
        the thing; None where there is nothing to seek, no run could be read, or no place promises
        `PROMISE` more than the given ones.
    """
    law = given[0]
    wanted = model.search(law.placed)
    if wanted is None:
        return None
    there = [name for name in wanted.runs if model.add_placed(name) is not None]
    stay = np.zeros(surface.space.size)
    rows = run_moved(runs, surface, [(name, wanted.rung, stay) for name in there])
    model.drop_placed(there)
    changes = {name: row for name, row in zip(there, rows, strict=True) if row is not None}
    places: dict[str, np.ndarray] = {}
    for name, within in wanted.places.items():
        parts = [changes.get(wanted.runs[k]) for k in within]
        if all(part is not None for part in parts):
            places[name] = np.sum(parts, axis=0)
    drops = {name: promise(found, law, wanted.rung, change) for name, change in places.items()}
    best = max(drops, key=lambda name: drops[name], default=None)
    if best is None or drops[best] < promised + PROMISE:
        return None
    candidate = model.add_placed(best, choices=len(places))
    if candidate is None:
        return None
    return Sought(candidate, (wanted.rung, np.array(list(places.values()))))
