"""Step 12: the measurement that would tell the surviving explanations apart.

With two explanations A and B, probabilities w, predictions of a new measurement that differ by d,
their covariances V_A and V_B (what their unknowns still leave open) and the error C_new of the
measurement, survey and model together,

    gain = sum_AB w_A w_B d' (C_new + V_A + V_B)^-1 d / sum_AB w_A w_B

is the expected separation in squared standard deviations. Measurements are chosen greedily: the
second is the one that adds most to the first.

Where one explanation alone survives, the measurement is its test: it is held against each of the
next most probable, not these against each other. Where that is the base model, they are it and each
candidate at the amplitude that would just be found: the measurement that would have shown most of
what may still hide.

With every measurement goes what each rival says that it would read: what lies outside all of these
refutes them all.

An answer has a test besides (`refutation`): the measurement whose reading by it differs most from
that by the candidates at the amplitudes that would just be found, whether they explain or not. For
an unlisted cause may do what any of them does.

Predictions of what has not been measured are read from runs that were made for other reasons: no
run is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from diagnosis.adequacy.compare import Comparison
from diagnosis.hypotheses.model import Proposal, Proposes
from diagnosis.options import Options
from diagnosis.selection.decide import Decision
from diagnosis.selection.explain import Explanation
from diagnosis.selection.selection import CONTENDERS
from diagnosis.selection.tried_models import TriedModels
from inversion.estimation.covariance import covariance, known, mean_of
from inversion.estimation.data import Data
from inversion.estimation.misfit import system
from inversion.estimation.response_surface import Spreads, Surface, Surrogate
from inversion.estimation.surface_search import Fit
from inversion.estimation.unknowns import Unknowns
from inversion.problem.state import Numerics, State
from pipeline.ties import largest_place

#: Explanations with less probability are not worth telling apart. By judgement: a fifth of what all
#: may have that stand outside the answer (`Options.credible`); `CONTENDERS` of them at most.
LEAST_SHARE = 0.02
#: Weight of what an explanation is held against, where only it is to be told from each of them:
#: pairs of these weigh this times as much, 3 % in all among 60.
AGAINST = 1e-3
#: Separation in squared std beyond which a candidate counts as told from an answer: three of them.
MOST_APART = 9.0
#: A proposal that a larger share of the runs cannot read is none. By judgement: with none allowed
#: one odd run strikes it out, with many they drop out of what is predicted of all proposals.
MOST_UNREAD = 0.1
#: Spreads of a prediction of which nothing is known, in units of the noise of a run: of its mean,
#: of its slopes, of their products, and of what these do not describe. By judgement: wide enough
#: for the runs to decide, simple terms before the others.
UNKNOWN = (300.0, 60.0, 20.0, 1.5)


@dataclass(frozen=True)
class ExpectedReading:
    """What an explanation says that a measurement would read.

    Attributes:
        names: effects of the explanation.
        values: (n,) in the measurement's unit.
        std: of the difference to what is read, by the model, its unknowns and the survey, (n,).
    """

    names: tuple[str, ...]
    values: np.ndarray
    std: np.ndarray


@dataclass(frozen=True)
class Suggestion:
    """One measurement.

    Attributes:
        proposal: what it is.
        gain: with all that were suggested before it, in squared standard deviations.
        outcomes: by the rivals that it tells apart, the most probable first.
    """

    proposal: Proposal
    gain: float
    outcomes: tuple[ExpectedReading, ...] = ()


@dataclass(frozen=True)
class Rival:
    """What an explanation predicts of all proposals.

    Attributes:
        names: its effects.
        weight: its probability.
        mean: prediction, (q,).
        covariance: of the same, by what its unknowns leave open, (q, q).
    """

    names: tuple[str, ...]
    weight: float
    mean: np.ndarray
    covariance: np.ndarray


class Readable:
    """The proposals of a model that can be read on nearly all of its runs that did not fail.

    A run that lacks one reading drops out of what is predicted of all. So a slip depth is no
    proposal where in many runs nothing slipped.

    Attributes:
        proposals: of those numbers.
        columns: their places among the model's own, (q,).
    """

    def __init__(self, model: Proposes, readable: np.ndarray) -> None:
        self._model = model
        self.proposals: list[Proposal] = []
        columns: list[int] = []
        for proposal in model.proposals:
            own = list(proposal.index)
            if readable[own].all():
                places = tuple(range(len(columns), len(columns) + len(own)))
                self.proposals.append(replace(proposal, index=places))
                columns += own
        self.columns = np.array(columns, dtype=int)

    @classmethod
    def of(cls, model: Proposes, comparison: Comparison) -> Readable:
        """Those read on all seeds of the base model and all but a few of the runs made so far."""
        kept = np.ones(sum(len(proposal.index) for proposal in model.proposals), dtype=bool)
        for states, most in ((_seeds(comparison), 0.0), (_own_states(comparison), MOST_UNREAD)):
            unread = ~np.isfinite(model.propose(states))
            ran = ~unread.all(axis=1)
            kept &= unread[ran].sum(axis=0) <= most * ran.sum()
        return cls(model, kept)

    def propose(self, states: Sequence[State]) -> np.ndarray:
        """Readings of these proposals, (n, q)."""
        return self._model.propose(states)[:, self.columns]


def _own_states(comparison: Comparison) -> list[State]:
    """Of the runs that were made, in numerics of their own."""
    return [state for state, _ in comparison.base.runs.every if state.numerics == "own"]


def _seeds(comparison: Comparison) -> list[State]:
    """Of the base model's jitter seeds."""
    base = comparison.base
    return [base.surface.space.state(base.surface.x, seed=seed) for seed in range(base.seeds)]


