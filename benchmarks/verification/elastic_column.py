"""A wide elastic layer under its own weight: stress, settlement, and how fast they converge.

In the middle, far from the side walls, the layer is a column that strains along y alone:

    sigma_yy = -rho g (H - y),   sigma_xx = nu / (1 - nu) sigma_yy,
    u_y = -(rho g / M) (H y - y^2 / 2),   M = E (1 - nu) / ((1 + nu) (1 - 2 nu)).

`settled` must find the stress and then stay; `k0` starts with it; `gravity_on` must reach stress
and settlement with damping. Errors of stress are shares of rho g H, of settlement of u(H).

With splines that reach through the ground, the stress of the two lowest cells would be off by some
12 % of rho g H at any cell size, and likewise next to a smooth wall; ours end there
(`mpm_taichi.solver.splines`). Limit: F-bar and the relaxation of pressure make the mean stress
constant in a cell, which is first order at a point.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row

TITLE = "Elastic column under gravity"
TOLERANCE = 0.01

HEIGHT, DENSITY, GRAVITY = 10.0, 1800.0, 9.81  # m, kg/m3, m/s2
YOUNGS_MODULUS, POISSON_RATIO = 30e6, 0.3
MODULUS = YOUNGS_MODULUS * (1 - POISSON_RATIO) / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
CELLS_WIDE = 24
BASE_CELLS = 3
"""Cells above the ground whose stress is reported apart."""

SPACINGS = (1.0, 0.5, 0.25, 0.125)
LEFT_ALONE_S = 1.0
"""Time a start in balance is watched [s]; the slowest period is 4 H / c_p = 0.27 s."""
DAMPED_S = 3.0
SMALL = 0.002
"""An error below which the rate of convergence is not checked: rest is not known better."""


@dataclass
class Layer:
    """One run; N points in the middle half of the layer."""

    spacing: float  # m
    height: np.ndarray  # (N,) y at t = 0 [m]
    stress: np.ndarray  # (N,) sigma_yy [Pa]
    settlement: np.ndarray  # (N,) u_y [m]
    wall_error: float  # largest stress error outside the middle half, share of rho g H
    shift: float  # largest shift of any point [m]

    @property
    def error(self) -> np.ndarray:
        """Error of sigma_yy, (N,), share of rho g H."""
        return self.stress / (DENSITY * GRAVITY * HEIGHT) + 1.0 - self.height / HEIGHT

    @property
    def at_base(self) -> np.ndarray:
        """Points in the lowest cells, (N,) bool."""
        return self.height < BASE_CELLS * 2.0 * self.spacing

    @property
    def settlement_error(self) -> np.ndarray:
        """Error of the settlement, (N,), share of u(H)."""
        return (self.settlement - settlement(self.height)) / abs(settlement(HEIGHT))


def settlement(height: np.ndarray | float) -> np.ndarray | float:
    """Exact u_y [m] at height y [m]."""
    return -(DENSITY * GRAVITY / MODULUS) * (HEIGHT * height - 0.5 * height**2)


def layer_scene(spacing: float) -> dict:
    """The layer between smooth walls, as a scene."""
    width = 2.0 * CELLS_WIDE * spacing
    return {
        "name": f"layer at {spacing:g} m",
        "domain": {"x_min": 0, "x_max": width, "y_max": HEIGHT + 4 * spacing},
        "ground": {"points": [[0, 0], [width, 0]]},
        "zones": [
            {
                "name": "layer",
                "polygon": [[0, 0], [width, 0], [width, HEIGHT], [0, HEIGHT]],
                "material": "elastic",
            }
        ],
        "materials": {
            "elastic": {
                "friction_deg": 0,
                "cohesion_kpa": 1e5,
                "density": DENSITY,
                "youngs_modulus_mpa": YOUNGS_MODULUS / 1e6,
                "poisson_ratio": POISSON_RATIO,
            }
        },
        "spacing": spacing,
    }


def run_layer(spacing: float, start: str, seconds: float, damping: float = 0.0) -> Layer:
    """Run the layer from one kind of initial stress for some time."""
    lab = Lab(
        layer_scene(spacing), initial_stress=start, local_damping=damping, gravity_m_per_s2=GRAVITY
    )
    lab.run(0)
    lab.run(round(seconds / lab.frame_time))
    x, y = lab.start.T
    middle = np.abs(x / x.max() - 0.5) < 0.25
    error = lab.stress[:, 1] / (DENSITY * GRAVITY * HEIGHT) + 1.0 - y / HEIGHT
    return Layer(
        spacing=spacing,
        height=y[middle],
        stress=lab.stress[middle, 1],
        settlement=lab.displacement[middle, 1],
        wall_error=float(np.abs(error[~middle]).max()),
        shift=float(np.hypot(*lab.displacement.T).max()),
    )


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Run all starts at all spacings; rows are of the finest, and of the way there."""
    spacings = SPACINGS[:3] if quick else SPACINGS
    settled = [run_layer(d, "settled", 0.0) for d in spacings]
    loaded = [run_layer(d, "gravity_on", DAMPED_S, damping=0.3) for d in spacings]
    left = {name: run_layer(spacings[-1], name, LEFT_ALONE_S) for name in ("settled", "k0")}
    rows = stress_rows("settled", settled[-1]) + stress_rows("gravity_on", loaded[-1])
    fine = loaded[-1]
    rows.append(bound("gravity_on: settlement", np.abs(fine.settlement_error).max(), TOLERANCE))
    for name, layer in left.items():
        what = f"{name}: largest shift in {LEFT_ALONE_S:g} s"
        rows.append(bound(what, layer.shift / layer.spacing, 0.1, "spacings"))
    errors = {
        "settled: stress": [rms(layer.error) for layer in settled],
        "gravity_on: stress": [rms(layer.error) for layer in loaded],
        "gravity_on: settlement": [rms(layer.settlement_error) for layer in loaded],
    }
    for name, values in errors.items():
        rows.append(bound(f"{name}, rms error per halving of the cell", mean_ratio(values), 0.6))
    if folder is not None:
        draw(folder / "elastic_column.png", settled, loaded, errors)
    return rows


