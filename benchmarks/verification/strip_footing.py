"""Bearing capacity of a strip footing on clay: (2 + pi) c, phi = 0 (Prandtl 1920).

A stiff rough block, half of it at a plane of symmetry, is pressed at a steady speed into soil
without weight; no tension cap. The block is a thousand times denser than soil, so it keeps its
speed between two corrections, and the momentum it loses is the load. Steady speed finds the limit
load from one run, where a load raised in steps would run away at an uncertain step; without
weight nothing but c carries the block.

Soil is bonded to the block at every node the block reaches, so the footing acts as if it were
wider by about a cell at its edge, and the shear bands are as thick as the grid makes them. Both
fade in proportion to the cell size: the limit load is given as found with the smallest cells and
extrapolated from two sizes to none. Without volumetric averaging the load keeps rising: locking.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row

TITLE = "Strip footing on clay"
TOLERANCE = 0.05

WIDTH = 4.0  # of the footing, B [m]
SOIL_WIDTH, SOIL_DEPTH = 7.2, 3.6
"""Half of the soil [m]; Prandtl's mechanism reaches 1.5 B from the axis and 0.71 B down."""
BLOCK_HEIGHT = 0.8  # m
COHESION_KPA, YOUNGS_MODULUS_MPA, DENSITY = 10.0, 100.0, 1800.0
BLOCK_FACTOR = 1e3
"""Density and stiffness of the block over those of the soil: its waves are as fast."""
LAST_SETTLEMENT = 0.005
"""Settlement at the end of a run, share of B."""
PLATEAU = 0.0025
"""Settlement from which the load is averaged, share of B."""
CROSSINGS = 25
"""Times an elastic wave crosses the soil during a run."""


@dataclass
class Pressing:
    """One footing pressed down; K readings, P points."""

    spacing: float  # m
    averaged: bool
    settlement: np.ndarray  # (K,) share of B
    load: np.ndarray  # (K,) mean pressure under the footing, in c
    displacement: np.ndarray  # (P, 2) [m]
    position: np.ndarray  # (P, 2) [m]
    shear: np.ndarray  # (P,) plastic shear strain

    @property
    def limit(self) -> float:
        """Mean load over the plateau [c]."""
        return float(self.load[self.settlement > PLATEAU].mean())


def footing_scene(spacing: float) -> dict:
    """Half of the soil and of the block, the axis on the left wall."""
    half, top = 0.5 * WIDTH, SOIL_DEPTH + BLOCK_HEIGHT
    soil = {
        "friction_deg": 0,
        "cohesion_kpa": COHESION_KPA,
        "density": DENSITY,
        "youngs_modulus_mpa": YOUNGS_MODULUS_MPA,
        "poisson_ratio": 0.3,
    }
    block = soil | {
        "cohesion_kpa": 1e6,
        "density": BLOCK_FACTOR * DENSITY,
        "youngs_modulus_mpa": BLOCK_FACTOR * YOUNGS_MODULUS_MPA,
    }
    return {
        "name": f"footing at {spacing:g} m",
        "domain": {"x_min": 0, "x_max": SOIL_WIDTH, "y_max": top + 1},
        "ground": {"points": [[0, 0], [SOIL_WIDTH, 0]], "contact": "no_slip"},
        "zones": [
            {
                "name": "soil",
                "polygon": [[0, 0], [SOIL_WIDTH, 0], [SOIL_WIDTH, SOIL_DEPTH], [0, SOIL_DEPTH]],
                "material": "soil",
            },
            {
                "name": "block",
                "polygon": [[0, SOIL_DEPTH], [half, SOIL_DEPTH], [half, top], [0, top]],
                "material": "block",
            },
        ],
        "materials": {"soil": soil, "block": block},
        "spacing": spacing,
    }


