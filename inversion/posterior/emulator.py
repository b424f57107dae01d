"""An emulator of the numbers of a run over all unknowns, made of coarse runs, corrected by fine.

A number y that was measured as y_0 with a standard deviation s is emulated as

    g = arsinh((y - y_0) / w),   w = 5 s:

linear where it could be right, logarithmic far away, where it is enough to know that it is far.
Numbers that were not measured are emulated as they are. With two spacings (Kennedy and O'Hagan
2000, their regression coefficient 1)

    g_fine(x) = g_coarse(x) + d(x),

both Gaussian processes, d from fine runs less the mean of the first process at the same x, so that
the scatter of single coarse runs does not enter. The variance of the prediction is that of the
smooth part of the first and of a run of the second, times the mean squared error of leaving coarse
runs out in units of the process's own variance where that exceeds 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.estimation.gaussian_process import GaussianProcess, fit
from inversion.problem.unknown import Unknown

#: Width of the linear part, in standard deviations of the measurement.
LINEAR_STD = 5.0
#: A number needs so many runs that could be read.
LEAST_RUNS = 20
#: Pairs at different spacings that a correction needs.
LEAST_PAIRS = 4
#: Points predicted at once; bounds the memory.
CHUNK = 4096


@dataclass(frozen=True)
class Warp:
    """The scale on which a number is emulated: arsinh about a middle; width None: as it is."""

    middle: float = 0.0
    width: float | None = None

    def of(self, y: np.ndarray) -> np.ndarray:
        """The scale's value of a number."""
        return y if self.width is None else np.arcsinh((y - self.middle) / self.width)

    def back(self, g: np.ndarray) -> np.ndarray:
        """The number of a scale's value."""
        return g if self.width is None else self.middle + self.width * np.sinh(g)

    def slope(self, g: np.ndarray) -> np.ndarray:
        """Change of the number with the scale's value."""
        return np.ones_like(g) if self.width is None else self.width * np.cosh(g)


@dataclass(frozen=True)
class Emulated:
    """One number.

    Attributes:
        name: of the number.
        warp: its scale.
        coarse: the process of the coarse runs; of all runs where there is one spacing.
        runs: places of its runs among all, (n,).
        correction: the process of fine less coarse; None: there is none.
        inflation: factor of the variance, at least 1.
    """

    name: str
    warp: Warp
    coarse: GaussianProcess
    runs: np.ndarray
    correction: GaussianProcess | None
    inflation: float

    def predict(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation, (s,) each, in the number's unit, at scaled (s, q)."""
        mean, variance = self.coarse.predict(points, with_noise=self.correction is None)
        if self.correction is not None:
            more, own = self.correction.predict(points)
            mean, variance = mean + more, variance + own
        std = np.sqrt(self.inflation * variance)
        return self.warp.back(mean), self.warp.slope(mean) * std

    def left_out(self) -> np.ndarray:
        """Error of the coarse process at each of its runs without that run, (n,)."""
        truth = self.coarse.predict(self.coarse.points)[0]  # a slope is enough here
        return self.warp.slope(truth) * self.coarse.left_out


@dataclass(frozen=True)
class Emulator:
    """All numbers over all unknowns."""

    unknowns: Sequence[Unknown]
    numbers: Sequence[Emulated]

    @property
    def names(self) -> list[str]:
        """Of the numbers, (k,)."""
        return [number.name for number in self.numbers]

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """Scaled unknowns (s, q) of values (s, q)."""
        return scaled(self.unknowns, values)

    def predict(
        self, values: np.ndarray, places: Sequence[int] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Means and standard deviations, (s, k) each.

        Args:
            values: of the unknowns, (s, q).
            places: of the numbers wanted; None: all.
        """
        wanted = range(len(self.numbers)) if places is None else places
        mean = np.empty((len(values), len(wanted)))
        std = np.empty_like(mean)
        for first in range(0, len(values), CHUNK):
            part = slice(first, first + CHUNK)
            points = self.scaled(values[part])
            for column, place in enumerate(wanted):
                mean[part, column], std[part, column] = self.numbers[place].predict(points)
        return mean, std


def scaled(unknowns: Sequence[Unknown], values: np.ndarray) -> np.ndarray:
    """Scaled unknowns (s, q) of values (s, q)."""
    return np.stack([one.scaled(values[:, k]) for k, one in enumerate(unknowns)], axis=1)


def make_emulator(
    unknowns: Sequence[Unknown],
    names: Sequence[str],
    warps: Sequence[Warp],
    values: np.ndarray,
    coarse: np.ndarray,
    fine: np.ndarray | None = None,
) -> Emulator:
    """The emulator of runs.

    Args:
        unknowns: (q,).
        names: of the numbers, (k,).
        warps: scales of the numbers, (k,).
        values: of the unknowns, (n, q).
        coarse: numbers of the coarse runs, (n, k); NaN: not read.
        fine: numbers at the spacing of the answer, (n, k); NaN: not run. None: one spacing.

    Raises:
        ValueError: a number with too few runs.
    """
    points = scaled(unknowns, values)
    numbers = []
    for place, (name, warp) in enumerate(zip(names, warps, strict=True)):
        runs = np.flatnonzero(np.isfinite(coarse[:, place]))
        if len(runs) < LEAST_RUNS:
            raise ValueError(
                f"{name}: only {len(runs)} runs could be read, {LEAST_RUNS} are needed"
            )
        process = fit(points[runs], warp.of(coarse[runs, place]))
        correction, score = None, process.left_out / process.left_out_std
        if fine is not None:
            paired = np.flatnonzero(np.isfinite(fine[:, place]))
            if len(paired) >= LEAST_PAIRS:
                smooth, _ = process.predict(points[paired])
                correction = fit(points[paired], warp.of(fine[paired, place]) - smooth)
        inflation = max(1.0, float(np.mean(score**2)))
        numbers.append(Emulated(name, warp, process, runs, correction, inflation))
    return Emulator(tuple(unknowns), tuple(numbers))
