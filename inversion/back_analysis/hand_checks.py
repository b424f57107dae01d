"""What can be said of an answer without a simulation: may it be true at all?

A slide that ran had a factor of safety below 1 with its residual strength, by limit equilibrium on
the section before. The ratio to the effective stress is compared with those of published flow
slides. An answer that passes is not confirmed; one that does not is doubted in the first line.
"""

from __future__ import annotations

import math

from geometry.scenes.scene import Scene
from geometry.sides import Side
from inversion.back_analysis.result import HandCheck, ParameterAnswer
from inversion.classical.block import block_factor
from inversion.classical.search import critical_circle
from inversion.classical.section import ClassicalSection, section_of
from inversion.classical.slices import WaterForm
from pipeline.cli import WorkFailed

#: Above this factor of safety a section stands: circles and blocks are not the weakest surfaces,
#: and differ from other methods by some percent.
STANDS = 1.05

#: S_r / sigma'_v0 of flow slides (Olson and Stark 2002, Can. Geotech. J. 39: 0.05 to 0.12).
FLOW_SLIDES = 0.05, 0.12

#: Finer and finer grids of circles: the third figure of a factor of safety is of no interest here.
ROUNDS = 2


def stability_check(scene: Scene, side: Side, form: WaterForm) -> HandCheck:
    """Whether the section before slides with the strengths of an answer.

    Args:
        scene: the section before, with these strengths.
        side: to which it slid.
        form: how water acts.

    Raises:
        WorkFailed: neither a circle nor a block stays within the soil.
    """
    section = section_of(scene)
    found = {
        "by Bishop's circles": _circle_factor(scene, section, side, form),
        "of a block on what liquefied": block_factor(section, side, form),
    }
    known = {how: factor for how, factor in found.items() if math.isfinite(factor)}
    if not known:
        raise WorkFailed("neither a circle nor a block stays within the soil")
    least = min(known.values())
    agrees = least <= STANDS
    verdict = "it slides" if agrees else "it would have stood"
    told = ", ".join(f"{factor:.2f} {how}" for how, factor in known.items())
    return HandCheck(
        name="stability",
        value=least,
        low=None,
        high=STANDS,
        agrees=agrees,
        words=f"factor of safety of the section before, to the {side}: {told}, with the strengths "
        f"of the answer; {verdict}",
    )


def _circle_factor(scene: Scene, section: ClassicalSection, side: Side, form: WaterForm) -> float:
    """The lowest factor of safety by Bishop's method; nan where no circle stays within the soil."""
    low, high = scene.extent
    near = 0.02 * (high - low)
    crest = [x for zone in scene.zones for x, y in zone.polygon if y > high - near]
    edge = min(crest) if side == "left" else max(crest)
    foot = scene.foot(side)
    behind = scene.end("right" if side == "left" else "left")
    # From the foot, or before it where soil lies there, to halfway up the slope.
    begin = scene.end(side) if scene.domain.goes_on(side) else foot
    toe = sorted((begin, foot + 0.45 * (edge - foot)))
    head = sorted((foot + 0.5 * (edge - foot), foot + 0.98 * (behind - foot)))
    try:
        return critical_circle(
            section,
            side,
            head=(head[0], head[1]),
            toe=(toe[0], toe[1]),
            form=form,
            rounds=ROUNDS,
        ).value
    except WorkFailed:
        return math.nan


def ratio_check(parameter: ParameterAnswer) -> HandCheck | None:
    """A ratio against those of published flow slides; None: it is no ratio."""
    ratio, std = parameter.ratio, parameter.ratio_std
    if ratio is None or std is None or not math.isfinite(ratio):
        return None
    low, high = FLOW_SLIDES
    agrees = ratio + std >= low and ratio - std <= high
    place = "within" if low <= ratio <= high else "below" if ratio < low else "above"
    within = ", within its error" if agrees and place != "within" else ""
    return HandCheck(
        name=f"ratio of {parameter.name}",
        value=ratio,
        low=low,
        high=high,
        agrees=agrees,
        words=f"{parameter.label}: S_r/sigma'_v0 {ratio:.3f} is {place} the {low:g} to {high:g} of "
        f"published flow slides (Olson and Stark 2002){within}",
    )
