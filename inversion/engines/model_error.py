"""The error of a learned simulator, measured by runs of the material point method next to it.

In: two engines of one question and a handful of states around its fit. Out: `Pairs`, what the two
predict there. The mean of their differences corrects the learned one, and 1.2 times the covariance
of the differences plus 0.1 times its diagonal enters the covariance of the fit: between a few
states the differences hang together more than they would between many, and no number is as sure
as a few pairs make it look. Where the error changes with the strength, the mean is not the error at
the corrected answer; `Settling` then finds the correction that is (space mapping, Bandler et al.
2004: values of the dear engine, derivatives of the cheap one).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inversion.estimation.data import Targets
from inversion.estimation.forward import Forward, Prediction, Request, Setup, WrappedEngine
from inversion.estimation.unknowns import Parameters
from pipeline.cli import WorkFailed

#: Covariance of the differences counts by this, and its diagonal by this in addition.
SHARED, OWN = 1.2, 0.1
#: Square of a change that is none [standard deviations of the survey].
TINY = 1e-12
#: Fewest pairs from which a covariance is taken.
LEAST_PAIRS = 3
#: States lie within one standard deviation of the answer, yet at least and at most so far from it:
#: of the logarithm of a strength; in scaled units for all else.
LOG_WIDTHS, SCALED_WIDTHS = (0.05, 0.2), (0.1, 0.5)


@dataclass(frozen=True)
class Pairs:
    """Predictions of two engines at the same states; n states, m numbers, p parameters.

    Attributes:
        names: of the numbers, (m,).
        states: values of the parameters (n, p), the answer first.
        surrogate: predictions of the learned simulator, without correction, (n, m).
        truth: those of the material point method, (n, m); NaN where it could not be read.
        width: half-width of the region of the states in scaled parameters, (p,).
        settled: the correction that was settled on instead of the mean difference, (m,).
    """

    names: list[str]
    states: np.ndarray
    surrogate: np.ndarray
    truth: np.ndarray
    width: np.ndarray
    settled: np.ndarray | None = None

    @property
    def differences(self) -> np.ndarray:
        """Truth minus surrogate, (n, m)."""
        return self.truth - self.surrogate

    @property
    def mean(self) -> np.ndarray:
        """Mean difference (m,); NaN for numbers that could not be read on each pair."""
        return self.differences.mean(axis=0)

    @property
    def correction(self) -> np.ndarray:
        """What is added to every prediction, (m,); NaN for numbers that could not be read."""
        return self.mean if self.settled is None else self.settled

    def moved(
        self, values: np.ndarray, truth: np.ndarray, surrogate: np.ndarray, settled: np.ndarray
    ) -> Pairs:
        """With a pair at another answer (p,), which is the first now, and a correction (m,)."""
        return replace(
            self,
            states=np.vstack([values, self.states]),
            surrogate=np.vstack([surrogate, self.surrogate]),
            truth=np.vstack([truth, self.truth]),
            settled=settled,
        )

    @property
    def covariance(self) -> np.ndarray:
        """Of the surrogate's error once it is corrected, (m, m); 0 for unread numbers."""
        known = np.isfinite(self.mean)
        found = np.zeros((len(known), len(known)))
        spread = np.atleast_2d(np.cov(self.differences[:, known], rowvar=False, ddof=1))
        found[np.ix_(known, known)] = SHARED * spread + OWN * np.diag(np.diag(spread))
        return found

    def holds(self, parameters: Parameters, values: np.ndarray) -> bool:
        """Whether values (p,) lie in the region of the states."""
        away = parameters.to_fitted(values) - parameters.to_fitted(self.states[0])
        return bool(np.all(np.abs(away) <= self.width * (1.0 + 1e-9)))


