"""What a judge with perfect luck could see of a hidden effect.

The slide with the effect is simulated with the judge's own cells, without any error; the base model
is calibrated to it; lambda is what is left, in the judge's own covariance, the model's error at the
calibrated state included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.blind import surveys
from diagnosis.blind.detectability import BINS, detectability, find_amplitude
from diagnosis.blind.laboratory import Entry, Laboratory, Request
from diagnosis.blind.sections import Section
from diagnosis.covariance import covariance
from geometry.measured import Deposit, Measured
from geometry.random_numbers import Stream
from mpm_taichi.effects import effect as effect_of

#: Replicates, their jitter, the second transfer scheme and the finer cells behind the covariance.
REPLICATES, JITTER, TRANSFER, RESOLUTION = 8, 0.5, "flip", 1.5
#: Steps of the derivative, farthest step of the calibration, both in fitted units; its iterations.
STEP, FARTHEST, ITERATIONS = 0.2, 0.6, 4
#: The calibration ends where it moves less than this.
SETTLED = 0.1


@dataclass(frozen=True)
class Around:
    """Deposits of the base model around one state.

    Attributes:
        replicates: with other jitters; transfer: by the other scheme; finer: with finer cells;
        own: the state itself, to which the last two are paired.
    """

    own: Deposit
    replicates: list[Deposit]
    transfer: Deposit | None
    finer: Deposit | None

    def covariance(self, entries: Sequence[Measured]) -> np.ndarray:
        """C of the judge, (m, m); ValueError where a deposit cannot be read."""
        own = surveys.reading(entries, self.own)
        differences = [
            None if one is None else surveys.reading(entries, one) - own
            for one in (self.transfer, self.finer)
        ]
        return covariance(
            surveys.covariance_of(entries),
            replicates=np.array([surveys.reading(entries, one) for one in self.replicates]),
            synthetic=True,
            transfer=differences[0],
            finer=differences[1],
        ).total


@dataclass
class Sight:
    """A section at its true parameters, and how the base model errs there.

    Attributes:
        laboratory, section, survey: what is simulated and read.
        values: true parameters (p,) in outside units.
        around: the base model's error there.
    """

    laboratory: Laboratory
    section: Section
    survey: str
    values: np.ndarray
    around: Around

    @classmethod
    def at(
        cls, laboratory: Laboratory, section: Section, survey: str, values: np.ndarray
    ) -> Sight | None:
        """Simulate what is needed at `values` (p,); None where the section cannot be simulated."""
        around = look_around(laboratory, section, values)
        return None if around is None else cls(laboratory, section, survey, values, around)

    def amplitude(
        self, name: str, wanted: float, stream: Stream, more: Mapping[str, float]
    ) -> tuple[float, float]:
        """The amplitude of an effect that gives lambda `wanted`, and the lambda it gives.

        Args:
            name: of the effect.
            wanted: lambda.
            stream: decides the sign where there are two.
            more: further numbers of the effect.
        """
        scale = effect_of(name).amplitude
        signs = [1.0]
        if scale.two_signed:
            first = 1.0 if stream.unit() < 0.5 else -1.0
            signs = [first, -first]
        best = (0.0, 0.0)
        for sign in signs:
            magnitude, seen = find_amplitude(
                lambda sizes, sign=sign: self.lambdas(
                    [{name: {"amplitude": sign * a, **more}} for a in sizes]
                ),
                scale.ladder,
                scale.high if sign > 0 else -scale.low,
                wanted,
            )
            best = (sign * magnitude, seen)
            if BINS[0] <= seen <= BINS[-1]:
                break
        return best

    def lambdas(self, effects: Sequence[Mapping[str, Entry]]) -> list[float]:
        """What can be seen of each set of effects; NaN where its run failed or is no flow slide."""
        return [
            np.nan if one is None else self.seen(one, self.survey) for one in self.slides(effects)
        ]

    def slides(self, effects: Sequence[Mapping[str, Entry]]) -> list[Deposit | None]:
        """Deposits with each set of effects; None where a run failed or is no flow slide."""
        requests = [Request(tuple(self.values.tolist()), one) for one in effects]
        return [
            one if one is not None and is_slide(self.section, one) else None
            for one in self.laboratory.deposits(self.section, requests)
        ]

    def seen(self, deposit: Deposit, survey: str) -> float:
        """Lambda of a deposit by a survey; NaN where it cannot be read."""
        found = self._calibrated(deposit, survey)
        return np.nan if found is None else found[1]

    def seen_for_good(self, effects: Mapping[str, Entry]) -> float:
        """The same of one set, with the model's error at the calibrated state."""
        (deposit,) = self.slides([effects])
        fitted = None if deposit is None else self._calibrated(deposit, self.survey)
        if deposit is None or fitted is None:
            return np.nan
        around = look_around(self.laboratory, self.section, fitted[0])
        if around is None:
            return np.nan
        return replace(self, around=around).seen(deposit, self.survey)

    def _calibrated(self, deposit: Deposit, survey: str) -> tuple[np.ndarray, float] | None:
        """Parameters that bring the base model nearest to a deposit, and lambda there."""
        toe = surveys.toe_of(self.section, deposit)
        entries = surveys.entries_of(self.section, survey, toe)
        parameters = self.section.parameters
        prior = parameters.to_fitted(parameters.prior_mean)
        rows = np.eye(len(prior))[parameters.has_prior]
        try:
            target, total = surveys.reading(entries, deposit), self.around.covariance(entries)
        except ValueError:
            return None
        x = parameters.to_fitted(self.values)
        slope = self._derivative(x, entries)
        here = self._reading(x, entries)
        if slope is None or here is None:
            return None
        best, least = x, np.inf
        for _ in range(ITERATIONS):
            left = detectability(target - here, slope[:, :0], total, rows[:, :0])
            if left < least:
                best, least, nearest = x, left, here
            step = _step(target - here, slope, total, rows, rows @ (prior - x))
            new = np.clip(
                x + np.clip(step, -FARTHEST, FARTHEST),
                parameters.fitted_low,
                parameters.fitted_high,
            )
            there = self._reading(new, entries)
            if np.max(np.abs(new - x)) < SETTLED or there is None:
                break
            # Broyden (1965): the slope as it should have been along the step that was taken.
            way = new - x
            slope = slope + np.outer(there - here - slope @ way, way) / (way @ way)
            x, here = new, there
        # What is left at the best state, less what one more linear step would take away.
        return parameters.to_values(best), detectability(target - nearest, slope, total, rows)

    def _derivative(self, x: np.ndarray, entries: Sequence[Measured]) -> np.ndarray | None:
        """Derivative of the base model's reading at x (p,) fitted, (m, p)."""
        here = self._reading(x, entries)
        moved = [self._reading(x + STEP * unit, entries) for unit in np.eye(len(x))]
        if here is None or any(there is None for there in moved):
            return None
        return np.column_stack([(there - here) / STEP for there in moved])

    def _reading(self, x: np.ndarray, entries: Sequence[Measured]) -> np.ndarray | None:
        """Reading of the base model at x (p,) fitted, (m,); None where it cannot be had."""
        values = tuple(self.section.parameters.to_values(x).tolist())
        (deposit,) = self.laboratory.deposits(self.section, [Request(values)])
        try:
            return None if deposit is None else surveys.reading(entries, deposit)
        except ValueError:
            return None


