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
from itertools import combinations_with_replacement, product

import numpy as np
import shapely
from shapely.ops import unary_union

from diagnosis.hypotheses.assumption import Assumption, Found, Sensitivities
from diagnosis.hypotheses.model import Candidate, Search
from geometry.scenes.scene import Scene
from inversion.estimation.forward import Setup
from mpm_taichi.effects import effect, liquefied_zones
from pipeline.cli import InputError

CONTRAST, PART = "strength_contrast", "part"

#: What the thirds of a zone are called.
ALONG, UPWARDS = ("left", "middle", "right"), ("lower", "middle", "upper")
#: Places in each direction at which the extent of the zone is sampled.
SAMPLES = 80
#: Strips and layers of the grid on which the place of a part is sought.
STRIPS, LAYERS = 8, 3
#: Digits of a place in the name of a part, in hundredths of the zone's extent or finer.
DIGITS = 2

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_PART = re.compile(rf"{PART}(?:_x_{_NUMBER}_to_{_NUMBER})?(?:_y_{_NUMBER}_to_{_NUMBER})?")


def assumptions(setup: Setup, sensitivities: Sensitivities) -> Found:
    """Layers, stretches and blocks of the liquefied zones."""
    if not liquefied_zones(setup.scene) or CONTRAST in setup.scene.effects:
        return [], {}
    x, y = thirds(setup.scene)
    found = [
        _part(f"{where}_layer", f"the {where} third", {**_interval("y_m", "half_height_m", span)})
        for where, span in zip(UPWARDS, y, strict=True)
    ]
    found += [
        _part(f"{where}_stretch", f"the {where} third", {**_interval("x_m", "half_width_m", span)})
        for where, span in zip(ALONG, x, strict=True)
    ]
    for up, high in zip(UPWARDS, y, strict=True):
        for along, wide in zip(ALONG, x, strict=True):
            place = {
                **_interval("x_m", "half_width_m", wide),
                **_interval("y_m", "half_height_m", high),
            }
            name = f"{up}_{along}_block" if up != along else "central_block"
            words = f"the {up} {along} part" if up != along else "the centre"
            found.append(_part(name, words, place))
    return found, {}


Span = tuple[float, float]


def thirds(scene: Scene) -> tuple[list[Span], list[Span]]:
    """Intervals of x and of y [m] that each hold a third of the area of the liquefied zones."""
    x, y = (_edges(scene, len(ALONG))[axis] for axis in (0, 1))
    return _between(x), _between(y)


def _edges(scene: Scene, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Ends in x and in y [m] of intervals that hold equal areas of the liquefied zones."""
    names = liquefied_zones(scene)
    zones = unary_union([shapely.Polygon(z.polygon) for z in scene.zones if z.name in names])
    left, low, right, high = zones.bounds
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    places = np.stack(
        np.meshgrid(left + shares * (right - left), low + shares * (high - low)), axis=-1
    ).reshape(-1, 2)
    inside = places[shapely.contains_xy(zones, places)]
    bounds = np.quantile(inside, np.arange(count + 1) / count, axis=0)
    bounds[0], bounds[-1] = (left, low), (right, high)
    return bounds[:, 0], bounds[:, 1]


def _between(edges: np.ndarray) -> list[Span]:
    return [(float(a), float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def part_search(scene: Scene) -> Search | None:
    """Cells of a grid, and the rectangles of them that may differ; None: nothing can."""
    if CONTRAST in scene.effects or not liquefied_zones(scene):
        return None
    x, y = _edges(scene, STRIPS)[0], _edges(scene, LAYERS)[1]
    # A name has its place in as few digits as tell the strips apart.
    x, y = (np.round(ends, _digits(float(np.ptp(ends)))) for ends in (x, y))

    def name(strips: tuple[int, int], layers: tuple[int, int]) -> str:
        """Of the part from the first to the last strip and layer."""
        text = PART
        if strips != (0, STRIPS - 1):
            text += f"_x_{x[strips[0]]:g}_to_{x[strips[1] + 1]:g}"
        if layers != (0, LAYERS - 1):
            text += f"_y_{y[layers[0]]:g}_to_{y[layers[1] + 1]:g}"
        return text

    cells = list(product(range(STRIPS), range(LAYERS)))
    places = {}
    for strips in combinations_with_replacement(range(STRIPS), 2):
        for layers in combinations_with_replacement(range(LAYERS), 2):
            within = [
                k
                for k, (i, j) in enumerate(cells)
                if strips[0] <= i <= strips[1] and layers[0] <= j <= layers[1]
            ]
            if len(within) < len(cells):
                places[name(strips, layers)] = within
    middle = effect(CONTRAST).amplitude.ladder[1]
    return Search([name((i, i), (j, j)) for i, j in cells], middle, places)


def _digits(extent: float) -> int:
    """Digits after the point of a place within an extent [m]."""
    return max(DIGITS - int(np.floor(np.log10(max(extent, 1e-9)))), 0)


def part_at(name: str) -> Assumption | None:
    """The part that a name such as `part_x_31_to_43_y_2_to_6` gives; None: it is no such name."""
    found = _PART.fullmatch(name)
    if found is None or not any(found.groups()):
        return None
    left, right, low, high = (None if text is None else float(text) for text in found.groups())
    place: dict[str, float] = {}
    words = []
    for axis, half, span in (("x", "half_width_m", (left, right)),
                             ("y", "half_height_m", (low, high))):  # fmt: skip
        if span[0] is None:
            continue
        if not span[1] > span[0]:
            raise InputError(f"{name}: a part runs from a lower to a higher {axis}")
        place |= _interval(f"{axis}_m", half, span, digits=6)
        words.append(f"{axis} {span[0]:g} and {span[1]:g} m")
    return _part(name, f"the part between {' and between '.join(words)}", place)


def _interval(centre: str, half: str, span: Span, digits: int = 2) -> dict[str, float]:
    middle, reach = 0.5 * sum(span), 0.5 * (span[1] - span[0])
    return {centre: round(middle, digits), half: round(reach, digits)}


def _part(name: str, words: str, place: dict[str, float]) -> Assumption:
    """Another strength in one part."""
    amplitude = effect(CONTRAST).amplitude
    candidate = Candidate(
        name=name,
        family="strength",
        words=f"{words} of the liquefied soil is stronger or weaker than the rest",
        unit=amplitude.unit,
        low=amplitude.low,
        high=amplitude.high,
        ladder=tuple(sorted([*amplitude.ladder, *(-rung for rung in amplitude.ladder)])),
        screened=True,
        placed=PART,
    )

    def change(setup: Setup, size: float) -> Setup:
        effects = setup.scene.effects
        if CONTRAST in effects:
            raise InputError(f"{name}: another part has its own strength already")
        entry = {"amplitude": size, **place}
        return setup.with_scene(setup.scene.changed(effects={**effects, CONTRAST: entry}))

    return Assumption(candidate, change)
