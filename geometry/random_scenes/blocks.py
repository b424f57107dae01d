"""Template (e): rectangular blocks thrown onto an uneven base (paper, Fig. 3e, Table A.1e).

The table gives the ground line alone. Number, size and speed come from the configuration: 1 to 3
blocks of 10-40 m, up to 10 m/s. Speeds scale with the square root of the size (Froude), so that a
scene of the small scale is the same motion in half the time.
"""

from __future__ import annotations

import math

from geometry.random_scenes.materials import SOILS
from geometry.random_scenes.sketch import Frame, Outline, Point, Sketch
from pipeline.random_numbers import Stream

#: Least distance along x between corners of the base: slopes stay under 35 degrees.
SHORTEST_GROUND = 20.0
#: A block starts up to this height over the highest ground beneath it.
HIGHEST_LIFT = 10.0
#: Free space between blocks at the start, in cells: no grid node then hears of two blocks.
CLEARANCE_CELLS = 2.0
#: Places tried for one block.
TRIES = 50


def sketch(stream: Stream, frame: Frame) -> Sketch:
    """Draw an uneven base and blocks above it.

    Edges lie on lattice lines, so that filling is exact. A block that finds no room makes the
    sketch invalid (no outlines), and `templates` draws again.
    """
    ground = _ground(stream, frame)
    settings = frame.blocks
    outlines: list[Outline] = []
    for number in range(stream.integer(*settings.number)):
        box = _place(stream, frame, ground, [o.polygon for o in outlines])
        if box is None:
            return Sketch(outlines=[], ground=ground)
        speed = stream.uniform(*settings.speed_m_per_s)
        direction = stream.direction()
        velocity = (speed * direction[0], speed * direction[1])
        soil = SOILS[stream.integer(1, 3) - 1]
        outlines.append(Outline(f"block_{number + 1}", soil, box, velocity))
    return Sketch(outlines=outlines, ground=ground)


def _ground(stream: Stream, frame: Frame) -> list[Point]:
    """Five points from wall to wall; sorted, so that x of the inner ones ascends."""
    slack = frame.width - 4 * SHORTEST_GROUND
    inner = sorted(stream.uniform(0.0, slack) for _ in range(3))
    x = [0.0, *(place + (i + 1) * SHORTEST_GROUND for i, place in enumerate(inner)), frame.width]
    return [(place, stream.uniform(2.0, 16.0)) for place in x]


def _place(
    stream: Stream, frame: Frame, ground: list[Point], others: list[list[Point]]
) -> list[Point] | None:
    """A rectangle on lattice lines, above the ground and apart from the others; None if no room."""
    lowest = min(y for _, y in ground)
    step = frame.spacing
    size = [
        max(1, round(stream.uniform(*frame.blocks.size_m) / step)) * step
        for _ in ("width", "height")
    ]
    for _ in range(TRIES):
        left = math.floor(stream.uniform(0.0, frame.width - size[0]) / step) * step
        highest = _highest_ground(ground, left, left + size[0])
        start = highest + stream.uniform(0.0, HIGHEST_LIFT)
        bottom = lowest + math.ceil((start - lowest) / step) * step
        if bottom + size[1] > frame.top:
            continue
        box = (left, bottom, left + size[0], bottom + size[1])
        if all(_apart(box, other, CLEARANCE_CELLS * frame.cell) for other in others):
            return [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
    return None


def _highest_ground(ground: list[Point], left: float, right: float) -> float:
    """Highest elevation of the base between two places."""
    heights = [y for x, y in ground if left <= x <= right]
    for (x0, y0), (x1, y1) in zip(ground, ground[1:], strict=False):
        for place in (left, right):
            if x0 <= place <= x1:
                heights.append(y0 + (place - x0) / (x1 - x0) * (y1 - y0))
    return max(heights)


def _apart(box: tuple[float, float, float, float], other: list[Point], clearance: float) -> bool:
    left, bottom = other[0]
    right, top = other[2]
    return (
        box[0] >= right + clearance
        or box[2] <= left - clearance
        or box[1] >= top + clearance
        or box[3] <= bottom - clearance
    )
