"""Step 7: models with effects, calibrated again.

The signatures have been run at finite amplitudes, so the response surface knows about where a model
with an effect fits: its two deepest valleys are run, each with two jitters of the points, and a few
runs more correct it. That costs a fraction of a calibration from nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from diagnosis.adequacy.adequacy import HeldOutMisfit, held_out_misfit
from diagnosis.selection.evidence import ln_evidence
from inversion.estimation.budget import Runs
from inversion.estimation.covariance import partly
from inversion.estimation.data import Data
from inversion.estimation.derivatives import central_differences, steps_above_noise
from inversion.estimation.misfit import system
from inversion.estimation.response_surface import Surface, Surrogate, anchor_of, spreads
from inversion.estimation.surface_search import (
    JITTERS,
    SEEN,
    Fit,
    best_of,
    least,
    run_points,
    search,
    settled,
)
from inversion.estimation.unknowns import Unknowns
from inversion.problem.unknown import Unknown
from pipeline.ties import smallest

#: Turns of a refit, two runs each: once with each pair of jitters, of which a second time would
#: bring the same noise.
TURNS = len(JITTERS)
#: Times that a refit whose parameters end where its surrogate ends is anchored anew there. By
#: judgement: each takes a derivative and lets a strength move by a factor of 20.
TIMES_ANEW = 2
#: Sum of squares by which a model may be worse than a rival and still be worth them. By judgement:
#: 1 to 1,800 in probability; at half a valley that was walked badly would be given up.
FAR = 15.0
#: Combinations of ladder amplitudes that are tried as first guesses; they cost time, but no run. By
#: judgement: all of two ladders of six rungs each, and more than double.
MOST_GUESSES = 100
#: Jitters of the points that judge a refit, none that a fit has seen (0 to 8): four halve the
#: noise. The second set where the first has moved it.
JUDGES = ((11, 12, 13, 14), (15, 16, 17))
#: Amplitudes beyond the top of a ladder, in units of it, each 1.6 times that before, as far as
#: a ladder is drawn out (`signatures.TOP_RAISED`).
BEYOND = (1.6, 2.5, 4.0)
#: Rise of the sum of squares at which a walk ends on a ladder, three standard deviations: a valley
#: may lie behind a hill. Differences that count as none: noise gives as much to one amplitude in
#: one case of twelve.
HILL, LEVEL = 9.0, 3.0
#: Runs that the prediction of a refit is worth, its noise averaged: as many as judge it.
ANCHORED = len(JUDGES[0])


@dataclass(frozen=True)
class RefitContext:
    """What every refit needs.

    Attributes:
        runs: the model.
        data: measurements with C.
        base: unknowns without effects.
        amplitudes: candidate -> its amplitude as an unknown.
        jitter: covariance of one run's noise, (m, m).
        count: K, candidates that are tested, for the prior odds.
        share: by which what effects do here may differ from what they do in the measured slide.
        exact: effects of which that is known exactly: errors of the survey.
    """

    runs: Runs
    data: Data
    base: Unknowns
    amplitudes: dict[str, Unknown]
    jitter: np.ndarray
    count: int
    share: float = 0.0
    exact: frozenset[str] = frozenset()

    def space(self, names: Sequence[str]) -> Unknowns:
        """Unknowns of a model with these effects."""
        return self.base.with_effects([self.amplitudes[name] for name in sorted(names)])

    def of(self, model: FittedModel) -> RefitContext:
        """The same with the errors that a model has of its own."""
        return self if model.own is None else replace(self, data=model.own, share=0.0)

    def data_for(self, fit: Fit) -> Data:
        """The measurements with what the law of the model's effects may be off by in C.

        `share` of all that the effects change where the model fits. A model whose effect cancels
        the change of its own parameters is thereby penalised: it relies on two errors that
        compensate. Without the run that shows the change, C itself.
        """
        acting = set(fit.names) - self.exact
        if not self.share or not acting:
            return self.data
        state = fit.space.state(fit.x)
        known = tuple(pair for pair in state.effects if pair[0] in self.exact)
        without = replace(state, effects=known)
        if not self.runs.affords([without], f"what {' + '.join(sorted(acting))} changes"):
            return self.data
        change = self.share * (fit.prediction - self.runs.predict([without])[0])
        if not np.all(np.isfinite(change)):
            return self.data
        error = partly(np.outer(change, change))
        return replace(self.data, covariance=self.data.covariance + error)


@dataclass(frozen=True)
class FittedModel:
    """A model with effects at its fit.

    Attributes:
        fit: the fit.
        ln_evidence: of the fitted data, with prior odds, and of the held-out data as predicted.
        held_out: misfit of the held-out numbers.
        dof: degrees of freedom: the noise level of the fit's sum of squares.
        surface: around the fit, for what comes after.
        surrogate: that its search has taught; None where there was none.
        judged: by jitters that it was not fitted with.
        sloped: its derivative is its own, by central differences.
        unread: no run at its fit could be read, so that it explains nothing.
        explains: it has effects, and passes the tests of adequacy.
        own: measurements with the model's own error as it was found at its fit, `share` included,
            in place of that of the base model; None: it was not.
    """

    fit: Fit
    ln_evidence: float
    held_out: HeldOutMisfit
    surface: Surface
    surrogate: Surrogate | None = None
    dof: int = 0
    judged: bool = False
    sloped: bool = False
    unread: bool = False
    explains: bool = False
    own: Data | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects, sorted."""
        return self.fit.names

    @property
    def ln_credit(self) -> float:
        """Its evidence without what it owes to misfits smaller than those of noise."""
        below = max(self.dof - self.fit.total, 0.0)
        below += max(self.held_out.n - self.held_out.chi2, 0.0)
        return self.ln_evidence - 0.5 * below


