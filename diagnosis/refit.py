"""Step 7: models with effects, calibrated anew.

The signatures have been run at finite amplitudes, so the response surface knows about where a model
with an effect fits: its two deepest valleys are run, each with two jitters of the points, and a few
runs more correct it. That costs a fraction of a calibration from nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from diagnosis.adequacy import HeldOutMisfit, held_out_misfit
from diagnosis.differences import central_differences, steps_above_noise
from diagnosis.evidence import ln_evidence
from diagnosis.fit import SEEN, Fit, best_of, least, search, settled
from diagnosis.runs import Runs
from diagnosis.space import Amplitude, Space
from diagnosis.surface import Surface
from diagnosis.surrogate import Surrogate, anchor_of, spreads
from diagnosis.whitened import Data, system

#: Turns of a refit, two runs each.
TURNS = 4
#: Combinations of ladder amplitudes that are tried as first guesses.
MOST_GUESSES = 100
#: Jitters of the points that judge a refit; the second set where the first has moved it.
JUDGES = ((11, 12, 13, 14), (15, 16, 17))
#: Runs that the prediction of a refit is worth, its noise averaged.
ANCHORED = 4


@dataclass(frozen=True)
class Bench:
    """What every refit needs.

    Attributes:
        runs: the model.
        data: measurements with C.
        base: unknowns without effects.
        amplitudes: candidate -> its amplitude as an unknown.
        jitter: covariance of one run's noise, (m, m).
        count: K, candidates that are tested, for the prior odds.
    """

    runs: Runs
    data: Data
    base: Space
    amplitudes: dict[str, Amplitude]
    jitter: np.ndarray
    count: int

    def space(self, names: Sequence[str]) -> Space:
        """Unknowns of a model with these effects."""
        return self.base.with_effects([self.amplitudes[name] for name in sorted(names)])


@dataclass(frozen=True)
class Refitted:
    """A model with effects at its fit.

    Attributes:
        fit: the fit.
        ln_evidence: of the fitted data, with prior odds, and of the held-out data as predicted.
        held_out: misfit of the held-out numbers.
        surface: around the fit, for what comes after.
        surrogate: that its search has taught; None where there was none.
        judged: by jitters that it was not sought with.
    """

    fit: Fit
    ln_evidence: float
    held_out: HeldOutMisfit
    surface: Surface
    surrogate: Surrogate | None = None
    judged: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects, sorted."""
        return self.fit.names


def first_guesses(surface: Surface, space: Space) -> list[np.ndarray]:
    """Every combination of ladder amplitudes, with the anchor's parameters and own effects.

    A surface of bent signatures has several valleys; these lead to all of them. Where there are too
    many combinations the anchor alone.
    """
    own = surface.space.amplitudes(surface.x)
    choices = []
    for effect in space.effects:
        known = effect.name in surface.ladders
        rungs = surface.ladders[effect.name].rungs if known else [own[effect.name]]
        choices.append([rung / effect.unit for rung in rungs])
    if np.prod([len(choice) for choice in choices]) > MOST_GUESSES or len(choices) > 3:
        return [space.clipped(anchor_of(surface, space))]
    return [
        space.clipped(np.concatenate([surface.x[: space.p], rungs])) for rungs in product(*choices)
    ]


def along_the_valley(
    data: Data, surrogate: Surrogate, guesses: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Points to run first: several amplitudes, each with the parameters that go with it.

    While an effect grows the parameters give way to it, and what it does changes with them. The
    surface knows its signature for the anchor's parameters alone; runs along the valley teach the
    rest. For one new effect these are the amplitudes of its ladder, of the sign that fits better,
    with the middle of the other; for several, the two deepest valleys.
    """
    space = surrogate.space
    new = [
        space.p + place
        for place, effect in enumerate(space.effects)
        if effect.name in surrogate.surface.ladders
    ]
    if len(new) != 1:
        return [x for x, _ in best_of(data, surrogate, guesses, 2)]
    found = [least(data, surrogate, x, held=new) for x in guesses]
    best = min(found, key=lambda pair: pair[1])[0][new[0]]
    same = [x for x, _ in found if x[new[0]] * best > 0.0]
    other = sorted((x for x, _ in found if x[new[0]] * best < 0.0), key=lambda x: abs(x[new[0]]))
    return same + other[len(other) // 2 :][:1]


def refit(bench: Bench, surface: Surface, names: Sequence[str], *, seeds: int) -> Refitted | None:
    """Calibrate a model with some effects.

    Args:
        bench: the model and its measurements.
        surface: knows every effect of the model, by a ladder or as its own.
        names: effects.
        seeds: runs whose mean the surface's anchor is.

    Returns:
        the model at its fit; None where no run succeeded or none was allowed.
    """
    space = bench.space(names)
    known = spreads(bench.data, surface, space, bench.jitter, anchored_by=seeds)
    surrogate = Surrogate(surface, space, known)
    surrogate.recall(bench.runs)
    guesses = first_guesses(surface, space)
    fit = search(
        bench.runs,
        bench.data,
        surrogate,
        guesses,
        first=along_the_valley(bench.data, surrogate, guesses),
        turns=TURNS,
        what=f"refit of {' + '.join(space.names)}",
    )
    return None if fit is None else weighed(bench, fit, around(fit), surrogate)


def judge(bench: Bench, model: Refitted) -> Refitted:
    """A refit judged by jitters of the points that it was not sought with.

    A search ends where surrogate and noise agree with the data; fresh noise does not. Where it
    moves the fit, it is judged there once more.
    """
    surrogate, fit = model.surrogate, model.fit
    if surrogate is None or model.judged:
        return model
    for jitters in JUDGES:
        states = [fit.space.state(fit.x, seed=seed) for seed in jitters]
        if not bench.runs.affords(states, f"fresh jitters for {' + '.join(fit.names)}"):
            break
        for row in bench.runs.predict(states):
            surrogate.learn(fit.x, row)
        before, fit = fit.x, settled(bench.data, surrogate, [fit.x, *surrogate.points])
        if np.max(np.abs(fit.x - before)) < SEEN:
            break
    return replace(weighed(bench, fit, around(fit), surrogate), judged=True)


def around(fit: Fit) -> Surface:
    """The surface of a fit, linear."""
    return Surface(fit.space, fit.x, fit.prediction, fit.derivative)


def weighed(
    bench: Bench, fit: Fit, surface: Surface, surrogate: Surrogate | None = None
) -> Refitted:
    """A fit with its evidence and its misfit on held-out data."""
    linear = system(bench.data, fit.space, fit.derivative, fit.x)
    held_out = held_out_misfit(fit, linear)
    evidence = ln_evidence(bench.data, fit, bench.count) + held_out.ln_density
    return Refitted(fit, evidence, held_out, surface, surrogate)


def adopted(bench: Bench, chosen: Refitted) -> Refitted:
    """A refit with a derivative of its own, by central differences at its fit.

    What a search has learnt of the slope by the way is enough to rank models, not to judge one.
    """
    fit = chosen.fit
    what = f"derivative of {' + '.join(fit.names)}"
    steps = steps_above_noise(fit.space, bench.data, fit.derivative, bench.jitter)
    slope = central_differences(bench.runs, fit.space, fit.x, fit.prediction, steps, what)
    if slope is None:
        return chosen
    surface = Surface(fit.space, fit.x, fit.prediction, slope)
    known = spreads(bench.data, surface, fit.space, bench.jitter, anchored_by=ANCHORED)
    surrogate = Surrogate(surface, fit.space, known)
    found = weighed(bench, settled(bench.data, surrogate, [fit.x]), surface)
    return replace(found, judged=True)
