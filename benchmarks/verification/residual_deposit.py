"""A deposit on rough ground whose S_r is lowered so slowly that it only creeps, and stops.

phi = 0, strength S_r, B = S_r / (rho g). Where the layer of thickness h stretches over ground that
holds it back with its full strength, its profile is

    h^2 - pi B h = 2 B (x_f - x).                                                            (1)

Derived here from the balance of a slice. The shear stress falls linearly from S_r at the base to
0 at the surface. The layer stretches, so at yield (Tresca, plane strain) sigma_xx exceeds
sigma_yy = -rho g (h - y) by 2 sqrt(S_r^2 - tau^2). Over the height that gives the section force
N = -rho g h^2 / 2 + 2 S_r h (pi / 4), the area under a quarter of a circle (without base shear it
would be 2 S_r h: 4 B in place of pi B). The ground pulls with -S_r, so dN/dx = S_r, and from the
toe, where N = 0: N = -S_r (x_f - x). With N inserted this is (1). The last equation is plain
statics, whatever the front looks like, and the picture shows it measured; the yield state is exact
for a uniform layer (Prandtl's compressed layer; Nye 1951 for glaciers) and wrong by terms of order
(B / h)^2 where h changes slowly.

So x_f is the toe, where the ground contact ends; (1) itself ends there with a blunt face of
height pi B, which real soil rounds off. The area under (1),
(h0^3 / 3 - pi B h0^2 / 4 - (pi B)^3 / 12) / B, gives h0 and x_f: nothing is fitted. The forms of
leading order, h = sqrt(2 B (x_f - x)) and x_f = (9 A^2 / (8 B))^(1/3), leave out pi B, which at
B / h0 = 0.05 are 9 % of the toe; they are drawn for comparison only.

The same runs on bonded ground (`no_slip`) show the drag of nodes that are held fixed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row
from geometry.survey.columns import naked_eye_toe
from geometry.survey.surface_profile import surface_profile

TITLE = "S_r deposit on a rough base"
TOLERANCE = 0.05
LARGEST_KINETIC_SHARE = 0.01

DENSITY, GRAVITY = 1800.0, 9.81
UNIT_WEIGHT = DENSITY * GRAVITY
START_HEIGHT, START_RATIO = 10.0, 0.12
"""h0 [m] and B / h0 of the profile (1) with which a run starts."""
HALTS = {0.08: 84.0, 0.05: 46.0, 0.03: 60.0}
"""B / h0 at which the lowering halts and the deposit is measured: seconds of lowering to there."""
HOLD_S = 5.0


@dataclass
class Deposit:
    """A deposit at rest."""

    ratio: float  # B / h0 of the closed form
    strength_length: float  # B [m]
    height: float  # h0 of the closed form [m]
    toe: float  # x_f of the closed form [m]
    measured_toe: float  # end of the ground contact [m]
    x: np.ndarray  # (K,) places [m]
    surface: np.ndarray  # (K,) measured h [m]
    section_force: np.ndarray  # (K,) integral of sigma_xx over the height [N/m]
    position: np.ndarray  # (P, 2) [m]
    shear: np.ndarray  # (P,) plastic shear strain
    kinetic_share: float  # largest kinetic energy so far, share of the energy released till then

    @property
    def toe_error(self) -> float:
        """Relative error of the toe."""
        return self.measured_toe / self.toe - 1.0

    @property
    def profile_error(self) -> float:
        """Rms error of h, share of h0, away from ridge (by h0) and front (by 2 pi B)."""
        body = (self.x > self.height) & (self.x < self.toe - 2.0 * np.pi * self.strength_length)
        off = self.surface - profile(self.x, self.toe, self.strength_length)
        return float(np.sqrt(np.mean(off[body] ** 2))) / self.height


def profile(x: np.ndarray, toe: float, length: float) -> np.ndarray:
    """Thickness h [m] at `x` by (1); `length` is B [m]."""
    half = 0.5 * np.pi * length
    return np.where(x < toe, half + np.sqrt(half**2 + 2.0 * length * np.maximum(toe - x, 0.0)), 0.0)


def toe_of(height: float, length: float) -> float:
    """x_f [m] of the profile of thickness `height` at x = 0."""
    return (height**2 - np.pi * length * height) / (2.0 * length)


def area_of(height: float, length: float) -> float:
    """Area [m2 per m] under the profile from x = 0 to the toe."""
    cut = np.pi * length
    return (height**3 / 3.0 - cut * height**2 / 4.0 - cut**3 / 12.0) / length


def height_of(area: float, length: float) -> float:
    """h0 [m] of the profile that has this area."""
    least = np.pi * length * (1.0 + 1e-9)
    return brentq(
        lambda h: area_of(h, length) - area, least, 10.0 * (area * length) ** (1 / 3) + least
    )


def length_of(area: float, ratio: float) -> float:
    """B [m] at which a deposit of this area has B / h0 = `ratio`."""
    return float(np.sqrt(area / area_of(1.0 / ratio, 1.0)))


def deposit_scene(spacing: float, contact: str) -> dict:
    """Half a ridge with the profile (1), at a smooth wall, a tenth stronger than necessary."""
    length = START_RATIO * START_HEIGHT
    toe = toe_of(START_HEIGHT, length)
    x = np.linspace(toe, 0.0, 80)
    top = profile(x - 1e-9, toe, length)
    area = area_of(START_HEIGHT, length)
    last = length_of(area, min(HALTS))
    width = float(np.ceil(1.3 * toe_of(height_of(area, last), last)))
    return {
        "name": f"deposit at {spacing:g} m, {contact}",
        "domain": {"x_min": 0, "x_max": width, "y_max": 1.3 * START_HEIGHT},
        "ground": {"points": [[0, 0], [width, 0]], "contact": contact},
        "zones": [
            {
                "name": "deposit",
                "polygon": [[0, 0], [toe, 0], *np.stack([x, top], axis=1).tolist()],
                "material": "soil",
            }
        ],
        "materials": {
            "soil": {
                "friction_deg": 0,
                "cohesion_kpa": 1.1 * UNIT_WEIGHT * length / 1e3,
                "density": DENSITY,
                "youngs_modulus_mpa": 30,
                "poisson_ratio": 0.3,
            }
        },
        "spacing": spacing,
    }


def creep(spacing: float, contact: str, *, halts: dict[float, float]) -> list[Deposit]:
    """Lower S_r from halt to halt and measure the deposit at each.

    The logarithm of S_r follows half a cosine, so motion starts and ends gently; at the halt S_r
    then stays for `HOLD_S`.
    """
    lab = Lab(deposit_scene(spacing, contact))
    lab.run(0)
    area = float(lab.prepared.volume.sum())
    start_energy, share = lab.potential_energy, 0.0
    length = lab.scene.materials["soil"].cohesion_pa / UNIT_WEIGHT
    deposits = []
    for ratio, seconds in halts.items():
        goal = length_of(area, ratio)
        begin, frames = length, int(seconds / lab.frame_time)
        for frame in range(0, frames + int(HOLD_S / lab.frame_time), 4):
            left = 0.5 * (1.0 + np.cos(np.pi * min((frame + 4) / frames, 1.0)))
            length = goal * (begin / goal) ** left
            lab.set_strength("soil", cohesion_kpa=UNIT_WEIGHT * length / 1e3)
            lab.run(4)
            released = start_energy - lab.potential_energy
            if released > 0.02 * start_energy:
                share = max(share, lab.kinetic_energy / released)
        deposits.append(measure(lab, ratio, length, area, share))
    return deposits


def measure(lab: Lab, ratio: float, length: float, area: float, share: float) -> Deposit:
    """Figures of the deposit in the lab; the wall counts as a mirror."""
    spacing, position, volume = lab.scene.spacing, lab.position, lab.volume
    height = height_of(area, length)
    mirrored = np.concatenate([position, position * (-1.0, 1.0)])
    toe = naked_eye_toe(position, volume, spacing=spacing, side="right")
    width = 4.0 * spacing
    x = np.arange(0.5 * width, toe, width)
    bins = np.arange(len(x) + 1) * width
    force = np.histogram(position[:, 0], bins, weights=lab.stress[:, 0] * volume)[0] / width
    return Deposit(
        ratio=ratio,
        strength_length=length,
        height=height,
        toe=toe_of(height, length),
        measured_toe=toe,
        x=x,
        surface=surface_profile(mirrored, np.tile(volume, 2), x, spacing=spacing),
        section_force=force,
        position=position,
        shear=lab.plastic_shear_strain,
        kinetic_share=share,
    )


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Creep at several cell sizes on rough and on bonded ground, compare, draw."""
    case = "residual_deposit"
    halts = dict(list(HALTS.items())[: 2 if quick else None])
    spacings = (0.5,) if quick else (1.0, 0.5, 0.25)
    contacts = ("rough",) if quick else ("rough", "no_slip")
    runs = {
        (contact, spacing): creep(spacing, contact, halts=halts)
        for contact in contacts
        for spacing in spacings
    }
    finest = spacings[-1]
    rows = []
    for place, deposit in enumerate(runs["rough", finest]):
        where = f"B/h0 = {deposit.ratio:g}"
        note = ""
        if "no_slip" in contacts:
            note = f"no_slip: {100 * runs['no_slip', finest][place].toe_error:+.1f} %"
        rows.append(
            Row(case, f"toe, {where}", deposit.measured_toe, deposit.toe, TOLERANCE, "m", note=note)
        )
        rows.append(
            Row(case, f"rms error of the profile / h0, {where}", deposit.profile_error, TOLERANCE,
                0.0, bound=True)
        )  # fmt: skip
    rows.append(
        Row(case, "largest kinetic energy / released energy", deposit.kinetic_share,
            LARGEST_KINETIC_SHARE, 0.0, bound=True)
    )  # fmt: skip
    if folder is not None:
        draw(folder / f"{case}.png", runs)
    return rows


