"""Step 5: which signature the residual resembles.

With s = (I - Q Q') [d; 0] and the projected residual r, a share t of the signature's amplitude
takes 2 t s'r - t^2 |s|^2 off the sum of squares. Its best share s'r / |s|^2 gives z^2 = (s'r)^2 /
|s|^2; an amplitude must stay within its bounds, and then the drop is what remains. A prior on the
amplitude is one more row of s and r. Family-wise p: the share of 4,000 projected noises in which
*any* candidate at *any* amplitude does as well (maxT, Westfall and Young 1993), so that many
candidates are not many chances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.adequacy.adequacy import ProjectedFit, exceedance
from diagnosis.hypotheses.model import Candidate
from diagnosis.signatures.signatures import Signature


@dataclass(frozen=True)
class Score:
    """One candidate at one amplitude of its ladder.

    Attributes:
        name: of the candidate.
        rung: amplitude of the signature.
        z: s'r / |s|.
        amplitude: that the score suggests, within its bounds.
        drop: of the sum of squares at that amplitude.
        visible: |s|, what the parameters cannot imitate at the rung.
        whole: |d|, all of it.
        projected: s, (k + r,).
    """

    name: str
    rung: float
    z: float
    amplitude: float
    drop: float
    visible: float
    whole: float
    projected: np.ndarray


@dataclass(frozen=True)
class Scores:
    """All scores of a round.

    Attributes:
        every: candidate -> its scores, by ascending amplitude.
        p_family: candidate -> family-wise p of its best.
        largest: root of the largest drop of any.
        p_largest: its p.
    """

    every: Mapping[str, list[Score]]
    p_family: Mapping[str, float]
    largest: float
    p_largest: float

    def best(self, name: str) -> Score:
        """The amplitude with the largest expected drop; if none drops, that with the largest z."""
        return max(self.every[name], key=lambda score: (score.drop, score.z))

    @property
    def ranked(self) -> list[str]:
        """Candidates, largest expected drop first."""
        return sorted(self.every, key=lambda name: -self.best(name).drop)


def score_all(
    found: ProjectedFit,
    signatures: Mapping[str, Signature],
    candidates: Sequence[Candidate],
    *,
    projection: bool = True,
) -> Scores:
    """Score every candidate at every amplitude.

    Args:
        found: the fit with its projected residual and noise.
        signatures: by name.
        candidates: with their bounds and priors.
        projection: False leaves in what the parameters could imitate. Ablation.
    """
    bounds = {candidate.name: candidate for candidate in candidates}
    every: dict[str, list[Score]] = {}
    nulls: dict[str, np.ndarray] = {}
    for name, signature in signatures.items():
        scored = []
        for rung in signature.amplitudes:
            score, drawn = _score(found, bounds[name], rung, signature.changes[rung], projection)
            scored.append(score)
            nulls[name] = np.maximum(nulls.get(name, np.zeros(len(drawn))), drawn)
        every[name] = scored
    family = np.max(list(nulls.values()), axis=0) if nulls else np.zeros(1)
    reached = {name: max(score.drop for score in scored) for name, scored in every.items()}
    p_family = {name: exceedance(family, drop) for name, drop in reached.items()}
    largest = max(reached.values(), default=0.0)
    return Scores(every, p_family, float(np.sqrt(largest)), exceedance(family, largest))


def _score(
    found: ProjectedFit, candidate: Candidate, rung: float, change: np.ndarray, projection: bool
) -> tuple[Score, np.ndarray]:
    """The score of one signature, and its drop on each simulated noise (draws,)."""
    whole = found.system.augmented(change)
    s = found.system.project(whole) if projection else whole
    size = float(s @ s)
    agree, drawn = float(s @ found.residual), s @ found.noise
    if candidate.prior_std is not None:
        # One more row: amplitude / std, with the prior's mean as its datum.
        row = rung / candidate.prior_std
        size += row**2
        shift = row * (candidate.prior_mean or 0.0) / candidate.prior_std
        agree, drawn = agree + shift, drawn + shift
    size = max(size, 1e-300)
    most = (candidate.high if rung > 0 else candidate.low) / rung
    share = float(np.clip(agree / size, 0.0, most))
    null_share = np.clip(drawn / size, 0.0, most)
    score = Score(
        name=candidate.name,
        rung=rung,
        z=agree / np.sqrt(size),
        amplitude=share * rung,
        drop=2.0 * share * agree - share**2 * size,
        visible=float(np.linalg.norm(s)),
        whole=float(np.linalg.norm(whole)),
        projected=s,
    )
    return score, 2.0 * null_share * drawn - null_share**2 * size
