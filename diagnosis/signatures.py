"""Step 4: what each effect changes, at finite amplitudes.

Each candidate is run at the amplitudes of its ladder, with the anchor's parameters and jitter, so
that what both runs share cancels: d = f(theta, a) - f(theta, 0). A slope at zero would not do:
shaking goes with the square of its amplitude, water and softening bend. A second jitter must give
the same direction after projection, or the signature is marked unresolved: what it shows may be the
points' positions. The mean of both jitters then stands in its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.model import Candidate, State
from diagnosis.runs import Runs
from diagnosis.surface import Ladder
from diagnosis.whitened import System


@dataclass(frozen=True)
class Signature:
    """Changes of all predictions by one candidate at an anchor.

    Attributes:
        name: of the candidate.
        changes: amplitude -> change of all m predictions (m,), mean over the jitters that were run.
        cosines: amplitude -> cosine between two jitters, after projection, where a second was run.
    """

    name: str
    changes: Mapping[float, np.ndarray]
    cosines: Mapping[float, float] = field(default_factory=dict)

    @property
    def amplitudes(self) -> list[float]:
        """Amplitudes that were run, ascending."""
        return sorted(self.changes)

    @property
    def ladder(self) -> Ladder:
        """The same with its zero, for the response surface."""
        rungs = sorted([0.0, *self.changes])
        nothing = np.zeros_like(next(iter(self.changes.values())))
        return Ladder(np.array(rungs), np.array([self.changes.get(a, nothing) for a in rungs]))


def take_signatures(
    runs: Runs,
    anchor: State,
    candidates: Sequence[Candidate],
    *,
    finite: bool = True,
) -> dict[str, Signature]:
    """Run every candidate's ladder at an anchor, in one batch.

    Where the allowance does not cover all, middle amplitudes of all candidates come first, then the
    largest, then the smallest. A candidate all of whose runs failed is not among the answers.

    Args:
        runs: the model.
        anchor: the run without the candidates, jitter seed 0.
        candidates: what is tried.
        finite: False takes the smallest amplitude alone, as a tangent would. Ablation.
    """
    wanted: list[tuple[str, float]] = []
    for turn in range(3):
        for candidate in candidates:
            wanted += [(candidate.name, a) for a in _rungs(candidate, turn, finite)]
    afforded: list[tuple[str, float]] = []
    states = [anchor]
    for name, amplitude in wanted:
        trial = [*states, anchor.with_effects({name: amplitude})]
        if runs.affords(trial, f"signature of {name} at {amplitude:g}"):
            afforded.append((name, amplitude))
            states = trial
    rows = runs.predict(states)
    changes: dict[str, dict[float, np.ndarray]] = {}
    for (name, amplitude), row in zip(afforded, rows[1:], strict=True):
        if np.all(np.isfinite(row)):
            changes.setdefault(name, {})[amplitude] = row - rows[0]
    order = [candidate.name for candidate in candidates if candidate.name in changes]
    return {name: Signature(name, changes[name]) for name in order}


def _rungs(candidate: Candidate, turn: int, finite: bool) -> Iterable[float]:
    """Amplitudes of one turn: the middle ones, the largest, the smallest; of each sign."""
    for sign in (1.0, -1.0):
        side = sorted((a for a in candidate.ladder if a * sign > 0), key=abs)
        if not side:
            continue
        if not finite:
            yield from side[:1] if turn == 0 else []
        elif turn == 0:
            yield side[len(side) // 2]
        elif turn == 1:
            yield from side[len(side) // 2 + 1 :]
        else:
            yield from side[: len(side) // 2]


def check_by_second_seed(
    runs: Runs,
    anchor: State,
    linear: System,
    signatures: Mapping[str, Signature],
    amplitudes: Mapping[str, float],
) -> dict[str, Signature]:
    """Run one amplitude of some candidates with another jitter and compare directions.

    Args:
        runs: the model.
        anchor: the run without the candidates, jitter seed 0.
        linear: projects.
        signatures: as taken with jitter seed 0.
        amplitudes: candidate -> the amplitude of its ladder that is run again.

    Returns:
        all signatures, those that were checked with their cosine and the mean of both jitters.
    """
    other = State(anchor.values, anchor.effects, 1, anchor.numerics)
    chosen = [name for name, a in amplitudes.items() if a in signatures[name].changes]
    states = [other.with_effects({name: amplitudes[name]}) for name in chosen]
    while states and not runs.affords([other, *states], "second jitter of the signatures"):
        chosen, states = chosen[:-1], states[:-1]
    if not states:
        return dict(signatures)
    rows = runs.predict([other, *states])
    found = dict(signatures)
    for name, row in zip(chosen, rows[1:], strict=True):
        second = row - rows[0]
        if not np.all(np.isfinite(second)):
            continue
        amplitude, old = amplitudes[name], signatures[name]
        first = old.changes[amplitude]
        cosine = _cosine(
            linear.project(linear.augmented(first)), linear.project(linear.augmented(second))
        )
        found[name] = Signature(
            name,
            {**old.changes, amplitude: 0.5 * (first + second)},
            {**old.cosines, amplitude: cosine},
        )
    return found


def _cosine(first: np.ndarray, second: np.ndarray) -> float:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0
