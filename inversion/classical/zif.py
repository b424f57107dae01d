"""Zero inertial factor (Kramer and Wang 2015): the strength at the moment without acceleration.

In: a slide and a share f of its displacement, 0.40 to 0.50 by custom. Out: the S_r at which the
section x_pre + f (x_post - x_pre) has a factor of safety of 1.

The mass first gains speed and later loses it; in between there is a moment at which the forces
balance, and a static analysis of that moment's section holds. Where that moment lies is the
judgement; IMM finds it for its own forces (`Motion.zero_inertia_share`).
"""

from __future__ import annotations

import numpy as np

from inversion.classical.limit_equilibrium import Method, required_strength
from inversion.classical.slices import Circle, Slices
from pipeline.cli import WorkFailed


def find_strength(
    slices: Slices, method: Method, circle: Circle | None = None, *, others: float = 1.0
) -> float:
    """The S_r [Pa] at which the section at the zero inertial factor just stands.

    Args:
        slices: of that section.
        method: of limit equilibrium.
        circle: the slip surface, for Bishop's method.
        others: multiplies the strength of the soil that has not liquefied; 0 leaves it out.

    Raises:
        WorkFailed: no liquefied base, no solution, or a section that stands without S_r.
    """
    strength = float(required_strength(slices, method, circle, others=others))
    if not np.isfinite(strength):
        raise WorkFailed(f"the {method} method has no solution on this section")
    if strength <= 0:
        raise WorkFailed("the section stands without S_r at this share of the displacement")
    return strength
