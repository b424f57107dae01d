"""Measurements as one vector: names, values, covariance, and which of them a fit may use.

In: the measurements of a set and the question. Out: `Targets`, and the same vector read from
points (`read`) by the measurements' own definitions: field data, the material point method and
learned simulators are read by the same lines. `Data` are targets as a fit sees them: weighed by a
covariance, split into what is fitted and what is held out. W with W' W = C^-1 turns differences
into independent numbers of variance 1; it is the symmetric root C^-1/2, which of all choices moves
the numbers least, so that a whitened difference still belongs to the place it comes from.

A series is a measurement of several numbers at ascending places. Windows, neighbours and held-out
blocks are looked for along series; all else is single numbers (`places_of`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Literal, Self, TypeVar

import numpy as np
from scipy.linalg import block_diag

from geometry.survey.measured import Deposit, Measured, Reading
from geometry.survey.quantity import Quantity
from pipeline.cli import InputError

#: How a fit uses a number.
Role = Literal["fitted", "held out", "compared", "constructed"]
#: Kind of axis along which a measurement's numbers lie.
Axis = Literal["x_m", "time_s", "none"]


Entry = TypeVar("Entry", bound=Quantity)


@dataclass(frozen=True)
class Targets(Generic[Entry]):
    """m measured numbers, and how a fit is to use them.

    Attributes:
        entries: the measurements, whose values follow each other in the vector.
        names: of the numbers, (m,); the measurement's name, with the place where it has several.
        measured: (m,) in the unit of each.
        covariance: of the survey's errors and what the model is granted, (m, m).
        roles: of the numbers, (m,).
        met: place of the limit that counts as if it had been measured, so that the end of that
            side is what is found; None: none.
    """

    entries: list[Entry]
    names: list[str]
    measured: np.ndarray
    covariance: np.ndarray
    roles: list[Role]
    met: int | None = None

    @classmethod
    def unmeasured(cls, entries: Sequence[Entry], names: Sequence[str]) -> Self:
        """Readings that nobody measured: they are predicted alone.

        Args:
            entries: the readings.
            names: of all their numbers, (m,).
        """
        count = len(names)
        return cls(list(entries), list(names), np.zeros(count), np.eye(count), ["fitted"] * count)

    @property
    def fitted(self) -> np.ndarray:
        """(m,) bool: enters the fit."""
        return np.array([role == "fitted" for role in self.roles], dtype=bool)

    @property
    def censored(self) -> np.ndarray:
        """(m,) bool: an upper limit that was not exceeded, in place of a measured value."""
        return np.array([self.entries[group].censored for group in self.groups], dtype=bool)

    @property
    def limits_alone(self) -> bool:
        """All that is fitted are limits: every answer on one side is as good."""
        return bool(np.all(self.censored[self.fitted]))

    def kept(self, values: np.ndarray) -> np.ndarray:
        """(..., m) bool: censored numbers whose prediction (..., m) is below the limit."""
        with np.errstate(invalid="ignore"):
            kept = self.censored & (values < self.measured)
        if self.met is not None:
            kept[..., self.met] = False
        return kept

    def counted(self, values: np.ndarray) -> np.ndarray:
        """Predictions (..., m) as a sum of squares counts them: a limit that is kept costs nothing.

        Differences and changes of such predictions are those of the one-sided misfit.
        """
        return np.where(self.kept(values), self.measured, values)

    @property
    def shown(self) -> np.ndarray:
        """(m,) bool: shown in tables and histories; not what was constructed."""
        return np.array([role != "constructed" for role in self.roles], dtype=bool)

    @property
    def groups(self) -> list[int]:
        """For each number the place of its measurement in `entries`, (m,)."""
        return [place for place, entry in enumerate(self.entries) for _ in entry.values]

    def data(self, covariance: np.ndarray | None = None, split: Split | None = None) -> Data:
        """The numbers as a fit sees them.

        Args:
            covariance: C (m, m), the model's own error included; None: the survey's alone.
            split: what is fitted and held out; None: by the roles.
        """
        fitted = self.fitted if split is None else split.fitted
        held = (
            np.array([role == "held out" for role in self.roles])
            if split is None
            else split.held_out
        )
        return Data(
            self.measured,
            self.covariance if covariance is None else covariance,
            np.flatnonzero(fitted),
            np.flatnonzero(held),
            self.censored,
        )

    def named(self, values: np.ndarray, mask: np.ndarray | None = None) -> dict[str, float]:
        """Finite values by name; `mask` (m,) bool chooses, None: all that is shown."""
        chosen = self.shown if mask is None else mask
        return {
            name: float(value)
            for name, value, wanted in zip(self.names, values, chosen, strict=True)
            if wanted and np.isfinite(value)
        }

    def with_values(self, values: Mapping[str, float]) -> Targets[Entry]:
        """The same with other target values, by name of a number.

        Raises:
            InputError: no number of that name.
        """
        measured = self.measured.copy()
        for name, value in values.items():
            if name not in self.names:
                raise InputError(
                    f"targets: no measurement {name!r}; there are {', '.join(self.names)}"
                )
            measured[self.names.index(name)] = value
        return replace(self, measured=measured)


@dataclass(frozen=True)
class Split:
    """Which numbers are fitted, which are held out.

    Attributes:
        fitted: (m,) bool.
        held_out: (m,) bool; the rest is neither (compared only, or constructed).
        words: how it was decided.
    """

    fitted: np.ndarray
    held_out: np.ndarray
    words: str


@dataclass(frozen=True)
class Data:
    """The measurements, their errors, and which of them are fitted.

    Attributes:
        measured: (m,).
        covariance: C, (m, m).
        fitted: places of the fitted numbers, (k,).
        held_out: places of the held-out numbers, (h,).
        censored: (m,) bool: an upper limit that was not exceeded; None: no number is.
        strength_error: share by which the slide's own strengths may differ from those that the
            model needs for it. Predictions are unchanged, because a free strength absorbs the same
            error; it widens the standard deviation of the strengths.
    """

    measured: np.ndarray
    covariance: np.ndarray
    fitted: np.ndarray
    held_out: np.ndarray
    censored: np.ndarray | None = None
    strength_error: float = 0.0

    def silent(self, derivative: np.ndarray) -> np.ndarray:
        """(k,) bool: fitted limits that are kept; none of the unknowns then moves what counts.

        Args:
            derivative: of all predictions as a sum of squares counts them, (m, q).
        """
        if self.censored is None:
            return np.zeros(len(self.fitted), dtype=bool)
        return (self.censored & ~derivative.any(axis=1))[self.fitted]

    @cached_property
    def whitener(self) -> np.ndarray:
        """W = C^-1/2 of the fitted numbers, (k, k)."""
        return symmetric_whitener(self.fitted_covariance)

    @cached_property
    def fitted_covariance(self) -> np.ndarray:
        """C of the fitted numbers, (k, k)."""
        return self.covariance[np.ix_(self.fitted, self.fitted)]

    @property
    def ln_density_at_best(self) -> float:
        """Ln of the density of the fitted numbers where they are met, less its constant."""
        return -0.5 * float(np.linalg.slogdet(self.fitted_covariance)[1])

    def residual(self, prediction: np.ndarray) -> np.ndarray:
        """W (y - f) of the fitted numbers, (k,); predictions are of all numbers, (m,)."""
        return self.whitener @ (self.measured - prediction)[self.fitted]

    def whitened(self, change: np.ndarray) -> np.ndarray:
        """W times changes of all predictions, (m, ...) -> (k, ...)."""
        return self.whitener @ change[self.fitted]

    def noise(self, jitter: np.ndarray, *, least: float = 0.0) -> float:
        """Standardised size of a noise (m, m) in all fitted numbers; `least` of its square."""
        fitted = jitter[np.ix_(self.fitted, self.fitted)]
        return np.sqrt(max(float(np.trace(self.whitener @ fitted @ self.whitener.T)), least))

    @cached_property
    def conditional(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the held-out numbers given the fitted ones: gain (h, k) and covariance (h, h)."""
        own = self.covariance[np.ix_(self.held_out, self.held_out)]
        cross = self.covariance[np.ix_(self.held_out, self.fitted)]
        gain = cross @ self.whitener.T @ self.whitener
        return gain, own - gain @ cross.T


