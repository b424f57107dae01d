"""Side shear of a slide of finite width, cohesive part: c on both flanks holds it back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def resistance(effect, here):  # noqa: ANN001, ANN201
    """Side shear f = 2 S_side / B [N/m3], S_side a share of the material's cohesion or S_r."""
    return 2.0 * effect.side_strength * here.cohesion * effect.amplitude / effect.height


def section_height(
    scene: Scene, amplitude: float, parameters: Mapping[str, float]
) -> dict[str, float]:
    """Height H of the section above its lowest ground [m]."""
    top = max(y for zone in scene.zones for _, y in zone.polygon)
    return {"height": top - scene.ground.lowest}


def applies(scene: Scene) -> str:
    """Needs soil with cohesion or a residual strength."""
    soils = [scene.materials[zone.material] for zone in scene.zones]
    if any(soil.cohesion_kpa > 0.0 or soil.strength_ratio for soil in soils):
        return ""
    return "no soil has cohesion"


EFFECT = Effect(
    name="side_shear",
    words="the flanks of a slide of finite width hold it back by their cohesion",
    equation="f = 2 S_side / B against the motion, S_side = k c, a = H / B, H the section's height",
    source=(
        "Skempton (1985), Geotechnique 35(1), and Baligh and Azzouz (1975), J. Geotech. Eng. Div. "
        "101(11): ends multiply the resistance by about 1 + K D / B; Stark and Eid (1998): without "
        "them back-analyses find up to 30 % too much strength. H / B is 0.03-0.3 for dams"
    ),
    looks_like=(
        "as a larger S_r where the slide is thick, and less so at the thin front: runout shorter, "
        "crest and remnant higher"
    ),
    family="dimension",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=10.0,
        ladder=(0.02, 0.05, 0.12),
        meaning="height of the section over the width of the slide, H / B",
    ),
    parameters=(
        Parameter(
            "side_strength",
            "",
            1.0,
            0.01,
            5.0,
            "k, strength of the flanks over the cohesion (S_r) of the soil that slides",
        ),
    ),
    constant_names=("height",),
    constants=section_height,
    resistance=resistance,
    applies=applies,
)