def refit_words(names: Sequence[str]) -> str:
    """What is said of a refit that the allowance has cut short."""
    return f"refit of {' + '.join(sorted(names))}"


def first_guesses(surface: Surface, space: Unknowns) -> list[np.ndarray]:
    """Every combination of ladder amplitudes, with the anchor's parameters and own effects.

    A surface of bent signatures has several valleys; these lead to all of them. Where there are too
    many combinations the anchor alone.
    """
    own = surface.space.amplitudes(surface.x)
    choices = []
    for effect in space.effects:
        known = effect.name in surface.ladders
        rungs = surface.ladders[effect.name].rungs if known else [own[effect.name]]
        choices.append([effect.scale.count(rung) for rung in rungs])
    if np.prod([len(choice) for choice in choices]) > MOST_GUESSES or len(choices) > 3:
        return [space.clipped(anchor_of(surface, space))]
    return [
        space.clipped(np.concatenate([surface.x[: space.p], rungs])) for rungs in product(*choices)
    ]


def walk_the_valley(
    context: RefitContext, surrogate: Surrogate, guesses: Sequence[np.ndarray], what: str
) -> list[np.ndarray]:
    """Run several amplitudes, each with the parameters that go with it; the surrogate learns.

    While an effect grows the parameters give way to it, and what it does changes with them. The
    surface knows its signature for the anchor's parameters alone, so each step is proposed by what
    the one before has taught. For one new effect these are the amplitudes of its ladder, of the
    sign that fits better, and on beyond the ladder's top while that fits better still; and the
    middle of the other sign. In decades no amplitude is a step from none to the next: each rung is
    run, from the anchor. For several new effects, the deepest valleys, two at most.

    Args:
        context: the model and its measurements.
        surrogate: of the model; learns.
        guesses: combinations of ladder amplitudes, (q,) each.
        what: words for what is left out where the allowance ends.

    Returns:
        where it was run, (q,) each.
    """
    data, space = context.data, surrogate.space
    new = [
        space.p + place
        for place, effect in enumerate(space.effects)
        if effect.name in surrogate.surface.ladders
    ]
    seeds = [seed for pair in JITTERS for seed in pair]
    # Of many effects there is one first guess, without the new one: nothing to walk along.
    if len(new) != 1 or all(x[new[0]] == 0.0 for x in guesses):
        points = [x for x, _ in best_of(data, surrogate, guesses, 2)]
        return run_points(context.runs, surrogate, list(zip(points, seeds, strict=False)), what)
    place = new[0]
    found = [least(data, surrogate, x, held=new)[0] for x in guesses]
    best = smallest(found, lambda x: surrogate.total(data, x))[place]
    other = sorted((x for x in found if x[place] * best < 0.0), key=lambda x: abs(x[place]))
    ladder = sorted((x[place] for x in found if x[place] * best > 0.0), key=abs)
    seen = run_points(context.runs, surrogate, [(x, 5) for x in other[len(other) // 2 :][:1]], what)
    x, totals = surrogate.anchor, [surrogate.total(data, surrogate.anchor)]
    apart = space.effects[place - space.p].scale.form == "decades"
    for number, amplitude in enumerate([*ladder, *(ladder[-1] * k for k in BEYOND)]):
        rise = HILL if number < len(ladder) else LEVEL
        if not space.low[place] <= amplitude <= space.high[place]:
            break
        if totals[-1] > min(totals) + rise and not apart:
            break
        start = (surrogate.anchor if apart else x).copy()
        start[place] = amplitude
        x, _ = least(data, surrogate, start, held=new)
        for turn in range(2):
            seed = seeds[(number + turn) % len(seeds)]
            ran = run_points(context.runs, surrogate, [(x, seed)], what)
            if not ran:
                return seen
            seen += ran
            better, total = least(data, surrogate, x, held=new)
            if surrogate.total(data, x) - total < LEVEL:
                break
            x = better
        totals.append(total)
    return seen


def refit(
    context: RefitContext,
    surface: Surface,
    names: Sequence[str],
    *,
    seeds: int,
    near: np.ndarray | None = None,
    rival: float = np.inf,
) -> FittedModel | None:
    """Calibrate a model with some effects.

    Args:
        context: the model and its measurements.
        surface: knows every effect of the model, by a ladder or as its own.
        names: effects.
        seeds: runs whose mean the surface's anchor is.
        near: unknowns (q,) to start from; None: along the valley of the new effect.
        rival: sum of squares of the best of its rivals; a model that is far from it once the valley
            has been walked is not refined further.

    Returns:
        the model at its fit; None where no run succeeded or none was allowed.
    """
    space = context.space(names)
    known = spreads(context.data, surface, space, context.jitter, anchored_by=seeds)
    surrogate = Surrogate(surface, space, known)
    surrogate.recall(context.runs)
    guesses = first_guesses(surface, space)
    what = refit_words(space.names)
    if near is None:
        first = walk_the_valley(context, surrogate, guesses, what)
    else:
        first = run_points(context.runs, surrogate, [(near, seed) for seed in JITTERS[0]], what)
    starts = [*first, *guesses]
    found = settled(context.data, surrogate, starts)
    for _ in range(TIMES_ANEW if first else 0):
        # Parameters that give way farther than was believed say nothing of the effect yet.
        anew = anchored_anew(context, found, what) if surrogate.ends_at(found.x) else None
        if anew is None:
            break
        surrogate, starts = anew, [found.x]
        found = settled(context.data, surrogate, starts)
    hopeless = near is None and found.total > rival + FAR
    fit = search(
        context.runs,
        context.data,
        surrogate,
        starts,
        first=[],
        turns=0 if hopeless else TURNS,
        what=what,
    )
    return None if fit is None else weighed(context, fit, around(fit), surrogate)


def anchored_anew(context: RefitContext, found: Fit, what: str) -> Surrogate | None:
    """A surrogate about a fit, with the runs and the derivative there; None where they fail."""
    space = found.space
    states = [space.state(found.x, seed=seed) for seed in JITTERS[-1]]
    if not context.runs.affords(states, what):
        return None
    prediction = np.mean(context.runs.predict(states), axis=0)
    if not np.all(np.isfinite(prediction)):
        return None
    surrogate = sloped_at(context, found, prediction, what, anchored_by=len(states))
    if surrogate is not None:
        surrogate.recall(context.runs)
    return surrogate


def sloped_at(
    context: RefitContext, fit: Fit, prediction: np.ndarray, what: str, *, anchored_by: int
) -> Surrogate | None:
    """A surrogate about a fit with a derivative by central differences; None where that fails.

    Args:
        context: the model and its measurements.
        fit: where; its own derivative sets the steps.
        prediction: there, the mean of `anchored_by` runs, (m,).
        what: words for what is left out where the allowance ends.
        anchored_by: runs behind the prediction.
    """
    steps = steps_above_noise(fit.space, context.data, fit.derivative, context.jitter)
    slope = central_differences(
        context.runs, fit.space, fit.x, prediction, steps, what, known=fit.derivative
    )
    if slope is None:
        return None
    surface = Surface(fit.space, fit.x, prediction, slope)
    known = spreads(context.data, surface, fit.space, context.jitter, anchored_by=anchored_by)
    return Surrogate(surface, fit.space, known)


def judge(context: RefitContext, model: FittedModel) -> FittedModel:
    """A refit judged by jitters of the points that it was not fitted with.

    A search ends where surrogate and noise agree with the data; fresh noise does not. Where it
    moves the fit, it is judged there once more. Where none of its runs can be read (a slide that
    does not rest in time) the surrogate knows nothing: the model is no explanation.
    """
    surrogate, fit = model.surrogate, model.fit
    if surrogate is None or model.judged:
        return model
    context = context.of(model)
    for jitters in JUDGES:
        states = [fit.space.state(fit.x, seed=seed) for seed in jitters]
        if not context.runs.affords(states, f"fresh jitters for {' + '.join(fit.names)}"):
            break
        rows = context.runs.predict(states)
        if not np.any(np.all(np.isfinite(rows), axis=1)):
            return replace(model, judged=True, unread=True)
        for row in rows:
            surrogate.learn(fit.x, row)
        before, fit = fit.x, settled(context.data, surrogate, [fit.x, *surrogate.points])
        if np.max(np.abs(fit.x - before)) < SEEN:
            break
    return replace(weighed(context, fit, around(fit), surrogate), judged=True, own=model.own)


def around(fit: Fit) -> Surface:
    """The surface of a fit, linear."""
    return Surface(fit.space, fit.x, fit.prediction, fit.derivative)


def weighed(
    context: RefitContext, fit: Fit, surface: Surface, surrogate: Surrogate | None = None
) -> FittedModel:
    """A fit with its evidence and its misfit on held-out data."""
    data = context.data_for(fit)
    linear = system(data, fit.space, fit.derivative, fit.x)
    held_out = held_out_misfit(fit, linear)
    evidence = ln_evidence(data, fit, context.count) + held_out.ln_density
    evidence += data.ln_density_at_best
    return FittedModel(fit, evidence, held_out, surface, surrogate, linear.dof)


def with_own_derivative(context: RefitContext, chosen: FittedModel) -> FittedModel:
    """A refit with a derivative of its own, by central differences at its fit.

    What a search has learnt of the slope by the way is enough to rank models, not to judge one, nor
    to choose between two that are near each other: with its own slope ln Z rises by 0.7 to 2.6.
    """
    if chosen.sloped or chosen.unread:
        return chosen
    fit, context = chosen.fit, context.of(chosen)
    what = f"derivative of {' + '.join(fit.names)}"
    surrogate = sloped_at(context, fit, fit.prediction, what, anchored_by=ANCHORED)
    if surrogate is None:
        return chosen
    # The slope that a search has learnt by the way can leave it short in a long valley.
    surrogate.recall(context.runs)
    refitted = search(
        context.runs, context.data, surrogate, [fit.x], first=[], turns=TURNS, what=what
    ) or settled(context.data, surrogate, [fit.x])
    found = weighed(context, refitted, around(refitted), surrogate)
    return replace(found, judged=True, sloped=True, own=chosen.own)
