"""Steady flow of grains down a plane, whose friction rises with the rate of shear (mu(I)).

The effect `inertial_friction` against the profile of Bagnold. On a slope b the ratio of shear to
normal stress is tan(b) at every depth, so the inertial number is the same everywhere,

    I = I_0 / (a / (tan b - mu_s) - 1),  a = mu_2 - mu_s,

and with I = u' d / sqrt(p / rho_s), p = rho g cos b (h - y),

    u(y) = 2/3 (I / d) sqrt(rho g cos b / rho_s) (h^(3/2) - (h - y)^(3/2)).

A long slab on level ground under tilted gravity is read in its middle after four seconds. Later
the spreading of its free ends arrives there. What is left of the start has not died out by then, so
it starts with four fifths of these speeds, or with six fifths (on rough ground).

Source: Jop, Forterre, Pouliquen (2006), Nature 441, 727; mu_s of the model is sin(phi)
(`granular_column`). On rough ground, which lets soil slip where its strength is exceeded, the same
profile is found: at the base the flowing soil resists as much as inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row

TITLE = "Grains flowing down a plane: the profile of Bagnold"
CASE = "inclined_flow"
SPEED_TOLERANCE = 0.05
PROFILE_TOLERANCE = 0.05

GRAVITY, DENSITY, GRAIN_DENSITY = 9.81, 1800.0, 2650.0
MU_S, RISE, INERTIAL_NUMBER = 0.38, 0.26, 0.279
GRAIN = 0.2
"""d [m]. A coarse grain makes the flow slow, so that it is steady before the ends arrive."""
HEIGHT, LENGTH, ROOM = 1.0, 40.0, 30.0
"""Of the slab, and what it may spread by [m]."""
SPACING, QUICK_SPACING = 0.1, 0.125
TIME_S = 4.0


@dataclass
class Flow:
    """A slab that has flowed; K layers of points."""

    slope_deg: float
    contact: str
    height: float  # now [m]
    y: np.ndarray  # (K,) heights of the layers [m]
    speed: np.ndarray  # (K,) [m/s]

    @property
    def law(self) -> np.ndarray:
        """Speeds of Bagnold's profile at `y`, (K,) [m/s]."""
        return bagnold(self.slope_deg, self.height, self.y)


def bagnold(slope_deg: float, height: float, y: np.ndarray) -> np.ndarray:
    """Steady speed at heights `y` [m] of a layer of this `height` [m], in m/s."""
    b = np.radians(slope_deg)
    inertia = INERTIAL_NUMBER / (RISE / (np.tan(b) - MU_S) - 1.0)
    unit = np.sqrt(DENSITY * GRAVITY * np.cos(b) / GRAIN_DENSITY)
    return 2.0 / 3.0 * inertia / GRAIN * unit * (height**1.5 - (height - y) ** 1.5)


def flow(slope_deg: float, contact: str, spacing: float, start: float) -> Flow:
    """Let a slab flow; it starts with the share `start` of the steady speeds."""
    lab = Lab(
        {
            "name": f"flow at {slope_deg:g} degrees",
            "domain": {"x_min": 0, "x_max": LENGTH + ROOM, "y_max": 3 * HEIGHT, "walls": "closed"},
            "ground": {"points": [[0, 0], [LENGTH + ROOM, 0]], "contact": contact},
            "zones": [
                {"name": "slab", "material": "grains",
                 "polygon": [[3, 0], [LENGTH + 3, 0], [LENGTH + 1, HEIGHT], [5, HEIGHT]]}
            ],
            "materials": {
                "grains": {"friction_deg": float(np.degrees(np.arcsin(MU_S))), "cohesion_kpa": 0,
                           "density": DENSITY, "youngs_modulus_mpa": 5, "poisson_ratio": 0.3}
            },
            "spacing": spacing,
            "effects": {
                "inertial_friction": {
                    "amplitude": RISE, "grain_size_mm": 1e3 * GRAIN,
                    "inertial_number": INERTIAL_NUMBER, "grain_density_kg_m3": GRAIN_DENSITY,
                }
            },
        },
        gravity_m_per_s2=GRAVITY,
    )  # fmt: skip
    lab.set_gravity(GRAVITY, tilt_deg=slope_deg)
    lab.run(0)
    lab.velocity[:, 0] = start * bagnold(slope_deg, HEIGHT, np.minimum(lab.start[:, 1], HEIGHT))
    lab.run(round(TIME_S / lab.frame_time))
    middle = np.abs(lab.start[:, 0] - 0.45 * LENGTH) < 3.0 * HEIGHT
    layer = np.round(lab.start[middle, 1] / spacing - 0.5).astype(int)
    layers = range(layer.max() + 1)
    y = np.array([lab.position[middle][layer == k, 1].mean() for k in layers])
    speed = np.array([lab.velocity[middle][layer == k, 0].mean() for k in layers])
    return Flow(slope_deg, contact, float(y[-1] + 0.5 * spacing), y, speed.astype(float))


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Three slopes on bonded ground, one on rough ground."""
    spacing = QUICK_SPACING if quick else SPACING
    flows = [flow(25.0, "rough", spacing, 1.2)]
    if not quick:
        flows += [flow(slope_deg, "no_slip", spacing, 0.8) for slope_deg in (23.0, 25.0, 27.0)]
    rows = []
    for one in flows:
        name = f"{one.slope_deg:g} degrees, {one.contact}"
        off = float(np.sqrt(np.mean((one.speed - one.law) ** 2)) / one.law[-1])
        rows += [
            Row(CASE, f"speed of the top layer, {name}", float(one.speed[-1]), float(one.law[-1]),
                SPEED_TOLERANCE, "m/s"),
            Row(CASE, f"profile, rms / top speed, {name}", off, PROFILE_TOLERANCE, 0.0, bound=True),
        ]  # fmt: skip
    if folder is not None:
        draw(folder / f"{CASE}.png", flows)
    return rows


def draw(path: Path, flows: list[Flow]) -> None:
    """Speeds over the height, with Bagnold's profiles."""
    figure, axes = plt.subplots(figsize=(6.5, 4.0), layout="constrained")
    for place, one in enumerate(flows):
        colour, filled = f"C{place}", one.contact == "no_slip"
        y = np.linspace(0.0, one.height, 100)
        if filled:
            axes.plot(bagnold(one.slope_deg, one.height, y), y, color=colour, linewidth=1.5)
        axes.plot(one.speed, one.y, "o", color=colour, markersize=6,
                  markerfacecolor=colour if filled else "white",
                  label=f"{one.slope_deg:g} degrees, {one.contact}")  # fmt: skip
    axes.plot([], [], color="0.3", linewidth=1.5, label="Bagnold")
    axes.set(xlabel="speed [m/s]", ylabel="y [m]", xlim=(0, None), ylim=(0, 1.05))
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)
    plt.close(figure)
