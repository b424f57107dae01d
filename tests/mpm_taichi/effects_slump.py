"""A small scene on which every effect of the library can act."""

from geometry.scenes.scene import scene_from_mapping
from pipeline.config import SimulationSettings

SHORT = SimulationSettings(duration_s=2.0, early_stop=False)


def slump(effects=None, **changes):
    """Liquefied soil (S_r 5 kPa) under sand, 20 m x 8 m, in a pool on the left; 160 points."""
    document = {
        "name": "slump",
        "domain": {"x_min": 0, "x_max": 60, "y_max": 20, "walls": "closed"},
        "ground": {"points": [[0, 0], [60, 0]]},
        "zones": [
            {"name": "a", "material": "silt", "polygon": [[20, 0], [40, 0], [40, 6], [20, 6]]},
            {"name": "b", "material": "sand", "polygon": [[20, 6], [40, 6], [40, 8], [20, 8]]},
        ],
        "materials": {
            "silt": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True},
            "sand": {"friction_deg": 30, "cohesion_kpa": 5},
        },
        "water_level": 7.0,
        "phreatic_line": [[0, 7], [30, 7], [40, 2], [60, 2]],
        "spacing": 1.0,
        "effects": effects or {},
    }
    if isinstance(effects, dict) and effects.get("pore_water"):
        drained = {"friction_deg": 30, "cohesion_kpa": 60}
        document["materials"]["silt"] |= {"permeability_m_per_s": 1e-3, "pre_failure": drained}
    return scene_from_mapping({**document, **changes})
