"""Template (c): a zoned dam, shells about a core; any zone may liquefy (Fig. 3c, Table A.1c)."""

from __future__ import annotations

from geometry.random_scenes.sketch import BASE, Frame, Outline, Sketch, between
from pipeline.random_numbers import Stream


def sketch(stream: Stream, frame: Frame) -> Sketch:
    """Draw a zoned dam; the numbers in brackets are the vertices of Table A.1c."""
    p0, p3 = (5.0, BASE), (stream.uniform(135.0, 180.0), BASE)
    p1 = between(p0, p3, stream.uniform(0.2, 0.3))
    p2 = between(p0, p3, stream.uniform(0.5, 0.6))
    p6 = (p0[0] + stream.uniform(40.0, 50.0), stream.uniform(35.0, 50.0))
    p9 = (stream.uniform(75.0, 90.0), p6[1])
    p7 = between(p6, p9, stream.uniform(0.1, 0.45))
    p8 = between(p6, p9, stream.uniform(0.5, 0.9))
    p4 = between(p8, p2, stream.uniform(0.4, 0.6))
    # At 0 [5] falls onto [3] and the foundation zone becomes a triangle, which is a valid zone.
    p5 = between(p3, p9, stream.uniform(0.0, 0.6))
    soils: list = [1, 2, 1, 1]
    soils[stream.integer(0, 3)] = 3
    return Sketch(
        outlines=[
            Outline("upstream_shell", soils[0], [p0, p1, p7, p6]),
            Outline("core", soils[1], [p1, p2, p4, p8, p7]),
            Outline("downstream_base", soils[2], [p2, p3, p5, p4]),
            Outline("downstream_shell", soils[3], [p4, p5, p9, p8]),
        ],
        ground=frame.level_base,
        crest=p6[1],
        seepage=(p7, p2),
    )
