"""A material law of one's own: von Mises with linear hardening, one history variable.

The shear strength is k = c + H gamma: the cohesion c of the scene's material, and the plastic shear
strain gamma that the point has gone through times H. In plane strain without hardening such a soil
flows as a Mohr-Coulomb soil with phi = 0 and the same c does. Source: de Souza Neto, Peric and Owen
(2008), Computational Methods for Plasticity, ch. 7. Run it with `law: hardening_von_mises` in
scene.yaml and

    flowslide scenes simulate my_dam/scene.yaml --effects docs/examples/my_law.py --out results
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.layout import SHEAR_MODULUS, vec4
from mpm_taichi.materials.elasticity import CENTRE, HALF, LEAST_STRESS, OUT, TRIAL_XY, larger
from mpm_taichi.materials.law import MaterialLaw

COHESION, HARDENING = range(2)
"""Constants: c [Pa]; H [Pa]."""
SHEARED = 0
"""History variable: the plastic shear strain gamma [-]."""


@ti.func
def von_mises_return(trial, elastic, strength, variables: ti.template()):
    """Radial return of the deviator, with the strength at the end of the step."""
    mean = (2.0 * trial[CENTRE] + trial[OUT]) * (1.0 / 3.0)
    plane, out = trial[CENTRE] - mean, trial[OUT] - mean
    half, xy = trial[HALF], trial[TRIAL_XY]
    # Half the square of the deviator: in simple shear the square of the shear stress.
    shear_stress = ti.sqrt(plane * plane + half * half + 0.5 * out * out + xy * xy)
    limit = strength[COHESION] + strength[HARDENING] * variables[SHEARED]
    excess = larger(shear_stress - limit, 0.0)
    sheared = excess / (elastic[SHEAR_MODULUS] + strength[HARDENING])
    reduced = shear_stress - elastic[SHEAR_MODULUS] * sheared
    scale = reduced / larger(shear_stress, LEAST_STRESS)
    variables[SHEARED] += sheared
    centre = mean + scale * plane
    stress = vec4(centre + scale * half, centre - scale * half, mean + scale * out, scale * xy)
    return stress, sheared, reduced * sheared, 0.0


@ti.func
def ground_strength(strength):
    """On rough ground the soil resists with its cohesion, whatever the normal stress."""
    return 0.0, strength[COHESION]


def hardening(modulus: float) -> MaterialLaw:
    """The law with H = `modulus` [Pa]."""
    return MaterialLaw(
        name="hardening_von_mises",
        constants=lambda material: (material.cohesion_pa, modulus),
        settling_constants=lambda material: (1e30, 0.0),  # elastic before failure
        usual_return=von_mises_return,
        usual_constants=2,
        ground_strength=ground_strength,
        variables=1,
    )


HARDENING_VON_MISES = hardening(200e3)
