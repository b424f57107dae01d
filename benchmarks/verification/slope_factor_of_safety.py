"""Factor of safety by strength reduction: infinite slope, and two published slopes.

The infinite slope, the effect of its ends, and why soil without dilation (psi = 0) has
c cos(phi) + sigma sin(phi) on a slip plane and not c + sigma tan(phi), are in `infinite_slope`.
The result depends on how slowly the strength is lowered, because creeping slabs flatten: phi 0 on
level ground, +2.4 % in stages of 2 %, as here, gave +8 % in finer ones.
Homogeneous slopes of height H on a rigid base at the level of the toe:

    2 : 1, phi = 20 degrees, c = 0.05 gamma H: F = 1.40, Griffiths and Lane (1999), example 1,
        finite elements with psi = 0; 1.38 by Bishop and Morgenstern's charts;
    60 degrees, phi = 0: gamma H / c = 5.24 at failure, Taylor (1937); slip circle through the toe.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.infinite_slope import THICKNESS, Slab, Stages, lower_in_stages
from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row
from benchmarks.verification.strength_reduction import FAILING_RATE, Ramp, lower

TITLE = "Factor of safety of slopes"
TOLERANCE = 0.05
HEIGHT, BEHIND, AHEAD = 10.0, 15.0, 8.0
"""Of the slope, widths of its crest and of the ground ahead of its toe [m]."""
DENSITY, GRAVITY = 2000.0, 9.81


@dataclass(frozen=True)
class Published:
    """A slope with a known factor of safety."""

    name: str
    source: str
    slope_deg: float
    friction_deg: float
    cohesion_ratio: float  # c / (gamma H)
    factor: float


TWO_TO_ONE = float(np.degrees(np.arctan(0.5)))
PUBLISHED = (
    Published("2:1, phi 20", "Griffiths and Lane 1999", TWO_TO_ONE, 20.0, 0.05, 1.40),
    Published("60 degrees, phi 0", "Taylor 1937", 60.0, 0.0, 1.2 / 5.24, 1.2),
)
BONDED = Slab(0.0, 0.40, "no_slip", level=True, spacing=0.125)
"""Nodes that are held fixed drag by a share that halves with the cell: 12 cells to the thickness,
where the other slabs have 6."""
COARSE = replace(BONDED, spacing=0.25)
SLABS = (
    Slab(0.0, 0.40, "rough", level=True),
    Slab(0.0, 0.40, "rough", level=False),
    BONDED,
    Slab(20.0, 0.15, "rough", level=True),
    Slab(20.0, 0.15, "rough", level=False),
    Slab(20.0, 0.15, "no_slip", level=True),
)


def slope_scene(slope: Published, spacing: float) -> dict:
    """A homogeneous slope that falls to the right."""
    toe = BEHIND + HEIGHT / np.tan(np.radians(slope.slope_deg))
    return {
        "name": f"slope {slope.name} at {spacing:g} m",
        "domain": {"x_min": 0, "x_max": float(np.ceil(toe + AHEAD)), "y_max": HEIGHT + 2},
        "ground": {"points": [[0, 0], [toe + AHEAD, 0]]},
        "zones": [
            {
                "name": "slope",
                "polygon": [[0, 0], [toe, 0], [BEHIND, HEIGHT], [0, HEIGHT]],
                "material": "soil",
            }
        ],
        "materials": {
            "soil": {
                "friction_deg": slope.friction_deg,
                "cohesion_kpa": slope.cohesion_ratio * DENSITY * GRAVITY * HEIGHT / 1e3,
                "density": DENSITY,
                "youngs_modulus_mpa": 100,
                "poisson_ratio": 0.3,
            }
        },
        "spacing": spacing,
    }


def fail(slope: Published, spacing: float) -> Ramp:
    """Lower the strength of a slope until it has failed."""
    lab = Lab(slope_scene(slope, spacing))
    factors = (0.8 * slope.factor, 1.25 * slope.factor)
    return lower(lab, "soil", factors, crest=crest_of(lab), height=HEIGHT, seconds=30.0)


def crest_of(lab: Lab) -> np.ndarray:
    """The points at the edge of the crest, (P,) bool."""
    beside = np.abs(lab.start[:, 0] - BEHIND + 1.0) < 1.0
    return beside & (lab.start[:, 1] > HEIGHT - 1.0)


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Slabs and slopes by strength reduction; compare, draw."""
    slabs = SLABS[:1] if quick else SLABS
    spacings = (0.5,) if quick else (0.5, 0.25)
    ramps = {slope: [fail(slope, spacing) for spacing in spacings] for slope in PUBLISHED}
    stages = [lower_in_stages(slab, 0.9 if slab.level else 0.8) for slab in slabs]
    coarse = None if quick else lower_in_stages(COARSE, 0.9)
    rows = [
        row
        for found in stages
        for row in rows_of_slab(found, coarse if found.slab == BONDED else None)
    ]
    for slope, found in ramps.items():
        cells = f"{HEIGHT / (2 * spacings[-1]):.0f} cells to H"
        rows.append(
            Row("slope_factor_of_safety", f"F, slope {slope.name}, {cells}", found[-1].limit,
                slope.factor, TOLERANCE, note=slope.source)
        )  # fmt: skip
    if folder is not None:
        draw(folder / "slope_factor_of_safety.png", stages, ramps)
    return rows