def draw(path: Path, runs: dict[tuple[str, float], list[Deposit]]) -> None:
    """Deposits on rough ground, the section force, and the toe against the cell size."""
    finest = min(spacing for _, spacing in runs)
    deposits = runs["rough", finest]
    figure = plt.figure(figsize=(11, 2.1 * len(deposits) + 3.6))
    grid = figure.add_gridspec(len(deposits) + 1, 2, height_ratios=[1] * len(deposits) + [1.7])
    widest = 1.08 * max(deposit.measured_toe for deposit in deposits)
    for place, deposit in enumerate(deposits):
        axes = figure.add_subplot(grid[place, :])
        draw_deposit(axes, deposit, widest)
        if place == 0:
            axes.legend(loc="upper right", fontsize=8, ncols=3)
    axes.set_xlabel("x [m]")
    draw_force(figure.add_subplot(grid[-1, 0]), deposits)
    draw_convergence(figure.add_subplot(grid[-1, 1]), runs)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_deposit(axes: plt.Axes, deposit: Deposit, widest: float) -> None:
    """Points of one deposit under the closed form."""
    b = deposit.strength_length
    axes.scatter(*deposit.position.T, s=2.0, c=np.log10(deposit.shear + 0.03), cmap="YlOrBr",
                 linewidths=0, rasterized=True)  # fmt: skip
    x = np.linspace(0.0, deposit.toe * (1.0 - 1e-9), 600)
    axes.plot(np.append(x, x[-1]), np.append(profile(x, deposit.toe, b), 0.0), "C0", linewidth=1.5,
              label="$h^2 - \\pi B h = 2 B (x_f - x)$")  # fmt: skip
    area = area_of(deposit.height, b)
    x = np.linspace(0.0, (9.0 * area**2 / (8.0 * b)) ** (1 / 3), 600)
    axes.plot(x, np.sqrt(2.0 * b * (x[-1] - x)), "k--", linewidth=0.8, label="leading order")
    inner = deposit.x < deposit.measured_toe - 0.5
    axes.plot(
        deposit.x[inner],
        deposit.surface[inner],
        "C3:",
        linewidth=1.5,
        label="surface of the points",
    )
    axes.set(xlim=(0, widest), ylim=(0, 1.15 * deposit.height), ylabel="y [m]")
    axes.set_title(
        f"$S_r$ = {UNIT_WEIGHT * b / 1e3:.1f} kPa, $B/h_0$ = {deposit.ratio:g}: "
        f"toe {deposit.measured_toe:.1f} m, expected {deposit.toe:.1f} m (heights stretched)",
        fontsize=9, loc="left",
    )  # fmt: skip


