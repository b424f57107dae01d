"""The strength of the liquefied soil on trial: one number for all of it was assumed.

Parts of it may be stronger or weaker: a layer, a stretch, a block, each a third of the zone wide or
high. Where such a part lies is not known beforehand, so each place is a hypothesis of its own, and
where one of them promises something its place is sought (`diagnosis.signatures.places`) on a finer
grid. A part that was sought is called after its place, `part_x_31_to_43`, so that a hypothesis file
can name it. That strength grows with the overburden, or varies at random, are effects of the
library (`overburden_strength`, `spatial_variability`) of the same family.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from diagnosis.hypotheses.assumption import Assumption, Found, Sensitivities
from diagnosis.hypotheses.model import Candidate, Curve
from geometry.scenes.scene import Scene
from inversion.engines.run_store import KeptRun
from inversion.estimation.forward import SectionSetup
from mpm_taichi.effects import effect, liquefied_zones
from pipeline.cli import InputError

CONTRAST, PART = "strength_contrast", "part"

#: One standard deviation of ln (strength of a part over that of the rest): a factor of 2. Undrained
#: strengths of one soil scatter from place to place by a tenth to a half of their mean (Phoon and
#: Kulhawy 1999, Can. Geotech. J. 36(4), recalled), those of silt and sand in one hydraulic fill
#: differ by a factor of two and more (Seed, Lee and Idriss 1975, recalled). With a factor of 5 a
#: part 16 times weaker than the rest was named for a pool (`0011` of the sixth set).
CONTRAST_STD = float(np.log(2.0))
#: What the thirds of a zone are called.
ALONG, UPWARDS = ("left", "middle", "right"), ("lower", "middle", "upper")
#: Places in each direction at which the extent of the zone is sampled: thirds to a hundredth of it.
SAMPLES = 80
#: Parts are moved by a strip or a layer. By judgement: half of them are hardly finer than thirds,
#: and with twice of both a part pays ln 4895 for its place in place of ln 359.
STRIPS, LAYERS = 8, 4
#: Share of a strip or layer that a part is wide at least. By judgement: a few points are no part.
LEAST_STEP = 0.75
#: So many places there are: any strips side by side, any layers, but not all of the soil.
PLACES = STRIPS * (STRIPS + 1) // 2 * (LAYERS * (LAYERS + 1) // 2) - 1
#: Digits of a place in the name of a part, in hundredths of the zone's extent or finer.
DIGITS = 2

#: Knots of an unknown curve, each a run. By judgement: three show one bend, and few measurements
#: see as many as ten.
KNOTS = 5
#: Their ranges, by judgement (no verdict depends on a curve, which is constant beyond): log10 of
#: the rate of shear around that of a fall from the section's height; plastic shear strain; times of
#: such a fall.
RATES, STRAINS, FALLS = (-2.0, 1.0), (0.0, 2.0), 6.0

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_PART = re.compile(rf"{PART}(?:_x_{_NUMBER}_to_{_NUMBER})?(?:_y_{_NUMBER}_to_{_NUMBER})?")


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """Layers, stretches and blocks of the liquefied zones."""
    if not liquefied_zones(setup.scene) or CONTRAST in setup.scene.effects:
        return [], {}
    return [_part(name, words, x, y) for name, (words, x, y) in _given(setup.scene).items()], {}


Span = tuple[float, float]


def _given(scene: Scene) -> dict[str, tuple[str, Span | None, Span | None]]:
    """Parts with a name of their own: words, interval of x and of y [m], None: all of it."""
    x, y = thirds(scene)
    found: dict[str, tuple[str, Span | None, Span | None]] = {}
    for where, span in zip(UPWARDS, y, strict=True):
        found[f"{where}_layer"] = f"the {where} third", None, span
    for where, span in zip(ALONG, x, strict=True):
        found[f"{where}_stretch"] = f"the {where} third", span, None
    for up, high in zip(UPWARDS, y, strict=True):
        for along, wide in zip(ALONG, x, strict=True):
            name = f"{up}_{along}_block" if up != along else "central_block"
            words = f"the {up} {along} part" if up != along else "the centre"
            found[name] = words, wide, high
    return found


def liquefied_soil(scene: Scene) -> BaseGeometry:
    """What the liquefied zones cover together."""
    names = liquefied_zones(scene)
    return unary_union([shapely.Polygon(z.polygon) for z in scene.zones if z.name in names])


def thirds(scene: Scene) -> tuple[list[Span], list[Span]]:
    """Intervals of x and of y [m] that each hold a third of the area of the liquefied zones."""
    zones = liquefied_soil(scene)
    left, low, right, high = zones.bounds
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    places = np.stack(
        np.meshgrid(left + shares * (right - left), low + shares * (high - low)), axis=-1
    ).reshape(-1, 2)
    inside = places[shapely.contains_xy(zones, places)]
    bounds = np.quantile(inside, (0.0, 1 / 3, 2 / 3, 1.0), axis=0)
    bounds[0], bounds[-1] = (left, low), (right, high)
    across, up = (
        [(float(a), float(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        for ends in bounds.T
    )
    return across, up


def _digits(extent: float) -> int:
    """Digits after the point of a place within an extent [m]."""
    return max(DIGITS - int(np.floor(np.log10(max(extent, 1e-9)))), 0)


def part_at(name: str) -> Assumption | None:
    """The part that a name such as `part_x_31_to_43_y_2_to_6` gives; None: it is no such name."""
    spans = _spans(name)
    if spans is None:
        return None
    words = [
        f"{axis} {span[0]:g} and {span[1]:g} m"
        for axis, span in zip("xy", spans, strict=True)
        if span is not None
    ]
    return _part(name, f"the part between {' and between '.join(words)}", *spans, digits=6)


def _spans(name: str) -> tuple[Span | None, Span | None] | None:
    """Intervals of x and y [m] that a name gives."""
    found = _PART.fullmatch(name)
    if found is None or not any(found.groups()):
        return None
    left, right, low, high = found.groups()
    across = None if left is None else (float(left), float(right))
    up = None if low is None else (float(low), float(high))
    for axis, span in (("x", across), ("y", up)):
        if span is not None and not span[1] > span[0]:
            raise InputError(f"{name}: a part runs from a lower to a higher {axis}")
    return across, up


def neighbours(scene: Scene, name: str) -> list[str]:
    """Parts of which a side or the whole lies a step away; none where `name` is no part."""
    given = _given(scene) if liquefied_zones(scene) else {}
    spans = given[name][1:] if name in given else _spans(name)
    if spans is None:
        return []
    left, bottom, right, top = liquefied_soil(scene).bounds
    whole = [(left, right), (bottom, top)]
    now = [span or all_of for span, all_of in zip(spans, whole, strict=True)]
    found = []
    for axis, count in enumerate((STRIPS, LAYERS)):
        step = (whole[axis][1] - whole[axis][0]) / count
        for low, high in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1)):
            ends = np.clip(now[axis] + step * np.array([low, high]), *whole[axis])
            if ends[1] - ends[0] >= LEAST_STEP * step and tuple(ends) != tuple(now[axis]):
                moved = [(float(ends[0]), float(ends[1])) if k == axis else now[k] for k in (0, 1)]
                found.append(_named(moved, whole))
    return [other for other in dict.fromkeys(found) if other not in (PART, name)]


def _named(spans: Sequence[Span], whole: Sequence[Span]) -> str:
    """Name of a part; an axis along which it is all of the soil is left out."""
    text = PART
    for axis, (low, high), (first, last) in zip("xy", spans, whole, strict=True):
        if low > first or high < last:
            # As few digits as tell its steps apart.
            places = _digits(last - first)
            text += f"_{axis}_{round(low, places):g}_to_{round(high, places):g}"
    return text


def _interval(centre: str, half: str, span: Span, digits: int) -> dict[str, float]:
    middle, reach = 0.5 * sum(span), 0.5 * (span[1] - span[0])
    return {centre: round(middle, digits), half: round(reach, digits)}


def _part(name: str, words: str, x: Span | None, y: Span | None, digits: int = 2) -> Assumption:
    """Another strength in one part."""
    place: dict[str, float] = {}
    for span, centre, half in ((x, "x_m", "half_width_m"), (y, "y_m", "half_height_m")):
        if span is not None:
            place |= _interval(centre, half, span, digits)
    amplitude = effect(CONTRAST).amplitude
    candidate = Candidate(
        name=name,
        family="strength",
        words=f"{words} of the liquefied soil is stronger or weaker than the rest",
        unit=amplitude.unit,
        low=amplitude.low,
        high=amplitude.high,
        ladder=tuple(sorted([*amplitude.ladder, *(-rung for rung in amplitude.ladder)])),
        prior_mean=0.0,
        prior_std=CONTRAST_STD,
        screened=True,
        placed=PLACES,
    )

    def change(setup: SectionSetup, size: float) -> SectionSetup:
        effects = setup.scene.effects
        if CONTRAST in effects:
            raise InputError(f"{name}: another part has its own strength already")
        entry = {"amplitude": size, **place}
        return setup.with_scene(setup.scene.changed(effects={**effects, CONTRAST: entry}))

    return Assumption(candidate, change)


def strength_curves(setup: SectionSetup, run: KeptRun, zones: Sequence[str]) -> list[Curve]:
    """Unknown curves over the range that the liquefied zones of a section have.

    Args:
        setup: the section.
        run: of it; its stress before failure is what counts.
        zones: that liquefied.
    """
    scene = setup.scene
    places = [number for number, zone in enumerate(scene.zones) if zone.name in zones]
    member = np.isin(run.zone, places)
    stress = 1e-3 * np.percentile(run.vertical_stress[member], (5.0, 95.0))
    x = np.percentile(run.initial[member, 0], (2.0, 98.0))
    height = float(np.ptp(run.initial[:, 1]))
    fall = np.sqrt(2.0 * height / setup.settings.gravity_m_per_s2)
    rate = np.log10(1.0 / fall)
    ranges = {
        "strain_rate": ("rate of shear", "log10 of 1/s", (rate + RATES[0], rate + RATES[1])),
        "strain": ("shear strain so far", "", STRAINS),
        "time": ("time since the slide began", "s", (0.0, FALLS * fall)),
        "overburden": ("vertical effective stress before failure", "kPa", stress),
        "position": ("place before the slide", "m", x),
    }
    return [
        Curve(variable, words, unit, tuple(np.linspace(low, high, KNOTS).tolist()))
        for variable, (words, unit, (low, high)) in ranges.items()
        if high > low
    ]
