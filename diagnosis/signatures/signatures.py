"""Steps 4 and 5: what each effect changes at finite amplitudes, and which the residual resembles.

Each candidate is run at the amplitudes of its ladder, with the anchor's jitter, so that what both
runs share cancels: d = f(theta, a) - f(theta, 0). A slope at zero would not do: shaking goes with
the square of its amplitude, softening and water bend.

A large effect is met by other parameters: with drag a slide fits with less strength, and what it
does to that slide is not what it does to the stronger one. So the middle amplitude is run with the
parameters of the anchor, and once more, like the others, with parameters theta + e that undo what
it does as far as they can. Then d = f(theta + e, a) - f(theta, 0) - J e, of which the parameters
imitate the same share. What a ladder calls large may hardly be seen by these data, while an effect
that has caused a misfit was seen: then the ladder is drawn out upwards.

A second jitter must give the same direction after projection, or the signature is marked
unresolved: what it shows may be the points' positions. The mean of both then stands for it.

With s = (I - Q Q') [d; 0] and the projected residual r, a share t of the signature's amplitude
takes 2 t s'r - t^2 |s|^2 off the sum of squares. Its best share s'r / |s|^2 gives z^2 = (s'r)^2 /
|s|^2; an amplitude must stay within its bounds, and then the drop is what remains. A prior on the
amplitude is one more row of s and r. Family-wise p: the share of 4,000 projected noises in which
*any* candidate at *any* amplitude does as well (maxT, Westfall and Young 1993), so that many
candidates are not many chances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.adequacy.adequacy import ProjectedFit, exceedance
from diagnosis.hypotheses.model import Candidate
from inversion.estimation.budget import Runs
from inversion.estimation.misfit import System
from inversion.estimation.response_surface import Ladder, Surface
from inversion.problem.unknown import Scale
from pipeline.ties import RELATIVE, largest, ranked

#: Farthest that a parameter is moved to meet an effect: half of how far a surrogate is believed
#: (`response_surface.REACH`), a strength 4.5 times as large.
FARTHEST = 1.5
#: A top rung of which less is seen, |s|, is raised, at most by the second factor. By judgement:
#: more than twice what is found with near certainty (`Options.detectable`); farther up the
#: amplitude is no longer what its ladder calls large.
TOP_SEEN, TOP_RAISED = 8.0, 4.0
#: Fall of the sum of squares that a single candidate must promise to be looked at more closely, or
#: have made to be built on: noise gives as much to one amplitude in one case of six.
LEAST_FALL = 2.0
#: Amplitudes that are run before who watches is told. By judgement: it decides nothing.
AT_ONCE = 12


@dataclass(frozen=True)
class Signature:
    """Changes of all predictions by one candidate at an anchor.

    Attributes:
        name: of the candidate.
        changes: amplitude -> d of all m predictions (m,), mean over the jitters that were run.
        moves: amplitude -> e, by which the anchor's unknowns were moved for its run, (q,).
        plain: an amplitude that was run with the anchor's own unknowns, and its change (m,).
        scale: on which its amplitudes are compared.
        cosines: amplitude -> cosine between two jitters, after projection, where a second was run.
    """

    name: str
    changes: Mapping[float, np.ndarray]
    moves: Mapping[float, np.ndarray]
    plain: tuple[float, np.ndarray]
    scale: Scale = Scale()
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
        changes = np.array([self.changes.get(a, nothing) for a in rungs])
        return Ladder(np.array(rungs), changes, self.scale)


Watcher = Callable[[Mapping[str, Signature]], None]
"""Called with the signatures that are known so far, by candidate."""


def take_signatures(
    runs: Runs,
    surface: Surface,
    linear: System,
    candidates: Sequence[Candidate],
    *,
    finite: bool = True,
    turns: int = 2,
    found: ProjectedFit | None = None,
    watch: Watcher | None = None,
) -> dict[str, Signature]:
    """Run every candidate's ladder at an anchor, in four batches, drawn out where little is seen.

    Where the allowance does not cover all, the largest come before the smallest. A candidate all of
    whose runs failed is not among the answers. Of a candidate that is screened the first amplitude
    is run alone, unless it promises to lower the sum of squares by `LEAST_FALL`, up or down.

    Args:
        runs: the model.
        surface: of the model without the candidates; its anchor is where they are run.
        linear: its system, which knows what the parameters imitate.
        candidates: effects to try.
        finite: False takes the smallest amplitude alone, as a tangent would. Ablation.
        turns: amplitudes of each sign in addition to the middle one; of one, the largest; 0: the
            middle one of one sign alone, the other sign taken as its mirror image.
        found: the fit whose residual screens; None: nothing is screened out.
        watch: called with the signatures so far, of fewer amplitudes; None: nobody watches.
    """
    ladders = _Ladders(runs, surface, linear, {c.name: c for c in candidates}, watch)
    stay = np.zeros(surface.space.size)
    ladders.run([(c.name, _first(c, finite), stay) for c in candidates])
    raw = {name: next(iter(changes.items())) for name, changes in ladders.changes.items()}
    if turns == 0:
        for name in raw:
            ladders.mirror(ladders.candidates[name])
    elif finite:
        kept = [
            c
            for c in candidates
            if found is None
            or not c.screened
            or c.name not in raw
            or _promise(found, c, *raw[c.name]) >= LEAST_FALL
        ]
        middles = [(c.name, a) for c in kept for a in _middles(c) if not c.switch]
        ladders.run([(name, a, ladders.meeting(name, a)) for name, a in middles])
        others = [(c.name, ladders.others(c.name, sign)) for c in kept for sign in (1.0, -1.0)]
        if turns == 1:
            others = [(name, [max(rungs, key=abs)] if rungs else []) for name, rungs in others]
        for turn in range(turns):
            wanted = [(name, rungs[turn]) for name, rungs in others if len(rungs) > turn]
            ladders.run([(name, a, ladders.meeting(name, a)) for name, a in wanted])
        for c in candidates:
            if c not in kept:
                ladders.mirror(c)
    return {
        c.name: Signature(
            c.name, ladders.changes[c.name], ladders.moves[c.name], raw[c.name], c.scale
        )
        for c in candidates
        if c.name in ladders.changes
    }


def _promise(found: ProjectedFit, candidate: Candidate, rung: float, change: np.ndarray) -> float:
    """Fall of the sum of squares by the better sign of a candidate, taken as linear."""
    whole = [(rung, change)] + ([(-rung, -change)] if candidate.two_signed else [])
    return max(_score(found, candidate, a, d, True)[0].drop for a, d in whole)


@dataclass
class _Ladders:
    """Unfinished ladders: runs so far, by candidate and amplitude."""

    runs: Runs
    surface: Surface
    linear: System
    candidates: Mapping[str, Candidate]
    watch: Watcher | None = None
    changes: dict[str, dict[float, np.ndarray]] = field(default_factory=dict)
    moves: dict[str, dict[float, np.ndarray]] = field(default_factory=dict)

    def meeting(self, name: str, amplitude: float) -> np.ndarray:
        """Move of the unknowns (q,) that undoes what an amplitude does, as far as is known.

        From the nearest amplitude of the same sign that was run, in proportion; where none was,
        the mirror image of the other sign's.
        """
        known = self.changes.get(name, {})
        nothing = np.zeros(self.surface.space.size)
        if self.candidates[name].free or not known:
            return nothing
        near = min(known, key=lambda a: (a * amplitude < 0, abs(abs(a) - abs(amplitude))))
        # d already has J e taken off: what the unknowns imitate of d is all they would have to do.
        count = self.candidates[name].scale.count
        times = count(amplitude) / count(near)
        wanted = -self.linear.imitating(self.linear.augmented(known[near])) * times
        space, x = self.surface.space, self.surface.x
        wanted[: space.p] = np.clip(wanted[: space.p], -FARTHEST, FARTHEST)
        return space.clipped(x + wanted) - x

    def others(self, name: str, sign: float) -> list[float]:
        """Amplitudes of one sign other than the middle one, in the order in which they are run.

        The top rung, then the lowest; where too little would be seen at the top rung, one between
        the middle and a raised top, then that top.
        """
        candidate = self.candidates[name]
        side = _side(candidate, sign)
        if len(side) < 2:
            return []
        middle, top = side[len(side) // 2], side[-1]
        seen = self._seen(name, middle)
        as_it_is = candidate.free or candidate.decades
        if as_it_is or seen is None or seen * (top / middle) >= TOP_SEEN:
            return [*reversed(side[len(side) // 2 + 1 :]), *side[: len(side) // 2]]
        share = min(TOP_RAISED, TOP_SEEN / max(seen * (top / middle), 1e-6))
        high = candidate.high if sign > 0 else -candidate.low
        raised = sign * min(abs(top) * share, max(high, abs(top)))
        return [sign * float(np.sqrt(middle * raised)), raised]

    def mirror(self, candidate: Candidate) -> None:
        """Take the other sign of a candidate that was screened out as its mirror image."""
        changes, moves = self.changes[candidate.name], self.moves[candidate.name]
        for amplitude in list(changes):
            if candidate.low <= -amplitude <= candidate.high:
                changes[-amplitude], moves[-amplitude] = -changes[amplitude], -moves[amplitude]

    def _seen(self, name: str, amplitude: float) -> float | None:
        """|s| of an amplitude that was run; None where its run failed."""
        change = self.changes.get(name, {}).get(amplitude)
        if change is None:
            return None
        return float(np.linalg.norm(self.linear.project(self.linear.augmented(change))))

    def run(self, wanted: Sequence[tuple[str, float, np.ndarray]]) -> None:
        """Run amplitudes with moves, as far as the allowance goes; a later run replaces another."""
        at_once = len(wanted) if self.watch is None else AT_ONCE
        for first in range(0, len(wanted), max(at_once, 1)):
            some = wanted[first : first + at_once]
            changes = run_moved(self.runs, self.surface, some)
            for (name, amplitude, move), change in zip(some, changes, strict=True):
                if change is not None:
                    self.changes.setdefault(name, {})[amplitude] = change
                    self.moves.setdefault(name, {})[amplitude] = move
            if self.watch is not None:
                self.watch(self.so_far)

    @property
    def so_far(self) -> dict[str, Signature]:
        """Signatures of the amplitudes that were run."""
        return {
            name: Signature(
                name,
                dict(changes),
                self.moves[name],
                next(iter(changes.items())),
                self.candidates[name].scale,
            )
            for name, changes in self.changes.items()
        }


def _first(candidate: Candidate, finite: bool) -> float:
    """The middle amplitude of the first sign; for the ablation the smallest."""
    side = _side(candidate, 1.0) or _side(candidate, -1.0)
    return side[len(side) // 2 if finite else 0]


def _middles(candidate: Candidate) -> list[float]:
    """The middle amplitude of each sign."""
    sides = [side for sign in (1.0, -1.0) if (side := _side(candidate, sign))]
    return [side[len(side) // 2] for side in sides]


def _side(candidate: Candidate, sign: float) -> list[float]:
    return sorted((a for a in candidate.ladder if a * sign > 0), key=abs)


def run_moved(
    runs: Runs, surface: Surface, wanted: Sequence[tuple[str, float, np.ndarray]], seed: int = 0
) -> list[np.ndarray | None]:
    """Changes d (m,) of amplitudes with moved unknowns; None where a run failed or was not allowed.

    Args:
        runs: the model.
        surface: its anchor is where they are run.
        wanted: (candidate, amplitude, move of the unknowns (q,)).
        seed: jitter of both runs of each pair.
    """
    states = [surface.space.state(surface.x, seed=seed)]
    places: list[int | None] = []
    for name, amplitude, move in wanted:
        moved = surface.space.state(surface.x + move, seed=seed).with_effects({name: amplitude})
        if runs.affords([*states, moved], f"signature of {name} at {amplitude:g}"):
            places.append(len(states))
            states.append(moved)
        else:
            places.append(None)
    if not runs.affords(states, "signatures"):
        return [None] * len(wanted)
    rows = runs.predict(states)
    found: list[np.ndarray | None] = []
    for (_, _, move), place in zip(wanted, places, strict=True):
        change = None if place is None else rows[place] - rows[0] - surface.derivative @ move
        found.append(change if change is not None and np.all(np.isfinite(change)) else None)
    return found


def check_by_second_seed(
    runs: Runs,
    surface: Surface,
    linear: System,
    signatures: Mapping[str, Signature],
    amplitudes: Mapping[str, float],
) -> dict[str, Signature]:
    """Run one amplitude of some candidates with another jitter and compare directions.

    Args:
        runs: the model.
        surface: as for `take_signatures`.
        linear: its system.
        signatures: as taken with jitter seed 0.
        amplitudes: candidate -> the amplitude of its ladder that is run again.

    Returns:
        all signatures, those that were checked with their cosine and the mean of both jitters.
    """
    wanted = [(n, a, signatures[n].moves[a]) for n, a in amplitudes.items()]
    second = run_moved(runs, surface, wanted, seed=1)
    found = dict(signatures)
    for (name, amplitude), again in zip(amplitudes.items(), second, strict=True):
        if again is None:
            continue
        old = signatures[name]
        first = old.changes[amplitude]
        cosine = _cosine(
            linear.project(linear.augmented(first)), linear.project(linear.augmented(again))
        )
        changes = {**old.changes, amplitude: 0.5 * (first + again)}
        found[name] = replace(old, changes=changes, cosines={**old.cosines, amplitude: cosine})
    return found


def _cosine(first: np.ndarray, second: np.ndarray) -> float:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0


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


def nearest_first(scored: Iterable[Score]) -> list[Score]:
    """Scores by the size of their amplitude, of each size the positive one first."""
    return sorted(scored, key=lambda score: (abs(score.rung), score.rung < 0.0))


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
        """The amplitude with the largest expected drop; if none drops, that with the largest z.

        All amplitudes of a linear effect have the same score: the smallest stands for it.
        """
        scored = nearest_first(self.every[name])
        best = largest(scored, lambda score: score.drop)
        return best if best.drop > RELATIVE else largest(scored, lambda score: score.z)

    @property
    def ranked(self) -> list[str]:
        """Candidates, largest expected drop first."""
        return ranked(self.every, lambda name: self.best(name).drop)


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
    paid = 0.0
    if candidate.counted_prior is not None:
        # One more row: amplitude / std, with the prior's mean as its datum.
        mean, std = candidate.counted_prior
        row = candidate.scale.count(rung) / std
        size += row**2
        shift = row * mean / std
        agree, drawn = agree + shift, drawn + shift
        # An amplitude other than 0 pays for its distance from the prior's mean there, which at 0
        # nobody pays who has not got the effect.
        paid = (mean / std) ** 2
    size = max(size, 1e-300)
    most = candidate.most_of(rung)
    share = np.clip(agree / size, 0.0, most)
    null_share = np.clip(drawn / size, 0.0, most)
    if candidate.switch:  # on, or off; there is nothing in between
        share, null_share = np.round(share), np.round(null_share)
    share = float(share)
    drop = 2.0 * share * agree - share**2 * size
    null_drop = 2.0 * null_share * drawn - null_share**2 * size
    score = Score(
        name=candidate.name,
        rung=rung,
        z=agree / np.sqrt(size),
        amplitude=candidate.scale.value(share * candidate.scale.count(rung)),
        drop=max(drop - paid, 0.0),
        visible=float(np.linalg.norm(s)),
        whole=float(np.linalg.norm(whole)),
        projected=s,
    )
    return score, np.maximum(null_drop - paid, 0.0)
