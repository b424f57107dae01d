"""A forward run in plain numbers: values, effects, jitter, numerics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Numerics = Literal["own", "transfer", "fine"]

DIGITS = 8
"""Significant digits with which a computed number enters a simulation."""


def simulated(number: float) -> float:
    """A computed number as a simulation takes it.

    Estimates differ in their last bits between processors, and a slide enlarges what they differ
    by to what is printed: of 8 digits the same run is made on all, and found where it is kept.
    """
    return float(f"{number:.{DIGITS}g}")


@dataclass(frozen=True)
class State:
    """One forward run.

    Attributes:
        values: parameters in outside units, in the order of `Forward.parameters`, (p,).
        effects: (name, amplitude), sorted by name; physics and survey nuisances alike. None is the
            base model. Coefficient j of an unknown strength curve over the variable u is
            (`strength_curve:u:j`, c_j): the logarithm of the strength's multiplier at knot j.
        seed: 0: the model's own points; k > 0: the k-th other jitter of the points.
        numerics: own; transfer: the second transfer scheme; fine: spacing / 1.5.
    """

    values: tuple[float, ...]
    effects: tuple[tuple[str, float], ...] = ()
    seed: int = 0
    numerics: Numerics = "own"

    def with_effects(self, amplitudes: Mapping[str, float]) -> State:
        """The same run with these effects in addition; an amplitude of 0 takes an effect out."""
        joined = {**dict(self.effects), **amplitudes}
        kept = sorted((name, float(a)) for name, a in joined.items() if a != 0.0)
        return replace(self, effects=tuple(kept))


def state(
    values: Sequence[float], effects: Mapping[str, float] | None = None, *, seed: int = 0
) -> State:
    """A state of plain numbers: values (p,) in outside units, amplitudes by name."""
    return State(tuple(float(v) for v in values), seed=seed).with_effects(effects or {})
