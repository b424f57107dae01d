"""The dimensionless features that a data set holds, from lowest to highest.

A model states the ranges it was trained on and warns outside them. Lengths in spacings d, time in
sqrt(d / g), strength in rho g d.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gns.data.scene_facts import CONTACTS, SOIL, SceneFacts
from gns.data.statistics import Moments
from mpm_taichi.solver.water import WATER_DENSITY

Range = tuple[float, float]

MEANINGS = {
    "tan_friction": "tangent of the friction angle",
    "cohesion": "cohesion / (rho g d)",
    "body_force_factor": "weight under water / weight in air, at t = 0",
    "horizontal_body_force": "horizontal force of the water / weight in air, at t = 0",
    "relative_density": "density / density of water",
    "youngs_modulus": "Young's modulus (mean of the soil) / (rho g d)",
    "height": "highest point above the ground below it / d, at t = 0",
    "ground_slope": "steepest slope of the ground under or next to the soil",
    "ground_friction": "Coulomb coefficient of the ground, where it has one",
    "initial_speed": "speed at t = 0 / sqrt(g d)",
    "speed": "largest component of a velocity over a frame / sqrt(g d)",
    "travel": "farthest way of a point / d",
    "points": "number of points",
    "frames": "number of frames",
}


def scene_ranges(positions: np.ndarray, facts: SceneFacts) -> dict[str, Range]:
    """Facts of a scene before it moves, which a model compares with its training.

    Args:
        positions: at t = 0, (N, 2) [m].
        facts: of the scene.

    Returns:
        lowest and highest value by name, of `MEANINGS`; `ground_friction` only for Coulomb ground.
    """
    soil = facts.type == SOIL
    tangent, cohesion, density, push, weight = facts.properties[soil, :5].astype(np.float64).T
    unit = density * facts.gravity * facts.spacing
    x, y = positions[soil].astype(np.float64).T
    slope = _steepest(facts, float(x.min()), float(x.max()))
    speed = np.linalg.norm(facts.initial_velocity, axis=1)
    ranges = {
        "tan_friction": _range(tangent),
        "cohesion": _range(cohesion / unit),
        "body_force_factor": _range(-weight),
        "horizontal_body_force": _range(np.abs(push)),
        "relative_density": _range(density / WATER_DENSITY),
        "youngs_modulus": _range(facts.numbers["youngs_modulus"] / unit),
        "height": _range(np.max(y - facts.ground_height(x)) / facts.spacing),
        "ground_slope": (slope, slope),
        "initial_speed": _range(speed / np.sqrt(facts.gravity * facts.spacing)),
    }
    if CONTACTS[int(facts.numbers["ground_contact"])] == "coulomb":
        ranges["ground_friction"] = _range(facts.numbers["ground_friction"])
    return ranges


def run_ranges(
    first: np.ndarray, last: np.ndarray, frames: int, facts: SceneFacts, velocity: Moments
) -> dict[str, Range]:
    """Facts of a finished run: `scene_ranges` with speed, travel, points and frames.

    Args:
        first: its first positions (N, 2) [m].
        last: its last ones (N, 2) [m].
        frames: number of frames T.
        facts: of its scene.
        velocity: moments of its velocities; the speed is their largest component.
    """
    way = np.linalg.norm(last.astype(np.float64) - first, axis=1).max() / facts.spacing
    speed = np.max(np.maximum(-velocity.low, velocity.high)) if velocity.count else 0.0
    return {
        **scene_ranges(first, facts),
        "speed": _range(speed),
        "travel": _range(way),
        "points": _range(float(facts.points)),
        "frames": _range(float(frames)),
    }


def widest(ranges: Iterable[dict[str, Range]]) -> dict[str, Range]:
    """The ranges that hold all of those given."""
    result: dict[str, Range] = {}
    for one in ranges:
        for name, (low, high) in one.items():
            old = result.get(name, (low, high))
            result[name] = (min(low, old[0]), max(high, old[1]))
    return {name: result[name] for name in MEANINGS if name in result}


def _range(values: np.ndarray | float) -> Range:
    return float(np.min(values)), float(np.max(values))


def _steepest(facts: SceneFacts, left: float, right: float) -> float:
    """Steepest slope of the ground between two places, and as far again on either side."""
    line = facts.ground
    if len(line) < 2:
        return 0.0
    reach = right - left
    touched = (line[1:, 0] > left - reach) & (line[:-1, 0] < right + reach)
    slopes = np.abs(np.diff(line[:, 1]) / np.diff(line[:, 0]))
    return float(slopes[touched].max(initial=0.0))
