"""Template (a): an embankment at the left wall, in three layers (paper, Fig. 3a, Table A.1a)."""

from __future__ import annotations

from geometry.random_scenes.sketch import BASE, Frame, Outline, Sketch, between
from pipeline.random_numbers import Stream


def sketch(stream: Stream, frame: Frame) -> Sketch:
    """Draw an embankment; the numbers in brackets are the vertices of Table A.1a."""
    p1 = (stream.uniform(120.0, 130.0), BASE)
    first, second = stream.uniform(70.0, 80.0), stream.uniform(70.0, 80.0)
    crest = stream.uniform(37.0, 47.0)
    # [7] and [8] have the same range of x: the smaller one is [7].
    p7, p8 = (min(first, second), crest), (max(first, second), crest)
    p6 = (0.0, stream.uniform(crest - 2.5, min(crest + 10.0, frame.top)))
    p0, p2, p4 = (0.0, BASE), (0.0, 17.0), (0.0, 34.0)
    p3, p5 = between(p1, p8, 1.0 / 3.0), between(p1, p8, 2.0 / 3.0)
    return Sketch(
        outlines=[
            Outline("lower", 3, [p0, p1, p3, p2]),
            Outline("middle", 2, [p2, p3, p5, p4]),
            Outline("upper", 1, [p4, p5, p8, p7, p6]),
        ],
        ground=frame.level_base,
        crest=crest,
    )
