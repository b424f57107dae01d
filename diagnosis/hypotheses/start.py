"""The start on trial: in which stress did the section stand, and did it all fail at once?

A section that had settled begins in equilibrium; one that had not is shaken by its own weight. The
ratio of horizontal to vertical stress was hardly ever measured. And where several zones liquefied,
one of them may have failed after the rest. That all liquefied late, or behind a front, are effects
of the library (`late_liquefaction`, `spreading_liquefaction`).
"""

from __future__ import annotations

from diagnosis.hypotheses.assumption import (
    Assumption,
    Found,
    Sensitivities,
    slug,
    with_setting,
)
from diagnosis.hypotheses.model import Candidate, switch_of
from inversion.estimation.forward import SectionSetup, Setup
from mpm_taichi.effects import flowing_pore_water, liquefied_zones
from pipeline.cli import InputError

SETTLED, SUDDEN, RATIO, LATE = "settled_start", "sudden_start", "lateral_stress", "late"
LATENESS = "late_liquefaction"

#: K0 of soil laid down in layers is about 1 - sin(phi), 0.4 to 0.5, and up to 1 where it was
#: compacted or preloaded; one standard deviation where nothing is known.
RATIO_STD = 0.25
#: Values of K0 that the stress of soil can have: active pressure at 42 deg, and, by judgement, soil
#: that was heavily preloaded.
LOWEST_K0, HIGHEST_K0 = 0.2, 1.5
#: Times by which a zone may have been late [s], each about three times that before, and the share
#: of them in which it held its peak. By judgement: a part of a slide's duration to all of it, and a
#: fall that is fast but no jump.
DELAYS, HOLD = (2.0, 6.0, 20.0), 0.8


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """What the start may have been."""
    flowing = flowing_pore_water(setup.scene)
    found, left_out = stresses(setup, flowing=flowing)
    zones = liquefied_zones(setup.scene)
    if len(zones) < 2:
        left_out[LATE] = "one zone liquefied: none could be later than another"
    elif flowing:
        left_out[LATE] = "pore water flows in the base model, which says when each liquefied"
    elif LATENESS in setup.scene.effects:
        left_out[LATE] = "the base model has late liquefaction already"
    else:
        found += [_late(setup, name) for name in zones]
    return found, left_out


def stresses(setup: Setup, *, flowing: bool = False) -> Found:
    """Other stresses before the slide; `flowing`: pore water flows in the base model."""
    own, what = setup.settings.initial_stress, setup.kind
    found, left_out = [], {}
    if own != "settled":
        words = f"the {what} had settled before it slid"
        found.append(_start(SETTLED, words, "settled"))
    if own != "gravity_on":
        if setup.has_strength_ratio:
            left_out[SUDDEN] = "a strength ratio is of the stress before failure, which it lacks"
        elif flowing:
            left_out[SUDDEN] = "pore water begins from the stress before failure, which it lacks"
        else:
            words = f"the {what} had not settled: its weight came on all at once"
            found.append(_start(SUDDEN, words, "gravity_on"))
        found.append(_ratio(setup))
    else:
        left_out[RATIO] = "gravity comes on at once: there is no stress before"
    return found, left_out


def _start(name: str, words: str, initial_stress: str) -> Assumption:
    return Assumption(
        switch_of(name, "start", words), lambda s, _: with_setting(s, initial_stress=initial_stress)
    )


def _ratio(setup: Setup) -> Assumption:
    """Another K0 at the start; the amplitude is the difference from the base model's."""
    own = k0_of(setup)
    ladder = sorted(
        min(max(step * RATIO_STD, LOWEST_K0 - own), HIGHEST_K0 - own) for step in (-1.0, 1.0, 2.0)
    )
    candidate = Candidate(
        name=RATIO,
        family="start",
        words="the ratio of horizontal to vertical stress before the slide was another",
        unit="",
        low=LOWEST_K0 - own,
        high=HIGHEST_K0 - own,
        ladder=tuple(rung for rung in dict.fromkeys(ladder) if rung != 0.0),
        prior_mean=0.0,
        prior_std=RATIO_STD,
        screened=True,
    )
    return Assumption(candidate, lambda s, change: with_setting(s, k0=own + change))


def k0_of(setup: Setup) -> float:
    """K0 that the base model starts from: the setting, else the mean over its materials."""
    if setup.settings.k0 is not None:
        return setup.settings.k0
    ratios = [soil.poisson_ratio for soil in setup.soil.materials.values()]
    return sum(nu / (1.0 - nu) for nu in ratios) / len(ratios)


def _late(setup: SectionSetup, zone: str) -> Assumption:
    """A zone that liquefied after the rest, by the amplitude."""
    name = f"{LATE}_{slug(zone)}"
    number = 1 + [one.name for one in setup.scene.zones].index(zone)
    candidate = Candidate(
        name=name,
        family="start",
        words=f"zone {zone} liquefied after the rest",
        unit="s",
        low=0.0,
        high=10.0 * DELAYS[-1],
        ladder=DELAYS,
        screened=True,
    )

    def change(setup: SectionSetup, delay: float) -> SectionSetup:
        effects = setup.scene.effects
        if LATENESS in effects:
            raise InputError(f"{name}: another zone liquefied late already")
        entry = {"amplitude": delay, "hold": HOLD, "zone": float(number)}
        return setup.with_scene(setup.scene.changed(effects={**effects, LATENESS: entry}))

    return Assumption(candidate, change)
