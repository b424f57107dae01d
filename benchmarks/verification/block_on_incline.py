"""A stiff, strong block slides down a plane with Coulomb friction.

    a = g (sin b - mu cos b) for mu < tan b, and rest for mu >= tan b.

The plane is a sloped ground line across the square grid, so the contact acts at nodes that lie
anywhere in the cell below the block. The acceleration is that of a parabola through the path of
the centre of mass.

Limit: where mu is close to tan b the net force is small, and an elastic block without damping
chatters on a plane with friction, with any transfer scheme, also on level ground under inclined
gravity, and more so the finer it is (sliding with Coulomb friction is unstable: Adams 1995, Journal
of Applied Mechanics 62; soil, which yields, damps it). There the mobilised friction is compared,
and the acceleration is given in addition.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row

TITLE = "Block on an incline"
TOLERANCE = 0.02

GRAVITY = 9.81
LENGTH, THICKNESS = 10.0, 2.0  # of the block [m]
PLANE = 50.0  # its horizontal length [m]
TIME_S = 2.0
YOUNGS_MODULUS_MPA = 100.0

SLIDING = {15.0: (0.0, 0.1, 0.2), 30.0: (0.0, 0.2, 0.4), 45.0: (0.0, 0.3, 0.6)}
"""Friction coefficients by angle of the plane [degrees]."""
CHATTERING = {30.0: (0.5,), 45.0: (0.8,)}
"""Above about 0.8 tan b the net force is small and an elastic block without damping chatters."""
STICKING = {15.0: (0.4,), 30.0: (0.7,), 45.0: (1.2,)}


@dataclass
class Slide:
    """The path of one block."""

    angle: float  # degrees
    friction: float
    time: np.ndarray  # (T,) [s]
    travel: np.ndarray  # (T,) of the centre of mass along the plane [m]
    outlines: list[np.ndarray]  # positions of the points at the start, halfway, at the end [m]

    @property
    def acceleration(self) -> float:
        """Of the parabola through the path [m/s2]."""
        return 2.0 * float(np.polyfit(self.time, self.travel, 2)[0])

    @property
    def expected(self) -> float:
        """Exact acceleration, 0 where the block sticks [m/s2]."""
        return expected_acceleration(self.angle, self.friction)

    @property
    def mobilised(self) -> float:
        """Friction coefficient that gives the acceleration found."""
        b = np.radians(self.angle)
        return float(np.tan(b) - self.acceleration / (GRAVITY * np.cos(b)))


def expected_acceleration(angle: float, friction: float | np.ndarray) -> float | np.ndarray:
    """Acceleration of a block on a plane at `angle` [degrees] in m/s2, 0 where it sticks."""
    b = np.radians(angle)
    return np.maximum(GRAVITY * (np.sin(b) - friction * np.cos(b)), 0.0)


def incline_scene(angle: float, friction: float, spacing: float) -> dict:
    """Block at the upper end of a plane that falls to the right, as a scene."""
    b = np.radians(angle)
    along, normal = np.array([np.cos(b), -np.sin(b)]), np.array([np.sin(b), np.cos(b)])
    top = PLANE * np.tan(b)
    corner = np.array([4.0, top - 4.0 * np.tan(b)])
    block = [corner, corner + LENGTH * along]
    block += [block[1] + THICKNESS * normal, corner + THICKNESS * normal]
    return {
        "name": f"block at {angle:g} degrees, mu {friction:g}",
        "domain": {"x_min": 0, "x_max": PLANE, "y_max": top + 4},
        "ground": {
            "points": [[0, top], [PLANE, 0]],
            "contact": "coulomb",
            "friction_coefficient": friction,
        },
        "zones": [{"name": "block", "polygon": np.array(block).tolist(), "material": "rock"}],
        "materials": {
            "rock": {
                "friction_deg": 0,
                "cohesion_kpa": 1e4,
                "youngs_modulus_mpa": YOUNGS_MODULUS_MPA,
            }
        },
        "spacing": spacing,
    }


def slide(angle: float, friction: float, spacing: float) -> Slide:
    """Release one block and follow it."""
    lab = Lab(incline_scene(angle, friction, spacing), gravity_m_per_s2=GRAVITY)
    lab.run(0)
    b = np.radians(angle)
    along = np.array([np.cos(b), -np.sin(b)])
    share = lab.mass / lab.mass.sum()
    frames = round(TIME_S / lab.frame_time)
    time, travel, outlines = [0.0], [0.0], [lab.position]
    for frame in range(frames):
        lab.run(1)
        time.append(lab.time)
        travel.append(float(share @ lab.displacement @ along))
        if frame in (frames // 2, frames - 1):
            outlines.append(lab.position)
    return Slide(angle, friction, np.array(time), np.array(travel), outlines)


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Slide blocks down planes of several angles and frictions."""
    spacing = 0.5 if quick else 0.25
    slides = [slide(b, mu, spacing) for b, values in SLIDING.items() for mu in values]
    rough = [slide(b, mu, spacing) for b, values in CHATTERING.items() for mu in values]
    stuck = [slide(b, mu, spacing) for b, values in STICKING.items() for mu in values]
    case = "block_on_incline"
    rows = [
        Row(case, f"acceleration, b = {s.angle:g}°, mu = {s.friction:g}", s.acceleration,
            s.expected, TOLERANCE, "m/s2")
        for s in slides
    ]  # fmt: skip
    rows += [
        Row(case, f"friction mobilised, b = {s.angle:g}°, mu = {s.friction:g}", s.mobilised,
            s.friction, TOLERANCE, note=f"acceleration {s.acceleration / s.expected - 1:+.1%}")
        for s in rough
    ]  # fmt: skip
    rows += [
        Row(case, f"travel in {TIME_S:g} s, b = {s.angle:g}°, mu = {s.friction:g}",
            float(np.abs(s.travel).max() / spacing), 0.1, 0.0, "spacings", bound=True)
        for s in stuck
    ]  # fmt: skip
    if folder is not None:
        draw(folder / f"{case}.png", slides, [*rough, *stuck])
    return rows


