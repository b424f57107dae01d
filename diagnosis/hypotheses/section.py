"""The section as it was drawn, on trial: a boundary between zones, a foot or the surface elsewhere.

Boundaries are those that the question lists among its sensitivities; an amplitude of 1 is one
standard deviation. Where it lists none the top of the liquefied soil may lie elsewhere all the
same: it is known from a few borings, or from the slide that is being explained.
"""

from __future__ import annotations

import shapely
from shapely.ops import unary_union

from diagnosis.hypotheses.assumption import (
    LEVEL_STD,
    RUNGS,
    WORST_KNOWN_M,
    Assumption,
    Found,
    Sensitivities,
    possible,
    slug,
)
from diagnosis.hypotheses.model import Candidate
from diagnosis.hypotheses.strength import liquefied_soil
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from inversion.back_analysis.deviations import deviating
from inversion.estimation.forward import SectionSetup
from inversion.problem.question import MovedVertex, ZoneBoundary
from mpm_taichi.effects import liquefied_zones

BOUNDARY, TOP = "boundary_", "top_of_the_liquefied_soil"
#: A vertex nearer to the outline or the ground than this share of the height lies on it. By
#: judgement: an eighth of `LEVEL_STD`, so that no layer is taken for a line.
ON_LINE = 0.01


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """Boundaries that may lie elsewhere, with the amplitudes for which there is a section.

    Raises:
        InputError: a boundary has a vertex that no zone has.
    """
    found, left_out = [], {}
    boundaries = [one for one in sensitivities if isinstance(one, ZoneBoundary)]
    if not boundaries and (top := top_of_liquefied_soil(setup.scene)) is not None:
        boundaries = [top]
    for one in boundaries:
        name = BOUNDARY + slug(one.name)
        wanted = [sign * rung for sign in one.senses for rung in RUNGS]
        tried = _boundary(one, name, wanted)
        deviating(setup, [one], [0.0], one.name)  # its vertices exist
        rungs = [rung for rung in wanted if possible(tried, setup, rung)]
        if rungs:
            found.append(_boundary(one, name, rungs))
        else:
            left_out[name] = f"at {setup.scene.spacing:g} m spacing no section has it moved"
    return found, left_out


def top_of_liquefied_soil(scene: Scene, std: float | None = None) -> ZoneBoundary | None:
    """The boundary between the liquefied soil and what lies on it.

    Args:
        scene: the section.
        std: standard deviation [m]; None: `LEVEL_STD` of the height.

    Returns:
        its vertices, those on the ground and on the outline of the section left out; None: it has
        no other.
    """
    names, liquid = liquefied_zones(scene), liquefied_soil(scene)
    outline = unary_union([shapely.Polygon(zone.polygon) for zone in scene.zones]).boundary
    height = scene.height
    near = ON_LINE * height
    # A wall cuts the section off: a boundary that ends there goes on beyond.
    domain = scene.domain
    walls = {domain.wall(side) for side in SIDES if not domain.is_open(side)}
    walls |= {scene.end(side) for side in SIDES if domain.goes_on(side)}
    std = min(LEVEL_STD * height, WORST_KNOWN_M) if std is None else std
    moved = [
        (x, y)
        for x, y in dict.fromkeys(p for z in scene.zones if z.name in names for p in z.polygon)
        if y > float(scene.ground.height(x)) + near
        and (x in walls or outline.distance(shapely.Point(x, y)) > near)
        and not liquid.contains(shapely.Point(x, y + near))
    ]
    if not moved:
        return None
    return ZoneBoundary(
        name=TOP.replace("_", " "),
        kind="zone_boundary",
        vertices=[MovedVertex(at=place, move=(0.0, round(std, 3))) for place in moved],
    )


def _boundary(one: ZoneBoundary, name: str, rungs: list[float]) -> Assumption:
    candidate = Candidate(
        name=name,
        family="section",
        words=f"{one.name} lies elsewhere",
        unit="std",
        low=min(0.0, *rungs),
        high=max(0.0, *rungs),
        ladder=tuple(sorted(rungs)),
        prior_mean=0.0,
        prior_std=1.0,
    )
    return Assumption(candidate, lambda setup, score: deviating(setup, [one], [score], name))
