"""Scenes: what is simulated, before anything moves.

In: a configuration and a number, or a section measured by hand. Out: a `Scene`, the one document
that every later stage reads, and its filling with material points. `survey` measures a deposit of
points the same way for field data, the material point method and the learned simulator.

In the paper this is the section on data and training, with its appendix of polygon coordinates.
"""

from geometry.random_scenes.templates import draw_scene
from geometry.scenes.fill import MaterialPoints, fill
from geometry.scenes.scene import (
    Domain,
    Ground,
    Material,
    Scene,
    Strength,
    Zone,
    load_scene,
    save_scene,
    scene_from_mapping,
)

#: Raised by one whenever the same configuration would draw or fill another scene than before.
PHYSICS_VERSION = 1

__all__ = [
    "PHYSICS_VERSION",
    "Domain",
    "Ground",
    "Material",
    "MaterialPoints",
    "Scene",
    "Strength",
    "Zone",
    "draw_scene",
    "fill",
    "load_scene",
    "save_scene",
    "scene_from_mapping",
]
