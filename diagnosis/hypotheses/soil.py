"""The other soils on trial: what is not calibrated was assumed.

Strength or strength ratio, friction, density and stiffness of every material that no parameter has.
How far each may be off is what the question lists among its sensitivities, else a quarter of a
strength, 2 degrees, 5 % of a density, a factor of 3 in stiffness, each one standard deviation.
"""

from __future__ import annotations

import math

from diagnosis.hypotheses.assumption import AnySetup, Assumption, Found, Sensitivities, slug
from diagnosis.hypotheses.model import Candidate
from geometry.scenes.scene import Material, Scene
from geometry.scenes3d.scene3d import Terrain
from inversion.back_analysis.deviations import property_changes, with_changes
from inversion.estimation.forward import Setup
from inversion.problem.question import FixedProperty, calibrated_keys, material_key

#: One standard deviation where nothing is known, as shares of the value. By judgement: strengths
#: scatter by a tenth to a half of their mean (`strength.CONTRAST_STD`), densities by far less.
SHARES = {"cohesion_kpa": 0.25, "strength_ratio": 0.25, "density": 0.05}
#: The same of friction as it is, and of the logarithm of stiffness. By judgement: sands of one
#: state differ by a few degrees, and moduli are seldom measured.
FRICTION_STD_DEG, STIFFNESS_STD = 2.0, math.log(3.0)
#: Amplitudes that are tried, in standard deviations; the last is the largest that is believed: by
#: judgement, more than of a surface (`assumption.RUNGS`), since soils are known less than drawings.
RUNGS = (0.5, 1.0, 2.5)

NOT_BELOW_NOTHING = ("cohesion_kpa", "strength_ratio", "friction_deg")
WORDS = {
    "cohesion_kpa": ("strength", "kPa"),
    "strength_ratio": ("strength ratio", ""),
    "friction_deg": ("friction", "deg"),
    "density": ("density", "kg/m3"),
    "youngs_modulus_mpa": ("stiffness", "ln ratio"),
}
"""Property -> what it is called, and the unit of the amplitude: stiffness as a logarithm."""


def assumptions(setup: Setup, sensitivities: Sensitivities) -> Found:
    """Properties that are not calibrated, by material, and by what the sensitivities list."""
    scene = setup.soil
    calibrated = calibrated_keys(setup.parameters.specs)
    found, stated = [], set()
    for one in sensitivities:
        if isinstance(one, FixedProperty):
            key = material_key(one.property)
            stated |= {(zone, key) for zone in one.zones}
            found.append(_assumption(scene, tuple(one.zones), key, one.std, one.name))
    for material in scene.materials:
        for key in WORDS:
            zones = tuple(
                zone.name
                for zone in scene.zones
                if zone.material == material and (zone.name, key) not in stated | calibrated
            )
            std = default_std(scene.materials[material], key)
            if zones and std > 0.0:
                found.append(_assumption(scene, zones, key, std, material))
    # What is stated comes first, and stays where a default has its name.
    return list({one.candidate.name: one for one in reversed(found)}.values())[::-1], {}


def default_std(soil: Material, key: str) -> float:
    """How far a property may be off where nothing is known of it, in the amplitude's unit."""
    if key == "cohesion_kpa" and soil.strength_ratio is not None:
        return 0.0  # the least strength of a point, which hardly any has
    if key in SHARES:
        return SHARES[key] * (getattr(soil, key) or 0.0)
    if key == "friction_deg":
        return FRICTION_STD_DEG if soil.friction_deg > 0.0 else 0.0
    return STIFFNESS_STD


def _assumption(
    scene: Scene | Terrain, zones: tuple[str, ...], key: str, std: float, of: str
) -> Assumption:
    """Another value of one property of some zones; the amplitude is the difference.

    It is called after its material, or the sensitivity that lists it (`of`).
    """
    word, unit = WORDS[key]
    name = slug(of) if slug(word) in slug(of) else f"{slug(word)}_of_{slug(of)}"
    values = [
        getattr(scene.materials[zone.material], key) for zone in scene.zones if zone.name in zones
    ]
    # No soil has less than no strength.
    lowest = -min(values) if key in NOT_BELOW_NOTHING else -math.inf
    rungs = [sign * rung * std for sign in (-1.0, 1.0) for rung in RUNGS]
    ladder = tuple(sorted({max(rung, lowest) for rung in rungs} - {0.0}))
    where = f"zone{'s' if len(zones) > 1 else ''} {', '.join(zones)}"
    candidate = Candidate(
        name=name,
        family="soil",
        words=f"the {word} of {where} is another",
        unit=unit,
        low=min(ladder[0], 0.0),
        high=max(ladder[-1], 0.0),
        ladder=ladder,
        prior_mean=0.0,
        prior_std=std,
        screened=True,
    )

    def change(setup: AnySetup, amplitude: float) -> AnySetup:
        changes = property_changes(setup.soil, zones, key, amplitude)
        return setup.with_soil(with_changes(setup.soil, changes, candidate.name))

    return Assumption(candidate, change)
