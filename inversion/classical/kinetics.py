"""Kinetics (Olson 2001): the slide as one rigid body on the path of its centre of gravity.

In: the forces of the section before and after (`SlideForces`). Out: the S_r with which the body,
starting at rest, stops where it was found, and its history.

Along the path a = (W sin(theta) - S_r L - T) / m: W the weight less uplift, m the whole mass, theta
the slope of the path, L and T the liquefied length and the resistance of the rest of the slip
surface, which go from their values before to those after in proportion to the travel.

The path is a cubic through both centres of gravity. Two points leave two of its four numbers free;
they follow from its slopes at the ends. At the start it is that of the slip surface under the mass,
sin(theta) = D / W. At the end it is the same quantity after the slide (`slip`), or nil (`level`).
The paper that the method comes from was not available; the published descriptions (a cubic path
whose slope drives the body) leave the end open, so it is an option here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inversion.classical.slide_forces import SlideForces
from pipeline.cli import WorkFailed

EndSlope = Literal["slip", "level"]
Stages = Literal["varying", "before", "after"]

TIME_STEP = 0.01  # s
LONGEST = 600.0  # s of motion, after which a body is taken not to stop


@dataclass(frozen=True)
class Path:
    """A cubic y(x) from one centre of gravity to the other; x counts in the slide's direction.

    Attributes:
        start: first centre of gravity (2,) [m].
        length: horizontal distance [m].
        drop: vertical distance, downwards [m].
        slope_start, slope_end: dy/dx there; negative downwards.
        direction: -1 for a slide to the left, +1 to the right.
    """

    start: np.ndarray
    length: float
    drop: float
    slope_start: float
    slope_end: float
    direction: int

    def slope(self, x: float) -> float:
        """dy/dx at the travel `x` [m]; straight on beyond the end."""
        t = min(max(x / self.length, 0.0), 1.0)
        chord = -self.drop / self.length
        return (
            self.slope_start * (1 - t) * (1 - 3 * t)
            + self.slope_end * t * (3 * t - 2)
            + 6 * chord * t * (1 - t)
        )

    def points(self, number: int = 101) -> np.ndarray:
        """Points on the path, (number, 2) [m]."""
        t = np.linspace(0.0, 1.0, number)
        rise = (
            self.slope_start * self.length * t * (1 - t) ** 2
            - self.slope_end * self.length * t**2 * (1 - t)
            - self.drop * t**2 * (3 - 2 * t)
        )
        x = self.start[0] + self.direction * self.length * t
        return np.column_stack([x, self.start[1] + rise])

    def arc_length(self) -> float:
        """Length of the path [m]."""
        t = np.linspace(0.0, 1.0, 1001)
        steps = [math.hypot(1.0, self.slope(self.length * part)) for part in t]
        return float(np.trapezoid(steps, t) * self.length)


@dataclass(frozen=True)
class Motion:
    """A history of motion; arrays of one length.

    Attributes:
        time: [s].
        travel: along the path [m].
        velocity: [m/s].
        acceleration: [m/s2].
        share: of the displacement, 0 to 1.
    """

    time: np.ndarray
    travel: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    share: np.ndarray

    @property
    def duration(self) -> float:
        """Time until it stops [s]."""
        return float(self.time[-1])

    @property
    def zero_inertia_share(self) -> float:
        """Share of the displacement at which the acceleration changes its sign for good."""
        before = np.flatnonzero((self.acceleration[:-1] > 0) & (self.acceleration[1:] <= 0))
        if not len(before):
            return math.nan
        k = before[-1]
        a0, a1 = self.acceleration[k], self.acceleration[k + 1]
        part = a0 / (a0 - a1)
        return float(self.share[k] + part * (self.share[k + 1] - self.share[k]))


@dataclass(frozen=True)
class Body:
    """The rigid body: weight, length and resistance before and after, mass, path."""

    weight: tuple[float, float]
    length: tuple[float, float]
    resistance: tuple[float, float]
    mass: float
    path: Path

    def force(self, x: float, residual_strength: float) -> float:
        """Force along the path [N/m] at the horizontal travel `x` [m]."""
        slope = self.path.slope(x)
        t = min(max(x / self.path.length, 0.0), 1.0)
        driving = _between(self.weight, t) * -slope / math.hypot(1.0, slope)
        held = residual_strength * _between(self.length, t) + _between(self.resistance, t)
        return driving - held

    def work(self, residual_strength: float) -> float:
        """Work of all forces from the first to the last centre of gravity [J/m]."""
        x = np.linspace(0.0, self.path.length, 1001)
        forces = [
            self.force(place, residual_strength) * math.hypot(1.0, self.path.slope(place))
            for place in x
        ]
        return float(np.trapezoid(forces, x))

    def energy_strength(self) -> float:
        """S_r [Pa] at which the work of all forces over the path is nil."""
        without, per_unit = self.work(0.0), self.work(0.0) - self.work(1.0)
        return without / per_unit

    def slide(self, residual_strength: float, time_step: float = TIME_STEP) -> Motion:
        """Integrate the motion from rest until the velocity returns to 0.

        Raises:
            WorkFailed: the body does not stop.
        """
        x = travel = velocity = time = 0.0
        rows = [(0.0, 0.0, 0.0, self.force(0.0, residual_strength) / self.mass, 0.0)]
        while rows[-1][3] > 0.0 or velocity > 0.0:
            # Midpoint rule: the acceleration half a step ahead.
            a = rows[-1][3]
            half = 0.5 * time_step
            middle_v = velocity + half * a
            middle_x = x + half * velocity * _cosine(self.path.slope(x))
            a_middle = self.force(middle_x, residual_strength) / self.mass
            step = time_step
            if velocity + step * a_middle < 0.0:
                step = velocity / -a_middle
                middle_v = 0.5 * velocity
            travel += step * middle_v
            x += step * middle_v * _cosine(self.path.slope(middle_x))
            velocity = max(velocity + step * a_middle, 0.0)
            time += step
            a = self.force(x, residual_strength) / self.mass
            rows.append((time, travel, velocity, a, x / self.path.length))
            if velocity == 0.0 or step < time_step:
                break
            if time > LONGEST:
                raise WorkFailed(f"the body does not stop within {LONGEST:g} s")
        return Motion(*np.array(rows).T)


def body_of(
    before: SlideForces,
    after: SlideForces,
    direction: int,
    *,
    end_slope: EndSlope = "slip",
    stages: Stages = "varying",
) -> Body:
    """The rigid body of a slide.

    Args:
        before: forces before, with buoyant weights.
        after: forces after.
        direction: -1 for a slide to the left, +1 to the right.
        end_slope: of the path, see the head of this file.
        stages: W, L and T going from before to after, or those of one of them throughout.

    Raises:
        WorkFailed: the centre of gravity did not go down and in the slide's direction.
    """
    moved = after.centre - before.centre
    distance, drop = direction * float(moved[0]), -float(moved[1])
    if distance <= 0 or drop <= 0:
        raise WorkFailed(
            f"the centre of gravity moved {distance:.3g} m outwards and {drop:.3g} m down; "
            "both must be positive"
        )
    first = -_tangent(before.driving / before.weight)
    last = -_tangent(after.driving / after.weight) if end_slope == "slip" else 0.0
    start, end = {"varying": (before, after), "before": (before, before), "after": (after, after)}[
        stages
    ]
    return Body(
        weight=(start.weight, end.weight),
        length=(start.liquefied_length, end.liquefied_length),
        resistance=(start.resistance, end.resistance),
        mass=before.mass,
        path=Path(before.centre, distance, drop, first, last, direction),
    )


def find_strength(
    body: Body, *, time_step: float = TIME_STEP, tolerance: float = 1e-4
) -> tuple[float, Motion]:
    """The S_r [Pa] with which the body stops at the end of its path, by bisection.

    Args:
        body: the slide.
        time_step: of the integration [s].
        tolerance: of the travel, as a share of the path.

    Returns:
        S_r [Pa] and the motion with it.

    Raises:
        WorkFailed: no positive S_r lets the body start and stop there.
    """
    target = body.path.arc_length()
    # The body stops where the work is used up: a bracket around the balance of energy.
    guess = body.energy_strength()
    if guess <= 0:
        raise WorkFailed("the body stops earlier than it was found even without S_r")
    low, high = 0.5 * guess, 1.5 * guess
    for _ in range(60):
        middle = 0.5 * (low + high)
        try:
            travel = body.slide(middle, time_step).travel[-1]
        except WorkFailed:
            travel = math.inf
        low, high = (middle, high) if travel > target else (low, middle)
        if abs(travel - target) < tolerance * target:
            break
    else:
        raise WorkFailed(
            "no S_r lets the body start from rest and stop where it was found: the path resists "
            "too early"
        )
    return middle, body.slide(middle, time_step)


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] + share * (ends[1] - ends[0])


def _cosine(slope: float) -> float:
    return 1.0 / math.hypot(1.0, slope)


def _tangent(sine: float) -> float:
    return math.tan(math.asin(min(max(sine, -0.99), 0.99)))
