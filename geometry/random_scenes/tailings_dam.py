"""Template (b): an upstream tailings dam, a shell before impounded layers (Fig. 3b, Table A.1b)."""

from __future__ import annotations

from geometry.random_scenes.sketch import BASE, Frame, Outline, Sketch, between
from pipeline.random_numbers import Stream


def sketch(stream: Stream, frame: Frame) -> Sketch:
    """Draw a tailings dam; the numbers in brackets are the vertices of Table A.1b.

    [1] refers to itself in the table; it is read as x of (a)[1], 120-130 m, minus 20-30 m. The
    inner boundary of the shell is [9]-[3]-[5]-[10], so the shifts of 5-10 m never cross. The range
    of [6] is cut at one cell under the top of the domain, which its upper end would pass.
    """
    p1 = (stream.uniform(120.0, 130.0) - stream.uniform(20.0, 30.0), BASE)
    p8 = (stream.uniform(70.0, 80.0), stream.uniform(37.0, 47.0))
    crest = p8[1]
    p6 = (0.0, stream.uniform(crest - 5.0, min(crest + 20.0, frame.top)))
    p7 = (stream.uniform(35.0, 40.0), crest)
    p9 = (p1[0] - stream.uniform(10.0, 15.0), BASE)
    p10 = (p8[0] - stream.uniform(5.0, 10.0), crest)
    p0, p2, p4 = (0.0, BASE), (0.0, 17.0), (0.0, 32.0)
    on_face = between(p1, p8, 1.0 / 3.0)
    p3 = (on_face[0] - stream.uniform(5.0, 10.0), on_face[1])
    on_face = between(p1, p8, 2.0 / 3.0)
    p5 = (on_face[0] - stream.uniform(5.0, 10.0), on_face[1])
    return Sketch(
        outlines=[
            Outline("lower", 3, [p0, p9, p3, p2]),
            Outline("middle", 2, [p2, p3, p5, p4]),
            Outline("upper", 1, [p4, p5, p10, p7, p6]),
            Outline("shell", 1, [p9, p1, p8, p10, p5, p3]),
        ],
        ground=frame.level_base,
        crest=crest,
    )
