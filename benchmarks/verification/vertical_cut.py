"""Critical height of a vertical cut in clay, phi = 0, without tension cap.

H_c lies between 3.76 and 3.83 c / gamma: bounds of limit analysis (3.83 is the slip circle through
the toe, Fellenius 1927; 3.776 the best lower bound, Pastor et al. 2009). Strength is lowered in a
steady ramp and N = gamma H / c at failure read off (`strength_reduction`). Shear bands are as thick
as the grid makes them, so N comes out too high by an amount proportional to the cell size.
In addition, a cut 8 % below the interval must come to rest, and one 8 % above it must fall.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row
from benchmarks.verification.strength_reduction import FAILING_RATE, Ramp, lower

TITLE = "Vertical cut in clay"
TOLERANCE = 0.08
INTERVAL = (3.76, 3.83)

HEIGHT, DEPTH, BEHIND, AHEAD = 5.0, 2.5, 10.0, 6.0
"""Of the cut, of the soil below its toe, widths of the soil behind and ahead [m]."""
DENSITY, GRAVITY = 1800.0, 9.81
FIRST, LAST = 3.0, 4.6
"""N at the start and at the end of a ramp."""
RAMP_S, WATCHED_S = 40.0, 12.0


@dataclass
class Watched:
    """A cut left alone with one strength; K readings."""

    number: float  # N
    time: np.ndarray  # (K,) [s]
    sunk: np.ndarray  # (K,) settlement of the crest, share of H


def cut_scene(spacing: float) -> dict:
    """The cut with N = `FIRST`."""
    right, top = BEHIND + AHEAD, DEPTH + HEIGHT
    outline = [[0, 0], [right, 0], [right, DEPTH], [BEHIND, DEPTH], [BEHIND, top], [0, top]]
    return {
        "name": f"vertical cut at {spacing:g} m",
        "domain": {"x_min": 0, "x_max": right, "y_max": top + 1},
        "ground": {"points": [[0, 0], [right, 0]]},
        "zones": [{"name": "soil", "polygon": outline, "material": "clay"}],
        "materials": {
            "clay": {
                "friction_deg": 0,
                "cohesion_kpa": DENSITY * GRAVITY * HEIGHT / FIRST / 1e3,
                "density": DENSITY,
                "youngs_modulus_mpa": 30,
                "poisson_ratio": 0.3,
            }
        },
        "spacing": spacing,
    }


def crest(lab: Lab) -> np.ndarray:
    """Points at the edge of the cut, (P,) bool."""
    return (lab.start[:, 0] > BEHIND - 1.0) & (lab.start[:, 1] > DEPTH + HEIGHT - 1.0)


def ramp(spacing: float) -> Ramp:
    """Lower the strength until the cut has failed."""
    lab = Lab(cut_scene(spacing))
    return lower(lab, "clay", (1.0, LAST / FIRST), crest=crest(lab), height=HEIGHT, seconds=RAMP_S)


def watch(spacing: float, number: float) -> Watched:
    """Lower the strength to N = `number` in 6 s and watch."""
    lab = Lab(cut_scene(spacing))
    lab.run(0)
    edge, begin = crest(lab), 6.0
    time, sunk = [-begin], [0.0]
    while lab.time < begin + WATCHED_S:
        factor = (number / FIRST) ** min(1.0, lab.time / begin)
        lab.reduce_strength("clay", factor)
        lab.run(2)
        time.append(lab.time - begin)
        sunk.append(-float(lab.displacement[edge, 1].mean()) / HEIGHT)
    return Watched(number=number, time=np.array(time), sunk=np.array(sunk))


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Ramps with several cell sizes, and two cuts left alone."""
    case, middle = "vertical_cut", float(np.mean(INTERVAL))
    spacings = (0.5, 0.25) if quick else (0.5, 0.25, 0.125)
    ramps = [ramp(spacing) for spacing in spacings]
    found = [FIRST * ramp.limit for ramp in ramps]
    rows = [
        Row(case, f"N = gamma H / c at failure, {HEIGHT / (2 * spacings[-1]):.0f} cells to H",
            found[-1], middle, TOLERANCE),
        Row(case, "N at failure, extrapolated from the two smallest cells",
            2.0 * found[-1] - found[-2], middle, TOLERANCE,
            note=", ".join(f"{n:.3f} at {2 * s:g} m cells" for n, s in zip(found, spacings,
                                                                         strict=True))),
    ]  # fmt: skip
    # With the coarse cells of a quick run the cut above the interval only just fails.
    bounds = ((1 - TOLERANCE) * INTERVAL[0], (1 + TOLERANCE) * INTERVAL[1])
    watched = [] if quick else [watch(spacings[-1], number) for number in bounds]
    if watched:
        rows += rows_of_watched(case, *watched)
    if folder is not None:
        draw(folder / f"{case}.png", ramps, watched)
    return rows


def rows_of_watched(case: str, standing: Watched, falling: Watched) -> list[Row]:
    """The cut below the interval rests, the one above it falls."""
    half = 0.5 * WATCHED_S
    rest = float(standing.sunk[-1] - np.interp(half, standing.time, standing.sunk))
    fallen = falling.time[falling.sunk > 0.01]
    return [
        Row(case, f"N = {standing.number:.2f} stands: settlement / H in the last {half:g} s", rest,
            1e-4, 0.0, bound=True),
        Row(case, f"N = {falling.number:.2f} falls: time after the lowering until sunk by H / 100",
            float(fallen[0]) if len(fallen) else np.inf, WATCHED_S, 0.0, "s", bound=True),
    ]  # fmt: skip


def draw(path: Path, ramps: list[Ramp], watched: list[Watched]) -> None:
    """Rate of settlement against N, the two cuts left alone, the failed cut."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.0), width_ratios=(1, 0.9, 1.25))
    for place, ramp in enumerate(ramps):
        axes[0].semilogy(FIRST * ramp.factor, np.maximum(ramp.rate, 1e-4), color=f"C{place}",
                         linewidth=1.2, label=f"{2 * ramp.spacing:g} m cells")  # fmt: skip
        axes[0].plot(FIRST * ramp.limit, FAILING_RATE, "o", color=f"C{place}", markersize=5)
    axes[0].axhline(FAILING_RATE, color="0.5", linewidth=0.8)
    axes[0].axvspan(*INTERVAL, color="0.75", label="3.76 to 3.83")
    axes[0].set(xlabel="$N = \\gamma H / c$", ylabel="d(crest displacement / H) / d ln N",
                ylim=(1e-3, 5), xlim=(FIRST, LAST))  # fmt: skip
    axes[0].legend(fontsize=8)
    for place, cut in enumerate(watched):
        axes[1].plot(cut.time, 100 * cut.sunk, color=f"C{3 + place}", label=f"N = {cut.number:.2f}")
    axes[1].axvline(0, color="0.5", linewidth=0.8)
    axes[1].set(xlabel="time since N was reached [s]", ylabel="settlement of the crest / H [%]")
    if watched:
        axes[1].legend(fontsize=8)
    last = ramps[-1]
    moved = 100 * np.hypot(*last.displacement.T) / HEIGHT
    size = (42.0 * last.spacing) ** 2
    dots = axes[2].scatter(*last.position.T, s=size, c=moved, cmap="magma_r", linewidths=0,
                           rasterized=True)  # fmt: skip
    axes[2].set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes[2].set_title("displacement / H at the end of the ramp [%]", fontsize=9, loc="left")
    plt.colorbar(dots, ax=axes[2], shrink=0.7)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