def draw(path: Path, slides: list[Slide], others: list[Slide]) -> None:
    """One block on its way, paths against parabolas, accelerations against friction."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 4.2))
    shown = next(s for s in slides if s.angle == 30.0 and s.friction == 0.2)
    top = PLANE * np.tan(np.radians(shown.angle))
    left.fill_between([0, PLANE], [top, 0], color="0.85", linewidth=0)
    for number, outline in enumerate(shown.outlines):
        left.scatter(*outline.T, s=1.0, color=f"C{number}", linewidths=0)
    left.set(aspect="equal", xlim=(0, 28), ylim=(14, top + 2), xlabel="x [m]", ylabel="y [m]")
    left.set_title("b = 30°, mu = 0.2, at t = 0, 1, 2 s", fontsize=10)
    for number, s in enumerate(s for s in slides if s.angle == 30.0):
        exact = 0.5 * s.expected * s.time**2
        middle.plot(s.time, s.travel, color=f"C{number}", linewidth=3, alpha=0.5)
        middle.plot(s.time, exact, "k:", linewidth=1)
        middle.text(s.time[-1], exact[-1], f" mu = {s.friction:g}", va="center", fontsize=8)
    middle.set(xlim=(0, 2.5), xlabel="time [s]", ylabel="travel [m]")
    middle.set_title("b = 30°: solver, and ½ a t² (dotted)", fontsize=10)
    friction = np.linspace(0.0, 1.3, 300)
    for number, angle in enumerate(SLIDING):
        color = f"C{number}"
        right.plot(friction, expected_acceleration(angle, friction) / GRAVITY, color=color, lw=1)
        found = [s for s in (*slides, *others) if s.angle == angle]
        right.plot([s.friction for s in found], [s.acceleration / GRAVITY for s in found], "o",
                   color=color, label=f"b = {angle:g}°")  # fmt: skip
    right.set(xlabel="friction coefficient mu", ylabel="acceleration / g")
    right.set_title("solver (dots), sin b - mu cos b (lines)", fontsize=10)
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