def states_around(
    parameters: Parameters, values: np.ndarray, std: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """An answer and states spread evenly around it, within the bounds; always the same ones.

    Args:
        parameters: what is to be found.
        values: the answer (p,).
        std: its standard deviations in scaled parameters, (p,).
        count: of the states, the answer among them.

    Returns:
        states (count, p); half-width of their region in scaled parameters (p,).
    """
    from scipy.stats import qmc  # takes half a second to import

    log = parameters.logarithmic
    unit = np.where(log, 1.0 / parameters.prior_std, 1.0)
    least = np.where(log, LOG_WIDTHS[0], SCALED_WIDTHS[0]) * unit
    most = np.where(log, LOG_WIDTHS[1], SCALED_WIDTHS[1]) * unit
    width = np.clip(std, least, most)
    places = qmc.Sobol(len(values), seed=0).random_base2(int(np.ceil(np.log2(max(count, 2)))))
    fitted = parameters.to_fitted(values) + width * (2.0 * places[: count - 1] - 1.0)
    around = [parameters.to_values(one) for one in fitted]
    return np.array([values, *around]), width


def paired(
    surrogate: Forward, truth: Forward, setup: Setup, states: np.ndarray, width: np.ndarray
) -> tuple[Pairs, list[Prediction]]:
    """Ask both engines at the states (n, p).

    Args:
        surrogate: the learned simulator, without correction.
        truth: the material point method.
        setup: the question; pairs on which a fitted number is missing are left out.
        states: the answer first.
        width: see `Pairs`.

    Returns:
        the pairs; the truth's predictions at all states.

    Raises:
        WorkFailed: too few pairs are left, or none at the answer.
    """
    requests, targets = [setup.at(values) for values in states], setup.targets
    exact, quick = truth.predict(requests), surrogate.predict(requests)
    values = np.array([[one.values for one in engine] for engine in (quick, exact)])
    whole = np.all(np.isfinite(values[:, :, targets.fitted]), axis=(0, 2))
    if whole.sum() < LEAST_PAIRS or not whole[0]:
        reason = next(
            one.reason
            for pair, kept in zip(zip(exact, quick, strict=True), whole, strict=True)
            for one in pair
            if not kept and one.failed
        )
        raise WorkFailed(
            f"the error of the learned simulator is not known: of {len(states)} runs next to the "
            f"material point method {len(states) - int(whole.sum())} failed ({reason})"
        )
    pairs = Pairs(list(targets.names), states[whole], values[0][whole], values[1][whole], width)
    return pairs, exact


def with_error(targets: Targets, pairs: Pairs) -> Targets:
    """The measurements with the surrogate's error in their covariance, number by name."""
    place = {name: number for number, name in enumerate(pairs.names)}
    own = [number for number, name in enumerate(targets.names) if name in place]
    there = [place[targets.names[number]] for number in own]
    covariance = targets.covariance.copy()
    covariance[np.ix_(own, own)] += pairs.covariance[np.ix_(there, there)]
    return replace(targets, covariance=covariance)


class Corrected(WrappedEngine):
    """`inversion.estimation.forward.Forward`: another engine with a constant added.

    Args:
        engine: the learned simulator.
        correction: by name of a number; numbers without one stay as they are, NaN makes them so.
    """

    def __init__(self, engine: Forward, correction: Mapping[str, float]) -> None:
        self.engine = engine
        self.correction = correction

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Corrected predictions."""
        found = self.engine.predict(requests)
        return [self._corrected(*pair) for pair in zip(requests, found, strict=True)]

    def derivative(
        self, request: Request, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Corrected prediction and the derivative, which a constant does not change."""
        prediction, derivative, taken = self.engine.derivative(request, steps)
        return self._corrected(request, prediction), derivative, taken

    def _corrected(self, request: Request, prediction: Prediction) -> Prediction:
        names = request.setup.targets.names
        correction = np.array([self.correction.get(name, 0.0) for name in names])
        return replace(prediction, values=prediction.values + correction)


@dataclass(frozen=True)
class Settling:
    """A correction that was tried, and what the truth said of the answer with it.

    Attributes:
        correction: (m,).
        left: truth minus corrected prediction at that answer, (m,).
        off: largest of those that are fitted, in standard deviations of the survey.
        weight: one over these, 0 for what is not fitted, (m,).
    """

    correction: np.ndarray
    left: np.ndarray
    off: float
    weight: np.ndarray

    def following(self, before: Settling | None) -> np.ndarray:
        """The correction to try next, (m,): what is left is added, less what the last step says.

        Alone it is that at the answer. After another it is Anderson's mixture of the two (1965, of
        depth 1), which does not swing about the answer where the truth is steeper than the
        surrogate.
        """
        plain = self.correction + self.left
        if before is None:
            return plain
        change = self.weight * (self.left - before.left)
        share = float(change @ (self.weight * self.left) / max(float(change @ change), TINY))
        return plain - share * (plain - before.correction - before.left)
