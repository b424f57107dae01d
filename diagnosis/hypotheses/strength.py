"""The strength of the liquefied soil on trial: one number for all of it was assumed.

Parts of it may be stronger or weaker: a layer, a stretch, a block, each a third of the zone wide or
high. Where such a part lies is not known beforehand, so each place is a hypothesis of its own. That
strength grows with the overburden, or varies at random, are effects of the library
(`overburden_strength`, `spatial_variability`) of the same family.
"""

from __future__ import annotations

import numpy as np
import shapely
from shapely.ops import unary_union

from diagnosis.hypotheses.assumption import Assumption, Found, Sensitivities
from diagnosis.hypotheses.model import Candidate
from geometry.scenes.scene import Scene
from inversion.estimation.forward import Setup
from mpm_taichi.effects import effect, liquefied_zones
from pipeline.cli import InputError

CONTRAST = "strength_contrast"

#: What the thirds of a zone are called.
ALONG, UPWARDS = ("left", "middle", "right"), ("lower", "middle", "upper")
#: Places in each direction at which the extent of the zone is sampled.
SAMPLES = 80


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


def thirds(scene: Scene) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Intervals of x and of y [m] that each hold a third of the area of the liquefied zones."""
    names = liquefied_zones(scene)
    zones = unary_union([shapely.Polygon(z.polygon) for z in scene.zones if z.name in names])
    left, low, right, high = zones.bounds
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    places = np.stack(
        np.meshgrid(left + shares * (right - left), low + shares * (high - low)), axis=-1
    ).reshape(-1, 2)
    inside = places[shapely.contains_xy(zones, places)]
    bounds = np.quantile(inside, (0.0, 1 / 3, 2 / 3, 1.0), axis=0)
    bounds[0], bounds[-1] = (left, low), (right, high)
    return tuple(
        [(float(a), float(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        for ends in bounds.T
    )


def _interval(centre: str, half: str, span: tuple[float, float]) -> dict[str, float]:
    return {centre: round(0.5 * sum(span), 2), half: round(0.5 * (span[1] - span[0]), 2)}


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
    )

    def change(setup: Setup, size: float) -> Setup:
        effects = setup.scene.effects
        if CONTRAST in effects:
            raise InputError(f"{name}: another part has its own strength already")
        entry = {"amplitude": size, **place}
        return setup.with_scene(setup.scene.changed(effects={**effects, CONTRAST: entry}))

    return Assumption(candidate, change)
