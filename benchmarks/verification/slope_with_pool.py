"""Factor of safety under water: submerged slab, and slopes with a pool or a falling water table.

- Infinite slope under still water (`infinite_slope`): submerged weight throughout, so

      F = (c' + gamma' z cos^2 b tan phi') / (gamma' z sin b cos b),

  which is that of the dry slope with the same c' / (gamma' z); reduced for psi = 0 as there.
- The 2:1 slope of `slope_factor_of_safety` (phi' = 20 degrees, c' = 0.05 gamma H, rho = 2 rho_w)
  with pools of several depths, and with a water table that falls through the soil: strength
  reduction by the solver against Spencer's method (`inversion.classical`: total weights, pore
  pressure, pressure of the pool on the slope) on the critical circle by Bishop's. Both have the
  pressure hydrostatic below the line.
- The same falling table with reduced weights alone, in both: what leaving out seepage is worth.

The dry slope is among the rows: 1.40 by Griffiths and Lane (1999). Limit: the solver may fail on a
surface that is no circle, and its soil has psi = 0, of which Spencer's method knows nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.infinite_slope import Slab, lower_in_stages
from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row
from benchmarks.verification.slope_factor_of_safety import (
    BEHIND,
    HEIGHT,
    PUBLISHED,
    crest_of,
    name_of,
    slope_scene,
)
from benchmarks.verification.strength_reduction import Ramp, lower
from geometry.scenes.scene import Scene, scene_from_mapping
from inversion.classical.limit_equilibrium import spencer
from inversion.classical.search import critical_circle
from inversion.classical.section import section_of
from inversion.classical.slices import Circle, WaterForm, cut

TITLE = "Factor of safety under water"
TOLERANCE = 0.05
CASE = "slope_with_pool"

SLOPE = PUBLISHED[0]
TOE = BEHIND + 2.0 * HEIGHT
SLABS = (
    Slab(0.0, 0.40, "rough", level=False, submerged=True),
    Slab(20.0, 0.15, "rough", level=False, submerged=True),
)
SAME = 0.005
"""The submerged slab slips at the F of the dry one, within a quarter of a stage."""


@dataclass(frozen=True)
class Water:
    """Water of a slope: its line, first vertex at the pool's level or the table's highest."""

    name: str
    line: tuple[tuple[float, float], ...] = ()
    form: WaterForm = "pore_pressure"


def pool(depth: float) -> Water:
    """A level table at `depth` H over the toe."""
    return Water(f"pool at {depth:g} H", ((0.0, depth * HEIGHT),))


FALLING = ((0.0, 8.0), (BEHIND, 6.5), (TOE, 0.0))
WATERS = (
    Water("dry"),
    *(pool(depth) for depth in (0.3, 0.5, 0.7, 1.2)),
    Water("falling table", FALLING),
    Water("falling table and pool at 0.3 H", ((0, 9), (BEHIND, 8), (TOE - 6.0, 3), (TOE, 3))),
    Water("falling table, reduced weights alone", FALLING, "buoyant"),
)
QUICK = (WATERS[2], WATERS[5])


@dataclass
class Compared:
    """A slope by both methods."""

    water: Water
    scene: Scene
    circle: Circle
    spencer: float
    ramp: Ramp


def compare(water: Water, spacing: float) -> Compared:
    """Spencer's F on the critical circle, and strength reduction around it."""
    document = slope_scene(SLOPE, spacing)
    if water.line:
        document["water_level"] = water.line[0][1]
        document["phreatic_line"] = list(water.line) if len(water.line) > 1 else None
        document["domain"]["y_max"] = HEIGHT + 4.0
    scene = scene_from_mapping(document)
    section = section_of(scene)
    ends = {"head": (1.0, BEHIND), "toe": (TOE - 10.0, TOE)}
    circle = critical_circle(section, "right", form=water.form, **ends).circle
    slices = cut(section, circle, "right", form=water.form, outside_liquefied=True)
    factor = float(spencer(slices)[()])
    lab = Lab(scene, water=water.form)
    factors = (0.8 * factor, 1.25 * factor)
    ramp = lower(lab, "soil", factors, crest=crest_of(lab), height=HEIGHT, seconds=30.0)
    return Compared(water, scene, circle, factor, ramp)


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Slabs and slopes under water; compare, draw."""
    spacing = 0.5 if quick else 0.25
    rows = [] if quick else [row for slab in SLABS for row in rows_of_slab(slab)]
    compared = [compare(water, spacing) for water in (QUICK if quick else WATERS)]
    rows += [
        Row(CASE, f"F, 2:1, {found.water.name}, {HEIGHT / (2 * spacing):.0f} cells to H",
            found.ramp.limit, found.spencer, TOLERANCE, note="Spencer")
        for found in compared
    ]  # fmt: skip
    if folder is not None:
        draw(folder / f"{CASE}.png", compared)
    return rows


def rows_of_slab(slab: Slab) -> list[Row]:
    """The submerged slab against the closed form and against the dry one."""
    wet, dry = (lower_in_stages(one, 0.8) for one in (slab, slab.dry()))
    exact = slab.without_dilation(slab.formula)
    return [
        Row(CASE, f"F, infinite slope, {name_of(slab)}", wet.found, exact, TOLERANCE,
            note=f"dry: {100 * (dry.found / exact - 1):+.1f} %"),
        Row(CASE, f"F / F of the dry slab, {name_of(slab)}", wet.slips / dry.slips, 1.0, SAME),
    ]  # fmt: skip


def draw(path: Path, compared: list[Compared]) -> None:
    """Factors by both methods, and the failed slope under the falling table."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.9), width_ratios=(1, 1.2))
    place = np.arange(len(compared))[::-1]
    left.plot([one.spencer for one in compared], place, "k|", markersize=14, label="Spencer")
    left.plot([one.ramp.limit for one in compared], place, "o", color="C0", label="solver")
    left.set_yticks(place, [one.water.name for one in compared], fontsize=8)
    left.set(xlabel="F")
    left.legend(fontsize=8)
    shown = next(one for one in compared if one.water.line == FALLING)
    moved = 100 * np.hypot(*shown.ramp.displacement.T) / HEIGHT
    dots = right.scatter(*shown.ramp.position.T, s=8.0 * shown.ramp.spacing, c=moved,
                         cmap="magma_r", linewidths=0, rasterized=True)  # fmt: skip
    plt.colorbar(dots, ax=right, shrink=0.7, label="displacement / H [%]")
    x = np.linspace(0.0, TOE, 200)
    right.plot(x, shown.scene.phreatic_level(x), color="C0", linewidth=1.2, label="water table")
    x = np.linspace(*shown.circle.ends, 200)
    right.plot(x, shown.circle.level(x), "k--", linewidth=1.2, label="critical circle")
    right.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    right.legend(fontsize=8, loc="upper right")
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