def is_slide(section: Section, deposit: Deposit) -> bool:
    """The toe has run as far as a flow slide of this section may."""
    way = abs(surveys.toe_of(section, deposit) - deposit.foot[section.survey.side])
    least, most = section.survey.runouts_m
    return least <= way <= most


def look_around(laboratory: Laboratory, section: Section, values: np.ndarray) -> Around | None:
    """The base model's error at a state; None where it cannot be simulated."""
    own = tuple(np.asarray(values).tolist())
    requests = [
        Request(own),
        Request(own, transfer=TRANSFER),
        Request(own, spacing_factor=1.0 / RESOLUTION),
        *(Request(own, jitter=JITTER, seed=k) for k in range(1, REPLICATES + 1)),
    ]
    base, transfer, finer, *replicates = laboratory.deposits(section, requests)
    if base is None:
        return None
    return Around(base, [one for one in replicates if one is not None], transfer, finer)


def _step(
    residual: np.ndarray,
    derivative: np.ndarray,
    total: np.ndarray,
    rows: np.ndarray,
    towards: np.ndarray,
) -> np.ndarray:
    """Gauss-Newton step (p,) of the whitened residual (m,) with prior rows (r, p)."""
    lower = np.linalg.cholesky(total)
    whitened = np.linalg.solve(lower, np.column_stack([residual, derivative]))
    matrix = np.vstack([whitened[:, 1:], rows])
    right = np.concatenate([whitened[:, 0], towards])
    return np.linalg.lstsq(matrix, right, rcond=None)[0]