def draw_force(axes: plt.Axes, deposits: list[Deposit]) -> None:
    """Force in the section against the shear of the ground ahead of it."""
    for place, deposit in enumerate(deposits):
        b, unit = deposit.strength_length, UNIT_WEIGHT * deposit.height**2
        axes.plot(deposit.x / deposit.toe, -deposit.section_force / unit, ".", markersize=3,
                  color=f"C{place}", label=f"$B/h_0$ = {deposit.ratio:g}")  # fmt: skip
        axes.plot([0, 1], [b * deposit.toe / deposit.height**2, 0], color=f"C{place}", linewidth=1)
    axes.set(xlabel="$x / x_f$", ylabel="$-N / (\\rho g h_0^2)$", ylim=(0, None), xlim=(0, 1.05))
    axes.set_title("push in the section; lines: $S_r (x_f - x)$", fontsize=9, loc="left")
    axes.legend(fontsize=8)


def draw_convergence(axes: plt.Axes, runs: dict[tuple[str, float], list[Deposit]]) -> None:
    """Error of the toe against the cell size, on both grounds."""
    for contact, marker, style in (("rough", "o", "-"), ("no_slip", "s", "--")):
        spacings = [spacing for name, spacing in runs if name == contact]
        for place in range(len(runs["rough", min(s for _, s in runs)]) if spacings else 0):
            kept = [runs[contact, spacing][place] for spacing in spacings]
            axes.plot(
                [2.0 * s / d.height for s, d in zip(spacings, kept, strict=True)],
                [100.0 * d.toe_error for d in kept],
                style + marker, color=f"C{place}", markersize=5, linewidth=1,
                markerfacecolor=f"C{place}" if contact == "rough" else "white",
                label=f"{contact}, $B/h_0$ = {kept[0].ratio:g}",
            )  # fmt: skip
    axes.axhspan(-100 * TOLERANCE, 100 * TOLERANCE, color="0.92", zorder=0)
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    axes.set(xlabel="cell size / $h_0$", ylabel="error of the toe [%]", xlim=(0, None))
    axes.set_title("convergence; band: tolerance", fontsize=9, loc="left")
    axes.legend(fontsize=7, ncols=2)
