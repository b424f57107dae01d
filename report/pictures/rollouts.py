"""Pictures of rollouts compared with their simulations, and of how a model was trained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from geometry.survey.surface_profile import surface_profile
from gns.data.scene_facts import SOIL, SceneFacts
from gns.evaluation.metrics import energy_history
from report.pictures.packed_data import KINEMATIC_COLOUR, limits_of
from report.style import GROUND_COLOUR, new_figure, save_figure, tidy

MODEL_COLOUR, SIMULATION_COLOUR = "#c8553d", "#2f6f9f"


@dataclass(frozen=True)
class Pair:
    """A rollout and its simulation, (T, N, 2) [m] each; the rollout may have fewer frames."""

    title: str
    predicted: np.ndarray
    simulated: np.ndarray
    facts: SceneFacts


def save_pairs(pairs: Sequence[Pair], path: str | Path, title: str) -> None:
    """One row for each pair: final positions of both, their surfaces, their energy.

    Raises:
        InputError: unknown suffix.
    """
    figure = new_figure(2.6 * len(pairs) + 0.6, 15.0, layout="constrained")
    rows = figure.subplots(len(pairs), 4, squeeze=False)
    for axes, pair in zip(rows, pairs, strict=True):
        both = np.concatenate([pair.simulated, pair.predicted])
        limits = limits_of(both[np.isfinite(both).all(axis=(1, 2))], pair.facts)
        way = np.linalg.norm(pair.simulated[-1] - pair.simulated[0], axis=1) / pair.facts.spacing
        scale = Normalize(0.0, max(float(way.max()), 1.0))
        _final(axes[0], pair.simulated, pair.facts, limits, scale)
        _final(axes[1], pair.predicted, pair.facts, limits, scale)
        axes[0].set_title(f"{pair.title}: simulation", fontsize=9, loc="left")
        axes[1].set_title(
            f"rollout, frame {len(pair.predicted) - 1} of {len(pair.simulated) - 1}",
            fontsize=9,
            loc="left",
        )
        _surfaces(axes[2], pair, limits)
        _energies(axes[3], pair)
    rows[0, 2].legend(fontsize=8, frameon=False)
    figure.suptitle(title, fontsize=12, x=0.01, ha="left", weight="bold")
    save_figure(figure, path, dpi=110)


def save_history(lines: Sequence[dict[str, Any]], path: str | Path, title: str) -> None:
    """The loss over the steps as in the paper, and the held-out rollouts.

    Args:
        lines: of `metrics.jsonl`.
        path: of the picture.
        title: above it.

    Raises:
        InputError: unknown suffix.
    """
    losses = [(line["step"], line["loss"]) for line in lines if "loss" in line]
    held = [(line["step"], line["validation"]) for line in lines if "validation" in line]
    figure = new_figure(4.2, 11.0, layout="constrained")
    left, right = figure.subplots(1, 2)
    if losses:
        steps, values = np.array(losses).T
        left.plot(steps, values, color="#b9cfe0", linewidth=1.0)
        width = max(len(values) // 50, 1)
        mean = np.convolve(values, np.full(width, 1.0 / width), mode="valid")
        left.plot(steps[width - 1 :], mean, color=SIMULATION_COLOUR)
        left.set_yscale("log")
    left.set(xlabel="step", ylabel="loss: mean square, normalised")
    for name, label, colour in (
        ("score", "final position, mean", MODEL_COLOUR),
        ("position_error", "position, mean", "#e69f00"),
        ("runout_error", "runout, median", SIMULATION_COLOUR),
    ):
        values = [found[name] for _, found in held]
        right.plot(
            [step for step, _ in held], values, "o-", color=colour, label=label, markersize=3
        )
    right.set(xlabel="step", ylabel="error of held-out rollouts / d")
    right.set_ylim(0.0, None)
    right.legend(fontsize=8, frameon=False)
    for ax in (left, right):
        tidy(ax)
    figure.suptitle(title, fontsize=12, x=0.01, ha="left", weight="bold")
    save_figure(figure, path, dpi=110)


def _final(
    ax: Axes,
    positions: np.ndarray,
    facts: SceneFacts,
    limits: tuple[tuple[float, float], tuple[float, float]],
    scale: Normalize,
) -> None:
    """Final positions, coloured by how far they went."""
    x = np.linspace(*limits[0], 200)
    ax.fill_between(x, limits[1][0], facts.ground_height(x), color=GROUND_COLOUR, linewidth=0)
    way = np.linalg.norm(positions[-1] - positions[0], axis=1) / facts.spacing
    soil = facts.type == SOIL
    ax.scatter(*positions[-1, soil].T, c=way[soil], s=2, norm=scale, cmap="magma_r", linewidths=0)
    ax.scatter(*positions[-1, ~soil].T, color=KINEMATIC_COLOUR, s=2, linewidths=0)
    ax.set(xlim=limits[0], ylim=limits[1], aspect="equal")
    tidy(ax)


def _surfaces(
    ax: Axes, pair: Pair, limits: tuple[tuple[float, float], tuple[float, float]]
) -> None:
    facts, soil = pair.facts, pair.facts.type == SOIL
    x = np.linspace(*limits[0], 400)
    ground = facts.ground_height(x)
    ax.fill_between(x, limits[1][0], ground, color=GROUND_COLOUR, linewidth=0)
    lines = (
        (pair.simulated[0], "#999999", "at t = 0"),
        (pair.simulated[-1], SIMULATION_COLOUR, "simulation"),
        (pair.predicted[-1], MODEL_COLOUR, "rollout"),
    )
    for positions, colour, label in lines:
        points = positions[soil].astype(np.float64)
        height = surface_profile(
            points, facts.spacing**2, x, spacing=facts.spacing, ground=facts.ground
        )
        ax.plot(x, np.where(height > ground + 1e-3, height, np.nan), color=colour, label=label)
    ax.set(xlim=limits[0], ylim=limits[1])
    tidy(ax)


def _energies(ax: Axes, pair: Pair) -> None:
    for positions, colour in ((pair.simulated, SIMULATION_COLOUR), (pair.predicted, MODEL_COLOUR)):
        if len(positions) > 1:
            time = np.arange(len(positions)) * pair.facts.frame_time
            ax.plot(time, energy_history(positions, pair.facts).kinetic / 1e6, color=colour)
    ax.set(xlabel="time (s)", ylabel="kinetic energy (MJ/m)")
    tidy(ax)