@dataclass(frozen=True)
class Foresight:
    """What could still be measured, and what explanations say of it.

    Attributes:
        model: the diagnosed model; predicts what proposals would have read.
        comparison: of the base model.
        explanation: of its misfit.
        tried_models: models that were tried.
        decision: with the probability of each.
        options: whether data are synthetic.
    """

    model: Proposes
    comparison: Comparison
    explanation: Explanation
    tried_models: TriedModels
    decision: Decision
    options: Options

    @cached_property
    def readable(self) -> Readable:
        """The proposals; none where the model makes none."""
        return Readable.of(self.model, self.comparison)

    @cached_property
    def error(self) -> tuple[np.ndarray, np.ndarray]:
        """Of `proposal_error`."""
        return proposal_error(self.readable, self.comparison, self.options)

    @cached_property
    def hidden(self) -> list[Rival]:
        """The base model, and each candidate at the amplitude that would just be found.

        Beyond the top of its ladder no amplitude is believed. The base model's weight is large
        against theirs, so that each is compared with it and not with the others.
        """
        base, explanation = self.comparison.base, self.explanation
        mean, slope = self._read(base.fit)
        covariance = _open(base.data, base.fit, slope)
        rivals = [Rival((), 1.0, mean, covariance)]
        anchor = base.surface.space.state(base.surface.x)
        linear = self.comparison.judged.system
        candidates = {candidate.name: candidate for candidate in explanation.candidates}
        for name in explanation.names:
            amplitude, change = explanation.signatures[name].plain
            states = [anchor, anchor.with_effects({name: amplitude})]
            before, after = self.readable.propose(states)
            if not np.all(np.isfinite(after)):
                continue
            size = float(np.linalg.norm(linear.project(linear.augmented(change))))
            share = self.options.detectable / max(size, 1e-9)
            count = candidates[name].scale.count
            most = max(abs(count(rung)) for rung in candidates[name].ladder) / abs(count(amplitude))
            met = -linear.imitating(linear.augmented(change))
            apart = min(share, most) * (after - before + slope @ met)
            rivals.append(Rival((name,), AGAINST, mean + apart, np.zeros_like(covariance)))
        return rivals

    def survivors(self, *, least: float = LEAST_SHARE) -> list[Rival]:
        """Explanations that still have some probability, the most probable first."""
        found: list[Rival] = []
        for names, weight in self.decision.probability.items():
            if weight < least or len(found) == CONTENDERS:
                break
            fit = self.tried_models.models[names].fit
            mean, slope = self._read(fit)
            covariance = _open(self.comparison.base.data, fit, slope)
            found.append(Rival(names, max(weight, 1e-9), mean, covariance))
        return found

    def _read(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        return read_at(self.readable, self.comparison, fit.space, fit.x)

    @property
    def nothing(self) -> bool:
        """Nothing is proposed that can be read."""
        return not self.model.proposals or not self.readable.proposals

    def suggest(self, count: int) -> list[Suggestion]:
        """The next measurements, best first, `count` at most."""
        if self.nothing:
            return []
        rivals = self.survivors()
        if len(rivals) == 1 and rivals[0].names:  # the answer, and what comes next to it
            rivals = one_against(self.survivors(least=0.0))
        said = rivals
        if len(rivals) < 2:
            rivals = self.hidden
            said = rivals[:1]  # what candidates that were not fitted would do is only its direction
        error, _ = self.error
        return [
            replace(one, outcomes=self._outcomes(one.proposal, said))
            for one in greedy(self.readable.proposals, rivals, error, count)
        ]

    def refutation(self) -> Suggestion | None:
        """The measurement by which the answer could be refuted.

        None where nothing explains, or nothing is proposed. Its gain is the mean separation from
        the candidates, each at most `MOST_APART`.
        """
        lead = tuple(self.decision.final.model.names)
        if not lead or self.decision.chance is None or self.nothing:
            return None
        others = self.survivors()
        answer = next((one for one in others if one.names == lead), None)
        if answer is None:
            return None
        others = [one for one in others if one.names != lead]
        base, *candidates = self.hidden
        error, _ = self.error
        proposals = self.readable.proposals
        apart = [told_apart(answer, candidates, error, one.index) for one in proposals]
        place = largest_place(np.array(apart))
        said = [answer, *others, *([] if any(not one.names for one in others) else [base])]
        return Suggestion(proposals[place], apart[place], self._outcomes(proposals[place], said))

    def _outcomes(self, proposal: Proposal, said: Sequence[Rival]) -> tuple[ExpectedReading, ...]:
        error, finer = self.error
        return outcomes(proposal, [replace(one, mean=one.mean + finer) for one in said], error)


def told_apart(
    answer: Rival, candidates: Sequence[Rival], error: np.ndarray, index: Sequence[int]
) -> float:
    """Mean separation of an answer from each candidate by some numbers, at most `MOST_APART`."""
    each = [separation([answer, one], error, index) for one in candidates]
    return float(np.mean([min(one, MOST_APART) for one in each if np.isfinite(one)] or [0.0]))


def one_against(rivals: Sequence[Rival]) -> list[Rival]:
    """The first with all its weight against each of the others."""
    return [replace(one, weight=AGAINST if place else 1.0) for place, one in enumerate(rivals)]


def outcomes(
    proposal: Proposal, rivals: Sequence[Rival], error: np.ndarray
) -> tuple[ExpectedReading, ...]:
    """What rivals say of a measurement; `error`: C_new of all proposals, (q, q)."""
    index = list(proposal.index)
    return tuple(
        ExpectedReading(one.names, one.mean[index], np.sqrt(np.diag(error + one.covariance)[index]))
        for one in rivals
    )


def proposal_error(
    model: Proposes, comparison: Comparison, options: Options
) -> tuple[np.ndarray, np.ndarray]:
    """C_new of all proposals (q, q), and what finer cells add to them (q,).

    Both as of the measurements that were made (`adequacy.calibration.errors_at`), from the base
    model's runs with other jitters, with the second transfer scheme and with finer cells.
    """
    replicates = model.propose(_seeds(comparison))
    survey = np.zeros((replicates.shape[1], replicates.shape[1]))
    for proposal in model.proposals:
        survey[np.ix_(proposal.index, proposal.index)] += proposal.covariance
    finer = _with_other(model, comparison, "fine")
    error = covariance(
        survey,
        replicates=replicates,
        synthetic=options.synthetic,
        transfer=_with_other(model, comparison, "transfer"),
        finer=finer,
        factor=options.finer_share_std,
        finer_noise=0.0 if finer is None else options.finer_noise,
    ).total
    nothing = np.zeros(replicates.shape[1])
    return error, nothing if finer is None else options.finer_share * known(finer)


def _with_other(model: Proposes, comparison: Comparison, numerics: Numerics) -> np.ndarray | None:
    """What other numerics change in the proposals (q,), by the base model's last runs of them."""
    made = [state for state, _ in comparison.base.runs.every]
    other = [state for state in made if state.numerics == numerics and not state.effects]
    other = [state for state in other if state.values == other[-1].values]
    own = [replace(state, numerics="own") for state in other]
    if not own or not set(own) <= set(made):
        return None
    return mean_of(model.propose(other)) - mean_of(model.propose(own))


def greedy(
    proposals: Sequence[Proposal], rivals: Sequence[Rival], error: np.ndarray, count: int
) -> list[Suggestion]:
    """Choose measurements one after another, each with those before it."""
    chosen: list[Suggestion] = []
    index: list[int] = []
    left = list(proposals)
    while left and len(chosen) < count:
        gains = [separation(rivals, error, [*index, *proposal.index]) for proposal in left]
        if not np.any(np.isfinite(gains)):
            break  # nothing that is left can be read on what the rivals leave behind
        best = largest_place(np.nan_to_num(gains, nan=-1.0))
        chosen.append(Suggestion(left[best], float(gains[best])))
        index += left[best].index
        left.pop(best)
    return chosen


def separation(rivals: Sequence[Rival], error: np.ndarray, index: Sequence[int]) -> float:
    """Expected separation of the rivals by some numbers together, in squared std."""
    own = np.ix_(index, index)
    total, weights = 0.0, 0.0
    for one, two in combinations(rivals, 2):
        apart = (one.mean - two.mean)[list(index)]
        spread = error[own] + one.covariance[own] + two.covariance[own]
        weight = one.weight * two.weight
        total += weight * float(apart @ np.linalg.solve(spread, apart))
        weights += weight
    return total / weights if weights > 0.0 else 0.0


def read_at(
    model: Proposes, comparison: Comparison, space: Unknowns, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Proposals (q,) at x of a model, and their derivative, from the runs made so far."""
    states = _own_states(comparison)
    readings = model.propose(states)
    q = readings.shape[1]
    empty = Surface(space, x, np.zeros(q), np.zeros((q, space.size)))
    mean, slope, product, local = UNKNOWN
    n = space.size
    spreads = Spreads(mean, np.full(n, slope), np.full((n, n), product), local)
    surrogate = Surrogate(empty, space, spreads)
    centre = readings[np.all(np.isfinite(readings), axis=1)].mean(axis=0)
    surrogate.recall_from(
        [(state, row - centre) for state, row in zip(states, readings, strict=True)], also_here=True
    )
    return surrogate.predict(x) + centre, surrogate.slope(x)


def _open(data: Data, fit: Fit, slope: np.ndarray) -> np.ndarray:
    """What the unknowns of a fit leave open of the proposals, (q, q)."""
    linear = system(data, fit.space, fit.derivative, fit.x)
    return slope @ linear.posterior @ slope.T
