"""Units that the fields of the page accept besides their own."""

from __future__ import annotations

from geometry.scenes.drawings import UNITS
from pipeline.config import SimulationSettings

FOOT_M, POUND_KG, STANDARD_GRAVITY = UNITS["ft"], 0.45359237, 9.80665
PSF_KPA = POUND_KG * STANDARD_GRAVITY / FOOT_M**2 / 1000.0
PCF_KG_PER_M3 = POUND_KG / FOOT_M**3
#: A unit weight [kN/m³] is turned into a density as the solver turns it back.
GRAVITY = SimulationSettings.model_fields["gravity_m_per_s2"].default

_PRESSURES = {
    "Pa": 1e-3,
    "kPa": 1.0,
    "MPa": 1e3,
    "GPa": 1e6,
    "kN/m²": 1.0,
    "MN/m²": 1e3,
    "psf": PSF_KPA,
    "ksf": 1e3 * PSF_KPA,
    "tsf": 2e3 * PSF_KPA,
    "psi": 144.0 * PSF_KPA,
    "ksi": 144e3 * PSF_KPA,
    "kgf/cm²": 10.0 * STANDARD_GRAVITY,
    "bar": 100.0,
}

FIELD_UNITS: dict[str, dict[str, float]] = {
    "m": UNITS,
    "kPa": _PRESSURES,
    "MPa": {name: kpa / 1e3 for name, kpa in _PRESSURES.items()},
    "kg/m³": {
        "kg/m³": 1.0,
        "t/m³": 1e3,
        "g/cm³": 1e3,
        "pcf": PCF_KG_PER_M3,
        "lb/ft³": PCF_KG_PER_M3,
        "kN/m³": 1e3 / GRAVITY,
    },
    "deg": {"deg": 1.0},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0},
    "m/s": {"m/s": 1.0, "km/h": 1.0 / 3.6, "ft/s": FOOT_M, "mph": 5280.0 * FOOT_M / 3600.0},
}
"""Unit of a field -> units that it accepts -> how many of the field's one of them is."""
