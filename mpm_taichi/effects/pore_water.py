"""Pore water that moves: excess pressure is made by shear, flows by Darcy's law and drains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, ti
from mpm_taichi.effects.framework.free_water import soaked_area

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers
    from mpm_taichi.effects.framework.between import Between, SettledPoints

#: Columns of `here.renewed`, which `solver.pore_water.PoreWater` writes.
DRAINED, HELD, FALL, SINE, SUCTION = range(5)


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """max(S_r, p' sin(phi')) of loose soil, p' sin(phi) + c cos(phi) of other soil.

    p' = a s + b - f g: of a change of the mean stress s over the chunk the share a is drained, the
    rest is borne by the water, and plastic shear g makes it fall, or rise where soil dilates.
    """
    sine = here.renewed[SINE]
    if sine >= 0.0:
        loose = here.liquefied > 0.5
        if not loose:
            sine = soil.friction / ti.sqrt(1.0 + soil.friction * soil.friction)
        held = here.renewed[HELD] - here.renewed[FALL] * here.strain
        share = here.renewed[DRAINED]
        mean = ti.max(here.plane_pressure, 0.0)
        held = ti.min(held, (1.0 - share) * mean + here.renewed[SUCTION])
        effective = ti.max(share * mean + held, 0.0)
        if held < 0.0:
            share = effective / ti.max(mean, 1.0)
        mobilised = share * sine
        cosine = ti.sqrt(1.0 - mobilised * mobilised)
        held_strength = ti.max(held, 0.0) * sine
        if not loose:
            if soil.friction > 0.0:
                soil.cap = ti.min(soil.cap, soil.cohesion / soil.friction)
            held_strength += soil.cohesion / ti.sqrt(1.0 + soil.friction * soil.friction)
        if not loose or effective * sine >= soil.cohesion:
            soil.friction = mobilised / cosine
            soil.cohesion = held_strength / cosine
        else:
            soil.friction = 0.0
    return soil


def between(scene: Scene, settled: SettledPoints, amplitude: float, parameters: Numbers) -> Between:
    """The pore water of a run."""
    from mpm_taichi.solver.pore_water import Volumes, pore_water

    volumes = Volumes(**{one.name: parameters[one.name] for one in VOLUMES})
    return pore_water(scene, settled, amplitude, parameters["initial_ratio"], volumes)


def applies(scene: Scene) -> str:
    """Needs saturated soil with a permeability."""
    if not scene.has_water:
        return "there is no water"
    for zone in scene.zones:
        if scene.materials[zone.material].permeability_m_per_s is not None:
            if soaked_area(scene, zone) > 0.5 * scene.spacing**2:
                return ""
    return "no soil with a permeability_m_per_s lies below the phreatic line"


VOLUMES = (
    Parameter(
        "contraction",
        "",
        0.02,
        0.0,
        0.2,
        "volumetric strain that liquefied soil loses until it has reconsolidated",
    ),
    Parameter(
        "contractancy",
        "",
        0.1,
        0.0,
        1.0,
        "b, volume that loose soil would lose per plastic shear strain, of the same total",
    ),
    Parameter(
        "dilation",
        "",
        0.02,
        0.0,
        0.2,
        "volumetric strain that soil which does not liquefy gains up to its critical state",
    ),
    Parameter(
        "dilatancy",
        "",
        0.0,
        0.0,
        1.0,
        "d, volume that such soil would gain per plastic shear strain, of the same total; 0: none",
    ),
)

EFFECT = Effect(
    name="pore_water",
    words="excess pore water flows through the soil, which liquefies and regains strength with it",
    equation="S du/dt = div(k / gamma_w grad u) + S ds/dt + (b or -d) dg/dt, S = 1/M + n/K_w; "
    "t = max(S_r, (s - u) sin(phi'))",
    source=(
        "Terzaghi (1943) and Rendulic (1936) for the flow; grains that settle out of liquefied "
        "sand: Florin and Ivanov (1961, recalled), Scott (1986), J. Geotech. Engng 112(2); loose "
        "sand loses 1-4 % of its volume after it has liquefied (Ishihara and Yoshimine 1992, "
        "Soils and Foundations 32(1)); it contracts by a tenth to a third of its shear at first "
        "(Rowe 1962, recalled). k of hydraulic sand fill 1e-6 to 1e-4 m/s"
    ),
    looks_like=(
        "saturated shells soften after the core has liquefied, and the toe goes farther; soil next "
        "to a drain or a free face regains strength and stops; under a seal soil fails late"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1e6,
        ladder=(0.1, 1.0, 10.0),
        meaning="factor on the permeabilities of the materials; 1 where a scene does not say",
        decades=True,
    ),
    parameters=(
        Parameter(
            "initial_ratio",
            "",
            1.0,
            0.0,
            1.0,
            "r_u at t = 0 of saturated soil that liquefies, u over its mean stress in the plane; "
            "a material may state its own",
        ),
        *VOLUMES,
    ),
    strength=strength,
    between=between,
    applies=applies,
)
