"""Pictures of packed data: one run as a learner is shown it, or all runs of a folder at a glance.

In: packed runs. Out: png, svg or pdf. Lengths in spacings d, time in sqrt(d / g), strength in
rho g d, since that is what is learned from; places on the sections in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from gns.data.scene_facts import KINEMATIC, SOIL, SceneFacts
from gns.data.shard import SPLITS, PackedRun
from gns.evaluation.metrics import energy_history, farther_side
from report.style import GROUND_COLOUR, WATER_LINE, new_figure, save_figure, tidy

if TYPE_CHECKING:
    from gns.rollout.rollout import Rollout

SPLIT_COLOURS = {"train": "#2f6f9f", "valid": "#e69f00", "test": "#c8553d"}
KINEMATIC_COLOUR = "#222222"
LEAST_COHESION = 1e-3
"""Smallest cohesion on the logarithmic scale [rho g d]."""


@dataclass(frozen=True)
class RunNumbers:
    """Data of a run in the overview."""

    split: str
    template: str
    travel: float  # [d]; NaN without a deposit
    cohesion: float  # of the weakest frictionless soil [rho g d]; NaN where there is none
    points: int
    frames: int


def numbers_of(
    split: str, template: str, first: np.ndarray, last: np.ndarray, frames: int, facts: SceneFacts
) -> RunNumbers:
    """The numbers of one run, from its first and last positions (N, 2) [m] and its facts."""
    tangent, cohesion, density = facts.properties[facts.type == SOIL, :3].T
    frictionless = tangent == 0.0
    unit = density * facts.gravity * facts.spacing
    weakest = np.min((cohesion / unit)[frictionless]) if frictionless.any() else np.nan
    travel = farther_side(last, first, facts)[1] / facts.spacing
    return RunNumbers(split, template, travel, float(weakest), facts.points, frames)


def save_run_picture(run: PackedRun | Rollout, path: str | Path, title: str) -> None:
    """One run: what is known of its points, where they are half-way and at the end, its energy.

    Raises:
        InputError: unknown suffix.
    """
    figure = new_figure(9.0, 12.0, layout="constrained")
    axes = figure.subplots(3, 2)
    facts, positions = run.facts, run.positions
    unit = facts.properties[:, 2] * facts.gravity * facts.spacing
    cohesion = np.maximum(facts.properties[:, 1] / unit, LEAST_COHESION)
    limits = limits_of(positions, facts)
    _points(
        axes[0, 0],
        facts,
        positions[0],
        facts.properties[:, 0],
        limits,
        "tan phi",
        Normalize(0.0, 1.0),
        "viridis",
    )
    _points(
        axes[0, 1],
        facts,
        positions[0],
        cohesion,
        limits,
        "cohesion / (rho g d)",
        LogNorm(LEAST_COHESION, 10.0),
        "viridis",
    )
    way = np.linalg.norm(positions.astype(np.float64) - positions[0], axis=2) / facts.spacing
    scale = Normalize(0.0, max(float(way.max()), 1.0))
    for ax, frame in zip(axes[1], (len(positions) // 2, len(positions) - 1), strict=True):
        _points(
            ax, facts, positions[frame], way[frame], limits, "displacement / d", scale, "magma_r"
        )
        time = frame * facts.frame_time
        ax.set_title(f"frame {frame}, {time:.1f} s", fontsize=9, loc="left")
    axes[0, 0].set_title("t = 0, what is known of each point", fontsize=9, loc="left")
    _energy(axes[2, 0], positions, facts)
    _steps(axes[2, 1], positions, facts)
    figure.suptitle(title, fontsize=12, x=0.01, ha="left", weight="bold")
    save_figure(figure, path, dpi=110)


def save_overview(runs: Sequence[RunNumbers], path: str | Path, title: str) -> None:
    """All runs: how many of each template, how far they travel, how weak and how large they are.

    Raises:
        InputError: unknown suffix.
    """
    figure = new_figure(7.5, 11.0, layout="constrained")
    (shares, travels), (strengths, sizes) = figure.subplots(2, 2)
    splits = [split for split in SPLITS if any(run.split == split for run in runs)]
    letters = sorted({run.template for run in runs})
    below = np.zeros(len(letters))
    for split in splits:
        own = [run for run in runs if run.split == split]
        count = np.array([sum(run.template == letter for run in own) for letter in letters])
        label = f"{split}, {len(own)} runs"
        names = [letter or "none" for letter in letters]
        shares.bar(names, count, bottom=below, color=SPLIT_COLOURS[split], label=label)
        below += count
        sizes.plot(
            [run.points for run in own],
            [run.frames for run in own],
            "o",
            color=SPLIT_COLOURS[split],
            markersize=3,
            alpha=0.6,
        )
    colours = [SPLIT_COLOURS[split] for split in splits]
    travel = [[r.travel for r in runs if r.split == s and np.isfinite(r.travel)] for s in splits]
    travels.hist(travel, bins=25, stacked=True, color=colours)
    weak = [[r.cohesion for r in runs if r.split == s and np.isfinite(r.cohesion)] for s in splits]
    every = [max(value, LEAST_COHESION) for values in weak for value in values]
    if every:
        low, high = np.log10(min(every)), np.log10(max(every)) + 1e-9
        strengths.hist(weak, bins=np.logspace(low, high, 26), stacked=True, color=colours)
        strengths.set_xscale("log")
    shares.legend(fontsize=8, frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    shares.set(xlabel="template", ylabel="runs")
    travels.set(xlabel="travel of the toe / d", ylabel="runs")
    strengths.set(xlabel="S_r / (rho g d) of the weakest frictionless soil", ylabel="runs")
    sizes.set(xlabel="points", ylabel="frames")
    sizes.set_ylim(0, None)
    for ax in (shares, travels, strengths, sizes):
        tidy(ax)
    figure.suptitle(title, fontsize=12, x=0.01, ha="left", weight="bold")
    save_figure(figure, path, dpi=110)


def _points(
    ax: Axes,
    facts: SceneFacts,
    place: np.ndarray,
    values: np.ndarray,
    limits: tuple[tuple[float, float], tuple[float, float]],
    label: str,
    norm: Normalize,
    colour_map: str,
) -> None:
    """Points in colour over the ground, with the water."""
    (left, right), (low, high) = limits
    x = np.linspace(left, right, 400)
    ax.fill_between(x, facts.ground_height(x), low, color=GROUND_COLOUR, linewidth=0)
    width = 6.0 * 72 * 0.8 / (right - left)  # points of the page a metre
    size = (facts.spacing * width) ** 2
    soil = facts.type == SOIL
    shown = ax.scatter(
        *place[soil].T,
        c=values[soil],
        s=size,
        norm=norm,
        cmap=colour_map,
        marker="s",
        linewidths=0,
        rasterized=True,
    )
    if np.any(facts.type == KINEMATIC):
        fixed = place[facts.type == KINEMATIC]
        ax.scatter(*fixed.T, color=KINEMATIC_COLOUR, s=size, marker="s", linewidths=0)
    if facts.has_water:
        level = np.interp(x, *facts.phreatic_line.T)
        ax.plot(x, level, color=WATER_LINE, linewidth=1.0, linestyle="--")
    ax.figure.colorbar(shown, ax=ax, label=label, shrink=0.6)
    ax.set(xlim=(left, right), ylim=(low, high), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    tidy(ax)


def limits_of(
    positions: np.ndarray, facts: SceneFacts
) -> tuple[tuple[float, float], tuple[float, float]]:
    """The part of the scene in which there ever is soil, with a margin [m]."""
    margin = 4.0 * facts.spacing
    low, high = positions.min(axis=(0, 1)), positions.max(axis=(0, 1))
    x = (float(low[0]) - margin, float(high[0]) + margin)
    ground = facts.ground_height(np.linspace(*x, 100))
    return x, (float(ground.min()) - margin, float(high[1]) + margin)


def _energy(ax: Axes, positions: np.ndarray, facts: SceneFacts) -> None:
    energy = energy_history(positions, facts)
    time = np.arange(len(positions)) * facts.frame_time
    ax.plot(time, energy.kinetic / 1e6, color=SPLIT_COLOURS["test"], label="kinetic")
    ax.plot(time, energy.released / 1e6, color=SPLIT_COLOURS["train"], label="released by weight")
    ax.set(xlabel="time (s)", ylabel="MJ per metre", xlim=(0, time[-1]))
    ax.legend(fontsize=8, frameon=False)
    tidy(ax)


def _steps(ax: Axes, positions: np.ndarray, facts: SceneFacts) -> None:
    """Displacements a frame of the soil: median of what moves, 99 %, most."""
    soil = positions[:, facts.type == SOIL].astype(np.float64)
    step = np.linalg.norm(np.diff(soil, axis=0), axis=2) / facts.spacing
    time = np.arange(1, len(positions)) * facts.frame_time
    for share, shade in ((1.0, "#9ecae1"), (0.99, "#4292c6"), (0.5, "#08306b")):
        label = "largest" if share == 1.0 else f"{100 * share:.0f} % of the points are below"
        ax.plot(time, np.quantile(step, share, axis=1), color=shade, label=label)
    ax.set(xlabel="time (s)", ylabel="displacement a frame / d", xlim=(0, time[-1]))
    ax.set_ylim(0.0, 1.3 * max(float(step.max()), 0.1))  # room for the legend
    ax.legend(fontsize=8, frameon=False)
    tidy(ax)
