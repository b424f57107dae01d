"""Sums over the slices of a slide at one stage: what drives it, what holds it, where it is.

In: `Slices`. Out: `SlideForces`, with which Kinetics and IMM write F = D - S_r L - T. The sums are
those of the ordinary method of slices, so that F = 0 is that method's FS = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inversion.classical.slices import Slices


@dataclass(frozen=True)
class SlideForces:
    """Sums over one stage of a slide; per metre of width.

    Attributes:
        driving: D, sum of w sin(alpha) over the slices, with the push of free water [N/m].
        liquefied_length: L, length of the base whose strength is S_r [m].
        resistance: T, sum over the other bases of c l + N' tan(phi) [N/m].
        weight: sum of w, the weight that drives: buoyant, or total with the pool on it [N/m].
        mass: total, water in the pores included [kg/m].
        centre: centre of the mass (2,) [m].
        base_length: of the whole slip surface [m].
    """

    driving: float
    liquefied_length: float
    resistance: float
    weight: float
    mass: float
    centre: np.ndarray
    base_length: float

    def net(self, residual_strength: float) -> float:
        """F = D - S_r L - T [N/m]."""
        return self.driving - residual_strength * self.liquefied_length - self.resistance

    @property
    def static_strength(self) -> float:
        """S_r [Pa] at which nothing accelerates: FS = 1 by the ordinary method."""
        return (self.driving - self.resistance) / self.liquefied_length


def sum_forces(slices: Slices, *, others: float = 1.0) -> SlideForces:
    """Sum the forces of one slip surface.

    Args:
        slices: of one slip surface.
        others: multiplies the strength of soil that has not liquefied; 0 leaves it out.
    """
    cosine, sine = np.cos(slices.angle), np.sin(slices.angle)
    push = slices.push + slices.side_water
    normal = slices.weight * cosine - push * sine - slices.pore * slices.length
    strength = slices.cohesion * slices.length + np.maximum(normal, 0.0) * slices.friction
    mass = float(slices.mass.sum())
    return SlideForces(
        driving=float(np.sum(slices.weight * sine + push * cosine)),
        liquefied_length=float(np.sum(slices.length[slices.liquefied])),
        resistance=float(others * np.sum(strength[~slices.liquefied])),
        weight=float(slices.weight.sum()),
        mass=mass,
        centre=np.array([slices.mass @ slices.x, slices.mass @ slices.centre]) / mass,
        base_length=float(slices.length.sum()),
    )
