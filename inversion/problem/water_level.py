"""The level of the pool: a scene with it elsewhere, and what moves with it."""

from __future__ import annotations

from typing import Any

import numpy as np

from geometry.scenes.scene import Scene

#: Two places nearer than this are one and the same [m].
SAME_PLACE_M = 0.05


def moves_with_pool(scene: Scene) -> np.ndarray:
    """Which vertices of the phreatic line stand at pool level, (L,) bool.

    A scene without a phreatic line of its own has one at pool level, with a vertex at either end.
    """
    if scene.phreatic_line is None:
        return np.ones(2, dtype=bool)
    heights = np.array([y for _, y in scene.phreatic_line])
    return np.abs(heights - scene.water_level) <= SAME_PLACE_M


def pool_at(scene: Scene, level: float) -> dict[str, Any]:
    """The document of the scene with its pool at another level [m]; not checked yet.

    The phreatic line moves where it stands at pool level.
    """
    line = scene.phreatic_line
    if line is not None:
        line = [
            (x, level if moves else y)
            for (x, y), moves in zip(line, moves_with_pool(scene), strict=True)
        ]
    return {**scene.model_dump(), "water_level": level, "phreatic_line": line}
