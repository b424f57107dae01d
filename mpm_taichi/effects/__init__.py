"""Physical effects that a scene can switch on, one file each.

In: the entry `effects:` of a scene, and for a user's own effects a Python file. Out: `Effect`
objects, with what each is and does. Off is off: a scene without effects runs by kernels that know
of none. Nothing here starts Taichi.
"""

from mpm_taichi.effects.framework.base import (
    DEGREE,
    KPA,
    STANDARD_GRAVITY,
    Active,
    Amplitude,
    Effect,
    Parameter,
    always,
    liquefied_zones,
    needs_liquefied_soil,
    ti,
)
from mpm_taichi.effects.framework.description import effects_table, effects_text
from mpm_taichi.effects.framework.registry import (
    BY_THE_CLOCK,
    LIBRARY,
    PORE_WATER,
    acting_scene,
    changes_volume,
    effect,
    effects,
    effects_on,
    flowing_pore_water,
    given_effects,
    has_own_code,
    kernel_effects,
    key_of_effects,
    load_effects_file,
    relative_width,
    user_effects,
)

PHYSICS_VERSION = 3
"""Raised whenever a scene with an effect of the library gives other numbers than before; part of
the key of every run with an effect on. The effects share their kernels, so they share this."""

__all__ = [
    "PHYSICS_VERSION",
    "BY_THE_CLOCK",
    "DEGREE",
    "KPA",
    "LIBRARY",
    "PORE_WATER",
    "STANDARD_GRAVITY",
    "Active",
    "Amplitude",
    "Effect",
    "Parameter",
    "acting_scene",
    "always",
    "changes_volume",
    "effect",
    "effects",
    "effects_on",
    "effects_table",
    "effects_text",
    "flowing_pore_water",
    "given_effects",
    "has_own_code",
    "kernel_effects",
    "key_of_effects",
    "liquefied_zones",
    "load_effects_file",
    "needs_liquefied_soil",
    "relative_width",
    "ti",
    "user_effects",
]
