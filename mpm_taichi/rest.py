"""When a slide is over though its kinetic energy is no small share of a peak it never had.

A section that stands, or has slumped by centimetres, sways and creeps a little for as long as it is
simulated. It is at rest once none of its points has moved by more than a small share of the spacing
for a while, which is longer the higher the section is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

STILL = 0.05
"""Movement that does not count, in spacings ..."""
WHILE = 3.0
"""... in this time, in sqrt(height / gravity)."""


def still_frames(height: float, gravity: float, frame_time: float) -> int:
    """Frames that make up the while.

    Args:
        height: of the section [m].
        gravity: [m/s2].
        frame_time: between two frames [s].
    """
    return max(math.ceil(WHILE * math.sqrt(height / gravity) / frame_time), 1)


def stands_still(frames: Sequence[np.ndarray], count: int, spacing: float) -> bool:
    """Whether no point has moved in the last `count` frames.

    Args:
        frames: positions (P, d) [m], in order of time.
        count: `still_frames`.
        spacing: distance between points [m].
    """
    if len(frames) <= count:
        return False
    moved = frames[-1] - frames[-1 - count]
    return bool(np.max(np.sum(moved**2, axis=1), initial=0.0) < (STILL * spacing) ** 2)
