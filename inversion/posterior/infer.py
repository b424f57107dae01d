"""The whole posterior, stage by stage: coarse runs, refined where it matters, corrected, sampled.

    coarse runs over the whole prior -> emulator
    -> coarse runs where the posterior is -> emulator
    -> pairs of coarse and fine runs there -> corrected emulator
    -> other ways to simulate, as errors
    -> nested sampling

Runs come from a store that keeps them by content and every draw has its seed, so a stage that was
finished costs nothing when it is started again.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from inversion.engines.small_cells import SmallCells
from inversion.estimation.data import Targets
from inversion.posterior.emulator import LEAST_RUNS, LINEAR_STD, Emulator, Warp, make_emulator
from inversion.posterior.likelihood import Likelihood
from inversion.posterior.runs import EmulatedModel
from inversion.posterior.sampling import Sampled, nested, spread_out, tempered
from inversion.problem.unknown import Unknown
from pipeline.cli import WorkFailed
from pipeline.config import PosteriorSettings
from pipeline.progress import Watch
from pipeline.ties import ranked

#: Prior draws that look for the posterior between the stages: a power of 2.
SCOUTS = 2**14
#: Draws from which each run of a round is chosen.
CHOICE = 3
#: Rounds of refined and of fine runs; each is placed by what the rounds before have found.
ROUNDS = 3
#: Runs in the middle of the posterior of which another way to simulate is tried, until one ends.
TRIES = 3
#: More coarse runs than this share may not fail.
MOST_FAILED = 0.5


AnyModel = TypeVar("AnyModel", bound=EmulatedModel)


@dataclass
class Inference(Generic[AnyModel]):
    """A posterior in the making; what it has found so far.

    Attributes:
        model: what is emulated.
        targets: what was measured, (m,).
        settings: numbers of runs and draws.
        watch: called for each stage.
        values: of the unknowns of all runs, (n, q).
        coarse: their numbers, (n, k); those of the answer's spacing where there is one spacing.
        fine: the same at the spacing of the answer, (n, k), NaN: not run.
        read: (all numbers of the model,) bool: enough runs could be read; these are the k numbers.
        otherwise: change of the numbers with each other way to simulate, (k,) by name.
        engine_std: of the engine's own error of the numbers, (k,), in the middle of the posterior.
        cells: what the size of the cells makes of the strengths there; None: nothing.
        remarks: on what could not be found.
        timings: of the stages [s].
    """

    model: AnyModel
    targets: Targets
    settings: PosteriorSettings
    watch: Watch = field(default_factory=Watch)
    values: np.ndarray = field(init=False)
    coarse: np.ndarray = field(init=False)
    fine: np.ndarray = field(init=False)
    read: np.ndarray = field(init=False)
    otherwise: dict[str, np.ndarray] = field(default_factory=dict)
    engine_std: np.ndarray = field(init=False)
    cells: SmallCells | None = None
    remarks: list[str] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.values = np.zeros((0, len(self.unknowns)))
        self.read = np.ones(len(self.model.names), dtype=bool)
        self.coarse = np.zeros((0, len(self.names)))
        self.fine = np.zeros((0, len(self.names)))
        self.engine_std = np.zeros(len(self.names))

    @property
    def unknowns(self) -> list[Unknown]:
        """(q,)."""
        return list(self.model.unknowns)

    @property
    def names(self) -> list[str]:
        """Of the numbers, (k,)."""
        return [name for name, read in zip(self.model.names, self.read, strict=True) if read]

    @property
    def unread(self) -> list[str]:
        """Numbers that are left out: too few runs could be read."""
        return [name for name in self.model.names if name not in self.names]

    def run(self) -> Inferred[AnyModel]:
        """All stages.

        Raises:
            WorkFailed: more than half of the coarse runs failed.
        """
        settings = self.settings
        runs = {"coarse runs": settings.coarse_runs, "refined runs": settings.refined_runs}
        if self.model.two_fidelities:
            runs["fine runs"] = 2 * settings.fine_runs
        self.watch.plan(runs)
        with self._stage("coarse runs"):
            self._add(design(self.unknowns, settings.coarse_runs, settings.seed))
            self._check()
        with self._stage("refined runs"):
            for number, part in enumerate(_parts(settings.refined_runs), start=1):
                self._add(self._where_it_matters(part, number))
        if self.model.two_fidelities:
            with self._stage("fine runs"):
                for number, part in enumerate(_parts(settings.fine_runs), start=ROUNDS + 1):
                    self._add(self._where_it_matters(part, number), paired=True)
        with self._stage("other ways to simulate"):
            self._simulate_otherwise()
        with self._stage("sampling"):
            return self._sampled()

    # --- runs ---

    def _add(self, values: np.ndarray, *, paired: bool = False) -> None:
        """Run values (n, q), with `paired` at both spacings."""
        if not len(values):
            return
        values = self.model.drawable(values)
        coarse = self.model.run(values, coarse=self.model.two_fidelities)[:, self.read]
        fine = np.full_like(coarse, np.nan)
        if paired:
            fine = self.model.run(values, coarse=False)[:, self.read]
        self.values = np.concatenate([self.values, values])
        self.coarse = np.concatenate([self.coarse, coarse])
        self.fine = np.concatenate([self.fine, fine])

    def _check(self) -> None:
        fitted = [
            self.names.index(self.targets.names[k]) for k in np.flatnonzero(self.targets.fitted)
        ]
        failed = float(np.isnan(self.coarse[:, fitted]).any(axis=1).mean())
        if failed > MOST_FAILED:
            raise WorkFailed(
                f"posterior: {100 * failed:.0f} % of the runs over the whole prior failed; "
                "narrow the bounds of the parameters, or see `flowslide invert` for the reason"
            )
        enough = np.isfinite(self.coarse).sum(axis=0) >= LEAST_RUNS
        enough[fitted] = True
        self.coarse, self.fine, self.read = self.coarse[:, enough], self.fine[:, enough], enough
        self.engine_std = np.zeros(len(self.names))

    def _where_it_matters(self, number: int, seed: int) -> np.ndarray:
        """Values (number, q) spread out over the posterior as it is known so far."""
        if number == 0:
            return np.zeros((0, len(self.unknowns)))
        random = np.random.default_rng([self.settings.seed, seed])
        scouts = design(self.unknowns, SCOUTS, self.settings.seed + seed)
        likelihood = self.likelihood()
        chosen = np.unique(tempered(likelihood(scouts), SCOUTS // 8, random))
        # Of all draws the farthest apart would be the outermost alone.
        found = scouts[random.permutation(chosen)[: CHOICE * number]]
        return found[spread_out(likelihood.emulator.scaled(found), number)]

    def _simulate_otherwise(self) -> None:
        if len(self.values) == 0:
            return
        fitted = [
            self.names.index(self.targets.names[k]) for k in np.flatnonzero(self.targets.fitted)
        ]
        middle = self._in_the_middle()
        self.otherwise, failed = {}, set[str]()
        for place in middle:
            changes = self.model.simulated_otherwise(self.values[place])
            for name, change in changes.items():
                if name not in self.otherwise and np.isfinite(change[self.read][fitted]).all():
                    self.otherwise[name] = np.nan_to_num(change[self.read])
            failed = changes.keys() - self.otherwise.keys()
            if not failed:
                break
        self.remarks += [
            f"{name}: could not be compared; its error is not known and left out"
            for name in sorted(failed)
        ]
        own = self.model.error_std(self.values[middle[0]])[self.read]
        if not np.isfinite(own[fitted]).all():
            self.remarks.append("the engine's own error could not be found and is left out")
        self.engine_std = np.nan_to_num(own)
        self.cells = self.model.cells_at(self.values[middle[0]])
        if self.cells is not None and not self.cells.known:
            self.remarks.append(self.cells.words)

    def _in_the_middle(self) -> list[int]:
        """Runs in the middle of the posterior, the first the best: others where that one fails."""
        paired = np.isfinite(self.fine).any(axis=1)
        known = np.isfinite(self.coarse).all(axis=1)
        likely = np.where(known, self.likelihood()(self.values), -np.inf)
        others = ranked(range(len(likely)), likely.__getitem__)[:TRIES]
        # Rounds are spread out from the middle of the posterior: so the first of the pairs, or of
        # the refined runs, lies there.
        first = int(np.argmax(paired)) if paired.any() else self.settings.coarse_runs
        if first >= len(self.values):
            return others
        return [first, *(place for place in others if place != first)][:TRIES]

    # --- the posterior ---

    def likelihood(self) -> Likelihood:
        """By all runs so far."""
        return Likelihood(self.emulator(), self.targets, self.errors())

    def emulator(self) -> Emulator:
        """Of all runs so far.

        Raises:
            WorkFailed: too few runs could be read.
        """
        fine = self.fine if self.model.two_fidelities else None
        try:
            return make_emulator(
                self.unknowns,
                self.names,
                warps(self.names, self.targets),
                self.values,
                self.coarse,
                fine,
            )
        except ValueError as error:
            raise WorkFailed(f"posterior: {error}") from None

    def errors(self) -> np.ndarray:
        """Covariance of all errors but the emulator's, (m, m).

        Of the survey, what the model is granted, other ways to simulate, and the engine's own,
        which is independent from number to number.
        """
        names = self.names
        total = self.targets.covariance.copy()
        for change in self.otherwise.values():
            by_name = dict(zip(names, change, strict=True))
            error = np.array([by_name.get(name, 0.0) for name in self.targets.names])
            total += np.outer(error, error)
        own = dict(zip(names, self.engine_std, strict=True))
        return total + np.diag([own.get(name, 0.0) ** 2 for name in self.targets.names])

    def shared_errors(self) -> np.ndarray:
        """Covariance of the errors of other ways to simulate and of the engine, (k, k)."""
        ways = [np.outer(change, change) for change in self.otherwise.values()]
        return sum(ways, np.diag(self.engine_std**2))

    def _sampled(self) -> Inferred[AnyModel]:
        likelihood, settings = self.likelihood(), self.settings
        sampled = sample(
            likelihood, draws=settings.draws, live_points=settings.live_points, seed=settings.seed
        )
        return Inferred(self, likelihood, sampled)

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        with self.watch.stage(name):
            yield
        self.timings[name] = time.perf_counter() - start


@dataclass(frozen=True)
class Inferred(Generic[AnyModel]):
    """A posterior that was found.

    Attributes:
        inference: what it was made of.
        likelihood: by the final emulator.
        sampled: draws in the unit cube, and the evidence.
    """

    inference: Inference[AnyModel]
    likelihood: Likelihood
    sampled: Sampled

    @cached_property
    def values(self) -> np.ndarray:
        """Posterior draws of the unknowns, (s, q)."""
        return at_shares(self.likelihood.emulator.unknowns, self.sampled.shares)

    @cached_property
    def told(self) -> np.ndarray:
        """The same with strengths in small cells, whose share of the error is drawn, (s, q).

        What a prior alone says of a strength the cells do not change.
        """
        cells, found = self.inference.cells, self.values.copy()
        if cells is None:
            return found
        random = np.random.default_rng([self.inference.settings.seed, 11])
        log = np.log(cells.factor) + cells.log_std * random.standard_normal(len(found))
        for place, unknown in enumerate(self.likelihood.emulator.unknowns):
            if unknown.strength:
                found[:, place] *= np.exp(self._known_by_data(place) * log)
        return found

    def _known_by_data(self, place: int) -> float:
        """Share of an unknown's prior variance that the data take off; 1: it had bounds alone."""
        unknown = self.likelihood.emulator.unknowns[place]
        if unknown.normal is None:
            return 1.0
        after, before = (
            np.var(unknown.counts(draws[:, place])) for draws in (self.values, self.prior)
        )
        return float(np.clip(1.0 - after / max(before, 1e-300), 0.0, 1.0))

    @cached_property
    def prior(self) -> np.ndarray:
        """Prior draws of the unknowns, (s, q)."""
        unknowns = self.likelihood.emulator.unknowns
        return design(unknowns, len(self.sampled.shares), self.inference.settings.seed + 7)

    @property
    def predicted(self) -> np.ndarray:
        """Numbers of a run at the posterior draws, without the emulator's own error, (s, k)."""
        return self._after[0]

    @cached_property
    def _after(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the numbers at the posterior draws, (s, k)."""
        return self.likelihood.emulator.predict(self.values)

    @cached_property
    def _before(self) -> tuple[np.ndarray, np.ndarray]:
        """The same at the prior draws."""
        return self.likelihood.emulator.predict(self.prior)

    @property
    def emulator_error(self) -> np.ndarray:
        """Root mean square error of the emulator over the posterior draws, (k,)."""
        return np.sqrt(np.mean(self._after[1] ** 2, axis=0))

    def replicated(self, *, prior: bool = False) -> np.ndarray:
        """Numbers of a run with all errors of the model, but none of the survey, (s, k).

        After the data the errors are those that the fitted numbers leave possible: an error that
        all numbers share is known from one of them. What a limit says of it is left out.
        """
        mean, std = self._before if prior else self._after
        random = np.random.default_rng([self.inference.settings.seed, 3 + prior])
        error = std * random.standard_normal(mean.shape)
        for change in self.inference.otherwise.values():
            error = error + random.standard_normal((len(error), 1)) * change
        error = error + random.standard_normal(error.shape) * self.inference.engine_std
        return mean + (error if prior else self._given_the_data(mean, std, error, random))

    def _given_the_data(
        self, mean: np.ndarray, std: np.ndarray, error: np.ndarray, random: np.random.Generator
    ) -> np.ndarray:
        """Errors of the model (s, k) drawn without the data, moved to what these leave possible.

        Matheron's rule: with E the covariance of these errors and S that of the survey, an error e
        and a survey's error n drawn from both become e + E_f (E_ff + S)^-1 (residual - e_f - n), f
        the fitted numbers.
        """
        inference, targets = self.inference, self.inference.targets
        fitted = np.flatnonzero(targets.fitted & ~targets.censored)
        at = [inference.names.index(targets.names[k]) for k in fitted]
        part = np.ix_(fitted, fitted)
        whole, shared = inference.errors()[part], inference.shared_errors()[:, at]
        root = np.linalg.cholesky(targets.covariance[part])
        survey = random.standard_normal((len(mean), len(fitted))) @ root.T
        left = targets.measured[fitted] - mean[:, at] - error[:, at] - survey
        found = error.copy()
        for one in np.array_split(np.arange(len(mean)), 1 + len(mean) * len(fitted) ** 2 // 10**7):
            total = whole + std[one][:, at, None] ** 2 * np.eye(len(fitted))
            weight = np.linalg.solve(total, left[one][..., None])[..., 0]
            found[one] += weight @ shared.T
            found[np.ix_(one, np.array(at))] += std[one][:, at] ** 2 * weight
        return found


def _parts(number: int) -> list[int]:
    """The runs of each round."""
    return [number // ROUNDS + (place < number % ROUNDS) for place in range(ROUNDS)]


def sample(likelihood: Likelihood, *, draws: int, live_points: int, seed: int) -> Sampled:
    """Draws of a posterior by nested sampling."""
    unknowns = likelihood.emulator.unknowns

    def at(share: np.ndarray) -> float:
        return float(likelihood(at_shares(unknowns, share[None]))[0])

    return nested(at, len(unknowns), draws=draws, live_points=live_points, seed=seed)


def warps(names: list[str], targets: Targets) -> list[Warp]:
    """The scale of each number: about what was measured, or as it is."""
    std = np.sqrt(np.diag(targets.covariance))
    measured = {
        name: Warp(float(value), LINEAR_STD * float(one))
        for name, value, one in zip(targets.names, targets.measured, std, strict=True)
    }
    return [measured.get(name, Warp()) for name in names]


def design(unknowns: Sequence[Unknown], number: int, seed: int) -> np.ndarray:
    """Values (number, q) that fill the prior evenly: a scrambled Sobol sequence."""
    from scipy.stats import qmc  # takes half a second to import

    power = int(np.ceil(np.log2(max(number, 1))))
    shares = qmc.Sobol(len(unknowns), seed=seed).random_base2(power)[:number]
    return at_shares(unknowns, shares)


def at_shares(unknowns: Sequence[Unknown], shares: np.ndarray) -> np.ndarray:
    """Values (s, q) at shares of the prior probability (s, q)."""
    return np.stack([one.at(shares[:, k]) for k, one in enumerate(unknowns)], axis=1)
