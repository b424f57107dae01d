"""A body in plan, frame by frame, as the page gets it: one binary message (`frames.message`).

Arrays of a message; a map has (nx, ny) cells, T frames are times:

- `base` (nx, ny) f4: elevation of the ground that does not move [m];
- `thickness` (T, nx, ny) f4: of the soil [m];
- `shade` (T, nx, ny) u1: hillshade of the surface, 255 is brightest;
- `zone` (T, nx, ny) u1: place of the zone whose point lies highest; 255: there is no point;
- `speed` (nx, ny) f4, of a slide: largest speed of the points that ended there [m/s]; NaN: none;
- `water` (nx, ny) f4, where there is some: level of pool and groundwater before the slide [m];
- `measured` (nx, ny) f4, where it was surveyed: elevation of the surface after the slide [m];
- `exceedance` (K, nx, ny) f4, of a prediction: probability that the deposit is thicker.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flowslide.studio.frames import FRAMES, message
from geometry.scenes3d.scene3d import Scene3d
from geometry.survey3d.measured import DepositMap, MapMeasured, MapNumber, MapPlaces
from geometry.survey3d.surface_after import SurfaceAfter
from geometry.terrain.raster import Raster, hillshade
from mpm_taichi.readings3d import Maps, maps_of, named
from mpm_taichi.solver3d.problem import Problem3d
from mpm_taichi.trajectory3d import Run3d
from report.numbers import unit_of

#: Cells of all frames of a film: 30 MB of a message.
MOST_CELLS = 5_000_000
NO_ZONE = 255


def ground_message(scene: Scene3d, problem: Problem3d, measured: Raster | None) -> bytes:
    """The message of a body before the slide: one frame.

    Args:
        scene: the body.
        problem: its points.
        measured: the surface after the slide as surveyed; None: it was not.
    """
    maps = maps_of(scene, problem)
    return message(
        {"type": "ground", "times": [0.0], **_head(scene, problem, maps)},
        {**_still(maps, problem, measured), **_frame(maps, problem, problem.position)},
    )


def slide_message(
    scene: Scene3d,
    problem: Problem3d,
    run: Run3d,
    readings: Sequence[Mapping[str, Any]],
    warning: str,
    measured: Raster | None,
    *,
    duration_s: float,
    **more: Any,
) -> bytes:
    """The message of a run.

    Args:
        scene: that was simulated.
        problem: its points.
        run: of them.
        readings: rows of `reading_rows`.
        warning: what makes readings wrong; empty: nothing.
        measured: the surface after the slide as surveyed; None: it was not.
        duration_s: that the run was given; one that ends earlier has come to rest.
        more: of the header.
    """
    maps = maps_of(scene, problem, run)
    assert maps.after is not None and maps.speed is not None
    places = chosen_frames(run.positions.shape[0], maps.before.values.size)
    frames = [
        _frame(maps_of(scene, problem, run, frame=int(k)), problem, run.positions[k])
        for k in places
    ]
    header = {
        "type": "slide",
        "times": [round(float(run.time[k]), 3) for k in places],
        "frames_of_run": int(run.positions.shape[0]),
        "came_to_rest": bool(run.time[-1] < duration_s - 0.5 * float(run.time[1])),
        "computed_s": round(run.wall_time_s, 2),
        "readings": list(readings),
        "warning": warning,
        **_head(scene, problem, maps),
        **more,
    }
    arrays = {name: np.concatenate([one[name] for one in frames]) for name in frames[0]}
    arrays |= {**_still(maps, problem, measured), "speed": _f4(maps.speed.values)}
    return message(header, arrays)


def exceedance_message(
    scene: Scene3d, problem: Problem3d, exceedance: Mapping[float, Raster], **more: Any
) -> bytes:
    """The message of a prediction: thickness [m] -> probability, over the body before the slide."""
    maps = maps_of(scene, problem)
    header = {
        "type": "exceedance",
        "times": [0.0],
        "thicker_than_m": [float(one) for one in exceedance],
        **_head(scene, problem, maps),
        **more,
    }
    arrays = {**_still(maps, problem, None), **_frame(maps, problem, problem.position)}
    arrays["exceedance"] = np.stack([_f4(one.values) for one in exceedance.values()])
    return message(header, arrays)


def chosen_frames(count: int, cells: int) -> np.ndarray:
    """Frames of a run that the page gets, evenly spread, the first and the last among them."""
    most = int(np.clip(MOST_CELLS // max(cells, 1), 2, FRAMES))
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))


def reading_rows(
    scene: Scene3d, maps: Maps, readings: Mapping[str, float], entries: Sequence[MapMeasured]
) -> list[dict[str, Any]]:
    """What is read of a run, next to what was measured: rows as those of a section.

    Args:
        scene: that was simulated.
        maps: of the run.
        readings: name with unit -> number.
        entries: what was measured.
    """
    assert maps.after is not None
    of_reading = {one.reading: one for one in entries if isinstance(one, MapNumber)}
    rows = []
    for name, value in readings.items():
        words, unit = named(name)
        rows.append(_row(words, unit, value, of_reading.get(name)))
    surface = None if scene.ground is None else scene.ground.surface
    deposit = DepositMap(surface, maps.base, maps.before, maps.after, maps.least, readings)
    return rows + [_places_row(one, deposit) for one in entries if isinstance(one, MapPlaces)]


def _row(words: str, unit: str, value: float, measured: MapNumber | None) -> dict[str, Any]:
    known = np.isfinite(value)
    row: dict[str, Any] = {
        "name": words,
        "label": words,
        "unit": unit_of(unit),
        "simulated": float(value) if known else None,
        "measured": None,
        "below": "",
        "std": None,
        "in_std": None,
        "confidence": None,
        "held_out": False,
        "trouble": "" if known else "nothing to read",
    }
    if measured is None:
        return row
    (there,) = measured.values
    row |= {"name": measured.name, "measured": float(there), "std": measured.std}
    row |= {"confidence": measured.confidence, "held_out": measured.held_out}
    row["in_std"] = float((value - there) / measured.std) if known else None
    return row


def _places_row(entry: MapPlaces, deposit: DepositMap) -> dict[str, Any]:
    """Many places as one row: root mean square of the differences, in standard deviations too."""
    off = entry.read(deposit) - entry.values
    rms = float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else float("nan")
    words = f"{entry.name}, {len(off)} places: rms off"
    row = _row(words, entry.unit, rms, None)
    row |= {"name": entry.name, "confidence": entry.confidence, "held_out": entry.held_out}
    row["in_std"] = None if np.isnan(rms) else rms / entry.std
    return row


def _head(scene: Scene3d, problem: Problem3d, maps: Maps) -> dict[str, Any]:
    return {
        "name": scene.name,
        "spacing_m": problem.spacing,
        "points": len(problem.position),
        "cell_m": maps.before.spacing,
        "first": list(maps.before.origin),
        "shape": list(maps.before.values.shape),
        "least_m": maps.least,
        "strengths_kpa": {key: one.cohesion_kpa for key, one in scene.soil.materials.items()},
    }


def _frame(maps: Maps, problem: Problem3d, position: np.ndarray) -> dict[str, np.ndarray]:
    """Maps of a frame, each (1, nx, ny)."""
    shade = np.rint(255.0 * hillshade(maps.surface)).astype(np.uint8)
    found = {
        "thickness": _f4(maps.deposit.values),
        "shade": shade,
        "zone": _highest(maps, problem, position),
    }
    return {name: values[None] for name, values in found.items()}


def _highest(maps: Maps, problem: Problem3d, position: np.ndarray) -> np.ndarray:
    """Zone (nx, ny) of the highest point of each cell."""
    raster = maps.before
    nx, ny = raster.values.shape
    place = np.rint((position[:, :2] - raster.origin) / raster.spacing).astype(int)
    i, j = np.clip(place[:, 0], 0, nx - 1), np.clip(place[:, 1], 0, ny - 1)
    upwards = np.argsort(position[:, 2], kind="stable")
    zone = np.full((nx, ny), NO_ZONE, np.uint8)
    # Where places repeat, the last one counts: the highest.
    zone[i[upwards], j[upwards]] = np.minimum(problem.zone[upwards], NO_ZONE - 1)
    return zone


def measured_surface(scene: Scene3d, entries: Sequence[MapMeasured]) -> Raster | None:
    """The surface after the slide as surveyed: that which is fitted, else that of the terrain."""
    surveyed = [one.raster for one in entries if isinstance(one, SurfaceAfter)]
    if surveyed:
        return surveyed[0]
    return None if scene.ground is None else scene.ground.after


def _still(maps: Maps, problem: Problem3d, raster: Raster | None) -> dict[str, np.ndarray]:
    """What does not change from frame to frame: ground, water, and the surveyed surface.

    The latter is NaN beyond its edges.
    """
    found = {"base": _f4(maps.base.values)}
    x, y = np.meshgrid(*maps.before.axes, indexing="ij")
    if problem.water is not None:
        found["water"] = _f4(problem.water.at(x, y))
    if raster is None:
        return found
    ends = [(axis[0], axis[-1]) for axis in raster.axes]
    inside = [(low <= one) & (one <= high) for one, (low, high) in zip((x, y), ends, strict=True)]
    return {**found, "measured": _f4(np.where(inside[0] & inside[1], raster.at(x, y), np.nan))}


def _f4(values: np.ndarray) -> np.ndarray:
    return np.asarray(values).astype("<f4")
