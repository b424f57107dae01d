"""The base model of a section, simulated once at many strengths.

Whatever is hidden, the base model that is refitted to it is one of the same family. So its runs,
and the runs that tell its own error, are made once for each section, and every lambda is read from
them (`benchmarks.hidden_effects.making.detectability`).

One parameter, the strength, has no prior and is known along its whole range; the others have
priors and stay near them, where a derivative is enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.detectability import Curve
from benchmarks.hidden_effects.making.laboratory import Laboratory, Request
from benchmarks.hidden_effects.making.sections import Section
from diagnosis.options import Options
from geometry.survey.measured import Deposit
from inversion.estimation.covariance import covariance, known, mean_of
from pipeline.cli import InputError

#: Levels of the strength between its bounds, equally spaced in its logarithm.
LEVELS = 20
#: Replicates, their jitter, the second transfer scheme and the finer cells behind the covariance.
REPLICATES, JITTER, TRANSFER, FINER = 8, 0.5, "flip", 2.0
#: Of the judge: how it corrects for the cells, and how well.
JUDGE = Options()
#: Steps to both sides of the prior mean for a derivative, fitted units; runs on each side.
STEP, PAIRS = 1.5, 4
#: A survey's places are those of the nearest toe on this lattice [m]: curves are read once.
LATTICE = 5.0


@dataclass
class Read:
    """A deposit, and what it reads by the fullest survey in addition to the profile.

    The frames of the run are let go once its histories have been read.
    """

    deposit: Deposit
    rest: np.ndarray

    @classmethod
    def of(cls, section: Section, deposit: Deposit | None) -> Read | None:
        """None where there is no deposit, or where it cannot be read."""
        if deposit is None:
            return None
        foot = section.scene.foot(section.survey.side)
        entries = surveys.entries_of(section, surveys.SURVEYS[-1], foot)
        _, *rest = entries  # the first is the profile
        try:
            values = surveys.reading(rest, deposit)
        except ValueError:
            return None
        return cls(replace(deposit, positions=None, time=None), values)

    def by(self, section: Section, survey: str, places: np.ndarray) -> np.ndarray:
        """All measurements of a survey (m,); NaN where the profile cannot be read."""
        entries = surveys.with_values(section, survey, places, None)
        profile, *rest = entries
        others = self.rest[: sum(len(entry.values) for entry in rest)]
        try:
            return np.concatenate([profile.observe(self.deposit), others])
        except ValueError:
            return np.full(len(places) + len(others), np.nan)


@dataclass(frozen=True)
class Level:
    """Runs at one strength; None where a run failed.

    Attributes:
        u: fitted strength.
        own: without jitter; transfer: by the other scheme.
        finer: with finer cells, of several jitters.
        replicates: with jitters.
        moved: for each other parameter, replicates with it lower and higher.
    """

    u: float
    own: Read | None
    transfer: Read | None
    finer: list[Read | None]
    replicates: list[Read | None]
    moved: list[tuple[list[Read | None], list[Read | None]]]


@dataclass
class BaseModel:
    """The base model of a section along its strength.

    Attributes:
        section: the section.
        levels: runs at ascending strengths.
    """

    section: Section
    levels: list[Level]
    _curves: dict[tuple[str, float], Curve] = field(default_factory=dict)

    @classmethod
    def simulate(
        cls,
        laboratory: Laboratory,
        section: Section,
        on_level: Callable[[int, int], None] = lambda done, total: None,
    ) -> BaseModel:
        """Make the runs.

        Args:
            laboratory: that simulates.
            section: the section.
            on_level: called with the number of levels done and in all.

        Raises:
            InputError: not exactly one parameter of the section is without a prior.
        """
        strength = strength_of(section)
        parameters = section.parameters
        low, high = parameters.fitted_low[strength], parameters.fitted_high[strength]
        middle = parameters.to_fitted(parameters.prior_mean)
        levels = []
        for number, u in enumerate(np.linspace(low, high, LEVELS), start=1):
            x = middle.copy()
            x[strength] = u
            levels.append(_level(laboratory, section, x, strength))
            on_level(number, LEVELS)
        return cls(section, levels)

    def split(self, values: np.ndarray) -> tuple[float, np.ndarray]:
        """Fitted strength, and the others less their prior means (q,), of parameters (p,)."""
        parameters = self.section.parameters
        strength = strength_of(self.section)
        x = parameters.to_fitted(values)
        return float(x[strength]), np.delete(
            x - parameters.to_fitted(parameters.prior_mean), strength
        )

    def joined(self, u: float, held: np.ndarray) -> np.ndarray:
        """Parameters (p,) in outside units; the inverse of `split`."""
        parameters = self.section.parameters
        strength = strength_of(self.section)
        middle = np.delete(parameters.to_fitted(parameters.prior_mean), strength)
        return parameters.to_values(np.insert(middle + held, strength, u))

    def places(self, survey: str, toe_x: float) -> np.ndarray:
        """Places of the profile (n,) [m] for a deposit that ends near `toe_x` [m]."""
        return surveys.profile_places(self.section, LATTICE * round(toe_x / LATTICE))

    def curve(self, survey: str, toe_x: float) -> Curve:
        """What a survey of a slide that ends near `toe_x` [m] would read along the strength.

        Raises:
            ValueError: it can be read at fewer than four strengths.
        """
        key = (survey, round(toe_x / LATTICE))
        if key not in self._curves:
            self._curves[key] = self._curve(survey, self.places(survey, toe_x))
        return self._curves[key]

    def _curve(self, survey: str, places: np.ndarray) -> Curve:
        entries = surveys.with_values(self.section, survey, places, None)
        own_error = surveys.covariance_of(entries)

        def read(one: Read | None) -> np.ndarray:
            missing = np.full(len(own_error), np.nan)
            return missing if one is None else one.by(self.section, survey, places)

        rows = []
        for level in self.levels:
            replicates = np.array([read(one) for one in level.replicates])
            halves = np.array([mean_of(replicates[k::2]) for k in (0, 1)])
            slopes = np.array([
                (mean_of([read(one) for one in high]) - mean_of([read(one) for one in low]))
                / (2.0 * STEP)
                for low, high in level.moved
            ]).reshape(len(level.moved), len(own_error)).T  # fmt: skip
            if not (np.isfinite(halves).all() and np.isfinite(slopes).all()):
                continue
            own = read(level.own)
            finer = known(mean_of([read(one) for one in level.finer]) - mean_of(replicates))
            error = covariance(
                np.zeros_like(own_error),
                replicates=replicates,
                synthetic=True,
                transfer=read(level.transfer) - own,
                finer=finer,
                factor=JUDGE.finer_share_std,
                finer_noise=JUDGE.finer_noise,
            ).total
            rows.append((level.u, halves, slopes, error, JUDGE.finer_share * finer))
        if len(rows) < 4:
            raise ValueError(f"{self.section.name}: {survey}: read at {len(rows)} strengths only")
        u, halves, slopes, error, missing = (np.array(column) for column in zip(*rows, strict=True))
        return Curve(
            u, halves.transpose(1, 0, 2), _smoothed(slopes), error, own_error, _smoothed(missing)
        )


def strength_of(section: Section) -> int:
    """Place of the strength among the parameters of a section.

    Raises:
        InputError: not exactly one parameter is without a prior.
    """
    free = np.flatnonzero(~section.parameters.has_prior)
    if len(free) != 1:
        raise InputError(
            f"{section.folder}: inversion.yaml: {len(free)} parameters without prior; "
            "a section of the benchmark has one, its strength"
        )
    return int(free[0])


def _level(laboratory: Laboratory, section: Section, x: np.ndarray, strength: int) -> Level:
    """Runs at fitted parameters (p,)."""

    def values(change: np.ndarray) -> tuple[float, ...]:
        return tuple(section.parameters.to_values(x + change).tolist())

    def jittered(change: np.ndarray, number: int) -> list[Request]:
        return [Request(values(change), jitter=JITTER, seed=k) for k in range(1, number + 1)]

    nothing = np.zeros(len(x))
    finer = [
        replace(request, spacing_factor=1.0 / FINER)
        for request in jittered(nothing, JUDGE.finer_runs)
    ]
    requests = [
        Request(values(nothing)),
        Request(values(nothing), transfer=TRANSFER),
        *finer,
        *jittered(nothing, REPLICATES),
    ]
    others = [place for place in range(len(x)) if place != strength]
    for place in others:
        for sign in (-1.0, 1.0):
            requests += jittered(sign * STEP * np.eye(len(x))[place], PAIRS)
    found = [Read.of(section, one) for one in laboratory.deposits(section, requests)]
    laboratory.forget()
    own, transfer, *rest = found
    fine, rest = rest[: len(finer)], rest[len(finer) :]
    replicates, rest = rest[:REPLICATES], rest[REPLICATES:]
    moved = []
    for _ in others:
        moved.append((rest[:PAIRS], rest[PAIRS : 2 * PAIRS]))
        rest = rest[2 * PAIRS :]
    return Level(float(x[strength]), own, transfer, fine, replicates, moved)


def _smoothed(rows: np.ndarray) -> np.ndarray:
    """Rows (n, ...) with weights 1, 2, 1 over neighbouring levels: few runs have shown them."""
    padded = np.concatenate([rows[:1], rows, rows[-1:]])
    return 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
