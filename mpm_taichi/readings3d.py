"""A three-dimensional run read in plan: maps, and the numbers that are read from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geometry.scenes3d.scene3d import Scene3d
from geometry.survey3d.deposit import (
    Plan,
    inundated_area,
    runout_along,
    threshold,
    toe_line,
    volume_beyond,
)
from geometry.terrain.raster import Raster
from mpm_taichi.solver3d.problem import Problem3d
from mpm_taichi.trajectory3d import Run3d

UNITS = {"_m3_per_s": "m3/s", "_m_per_s": "m/s", "_m3": "m3", "_m2": "m2", "_m": "m", "_s": "s"}
"""End of the name of a reading -> its unit."""
BACK = 0.01
"""Least share of what moved that makes soil cross a line the other way."""
ACROSS = ("volume_across_", "_m3")
"""Before and after the name of a line in the reading of what has crossed it to its right."""


@dataclass(frozen=True)
class Maps:
    """Rasters at the same places, pixels as wide as a cell of the solver."""

    base: Raster  # elevation of the ground [m]
    before: Raster  # thickness of the soil [m]
    after: Raster | None  # the same at the end; None: nothing has been simulated
    speed: Raster | None  # largest speed of the points that ended there [m/s]; NaN: none
    least: float  # thickness from which soil is a deposit [m]

    @property
    def deposit(self) -> Raster:
        """Thickness at the end of the run, or before anything moved [m]."""
        return self.before if self.after is None else self.after

    @property
    def surface(self) -> Raster:
        """Elevation of the ground with the soil on it [m]."""
        base = self.base
        return Raster(base.origin, base.spacing, base.values + self.deposit.values, base.crs)


def maps_of(
    scene: Scene3d, problem: Problem3d, run: Run3d | None = None, *, frame: int = -1
) -> Maps:
    """The maps of a problem, and of a frame of its run: the last unless another is named."""
    crs = scene.ground.surface.crs if scene.ground else ""
    plan = Plan.over(problem.domain[:4], problem.cells_per_spacing * problem.spacing, crs)
    before = plan.thickness(problem.position, problem.volume)
    x, y = np.meshgrid(*before.axes, indexing="ij")
    after = speed = None
    if run is not None:
        end = run.positions[frame].astype(float)
        after, speed = plan.thickness(end, run.volume), plan.largest(end, run.top_speed)
    least = threshold(problem.spacing)
    return Maps(plan.raster(problem.base.at(x, y)), before, after, speed, least)


def paths_of(scene: Scene3d, maps: Maps) -> dict[str, np.ndarray]:
    """The paths of a scene, name -> (P, 2) [m]; the middle towards its side if it has none."""
    if scene.document.paths:
        return {name: np.asarray(path, float) for name, path in scene.document.paths.items()}
    x, y = maps.before.axes
    ends = [x[-1], x[0]] if scene.document.side == "left" else [x[0], x[-1]]
    return {"middle": np.array([[end, 0.5 * (y[0] + y[-1])] for end in ends])}


def readings_3d(scene: Scene3d, problem: Problem3d, run: Run3d, maps: Maps) -> dict[str, float]:
    """What is read of a run: name with its unit -> number; NaN where there is nothing to read."""
    assert maps.after is not None
    side, least = scene.document.side, maps.least
    outward = -1.0 if side == "left" else 1.0
    first, last = (
        _outermost(outward * toe_line(deposit, least, side)[1])
        for deposit in (maps.before, maps.after)
    )
    start, end = problem.position, run.positions[-1].astype(float)
    beyond = [problem.volume[outward * place[:, 0] > first].sum() for place in (start, end)]
    found = {
        "duration_s": float(run.time[-1]),
        "toe_runout_m": last - first,
        "inundated_area_m2": inundated_area(maps.before, maps.after, least),
        "volume_beyond_foot_m3": float(beyond[1] - beyond[0]),
        "volume_moved_m3": float(
            problem.volume[np.linalg.norm(end - start, axis=1) > problem.spacing].sum()
        ),
        "largest_speed_m_per_s": float(run.top_speed.max()),
    }
    for name, path in paths_of(scene, maps).items():
        before, after = (
            runout_along(deposit, path, least) for deposit in (maps.before, maps.after)
        )
        found[f"runout_{name}_m"] = after - (0.0 if np.isnan(before) else before)
    for name, line in scene.document.lines.items():
        before, after = (volume_beyond(place, problem.volume, *line) for place in (start, end))
        found[name.join(ACROSS)] = after - before
    if scene.ground is not None and scene.ground.after is not None:
        x, y = np.meshgrid(*maps.after.axes, indexing="ij")
        off = maps.surface.values - scene.ground.after.at(x, y)
        found["rms_to_measured_surface_m"] = float(np.sqrt(np.mean(off**2)))
    return found


def volumes_across(
    scene: Scene3d, problem: Problem3d, run: Run3d, times: np.ndarray
) -> dict[str, np.ndarray]:
    """Volume that has crossed each line to its right by some times: name -> (k,) [m3].

    Args:
        scene: with the lines.
        problem: of the run.
        run: its frames; after the last the soil stays where it is.
        times: after the start of the slide, (k,) [s].
    """
    found = {}
    for name, line in scene.document.lines.items():
        right = np.array(
            [volume_beyond(place.astype(float), problem.volume, *line) for place in run.positions]
        )
        found[name] = np.interp(times, run.time, right - right[0])
    return found


def crossed_to_the_left(readings: Mapping[str, float]) -> list[str]:
    """Lines that more soil crossed to their left than to their right; readings of `readings_3d`.

    Of what moved at least `BACK`: a point that rebounds is no slide the other way.
    """
    begin, end = ACROSS
    least = BACK * readings.get("volume_moved_m3", 0.0)
    return [
        name.removeprefix(begin).removesuffix(end)
        for name, volume in readings.items()
        if name.startswith(begin) and volume < -least
    ]


def named(reading: str) -> tuple[str, str]:
    """Words and unit of a reading: "toe_runout_m" -> ("toe runout", "m")."""
    end = next(end for end in UNITS if reading.endswith(end))
    return reading.removesuffix(end).replace("_", " "), UNITS[end]


def _outermost(toe: np.ndarray) -> float:
    known = toe[~np.isnan(toe)]
    return float(known.max()) if len(known) else float("nan")


def walls_reached(scene: Scene3d, maps: Maps) -> list[str]:
    """Walls at which soil came to lie where there was none: the domain is too small.

    Flanks of a section are part of it and are not named.
    """
    assert maps.after is not None
    new = (maps.after.values >= maps.least) & (maps.before.values < maps.least)
    edges = {"x_min": new[0], "x_max": new[-1]}
    if scene.section is None:
        edges |= {"y_min": new[:, 0], "y_max": new[:, -1]}
    return [name for name, edge in edges.items() if edge.any()]
