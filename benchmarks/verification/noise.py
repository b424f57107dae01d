"""Noise of a result, measured on the Lower San Fernando section at 1 m.

Point jitter (16 seeds), motion after rest, volume gained, pressure that differs from point to
point. Public codes of the same kind showed 6 % of scatter of the toe, 2-4 % of the peak energy as
motion that never ends, and 40-100 % more volume at the free surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from benchmarks.dam_section import dam_section
from benchmarks.verification.rows import Row
from geometry.scenes.scene import Scene
from geometry.survey.columns import kernel
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings

TITLE = "Noise: point jitter, motion after rest, volume, pressure (Lower San Fernando)"

SIDE = "left"
JITTER = 0.6
"""Every point is moved at random by up to 0.3 spacings in x and in y."""
AFTER_REST_S = 20.0
REACH = 3.0
"""The neighbourhood of a point in which pressure is compared, in spacings: 1.5 cells."""

TITLE_STYLE = {"loc": "left", "fontsize": 10}


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Measure all four kinds of noise; a picture goes to `folder`."""
    scene = dam_section().changed(spacing=2.0 if quick else 1.0)
    seeds = simulate_seeds(scene, 3 if quick else 16)
    runouts = np.array([runout(run) for run in seeds])
    (base,) = simulate([scene], SimulationSettings(), threads=1)
    longer = SimulationSettings(early_stop=False, duration_s=float(base.time[-1]) + AFTER_REST_S)
    (rest,) = simulate([scene], longer, threads=1)
    (single,) = simulate([scene], SimulationSettings(volumetric_averaging=False), threads=1)
    with_mean, without_mean = pressure_noise(base), pressure_noise(single)
    if folder is not None:
        draw(folder / "noise.png", seeds, base, rest, single)
    scatter = 100.0 * float(runouts.std(ddof=1) / runouts.mean())
    moved = abs(runout(rest) - runout(rest, base.frames - 1)) / scene.spacing
    kinetic = rest.energy["kinetic"]
    grown = 100.0 * (soil_area(base, -1) / soil_area(base, 0) - 1.0)
    seeds_note = (
        f"{len(seeds)} seeds, points moved by up to {JITTER / 2:g} spacings; "
        f"runout {runouts.mean():.1f} m, std {runouts.std(ddof=1):.2f} m, on the lattice "
        f"{runout(base):.1f} m"
    )
    later = f"{AFTER_REST_S:g} s after rest"
    return [
        bound("toe: standard deviation over jitter, of the runout", scatter, 2.0, "%", seeds_note),
        bound(f"toe: shift in {later}", moved, 0.1, "spacing"),
        bound(f"kinetic energy {later}, of its peak", 100 * kinetic[-1] / kinetic.max(), 0.1, "%"),
        bound(
            "volume of all points: growth",
            100.0 * abs(float(base.audit["volume_growth"])),
            2.0,
            "%",
            "as the solver counts it",
        ),
        bound(
            "area of the deposit: growth",
            abs(grown),
            2.0,
            "%",
            f"within the outline; {grown:+.2f} %",
        ),
        bound(
            "pressure noise in the phi = 0 zone at the start, of its mean",
            100.0 * with_mean.start,
            5.0,
            "%",
            f"without F-bar {100 * without_mean.start:.1f} %",
        ),
        bound(
            "the same after the flow, of that without F-bar",
            with_mean.end / without_mean.end,
            0.5,
            "",
            f"{100 * with_mean.end:.0f} % of the mean pressure with F-bar, "
            f"{100 * without_mean.end:.0f} % without",
        ),
    ]


def bound(quantity: str, measured: float, most: float, unit: str, note: str = "") -> Row:
    """A row that passes where `measured` does not exceed `most`."""
    return Row("noise", quantity, float(measured), most, 0.0, unit, bound=True, note=note)


def simulate_seeds(scene: Scene, number: int) -> list[Run]:
    """The same scene with points moved at random, by seed."""
    scenes = [scene.changed(jitter=JITTER, seed=seed) for seed in range(number)]
    return simulate(scenes, SimulationSettings(), threads=1)


