"""Strength lowered in a steady ramp until something gives way.

A failing slope moves, flattens and stops again, so "moves" is not a criterion. While it stands,
a ramp of the strength makes it creep elastically, by little and evenly; at the limit it sinks much
more for the same loss of strength. The limit is where the rate d(u / H) / d(ln F) passes
`FAILING_RATE`, u the displacement of the crest, F the factor by which the strength is divided: one
per cent less strength then moves the crest by H / 1000. Standing slopes stay tens of times below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.verification.lab import Lab

FAILING_RATE = 0.1
WINDOW_S = 0.5
"""Time over which the rate is taken."""
FAR = 0.03
"""Displacement that ends a ramp, share of H."""


@dataclass
class Ramp:
    """A ramp; K readings."""

    factor: np.ndarray  # (K,) F
    moved: np.ndarray  # (K,) displacement of the crest since the ramp began, share of H
    rate: np.ndarray  # (K,) its rate over the last window, per unit of ln F; nan in the first
    position: np.ndarray  # (P, 2) at the end [m]
    displacement: np.ndarray  # (P, 2) at the end [m]
    spacing: float  # m

    @property
    def limit(self) -> float:
        """F at which the rate passes `FAILING_RATE`, interpolated.

        Raises:
            ValueError: the ramp never got there.
        """
        beyond = np.flatnonzero(self.rate > FAILING_RATE)
        if len(beyond) == 0:
            raise ValueError(f"stands up to F = {self.factor[-1]:.3g}")
        last = beyond[0]
        pair = slice(last - 1, last + 1)
        return float(np.interp(FAILING_RATE, self.rate[pair], self.factor[pair]))


def lower(
    lab: Lab,
    material: str,
    factors: tuple[float, float],
    *,
    crest: np.ndarray,
    height: float,
    seconds: float,
    rest_s: float = 2.0,
) -> Ramp:
    """Divide c and tan(phi) of a material by F, rising from `factors[0]` to `factors[1]`.

    Args:
        lab: with the scene as it was built; it settles first and rests with the first factor.
        material: whose strength falls.
        factors: first and last F.
        crest: (P,) bool, the points watched.
        height: H [m].
        seconds: time of the ramp.
        rest_s: time before it, in which the elastic start comes to rest with its strength [s].
    """
    lab.run(0)
    lab.reduce_strength(material, factors[0])
    lab.run(round(rest_s / lab.frame_time))
    begun, origin = lab.time, lab.displacement[crest].mean(axis=0)
    speed = np.log(factors[1] / factors[0]) / seconds
    factor, moved = [factors[0]], [0.0]
    while lab.time - begun < seconds and moved[-1] < FAR:
        factor.append(factors[0] * float(np.exp(speed * (lab.time - begun))))
        lab.reduce_strength(material, factor[-1])
        lab.run(2)
        moved.append(float(np.hypot(*(lab.displacement[crest].mean(axis=0) - origin))) / height)
    window = max(round(WINDOW_S / (2 * lab.frame_time)), 1)
    rate = np.full(len(moved), np.nan)
    rate[window:] = np.subtract(moved[window:], moved[:-window]) / (
        speed * window * 2 * lab.frame_time
    )
    return Ramp(
        factor=np.array(factor),
        moved=np.array(moved),
        rate=rate,
        position=lab.position,
        displacement=lab.displacement - 0.0,
        spacing=lab.scene.spacing,
    )
