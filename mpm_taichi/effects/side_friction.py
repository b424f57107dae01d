"""Side friction of a slide of finite width, or of a box: friction on both flanks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, ti
from mpm_taichi.effects.side_shear import section_height

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def resistance(effect, here):  # noqa: ANN001, ANN201
    """Side friction f = 2 mu K sigma'_v / B [N/m3], mu a share of the material's own tan(phi)."""
    coefficient = effect.side_friction * here.friction * effect.earth_pressure_ratio
    return 2.0 * coefficient * ti.max(here.vertical, 0.0) * effect.amplitude / effect.height


def applies(scene: Scene) -> str:
    """Needs frictional soil."""
    if any(scene.materials[zone.material].friction_deg > 0.0 for zone in scene.zones):
        return ""
    return "no soil has friction"


EFFECT = Effect(
    name="side_friction",
    words="the flanks of a slide of finite width, or the walls of a box, hold it back by friction",
    equation="f = 2 mu K sigma'_v / B against the motion, mu = k tan(phi), a = H / B",
    source=(
        "earth pressure at rest on the flanks of a sliding mass: Arellano and Stark (2000), ASCE "
        "GSP 101; walls of a channel: Savage (1979), J. Fluid Mech. 92, Taberlet et al. (2003), "
        "PRL 91. H / B is 0.03-0.3 for dams, 0.3-5 in laboratory boxes"
    ),
    looks_like=(
        "frictional shells are held back with the stress on them: thick, deep parts most, a thin "
        "front hardly; crest and remnant higher, runout shorter; in a box a steeper deposit"
    ),
    family="dimension",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=10.0,
        ladder=(0.03, 0.07, 0.15),
        meaning="height of the section over the width of the slide or box, H / B",
    ),
    parameters=(
        Parameter(
            "side_friction",
            "",
            1.0,
            0.01,
            5.0,
            "k, friction coefficient of the flanks over tan(phi) of the soil; walls of glass "
            "or steel 0.2-0.5",
        ),
        Parameter(
            "earth_pressure_ratio",
            "",
            0.5,
            0.1,
            3.0,
            "K, normal stress on the flanks over the vertical effective stress",
        ),
    ),
    constant_names=("height",),
    constants=section_height,
    resistance=resistance,
    applies=applies,
)