def press(spacing: float, *, averaged: bool) -> Pressing:
    """Press the footing down to `LAST_SETTLEMENT`; the speed grows over the first third."""
    lab = Lab(footing_scene(spacing), initial_stress="gravity_on", volumetric_averaging=averaged)
    lab.set_gravity(0.0)
    lab.hold_walls()
    wave = lab.prepared.wave_speed
    lab.set_frame_time(10 * 0.29 * lab.scene.cell_size / wave)  # ten steps
    block = lab.of("block")
    mass, last = lab.mass[block].sum(), LAST_SETTLEMENT * WIDTH
    time = CROSSINGS * SOIL_WIDTH / wave
    top_speed = last / (time - time / 6)
    settlement, load, lost = [0.0], [0.0], []
    while settlement[-1] < LAST_SETTLEMENT:
        speed = top_speed * min(1.0, 3.0 * (lab.time + lab.frame_time) / time)
        lab.velocity[block] = (0.0, -speed)
        lab.run(1)
        lost.append(mass * (float(lab.velocity[block, 1].astype(float).mean()) + speed))
        if len(lost) == 10:
            settlement.append(-float(lab.displacement[block, 1].mean()) / WIDTH)
            force = np.mean(lost) / lab.frame_time
            load.append(force / (0.5 * WIDTH) / (1e3 * COHESION_KPA))
            lost.clear()
    return Pressing(
        spacing=spacing,
        averaged=averaged,
        settlement=np.array(settlement),
        load=np.array(load),
        displacement=lab.displacement,
        position=lab.position,
        shear=lab.plastic_shear_strain,
    )


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Press footings with several cell sizes, with and without averaging; compare, draw."""
    case, exact = "strip_footing", 2.0 + np.pi
    spacings = (0.2, 0.1) if quick else (0.2, 0.1, 0.05, 0.02)
    runs = [press(spacing, averaged=True) for spacing in spacings]
    locked = [press(spacing, averaged=False) for spacing in spacings[: 1 if quick else 3]]
    coarse, fine = runs[-2:]
    slope = (coarse.limit - fine.limit) / (coarse.spacing - fine.spacing)
    rows = []
    if not quick:
        rows.append(
            Row(case, f"limit load, {0.5 * WIDTH / (2 * fine.spacing):.0f} cells to half the width",
                fine.limit, exact, TOLERANCE, "c")
        )  # fmt: skip
    rows.append(
        Row(case, "limit load, extrapolated from the two smallest cells",
            fine.limit - slope * fine.spacing, exact, TOLERANCE, "c",
            note=", ".join(f"{p.limit:.3f} c at {2 * p.spacing:g} m cells" for p in runs))
    )  # fmt: skip
    if folder is not None:
        draw(folder / f"{case}.png", runs, locked)
    return rows


def draw(path: Path, runs: list[Pressing], locked: list[Pressing]) -> None:
    """Load against settlement, limit load against cell size, mechanism."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), width_ratios=(1.0, 0.8, 1.4))
    exact = 2.0 + np.pi
    for place, pressing in enumerate(runs):
        axes[0].plot(100 * pressing.settlement, pressing.load, color=f"C{place}", linewidth=1.2,
                     label=f"{2 * pressing.spacing:g} m")  # fmt: skip
    for place, pressing in enumerate(locked):
        axes[0].plot(100 * pressing.settlement, pressing.load, "--", color=f"C{place}",
                     linewidth=1.0, label=f"{2 * pressing.spacing:g} m, no averaging")  # fmt: skip
    axes[0].axhline(exact, color="k", linewidth=0.8)
    axes[0].text(0.5, exact - 0.1, "$(2 + \\pi) c$", va="top", ha="right", fontsize=9)
    axes[0].set(xlabel="settlement / B [%]", ylabel="mean pressure / c", ylim=(0, None))
    axes[0].legend(fontsize=7, title="cell size", title_fontsize=7, loc="lower right", ncols=2)
    for kept, marker, label in ((runs, "o-", "averaged"), (locked, "s--", "not averaged")):
        sizes = [2.0 * pressing.spacing / (0.5 * WIDTH) for pressing in kept]
        axes[1].plot(sizes, [p.limit / exact for p in kept], marker, markersize=5, label=label)
    axes[1].axhspan(1 - TOLERANCE, 1 + TOLERANCE, color="0.92", zorder=0)
    axes[1].axhline(1.0, color="0.5", linewidth=0.8)
    axes[1].set(
        xlabel="cell size / half width", ylabel="limit load / $(2 + \\pi) c$", xlim=(0, None)
    )
    axes[1].legend(fontsize=8)
    draw_mechanism(axes[2], runs[-1])
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_mechanism(axes: plt.Axes, pressing: Pressing) -> None:
    """Plastic shear strain next to the boundary of Prandtl's mechanism."""
    size = (45.0 * pressing.spacing) ** 2  # points touch
    highest = np.quantile(pressing.shear, 0.99)
    dots = axes.scatter(*pressing.position.T, s=size, c=pressing.shear, cmap="magma_r",
                        vmax=highest, linewidths=0, rasterized=True)  # fmt: skip
    half, top = 0.5 * WIDTH, SOIL_DEPTH
    fan = np.radians(np.linspace(-135, -45, 60))
    radius = half * np.sqrt(2.0)
    arc = np.stack([half + radius * np.cos(fan), top + radius * np.sin(fan)], axis=1)
    line = np.concatenate([[[0.0, top - half]], arc, [[half + 2 * half, top]]])
    axes.plot(*line.T, "C0", linewidth=1.2)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", xlim=(0, SOIL_WIDTH),
             ylim=(0, SOIL_DEPTH + BLOCK_HEIGHT))  # fmt: skip
    axes.set_title(f"plastic shear strain, {2 * pressing.spacing:g} m cells; line: Prandtl",
                   fontsize=9, loc="left")  # fmt: skip
    plt.colorbar(dots, ax=axes, shrink=0.6)
