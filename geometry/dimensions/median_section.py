"""The section of a family with every dimension at its median: `scene.yaml` of its case."""

from __future__ import annotations

from geometry.dimensions.family import FILL, LIQUEFIED, ROOM, ROOM_RUNOUTS, SectionFamily, shape_of
from geometry.random_scenes.materials import GRAVITY
from geometry.scenes.scene import Scene, scene_from_mapping

#: Rows of points over the height, and over what liquefied.
ROWS, LIQUEFIED_ROWS = 20.0, 4.0
#: First guess of S_r over rho g H.
FIRST_GUESS = 0.03


def median_section(family: SectionFamily, name: str, spacing: float | None = None) -> Scene:
    """The section in which every dimension has its median.

    Args:
        family: of sections.
        name: of the scene.
        spacing: of material points [m]; None: a twentieth of the height, at most a quarter of what
            liquefied, rounded.

    Raises:
        InputError: no such section at that spacing; one line.
    """
    values = family.values({})
    shape = shape_of(values, family.stated.slid_face)
    height, base = values["height_m"], shape.zones[FILL][1][0]
    thick = shape.zones[LIQUEFIED][2][1]
    strong = {
        "friction_deg": values["fill_friction_deg"],
        "cohesion_kpa": 0.0,
        "density": values["density"],
    }
    guess = FIRST_GUESS * values["density"] * GRAVITY * height / 1000.0
    runout = family.stated.runout_m
    left = max(ROOM * height, ROOM_RUNOUTS * (0.0 if runout is None else runout.middle))
    document = {
        "name": name,
        "description": "Every dimension at its median (dimensions.yaml).",
        "domain": {
            "x_min": -round(left, 1),
            "x_max": round(base + ROOM * height, 1),
            "y_max": round(ROOM * height, 1),
            "walls": "open",
        },
        "ground": {"points": [(-round(left, 1), 0.0), (round(base + ROOM * height, 1), 0.0)]},
        "zones": [
            {"name": zone, "polygon": polygon, "material": zone}
            for zone, polygon in shape.zones.items()
        ],
        "materials": {
            LIQUEFIED: {
                **strong,
                "friction_deg": 0.0,
                "cohesion_kpa": float(f"{guess:.2g}"),
                "liquefied": True,
            },
            FILL: strong,
        },
        "spacing": spacing or float(f"{min(height / ROWS, thick / LIQUEFIED_ROWS):.2g}"),
    }
    scene = scene_from_mapping(document, name)
    return scene_from_mapping(family.document(scene, {}), name)
