"""What could be measured next: places and times on a section, as measurements without a value.

In: the section and what was measured. Out: `Measured` entries, one for each thing a surveyor could
go and read: the surface at a place, the way of a stake, the toe at a time (from a film, a tide
gauge, a witness), how long it took, how high the remnant stands. What has been measured already is
not among them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import TypeAdapter
from shapely.geometry import Point as PlacedPoint
from shapely.geometry import Polygon

from diagnosis.hypotheses.model import Proposal
from geometry.scenes.scene import Scene
from geometry.survey.measured import Measured
from geometry.survey.measured_numbers import Freeboard, MarkerDisplacement, ToeRunout
from geometry.survey.measured_series import SlideDuration, SurfaceProfile, ToeHistory
from geometry.survey.measurements import Measurement
from geometry.survey.profiles import WHOLE, Profile
from inversion.engines.mpm_engine import Setup

#: Standard deviations where the case has none of the kind: share of the section's height, and the
#: least [m].
USUAL = {SurfaceProfile: (0.01, 0.1), ToeRunout: (0.02, 0.3), ToeHistory: (0.02, 0.5),
         MarkerDisplacement: (0.007, 0.1), Freeboard: (0.01, 0.1)}  # fmt: skip
#: Of a duration, in times of a fall from the section's height.
DURATION_SHARE = 0.3
#: Places along the surface, stakes along the section, times in falls from its height.
SURFACE_PLACES, STAKES, TIMES = 10, 6, (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)

_ENTRY = TypeAdapter(Measurement)
_ABOUT = {"confidence": "assumed", "source": "not measured yet"}


def possible_measurements(setup: Setup) -> list[Measured]:
    """Measurements that could still be made on a section."""
    scene, had = setup.scene, made(setup)
    height = _height(scene)
    fall = float(np.sqrt(2.0 * height / setup.settings.gravity_m_per_s2))
    documents: list[dict[str, Any]] = []
    surfaces: list[float] = []
    surveyed = [x for e in had if isinstance(e, SurfaceProfile) for x in e.profile.x]
    for x in _between(*reach(setup), SURFACE_PLACES):
        if _far(x, surveyed, 2.0 * scene.spacing):
            surfaces.append(x)
    stakes = [e.x_m for e in had if isinstance(e, MarkerDisplacement)]
    for x, y in _stakes(scene):
        if _far(x, stakes, 2.0 * scene.spacing):
            documents.append({"type": "marker_displacement", "name": f"stake at x {x:g} m",
                              "x_m": x, "y_m": y, "dx_m": 0.0, "dy_m": 0.0})  # fmt: skip
    filmed = {e.side for e in had if isinstance(e, ToeHistory)}
    for side in _sides(had):
        if side not in filmed:
            documents += [
                {"type": "toe_history", "name": f"{side} toe", "side": side, "values_m": [0.0],
                 "times_s": [round(share * fall, 1)]}
                for share in TIMES
            ]  # fmt: skip
        if not any(isinstance(e, ToeRunout) and e.side == side for e in had):
            documents.append({"type": "toe_runout", "name": f"{side} toe in the end",
                              "side": side, "value_m": 0.0})  # fmt: skip
    if not any(isinstance(e, SlideDuration) for e in had):
        documents.append({"type": "slide_duration", "name": "duration of the slide",
                          "value_s": 0.0, "std_s": round(DURATION_SHARE * fall, 2)})  # fmt: skip
    if scene.has_water and not any(isinstance(e, Freeboard) for e in had):
        documents.append({"type": "freeboard", "name": "freeboard of the remnant",
                          "water_level_m": scene.water_level, "value_m": 0.0})  # fmt: skip
    found = [_entry(document, setup, height) for document in documents]
    return [*(_surface(x, setup, height) for x in surfaces), *found]


def made(setup: Setup) -> list[Measured]:
    """Measurements that were made; what was constructed was not."""
    return [entry for entry in setup.targets.entries if not entry.constructed]


def proposal_of(entry: Measured, first: int) -> Proposal:
    """A measurement as the statistics see it.

    Args:
        entry: the measurement.
        first: place of its first number among those of all proposals.
    """
    numbers = tuple(range(first, first + len(entry.values)))
    place = f" {entry.parts[0]}" if isinstance(entry, SurfaceProfile | ToeHistory) else ""
    return Proposal(
        name=f"{entry.name}{place}",
        words=f"{entry.name}{place}, to {entry.std:g} {entry.unit}",
        index=numbers,
        covariance=entry.covariance(),
    )


def reach(setup: Setup) -> tuple[float, float]:
    """Where soil lies before or after the slide, as far as that is known, x from and to [m]."""
    scene, places = setup.scene, [setup.scene.foot("left"), setup.scene.foot("right")]
    for entry in made(setup):
        if isinstance(entry, SurfaceProfile):
            places += entry.profile.x.tolist()
        elif isinstance(entry, ToeRunout):
            outward = -1.0 if entry.side == "left" else 1.0
            places.append(setup.foot[entry.side] + outward * entry.value_m)
    return max(min(places), scene.domain.x_min), min(max(places), scene.domain.x_max)


def _sides(had: list[Measured]) -> list[str]:
    """Sides to which the slide ran, as far as toes were measured."""
    sides = [e.side for e in had if isinstance(e, ToeRunout | ToeHistory)]
    return list(dict.fromkeys(sides)) or ["left", "right"]


def _height(scene: Scene) -> float:
    top = max(y for zone in scene.zones for _, y in zone.polygon)
    return top - scene.ground.lowest


def _between(first: float, last: float, count: int) -> list[float]:
    """Places well within a stretch."""
    ends = first + 0.04 * (last - first), last - 0.04 * (last - first)
    return [round(float(x), 1) for x in np.linspace(*ends, count)]


def _far(x: float, others: list[float], least: float) -> bool:
    return all(abs(x - other) > least for other in others)


def _stakes(scene: Scene) -> list[tuple[float, float]]:
    """Places just below the surface before the slide."""
    outlines = [Polygon(zone.polygon) for zone in scene.zones]
    found = []
    for x in _between(scene.foot("left"), scene.foot("right"), STAKES):
        for y in np.arange(_height(scene) + scene.ground.lowest, scene.ground.lowest, -0.25):
            place = PlacedPoint(x, y - scene.spacing)
            if any(outline.contains(place) for outline in outlines):
                found.append((x, round(float(y) - scene.spacing, 2)))
                break
    return found


def _std(kind: type[Measured], setup: Setup, height: float) -> float:
    """That of the case's own measurements of the kind, else what is usual."""
    own = [entry.std for entry in made(setup) if isinstance(entry, kind)]
    share, least = USUAL[kind]
    return min(own) if own else float(f"{max(share * height, least):.2g}")


def _entry(document: dict[str, Any], setup: Setup, height: float) -> Measured:
    kind = {"marker_displacement": MarkerDisplacement, "toe_history": ToeHistory,
            "toe_runout": ToeRunout, "freeboard": Freeboard}.get(document["type"])  # fmt: skip
    std = {} if kind is None else {"std_m": _std(kind, setup, height)}
    return _ENTRY.validate_python({**document, **std, **_ABOUT})


def _surface(x: float, setup: Setup, height: float) -> Measured:
    entry = _ENTRY.validate_python(
        {"type": "surface_profile", "name": "surface", "file": "none",
         "std_m": _std(SurfaceProfile, setup, height), **_ABOUT}
    )  # fmt: skip
    entry.attach(Profile(np.array([x]), np.array([0.0]), [WHOLE]))
    return entry
