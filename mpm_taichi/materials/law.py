"""Interface of a material law: its constants, its return mapping, its history variables.

A law is one file in this folder with one `MaterialLaw`. Both schedules are compiled for the law
that a run has; the solver itself reads neither its constants nor its history variables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm_taichi.materials.elasticity import elastic_trial

if TYPE_CHECKING:
    from geometry.scenes.scene import Material

CONSTANTS = 8
"""Most constants of a law: a row of `layout.MaterialTable.strength`."""


@dataclass(frozen=True, eq=False)
class MaterialLaw:
    """A material law. Functions on the device are `ti.func`s.

    On the device `trial` is what `elastic_trial` returns (CENTRE, HALF, OUT, TRIAL_XY [Pa]);
    `elastic` a row of `layout.MaterialTable.elastic`; `strength` the row of constants. Stress is
    tension positive, (XX, YY, ZZ, XY) [Pa]. A law with history variables gets them as a further
    argument `variables: ti.template()`, a vector that it changes in place.

    Attributes:
        name: of the law.
        constants: a material's row of constants, up to `CONSTANTS` numbers, in SI.
        settling_constants: the row while the initial stress settles, before failure.
        usual_return: `(trial, elastic, strength) -> stress, shear, work, elsewhere`: the stress
            after a step where that is elastic or on the part of the yield surface that most points
            meet. Without branches (`ti.select`, `elasticity.larger`): it runs on eight points at
            once. `shear` is the increment of plastic shear strain, largest minus smallest principal
            one [-], `work` the plastic dissipation [J/m3]; `elsewhere` above 0 asks for
            `rare_return`.
        ground_strength: `(strength) -> friction, adhesion`: what soil resists that shears along
            rough ground: friction x normal stress + adhesion [Pa].
        usual_constants: how many of the constants, from the first, `usual_return` reads.
        rare_return: `(trial, elastic, strength) -> stress, shear, opening, work`: the return
            everywhere else, point by point; `opening` is the increment of plastic volumetric strain
            in tension [-]. None: `usual_return` is all.
        trial: `(stress, gradient, volumetric, dt, elastic) -> trial`. The energies that the solver
            accounts for are those of isotropic linear elasticity.
        strength_constants: `(soil) -> constants`, (8,), of the `friction` (tan phi), `cohesion`
            [Pa] and `cap` [Pa] that effects leave of a point; None: no effect may change strength.
        variables: number of history variables of a point.
        initial_variables: their values at t = 0 for a material; None: zero.
        version: hash of the user's file that defines it; empty: of the library.
    """

    name: str
    constants: Callable[[Material], Sequence[float]]
    settling_constants: Callable[[Material], Sequence[float]]
    usual_return: Callable
    ground_strength: Callable
    usual_constants: int = CONSTANTS
    rare_return: Callable | None = None
    trial: Callable = elastic_trial
    strength_constants: Callable | None = None
    variables: int = 0
    initial_variables: Callable[[Material], Sequence[float]] | None = None
    version: str = ""