def stress_rows(name: str, layer: Layer) -> list[Row]:
    """Largest stress error of the points above the base, at the base, and next to the walls."""
    error, base = np.abs(layer.error), layer.at_base
    return [
        bound(
            f"{name}: stress, above the lowest {BASE_CELLS} cells", error[~base].max(), TOLERANCE
        ),
        bound(f"{name}: stress, lowest {BASE_CELLS} cells", error[base].max(), TOLERANCE),
        bound(f"{name}: stress, next to smooth walls", layer.wall_error, TOLERANCE),
    ]


def bound(quantity: str, measured: float, limit: float, unit: str = "") -> Row:
    """A row that must not exceed `limit`."""
    return Row("elastic_column", quantity, float(measured), limit, 0.0, unit, bound=True)


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def mean_ratio(errors: list[float]) -> float:
    """Mean factor by which an error shrinks from one spacing to the next, down to `SMALL`."""
    last = next((i for i, error in enumerate(errors) if error < SMALL), len(errors) - 1)
    last = max(last, 1)
    return float((errors[last] / errors[0]) ** (1.0 / last))


def draw(
    path: Path, settled: list[Layer], loaded: list[Layer], errors: dict[str, list[float]]
) -> None:
    """Stress and settlement over the height, and errors over the spacing."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 4.4))
    exact = np.linspace(0.0, HEIGHT, 50)
    weight = DENSITY * GRAVITY / 1e3
    left.plot(-weight * (HEIGHT - exact), exact, "k", linewidth=1, label="exact")
    middle.plot(1e3 * settlement(exact), exact, "k", linewidth=1, label="exact")
    for number, index in enumerate((1, len(settled) - 1)):
        for axes, layer, values in (
            (left, settled[index], settled[index].stress / 1e3),
            (middle, loaded[index], 1e3 * loaded[index].settlement),
        ):
            size = 14 if number == 0 else 4
            axes.scatter(values, layer.height, s=size, color=f"C{number}", edgecolors="none",
                         label=f"spacing {layer.spacing:g} m")  # fmt: skip
    left.set(xlabel="sigma_yy [kPa]", ylabel="height y [m]", title="settled")
    middle.set(xlabel="settlement u_y [mm]", ylabel="height y [m]", title="gravity turned on")
    left.legend(fontsize=8)
    middle.legend(fontsize=8)
    spacings = np.array([layer.spacing for layer in settled])
    for number, (name, values) in enumerate(errors.items()):
        right.loglog(spacings, values, "o-", color=f"C{number}", label=name)
    guide = errors["gravity_on: settlement"][0] * 0.5 * spacings / spacings[0]
    right.loglog(spacings, guide, color="0.6", linestyle="--", label="first order")
    right.set_xticks(spacings, [f"{d:g}" for d in spacings], minor=False)
    right.minorticks_off()
    right.set(xlabel="spacing [m]", ylabel="rms error / largest value", title="convergence")
    right.legend(fontsize=8)
    right.grid(color="0.9")
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