def symmetric_whitener(matrix: np.ndarray) -> np.ndarray:
    """C^-1/2 of a positive definite C (n, n)."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors / np.sqrt(np.maximum(values, 1e-12 * values.max()))) @ vectors.T


def make_targets(
    entries: Sequence[Entry],
    *,
    fit: Sequence[str] | None,
    loss: str,
    source: str,
    use_constructed: bool = False,
) -> Targets[Entry]:
    """Decide which numbers enter the fit.

    Args:
        entries: the measurements of a set.
        fit: their names; None: all that may (with the loss `runout`: all runouts that may).
        loss: runout or misfit.
        source: file for messages.
        use_constructed: let constructed data enter the fit.

    Raises:
        InputError: a name that does not exist or must not enter, or nothing to fit.
    """
    known = {entry.name: entry for entry in entries}
    for name in fit or ():
        _check_may_enter(name, known, loss, source, use_constructed)
    names: list[str] = []
    roles: list[Role] = []
    for entry in entries:
        allowed = fit is None or entry.name in fit
        allowed = allowed and (loss == "misfit" or entry.is_runout)
        for part, held in zip(entry.parts, entry.held_out_values, strict=True):
            names.append(f"{entry.name} {part}".strip())
            roles.append(_role(entry, bool(held), allowed, use_constructed))
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"{source}: two measured numbers would be called {name!r}; give one of the "
                "measurements another name"
            )
    targets = Targets(
        entries=list(entries),
        names=names,
        measured=np.concatenate([entry.values for entry in entries]),
        covariance=block_diag(*[entry.covariance() for entry in entries]),
        roles=roles,
    )
    for entry in entries:
        _check_covariance(entry, source)
    if not targets.fitted.any():
        what = "toe_runout" if loss == "runout" else "measurement"
        raise InputError(
            f"{source}: nothing to fit: no {what} in this set is neither held out nor constructed"
        )
    return targets


def _check_covariance(entry: Quantity, source: str) -> None:
    """Refuse errors that hang together so far that one value follows from the others."""
    try:
        np.linalg.cholesky(entry.covariance())
    except np.linalg.LinAlgError:
        raise InputError(
            f"{source}: {entry.name!r}: its correlation length is so great that its values are "
            "one and the same measurement; give a shorter one, of the order of the profile"
        ) from None


def _role(entry: Quantity, held_out: bool, allowed: bool, use_constructed: bool) -> Role:
    if held_out:
        return "held out"
    if entry.constructed and not use_constructed:
        return "constructed"
    return "fitted" if allowed else "compared"


def _check_may_enter(
    name: str, known: Mapping[str, Quantity], loss: str, source: str, use_constructed: bool
) -> None:
    """Refuse what `fit` names but must not enter a fit."""
    if name not in known:
        raise InputError(
            f"{source}: fit: no measurement {name!r} in this set; it has {', '.join(known)}"
        )
    entry = known[name]
    if entry.held_out:
        raise InputError(f"{source}: fit: {name!r} is held out and enters no fit")
    if entry.constructed and not use_constructed:
        raise InputError(
            f"{source}: fit: {name!r} is constructed and enters no fit without --use-constructed"
        )
    if loss == "runout" and not entry.is_runout:
        raise InputError(
            f"{source}: fit: {name!r} is not a toe_runout; the loss `runout` takes nothing else, "
            "use loss: misfit"
        )


def read(
    targets: Targets[Measured], deposit: Deposit, readings: Mapping[str, Reading] | None = None
) -> tuple[np.ndarray, str]:
    """Read the measurements on a deposit: (m,), and why some are NaN, if any.

    Args:
        targets: the measurements.
        deposit: points of one moment, or of a whole run.
        readings: what was read on the whole run as it ended, by `reading_key`; None: the deposit
            has all frames.
    """
    values, trouble = [], ""
    for entry in targets.entries:
        found = _read_one(entry, deposit, readings)
        values.append(found.values)
        if found.trouble:
            named = found.trouble.startswith(f"{entry.name}: ")
            trouble = trouble or (found.trouble if named else f"{entry.name}: {found.trouble}")
    return np.concatenate(values), trouble


def _read_one(entry: Measured, deposit: Deposit, readings: Mapping[str, Reading] | None) -> Reading:
    if readings is not None and entry.needs_history:
        return readings[entry.reading_key(deposit.foot)]
    return entry.reading(deposit)


def toes_by_eye(targets: Targets[Measured], deposit: Deposit) -> dict[str, float]:
    """Runout of the last connected point, for each measured toe [m]."""
    read = {entry.name: entry.by_eye(deposit) for entry in targets.entries}
    return {name: value for name, value in read.items() if value is not None}


@dataclass(frozen=True)
class Places:
    """Numbers of one measurement.

    Attributes:
        name: of the measurement.
        axis: what `place` is.
        place: where or when, (n,) in m or s; NaN where the measurement has no place.
        index: of its numbers in the vector of all, (n,).
        series: they follow each other along the axis.
    """

    name: str
    axis: Axis
    place: np.ndarray
    index: np.ndarray
    series: bool


def places_of(targets: Targets[Measured]) -> list[Places]:
    """Places of every measurement, in the order of the entries."""
    found, first = [], 0
    for entry in targets.entries:
        n, along = len(entry.values), entry.along
        index = np.arange(first, first + n)
        if along is None:
            found.append(Places(entry.name, "none", np.full(n, np.nan), index, False))
        else:
            found.append(Places(entry.name, along.axis, along.place, index, along.series))
        first += n
    return found
