"""Slides that reach ground that goes on beyond the drawing."""

from __future__ import annotations

import numpy as np

from geometry.scenes.scene import Scene
from geometry.sides import SIDES, outward_of

#: A slide has reached a far boundary where soil that began within so many spacings of it has moved
#: by more than so many.
NEAR, MOVED = 4.0, 2.0


def ends_reached(scene: Scene, before: np.ndarray, after: np.ndarray) -> tuple[str, ...]:
    """Where a slide reaches ground that goes on beyond the section, a line for each end.

    A far boundary holds soil like a smooth wall, so what reaches it is held back by the drawing.

    Args:
        scene: the section.
        before: positions of the points before the slide, (N, 2) [m].
        after: after it, (N, 2) [m].
    """
    lines = []
    for side in (one for one in SIDES if scene.domain.goes_on(one)):
        wall = scene.domain.wall(side)
        near = outward_of(side) * (before[:, 0] - wall) > -NEAR * scene.spacing
        moved = np.linalg.norm(after[near].astype(float) - before[near], axis=1)
        most = float(np.max(moved, initial=0.0))
        if most > MOVED * scene.spacing:
            lines.append(
                f"the slide reaches the {side} end of the section (x = {wall:g} m), where it is "
                f"held although the ground goes on: soil there moves by {most:.1f} m; draw more of "
                "the ground"
            )
    return tuple(lines)