def name_of(slab: Slab) -> str:
    """What tells a slab from the others."""
    plane = "gravity tilted" if slab.level else "ground sloped"
    water = ", under water" if slab.submerged else ""
    return f"phi {slab.friction_deg:g}, {slab.contact}, {plane}{water}"


def rows_of_slab(found: Stages, coarse: Stages | None = None) -> list[Row]:
    """Against (2), which for phi = 0 is (1); with friction also against (1), and the reason.

    `coarse` is the same slab with larger cells, which is reported as well.
    """
    slab, case = found.slab, "slope_factor_of_safety"
    note = f"the ends add at most {100 * (slab.whole / slab.formula - 1):.1f} %"
    if not slab.level:
        note = "the ground crosses the cells"
    if coarse is not None:
        fine, large = (round(0.5 * THICKNESS / s.spacing) for s in (slab, coarse.slab))
        excess = 100 * (coarse.found / slab.without_dilation(slab.formula) - 1)
        note = f"{fine} cells to the thickness; {excess:+.0f} % with {large}"
    rows = [
        Row(case, f"F, infinite slope, {name_of(slab)}", found.found,
            slab.without_dilation(slab.formula), TOLERANCE, note=note)
    ]  # fmt: skip
    if slab.friction_deg and slab.level and slab.contact == "rough":
        rows.append(
            Row(case, f"the same by c + sigma tan(phi), {name_of(slab)}", found.found,
                slab.formula, TOLERANCE, note="not the strength where psi = 0")
        )  # fmt: skip
    if slab.friction_deg and slab.contact == "no_slip":
        rows.append(
            Row(case, "shear stress on the slip plane / (c cos(phi) + sigma sin(phi))",
                found.on_plane[1], 1.0, TOLERANCE,
                note=f"over c + sigma tan(phi): {found.on_plane[0]:.3f}")
        )  # fmt: skip
    return rows


def draw(path: Path, stages: list[Stages], ramps: dict[Published, list[Ramp]]) -> None:
    """Slabs: sliding per stage; slopes: rate of settlement and the failed slope."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 7.2), width_ratios=(1, 1.15))
    for place, found in enumerate(stages):
        expected = found.slab.without_dilation(found.slab.formula)
        axes[0, 0].semilogy(found.factor / expected, found.slid + 1e-5, "o-",
                            markersize=3, linewidth=1, color=f"C{place}",
                            label=name_of(found.slab))  # fmt: skip
        axes[0, 0].axvline(found.found / expected, color=f"C{place}", linewidth=0.8, linestyle=":")
    axes[0, 0].axvspan(1 - TOLERANCE, 1 + TOLERANCE, color="0.92", zorder=0)
    axes[0, 0].set(xlabel="F / expected, infinite slope with psi = 0",
                   ylabel="sliding in a stage / thickness", ylim=(5e-6, 3))  # fmt: skip
    axes[0, 0].legend(fontsize=7)
    for place, (slope, found) in enumerate(ramps.items()):
        for ramp, style in zip(found, ("--", "-") if len(found) > 1 else ("-",), strict=True):
            axes[1, 0].semilogy(ramp.factor / slope.factor, np.maximum(ramp.rate, 1e-4), style,
                                color=f"C{place}", linewidth=1.2,
                                label=f"{slope.name}, {2 * ramp.spacing:g} m cells")  # fmt: skip
            axes[1, 0].plot(ramp.limit / slope.factor, FAILING_RATE, "o", color=f"C{place}",
                            markersize=5)  # fmt: skip
    axes[1, 0].axvspan(1 - TOLERANCE, 1 + TOLERANCE, color="0.92", zorder=0)
    axes[1, 0].axhline(FAILING_RATE, color="0.5", linewidth=0.8)
    axes[1, 0].set(xlabel="F / published F", ylabel="d(crest displacement / H) / d ln F",
                   ylim=(5e-4, 5))  # fmt: skip
    axes[1, 0].legend(fontsize=7)
    sloped = ([found for found in stages if not found.slab.level] or stages)[0]
    moved = np.hypot(*sloped.displacement.T) / THICKNESS
    title = f"slab that slides away ({name_of(sloped.slab)}): displacement / thickness"
    picture(axes[0, 1], sloped.position, moved, 4.0 * sloped.slab.spacing, title)
    slope, found = next(iter(ramps.items()))
    moved = 100 * np.hypot(*found[-1].displacement.T) / HEIGHT
    title = f"slope {slope.name}: displacement / H [%]"
    picture(axes[1, 1], found[-1].position, moved, 8.0 * found[-1].spacing, title)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def picture(
    axes: plt.Axes, position: np.ndarray, value: np.ndarray, size: float, title: str
) -> None:
    """Points coloured by a value."""
    dots = axes.scatter(*position.T, s=size, c=value, cmap="magma_r", linewidths=0, rasterized=True)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.set_title(title, fontsize=8, loc="left")
    plt.colorbar(dots, ax=axes, shrink=0.7)
