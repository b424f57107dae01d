"""Step 7: models with effects, calibrated anew.

The signatures have been run at finite amplitudes, so the response surface knows about where a model
with an effect fits: its two deepest valleys are run, each with two jitters of the points, and a few
runs more correct it. That costs a fraction of a calibration from nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from diagnosis.adequacy import HeldOutMisfit, held_out_misfit
from diagnosis.differences import central_differences, steps_above_noise
from diagnosis.evidence import ln_evidence
from diagnosis.fit import Fit, search, settled
from diagnosis.runs import Runs
from diagnosis.space import Amplitude, Space
from diagnosis.surface import Surface
from diagnosis.surrogate import Surrogate, spreads
from diagnosis.whitened import Data, system

#: Turns of a refit, two runs each.
TURNS = 4
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
        ln_evidence: with prior odds.
        held_out: misfit of the held-out numbers.
        surface: around the fit, for what comes after.
    """

    fit: Fit
    ln_evidence: float
    held_out: HeldOutMisfit
    surface: Surface

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects, sorted."""
        return self.fit.names


def first_guesses(surface: Surface, space: Space) -> list[np.ndarray]:
    """Every combination of ladder amplitudes, with the anchor's parameters and own effects.

    A surface of bent signatures has several valleys; these lead to all of them.
    """
    own = surface.space.amplitudes(surface.x)
    choices = []
    for effect in space.effects:
        known = effect.name in surface.ladders
        rungs = surface.ladders[effect.name].rungs if known else [own[effect.name]]
        choices.append([rung / effect.unit for rung in rungs])
    return [
        space.clipped(np.concatenate([surface.x[: space.p], rungs])) for rungs in product(*choices)
    ]


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
    fit = search(
        bench.runs,
        bench.data,
        surrogate,
        first_guesses(surface, space),
        valleys=2,
        turns=TURNS,
        what=f"refit of {' + '.join(space.names)}",
    )
    return None if fit is None else weighed(bench, fit, around(fit))


def around(fit: Fit) -> Surface:
    """The surface of a fit, linear."""
    return Surface(fit.space, fit.x, fit.prediction, fit.derivative)


def weighed(bench: Bench, fit: Fit, surface: Surface) -> Refitted:
    """A fit with its evidence and its misfit on held-out data."""
    linear = system(bench.data, fit.space, fit.derivative, fit.x)
    return Refitted(
        fit, ln_evidence(bench.data, fit, bench.count), held_out_misfit(fit, linear), surface
    )


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
    return weighed(bench, settled(bench.data, surrogate, [fit.x]), surface)
