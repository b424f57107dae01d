"""Step 6: which candidates look alike, which can be seen at all, and what they hide unseen.

The cosine between two projected signatures says whether these data can tell them apart, whatever
the residual. The visible fraction |s| / |d| is what the parameters cannot imitate. The amplitude
that would be found with near certainty, 3.3 a / |s|, shifts the parameters by V A'[d; 0] until it
is found: so much of a strength may be that effect. It is worth knowing when the model passes, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from diagnosis.signatures.signatures import Score, Scores, Signature, nearest_first
from inversion.estimation.misfit import System
from inversion.estimation.unknowns import Unknowns
from pipeline.ties import RELATIVE, largest, largest_place, smallest


@dataclass(frozen=True)
class Visibility:
    """How well one candidate could be seen.

    Attributes:
        fraction: |s| / |d| at its representative amplitude.
        smallest: amplitude that would be found with near certainty; beyond its bounds: never.
        bias: parameter -> change of its value [%] while that amplitude, or the largest that was run
            if that is smaller, remains unfound.
        rung: amplitude that was run and is nearest to `smallest`.
        believed: that amplitude, or the largest that was run if that is smaller, over `rung`.
    """

    fraction: float
    smallest: float
    bias: dict[str, float]
    rung: float
    believed: float


def representative(scores: Scores, name: str) -> Score:
    """The amplitude a candidate is judged by: where it drops most, else its middle one."""
    best = scores.best(name)
    if best.drop > RELATIVE:
        return best
    every = nearest_first(scores.every[name])
    return every[len(every) // 2]


def cosines(scores: Scores, names: list[str]) -> np.ndarray:
    """Signed cosines between projected signatures, (n, n).

    Signatures bend with amplitude, so each candidate's representative one is compared with every
    amplitude of the other, and the larger of both ways counts.
    """
    unit = {
        name: np.array([_direction(score.projected) for score in nearest_first(scores.every[name])])
        for name in names
    }
    own = {name: _direction(representative(scores, name).projected) for name in names}
    matrix = np.eye(len(names))
    for i, first in enumerate(names):
        for j, second in enumerate(names):
            if i != j:
                along = unit[second] @ own[first]
                matrix[i, j] = along[largest_place(np.abs(along))]
    for i, j in combinations(range(len(names)), 2):
        matrix[i, j] = matrix[j, i] = largest((matrix[i, j], matrix[j, i]), abs)
    return np.clip(matrix, -1.0, 1.0)


def _direction(vector: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(vector)
    return vector / size if size > 0.0 else vector


def visibility(
    linear: System,
    space: Unknowns,
    x: np.ndarray,
    scored: list[Score],
    signature: Signature,
    detectable: float,
) -> Visibility:
    """Visible fraction, smallest detectable amplitude, and the biases it hides.

    Args:
        linear: the system at the fit.
        space: unknowns of the fit.
        x: the fit, (q,).
        scored: the candidate's scores, by amplitude.
        signature: the same candidate's changes.
        detectable: |s| that is found with near certainty.
    """

    # The rung whose own |s| is nearest to what is just seen: least extrapolation.
    def distance(score: Score) -> float:
        return abs(np.log(max(score.visible, 1e-12) / detectable))

    nearest = smallest(nearest_first(scored), distance)
    share = detectable / max(nearest.visible, 1e-12)
    change = signature.changes[nearest.rung]
    imitation = linear.imitating(linear.augmented(change))[: space.p]
    # Nobody believes in an amplitude beyond the largest that was run, seen or not.
    believed = min(share, max(abs(score.rung) for score in scored) / abs(nearest.rung))
    moved = space.clipped(np.concatenate([x[: space.p] + believed * imitation, x[space.p :]]))
    before, after = space.values(x), space.values(moved)
    bias = {
        name: float(100.0 * (b - a) / a) if a else 0.0
        for name, a, b in zip(space.parameters.names, before, after, strict=True)
    }
    fraction = nearest.visible / nearest.whole if nearest.whole > 0.0 else 0.0
    return Visibility(
        fraction=float(min(fraction, 1.0)),
        smallest=float(share * nearest.rung),
        bias=bias,
        rung=nearest.rung,
        believed=float(believed),
    )


def look_alike(names: list[str], matrix: np.ndarray, name: str, least: float) -> list[str]:
    """Other candidates whose |cosine| with one is at least `least`."""
    row = np.abs(matrix[names.index(name)])
    return [other for other, c in zip(names, row, strict=True) if other != name and c >= least]
