"""The stages of a posterior: design, coarse runs, fine runs, sampling.

A quarter of the coarse runs are spread over the prior; the others go, in three rounds, where the
posterior of those before lies, widened; fine runs repeat some of the last. All runs come from the
run store: what was simulated before costs nothing, and a killed analysis continues.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import qmc

from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.engines.setup import Setup
from inversion.estimation.data import Targets
from inversion.posterior.emulator import Emulator, fit_emulator
from inversion.posterior.likelihood import (
    Correction,
    EmulatedLikelihood,
    correction_of,
    no_correction,
)
from inversion.posterior.sampling import Samples, sample
from inversion.posterior.shares import Share, sobol_shares
from inversion.posterior.unknowns import PriorSpace
from inversion.problem.forward import Prediction
from pipeline.cli import InputError, WorkFailed
from pipeline.config import PosteriorSettings
from pipeline.progress import Watch

ROUNDS = 4
"""Of coarse runs, the first over the prior."""

WIDER = 1.3
"""Runs of a round are spread by this factor more than the posterior of those before."""

FAR = 6.0
"""Fitted numbers that miss by more standard deviations say no more than that they miss by so many.
"""

LEAST_NEAR = 10
"""Fewer runs near the data do not say where the extremes begin."""

MOST_FAILED = 0.25
"""Of the coarse runs no larger share may fail."""

LEAST_RUNS = 16
"""Coarse runs for each coordinate, at least: those of the first round fit a trend of 3 d + 1."""


@dataclass(frozen=True)
class Found:
    """A posterior and what it was made of.

    Attributes:
        x: (n, d) points of the coarse runs that finished; y (n, m + p) their numbers, the effective
            stress of every parameter's zones last [kPa].
        y: the same runs.
        emulator: of the numbers.
        likelihood: of the survey.
        samples: the posterior.
        predicted: (s, m) draws of what a survey would have measured.
        sigma_v0_kpa: (s, p) effective vertical stress before failure; NaN where it is not known.
        shares: what moves the answer.
        coarse_m: spacing of the coarse runs; fine_m: of the fine ones.
        fine_m: the case's own.
        failed: coarse runs that failed.
    """

    x: np.ndarray
    y: np.ndarray
    emulator: Emulator
    likelihood: EmulatedLikelihood
    samples: Samples
    predicted: np.ndarray
    sigma_v0_kpa: np.ndarray
    shares: list[Share]
    coarse_m: float
    fine_m: float
    failed: int


@dataclass
class PosteriorAnalysis:
    """A posterior under way.

    Attributes:
        space: what varies.
        store: where runs are kept.
        settings: how many runs and draws.
        watch: told of every stage.
        remarks: what a reader of the result should know.
    """

    space: PriorSpace
    store: RunStore
    settings: PosteriorSettings
    watch: Watch = field(default_factory=Watch)
    remarks: list[str] = field(default_factory=list)
    failed: int = 0
    undrawn: int = 0

    def __post_init__(self) -> None:
        if self.settings.runs < LEAST_RUNS * (self.space.d + 1):
            raise InputError(
                f"posterior.runs {self.settings.runs}: {self.space.d} unknowns need at least "
                f"{LEAST_RUNS * (self.space.d + 1)}"
            )

    @property
    def targets(self) -> Targets:
        """The measurements."""
        return self.space.case.setup.targets

    @property
    def coarse_m(self) -> float:
        """Spacing of the coarse runs [m]."""
        return self.space.case.scene.spacing * self.settings.coarse_factor

    def run(self) -> Found:
        """All stages."""
        settings = self.settings
        rounds = [len(part) for part in np.array_split(np.arange(settings.runs), ROUNDS)]
        fine = settings.fine_runs if settings.coarse_factor > 1.0 else 0
        self.watch.plan({
            "coarse runs": settings.runs, "fine runs": fine,
            "other ways to simulate": len(self.space.alternatives) + 1, "sampling": 1,
        })  # fmt: skip
        with self.watch.stage("coarse runs"):
            x, y = self._runs(self._spread(rounds[0]))
            for seed, number in enumerate(rounds[1:], start=1):
                rough = self._rough(x, y, seed)
                more_x, more_y = self._runs(self._near(rough, number, seed))
                x, y = np.concatenate([x, more_x]), np.concatenate([y, more_y])
        with self.watch.stage("fine runs"):
            emulator = self._emulator(x, y)
            correction = self._correction(emulator, more_x, fine)
        with self.watch.stage("other ways to simulate"):
            alternatives = self._alternatives(rough.x.mean(axis=0))
        with self.watch.stage("sampling"):
            likelihood = EmulatedLikelihood(
                self.targets, correction.applied(emulator), correction, alternatives
            )
            samples = self._sample(likelihood, ROUNDS)
            generator = np.random.default_rng(settings.seed)
            return Found(
                x=x, y=y, emulator=likelihood.emulator, likelihood=likelihood, samples=samples,
                predicted=likelihood.predictive(samples.x, generator),
                sigma_v0_kpa=self._sigma_v0(x, y, samples.x),
                shares=sobol_shares(self.space, likelihood, seed=settings.seed),
                coarse_m=self.coarse_m, fine_m=self.space.case.scene.spacing, failed=self.failed,
            )  # fmt: skip

    # --- points ---

    def _spread(self, number: int) -> np.ndarray:
        """Points spread evenly over the prior, (number, d)."""
        sequence = qmc.Sobol(self.space.d, scramble=True, rng=self.settings.seed)
        power = int(np.ceil(np.log2(number)))
        return self.space.from_shares(sequence.random_base2(power)[:number])

    def _near(self, rough: Samples, number: int, seed: int) -> np.ndarray:
        """Points spread like a rough posterior, but wider, (number, d)."""
        drawn = rough.x[np.linspace(0, len(rough.x) - 1, number).astype(int)]
        noise = np.random.default_rng((self.settings.seed, seed)).standard_normal(drawn.shape)
        spread = np.sqrt(WIDER**2 - 1.0) * np.std(rough.x, axis=0)
        return self.space.clipped(drawn + noise * spread)

    # --- runs ---

    def _runs(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coarse runs at points (n, d): the points and numbers of those that finished."""
        found = self._predictions(x, self.coarse_m)
        kept = np.array([one is not None and not one.failed for one in found], bool)
        reasons = [one.reason for one in found if one is not None and one.failed]
        self.failed += len(reasons)
        self.undrawn += int(np.sum(~kept)) - len(reasons)
        if len(reasons) > MOST_FAILED * len(x):
            raise WorkFailed(f"{len(reasons)} of {len(x)} simulations failed: {reasons[0]}")
        if kept.sum() < len(x) / 2:
            raise WorkFailed(
                f"{np.sum(~kept)} of {len(x)} sections cannot be drawn: the sensitivities move "
                "boundaries too far"
            )
        numbers = [_numbers(one) for one in found if one is not None and not one.failed]
        return x[kept], np.array(numbers)

    def _predictions(
        self, x: np.ndarray, spacing_m: float, changes: Sequence[Setup] | None = None
    ) -> list[Prediction | None]:
        """Predictions at points (n, d); None where the section cannot be drawn."""
        requests: list[tuple[MPMEngine, np.ndarray] | None] = []
        for place, point in enumerate(x):
            try:
                setup = self.space.setup(point, spacing_m)
                if changes is not None:
                    setup = replace(setup, settings=changes[place].settings)
                requests.append((MPMEngine(setup, self.store), self.space.values(point)))
            except InputError:
                requests.append(None)
        asked = [one for one in requests if one is not None]
        if not asked:
            return [None] * len(x)
        answers = iter(asked[0][0].predict_each(asked))
        return [None if one is None else next(answers) for one in requests]

    def _correction(self, emulator: Emulator, x: np.ndarray, number: int) -> Correction:
        """From the emulator to fine runs, by fine runs at `number` of the points (n, d)."""
        m = len(self.targets.measured)
        if number == 0:
            return no_correction(m)
        points = x[np.unique(np.linspace(0, len(x) - 1, number).astype(int))]
        found = self._predictions(points, self.space.case.scene.spacing)
        kept = np.array([one is not None and not one.failed for one in found], bool)
        if kept.sum() < 3:
            raise WorkFailed(f"{np.sum(~kept)} of {len(points)} fine simulations failed")
        fine = [one.values for one in found if one is not None and not one.failed]
        return correction_of(emulator(points[kept])[0], np.array(fine))

    def _alternatives(self, centre: np.ndarray) -> np.ndarray:
        """Differences (a, m) that other ways to simulate make at the centre of the posterior."""
        changed = [
            side.setup for one in self.space.alternatives for side in self.space.case.sides(one)
        ]
        m = len(self.targets.measured)
        if not changed:
            return np.zeros((0, m))
        setups = [self.space.case.setup, *changed]
        points = np.tile(centre, (len(setups), 1))
        found = self._predictions(points, self.coarse_m, setups)
        base, *others = found
        if base is None or base.failed:
            raise WorkFailed("the simulation at the centre of the posterior failed")
        whole = [one for one in others if one is not None and not one.failed]
        if len(whole) < len(others):
            self.remarks.append(
                f"{len(others) - len(whole)} other ways to simulate failed and are left out"
            )
        return np.array([one.values - base.values for one in whole]).reshape(-1, m)

    # --- numbers ---

    def _emulator(self, x: np.ndarray, y: np.ndarray) -> Emulator:
        """An emulator of coarse runs."""
        scale = np.sqrt(np.diag(self.targets.covariance))
        numbers = self._tamed(y[:, : len(scale)], scale)
        return fit_emulator(x, numbers, scale, self.settings.seed)

    def _rough(self, x: np.ndarray, y: np.ndarray, seed: int) -> Samples:
        """The posterior as the coarse runs so far give it."""
        m = len(self.targets.measured)
        likelihood = EmulatedLikelihood(
            self.targets, self._emulator(x, y), no_correction(m), np.zeros((0, m))
        )
        return self._sample(likelihood, seed, quick=True)

    def _tamed(self, y: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Numbers (n, m) without the extremes that runs far from the data have."""
        fitted = self.targets.fitted
        miss = np.abs(y - self.targets.measured)[:, fitted] / scale[fitted]
        near = y[np.all(miss < FAR, axis=1)]
        if len(near) < LEAST_NEAR:
            return y
        low, high = near.min(axis=0), near.max(axis=0)
        room = 0.5 * (high - low)
        return np.clip(y, low - room, high + room)

    def _sigma_v0(self, x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Effective stress (s, p) [kPa] at the draws (s, d): smooth, so a linear fit holds it."""
        stress = y[:, len(self.targets.measured) :]
        basis = np.column_stack([np.ones(len(x)), x])
        slope = np.linalg.lstsq(basis, stress, rcond=None)[0]
        return np.column_stack([np.ones(len(at)), at]) @ slope

    def _sample(self, likelihood: EmulatedLikelihood, seed: int, *, quick: bool = False) -> Samples:
        settings = self.settings
        return sample(
            likelihood,
            self.space.from_shares,
            self.space.d,
            live=min(settings.live_points, 100) if quick else settings.live_points,
            draws=settings.draws,
            seed=settings.seed + seed,
        )


def _numbers(prediction: Prediction) -> np.ndarray:
    """Numbers of a run, and the effective stress of every parameter's zones."""
    return np.concatenate([prediction.values, prediction.sigma_v0_kpa])