def runout(run: Run, frame: int = -1) -> float:
    """Toe runout of a frame [m]."""
    return toe_runout(
        run.positions[frame].astype(float),
        run.initial_volume,
        spacing=run.scene.spacing,
        side=SIDE,
        initial_toe=run.scene.foot(SIDE),
    )


def soil_area(run: Run, frame: int, *, length: float = 1.5, fine: int = 4) -> float:
    """Area [m2] in which the soil fills more than half of the space.

    The share of the space that soil fills is the mass, smoothed by a B-spline of `length` spacings,
    on a grid of `fine` cells a spacing. A straight edge lies where the share is one half, so the
    area of a body that neither gains nor loses volume stays what it is.
    """
    spacing = run.scene.spacing
    reach, step = length * spacing, spacing / fine
    points = run.positions[frame].astype(float)
    low = points.min(axis=0) - 3.0 * reach
    shape = np.ceil((points.max(axis=0) + 3.0 * reach - low) / step).astype(int)
    share = np.zeros(shape)
    centre = np.floor((points - low) / step).astype(int)
    offset = (points - low) / step - centre - 0.5
    span = int(2.0 * reach / step) + 1
    for i in range(-span, span + 1):
        across = run.initial_volume * kernel((i - offset[:, 0]) * step, reach)
        for j in range(-span, span + 1):
            weight = across * kernel((j - offset[:, 1]) * step, reach)
            np.add.at(share, (centre[:, 0] + i, centre[:, 1] + j), weight)
    return float((share > 0.5).sum() * step**2)


# --- pressure ---


@dataclass(frozen=True)
class PressureNoise:
    """Noise of the pressure in the liquefied zones, over their mean pressure."""

    start: float
    end: float


def pressure_noise(run: Run) -> PressureNoise:
    """Root mean square of (pressure of a point - plane through its neighbours), over the mean.

    The neighbours are the points of the liquefied zones within `REACH` spacings: a pressure that
    rises evenly with depth has no noise, a pressure that alternates from cell to cell has.
    """
    liquefied = np.array([m.liquefied for m in run.scene.materials.values()])[run.material]
    values = []
    for frame, stress in ((0, run.initial_stress), (-1, run.stress)):
        pressure = pressure_of(stress)[liquefied]
        points = run.positions[frame][liquefied].astype(float) / run.scene.spacing
        ripple = off_the_plane(points, pressure)
        values.append(float(np.sqrt(np.mean(ripple**2)) / pressure.mean()))
    return PressureNoise(*values)


def pressure_of(stress: np.ndarray) -> np.ndarray:
    """Mean pressure (N,) [Pa], compression positive, of stresses (N, 4)."""
    return -stress[:, :3].astype(float).mean(axis=1)


