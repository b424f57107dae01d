"""How far a rollout is from the simulation it stands for.

In: predicted and simulated positions of the same frames, and the scene's facts. Out: one
`RolloutScore` a run (`gns.evaluation.score_tables` makes tables of them). Numpy alone; the deposit
is read by the definitions with which everything else is measured (`geometry.survey`).

Errors are in metres, and where it says so in spacings d. Only soil counts: kinematic points are
where they are prescribed. A rollout that is not finite has infinite errors, so that it can be
neither overlooked nor averaged away by a median.

Shapes: T frames, N points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.sides import SIDES, Side
from geometry.survey.columns import kernel_length, toe
from geometry.survey.surface_profile import surface_profile
from gns.data.scene_facts import SOIL, SceneFacts
from gns.data.statistics import moving, velocities

LEAST_TRAVEL = 1.0
"""Travel [spacings] below which an error in per cent of it says nothing."""


OUTSIDE = 2.0
"""Distance [spacings] beyond a wall, the lid or the ground at which a point has left the scene: one
cell. In simulations of thrown blocks points sink up to 1.4 spacings into sloping ground."""


@dataclass(frozen=True)
class RolloutScore:
    """One rollout against its simulation. NaN where a number has no meaning for the run.

    Attributes:
        run: number of the run; template: its letter; points, frames: N, T; spacing_m: d.
        position_error_m: root mean square over points and frames.
        final_position_error_m: the same in the last frame.
        side: on which the simulation travelled the farther.
        travel_m: how far its toe travelled there, `farther_side`.
        runout_error_m: signed, rollout minus simulation; positive: too far.
        runout_error_spacings, runout_error_percent: of travel, if that is over LEAST_TRAVEL.
        profile_error_m: mean difference of the final surfaces over where either lies.
        profile_error_share: area between them over the area of the soil.
        kinetic_error: root mean square over time, in shares of the simulation's peak.
        released_error: of the energy released in all, signed share of the simulation's.
        finite: every position is a number; inside: no point leaves the scene.
    """

    run: int
    template: str
    points: int
    frames: int
    spacing_m: float
    position_error_m: float
    final_position_error_m: float
    side: str
    travel_m: float
    runout_error_m: float
    runout_error_spacings: float
    runout_error_percent: float
    profile_error_m: float
    profile_error_share: float
    kinetic_error: float
    released_error: float
    finite: bool
    inside: bool


@dataclass(frozen=True)
class Energy:
    """Energy of the soil over time [J per metre of width], (T,) each."""

    kinetic: np.ndarray
    released: np.ndarray  # work done by weight and water since t = 0


def score(
    predicted: np.ndarray,
    simulated: np.ndarray,
    facts: SceneFacts,
    *,
    run: int = 0,
    template: str = "",
) -> RolloutScore:
    """Compare a rollout with its simulation.

    Args:
        predicted: (T, N, 2) [m], from the same start.
        simulated: (T, N, 2) [m].
        facts: of the scene.
        run: number of the run, to be named by.
        template: its letter.

    Raises:
        ValueError: different frames or points.
    """
    if predicted.shape != simulated.shape:
        raise ValueError(f"a rollout of {predicted.shape} for a simulation of {simulated.shape}")
    finite = bool(np.all(np.isfinite(predicted)))
    side, travel, reached = farther_side(simulated[-1], simulated[0], facts)
    error = runout(predicted[-1], simulated[0], facts, side) - reached
    thickness, share = profile_error(predicted[-1], simulated[-1], facts)
    kinetic, released = energy_errors(predicted, simulated, facts)
    enough = travel > LEAST_TRAVEL * facts.spacing
    return RolloutScore(
        run=run,
        template=template,
        points=facts.points,
        frames=len(simulated),
        spacing_m=facts.spacing,
        position_error_m=position_error(predicted, simulated, facts),
        final_position_error_m=position_error(predicted[-1:], simulated[-1:], facts),
        side=side,
        travel_m=travel,
        runout_error_m=error,
        runout_error_spacings=error / facts.spacing,
        runout_error_percent=100.0 * error / travel if enough else math.nan,
        profile_error_m=thickness,
        profile_error_share=share,
        kinetic_error=kinetic,
        released_error=released,
        finite=finite,
        inside=finite and stays_inside(predicted, facts),
    )


# --- positions ---


def position_error(predicted: np.ndarray, simulated: np.ndarray, facts: SceneFacts) -> float:
    """Root mean square distance of the soil points, over all frames given [m]."""
    soil = facts.type == SOIL
    return _root_mean_square(_distance(predicted[:, soil], simulated[:, soil]))


def one_step_error(
    predicted: np.ndarray, window: np.ndarray, facts: SceneFacts, *, moving_only: bool = True
) -> float:
    """Root mean square error of one predicted frame, in spacings.

    Args:
        predicted: the frame after the last known one, (N, 2) [m].
        window: frames before, the last known, and the true next one, (at least 3, N, 2) [m].
        facts: of the scene.
        moving_only: over the soil that moves (`gns.data.statistics.moving`) and not over all of it.

    Returns:
        NaN where nothing counts.
    """
    counts = facts.type == SOIL
    if moving_only:
        old, new = velocities(window[-3:].astype(np.float64), facts)
        counts = counts & moving(old[0], new[0])
    if not counts.any():
        return math.nan
    return _root_mean_square(_distance(predicted[counts], window[-1, counts])) / facts.spacing


def stays_inside(positions: np.ndarray, facts: SceneFacts) -> bool:
    """No soil point is ever more than OUTSIDE spacings behind a wall or lid, or in the ground."""
    soil = positions[:, facts.type == SOIL].astype(np.float64)
    slack = OUTSIDE * facts.spacing
    x, y = soil[..., 0], soil[..., 1]
    above = np.all(y > facts.ground_height(x) - slack)
    if facts.numbers["walls_open"]:
        return bool(above)
    low, high = facts.numbers["x_min"] - slack, facts.numbers["x_max"] + slack
    below = np.all(y < facts.numbers["y_max"] + slack)
    return bool(above and below and np.all(x > low) and np.all(x < high))


# --- the deposit ---


def runout(positions: np.ndarray, start: np.ndarray, facts: SceneFacts, side: Side) -> float:
    """Distance of the toe from the foot of the section, outwards positive [m].

    Args:
        positions: (N, 2) [m].
        start: positions at t = 0; the section ends half a spacing beyond its last point.
        facts: of the scene.
        side: left or right.

    Returns:
        inf where a position is not finite, or no column is as high as a deposit.
    """
    soil = facts.type == SOIL
    outward = -1.0 if side == "left" else 1.0
    foot = float(np.max(outward * start[soil, 0])) + 0.5 * facts.spacing
    points = positions[soil].astype(np.float64)
    if not np.all(np.isfinite(points)):
        return math.inf
    try:
        place = toe(points, facts.spacing**2, spacing=facts.spacing, side=side)
    except ValueError:  # spread thinner than a deposit, or flung apart
        return math.inf
    return float(outward * place - foot)


def farther_side(
    simulated: np.ndarray, start: np.ndarray, facts: SceneFacts
) -> tuple[Side, float, float]:
    """Side on which a simulation travelled the farther, its travel and its runout there [m].

    Travel is the runout less what the toe reads at t = 0: the smoothed column of a steep face ends
    about two spacings beyond it, which nothing has travelled.

    Args:
        simulated: final positions (N, 2) [m].
        start: positions at t = 0.
        facts: of the scene.

    Returns:
        side, travel, runout; NaN where the simulation left no deposit.
    """
    found = {side: runout(simulated, start, facts, side) for side in SIDES}
    if not all(map(math.isfinite, found.values())):
        return "right", math.nan, math.nan
    travel = {side: found[side] - _reading_at_rest(start, facts, side) for side in SIDES}
    side: Side = "left" if travel["left"] > travel["right"] else "right"
    return side, travel[side], found[side]


def _reading_at_rest(start: np.ndarray, facts: SceneFacts, side: Side) -> float:
    """Reading of `runout` before anything moves [m]; 0 where other bodies lie farther out."""
    reading = runout(start, start, facts, side)
    return max(reading, 0.0) if math.isfinite(reading) else 0.0


def profile_error(
    predicted: np.ndarray, simulated: np.ndarray, facts: SceneFacts
) -> tuple[float, float]:
    """Difference of two deposits' surfaces.

    Args:
        predicted: final positions (N, 2) [m].
        simulated: the simulation's.
        facts: of the scene.

    Returns:
        mean absolute difference over where either deposit lies [m], NaN where none does; area
        between the two surfaces over the area of the soil.
    """
    soil = facts.type == SOIL
    one, other = predicted[soil].astype(np.float64), simulated[soil].astype(np.float64)
    if not np.all(np.isfinite(one)):
        return math.inf, math.inf
    d = facts.spacing
    x = np.arange(*_extent(np.concatenate([one, other]), d, facts), 0.5 * d)
    heights = [
        surface_profile(points, d**2, x, spacing=d, ground=facts.ground) for points in (one, other)
    ]
    difference = np.abs(heights[0] - heights[1])
    covered = float(np.sum(np.maximum(*heights) > facts.ground_height(x)))
    between = float(difference.sum()) * 0.5 * d
    thickness = between / (covered * 0.5 * d) if covered else math.nan
    return thickness, between / (float(soil.sum()) * d**2)


# --- energy ---


def energy_history(positions: np.ndarray, facts: SceneFacts) -> Energy:
    """Kinetic energy and work of weight and water, from positions alone.

    Velocities are central differences, the first one that of the scene. Every point has the mass
    rho d^2; the water acts on it where it is at the time.

    Args:
        positions: (T, N, 2) [m].
        facts: of the scene.
    """
    soil = facts.type == SOIL
    mass = facts.properties[soil, 2].astype(np.float64) * facts.spacing**2
    path = positions[:, soil].astype(np.float64)
    moves = len(path) > 1
    velocity = np.gradient(path, facts.frame_time, axis=0) if moves else np.zeros_like(path)
    velocity[0] = facts.initial_velocity[soil]
    kinetic = 0.5 * (velocity**2).sum(axis=2) @ mass
    middle = 0.5 * (positions[1:].astype(np.float64) + positions[:-1])
    force = facts.body_force(middle)[:, soil]
    work = (force * np.diff(path, axis=0)).sum(axis=2) @ mass * facts.gravity
    return Energy(kinetic=kinetic, released=np.concatenate([[0.0], np.cumsum(work)]))


def energy_errors(
    predicted: np.ndarray, simulated: np.ndarray, facts: SceneFacts
) -> tuple[float, float]:
    """Errors of the energy history.

    Returns:
        root mean square error of the kinetic energy over time, in shares of the simulation's peak;
        error of the energy released at the end, as a share of the most that the simulation
        released. NaN where the simulation has none.
    """
    if not np.all(np.isfinite(predicted)):
        return math.inf, math.inf
    one, other = energy_history(predicted, facts), energy_history(simulated, facts)
    peak, most = float(other.kinetic.max()), float(np.abs(other.released).max())
    kinetic = _root_mean_square(one.kinetic - other.kinetic) / peak if peak > 0 else math.nan
    released = float(one.released[-1] - other.released[-1]) / most if most > 0 else math.nan
    return kinetic, released


def _distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distances [m]; infinite where a position is not a number."""
    distance = np.linalg.norm(one.astype(np.float64) - other, axis=-1)
    return np.where(np.isfinite(distance), distance, np.inf)


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _extent(points: np.ndarray, spacing: float, facts: SceneFacts) -> tuple[float, float]:
    """Where deposits lie, and the reach of the kernel next to it [m].

    A point that was flung out of the scene does not stretch it for ever.
    """
    reach = 2.0 * kernel_length(spacing)
    width = facts.numbers["x_max"] - facts.numbers["x_min"]
    low = max(float(points[:, 0].min()), facts.numbers["x_min"] - width)
    high = min(float(points[:, 0].max()), facts.numbers["x_max"] + width)
    return low - reach, high + reach