def off_the_plane(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Each value minus the plane fitted to its neighbours; points with fewer than 8 are left out.

    Args:
        points: (N, 2) in spacings.
        values: (N,).
    """
    ripple = []
    for own, near in enumerate(cKDTree(points).query_ball_point(points, REACH)):
        if len(near) >= 8:
            plane = np.column_stack([np.ones(len(near)), points[near] - points[own]])
            ripple.append(values[own] - np.linalg.lstsq(plane, values[near], rcond=None)[0][0])
    return np.array(ripple)


# --- picture ---


def draw(path: Path, seeds: list[Run], base: Run, rest: Run, single: Run) -> None:
    """Surfaces of all seeds, kinetic energy until long after rest, pressure with and without."""
    figure = Figure(figsize=(11.0, 9.0), dpi=120, layout="constrained")
    grid = figure.add_gridspec(4, 2, height_ratios=[1.15, 2.2, 1.3, 1.3])
    _draw_surfaces(figure.add_subplot(grid[0, :]), seeds, base)
    _draw_toes(figure.add_subplot(grid[1, 0]), seeds, base)
    _draw_energy(figure.add_subplot(grid[1, 1]), base, rest)
    panels = [figure.add_subplot(grid[2, :]), figure.add_subplot(grid[3, :])]
    titles = ["Pressure after the flow, F-bar", "Pressure after the flow, without F-bar"]
    for ax, run, title in zip(panels, (base, single), titles, strict=True):
        share = 100.0 * pressure_noise(run).end
        coloured = _draw_pressure(ax, run)
        ax.set_title(f"{title}: noise {share:.0f} % in the liquefied zone", **TITLE_STYLE)
    figure.colorbar(coloured, ax=panels, label="pressure (kPa)", extend="both", shrink=0.8)
    figure.savefig(path)


def _draw_surfaces(ax: Axes, seeds: list[Run], base: Run) -> None:
    scene = base.scene
    points = base.positions[-1]
    x = np.linspace(points[:, 0].min() - 4.0, scene.foot("right") + 2.0, 700)
    level = float(scene.ground.height(0.0))
    for run in seeds:
        y = surface_profile(
            run.positions[-1].astype(float), run.initial_volume, x, spacing=scene.spacing,
            ground=level,
        )  # fmt: skip
        ax.plot(x, y, color="#0b3c8c", linewidth=0.7, alpha=0.5)
    before = surface_profile(
        base.positions[0].astype(float), base.initial_volume, x, spacing=scene.spacing,
        ground=level,
    )  # fmt: skip
    ax.plot(x, before, color="#444444", linewidth=1.0, linestyle="--", label="before")
    ax.plot([], [], color="#0b3c8c", linewidth=1.0, label=f"after, {len(seeds)} seeds")
    ax.axhline(level, color="#4d4842", linewidth=1.0)
    ax.set(xlabel="x (m)", ylabel="y (m)", xlim=(x[0], x[-1]), aspect="equal")
    ax.legend(frameon=False, fontsize=8, loc="upper left")
    ax.set_title(
        f"Surfaces of {len(seeds)} runs whose points are moved by up to {JITTER / 2:g} spacings",
        **TITLE_STYLE,
    )


def _draw_toes(ax: Axes, seeds: list[Run], base: Run) -> None:
    runouts = np.array([runout(run) for run in seeds])
    mean, std = runouts.mean(), runouts.std(ddof=1)
    ax.axhspan(0.98 * mean, 1.02 * mean, color="#dddddd", label="mean ± 2 %")
    ax.plot(range(len(seeds)), runouts, "o", color="#0b3c8c", markersize=5, label="seeds")
    ax.axhline(runout(base), color="#d55e00", linewidth=1.2, label="regular lattice")
    ax.set(xlabel="seed", ylabel="toe runout (m)", ylim=(0.96 * mean, 1.04 * mean))
    ax.legend(frameon=False, fontsize=8, ncols=3, loc="upper center")
    ax.set_title(f"Toe runout: std {std:.2f} m, {100 * std / mean:.2f} %", **TITLE_STYLE)


def _draw_energy(ax: Axes, base: Run, rest: Run) -> None:
    share = rest.energy["kinetic"] / rest.energy["kinetic"].max()
    ax.semilogy(rest.time, np.maximum(share, 1e-12), color="#0b3c8c", linewidth=1.2)
    ax.axvline(base.time[-1], color="#444444", linewidth=0.9, linestyle="--")
    ax.annotate(
        "early stop ", (base.time[-1], 0.4), ha="right", va="center", fontsize=8, color="#444444"
    )
    ax.axhline(1e-3, color="#d55e00", linewidth=1.0)
    ax.annotate("0.1 %", (0.5, 1.2e-3), fontsize=8, color="#d55e00", va="bottom")
    ax.set(xlabel="t (s)", ylabel="kinetic energy / its peak", xlim=(0, rest.time[-1]))
    ax.set_ylim(1e-7, 2.0)
    ax.set_title(f"Motion until {AFTER_REST_S:g} s after rest", **TITLE_STYLE)


def _draw_pressure(ax: Axes, run: Run) -> PathCollection:
    points = run.positions[-1]
    ax.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    ax.set(xlim=(points[:, 0].min() - 4.0, 260.0), ylim=(0.0, 38.0))
    return ax.scatter(
        points[:, 0],
        points[:, 1],
        c=pressure_of(run.stress) / 1e3,
        s=8.0 * run.scene.spacing**2,
        linewidths=0,
        cmap="viridis",
        norm=Normalize(-50.0, 250.0),
        rasterized=True,
    )
