"""One material point under given strains: the return to yield against an independent solution.

Random trial stresses of soils of every kind (phi = 0 with and without a tension cap, c = 0, both,
a cap at or below the apex) are returned by the solver in float32 and by the enumeration of
`mohr_coulomb_reference` in float64; random strain paths with rotation are followed by both.
Three paths have a closed form; a full turn without strain must keep the stress.

The regions: elastic, shear on the main plane and on both edges, tension with one, two and three
stresses at the cap, the corners of both, and the apex. Each answer of the reference meets all
conditions of Koiter to rounding, and no second answer does. What limits it: float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.mohr_coulomb_reference import (
    Soil,
    enumerate_return,
    region_names,
    stress_scale,
)
from benchmarks.verification.one_element import solver_path, solver_return
from benchmarks.verification.rows import Row

TITLE = "One-element stress paths and the return to yield"
TOLERANCE = 1e-4

SOILS = {
    "phi = 0": Soil(0.0, 20e3, 30e6, 0.3),
    "phi = 0, soft": Soil(0.0, 2e3, 3e6, 0.45),
    "phi = 0, cap": Soil(0.0, 20e3, 30e6, 0.3, 10e3),
    "phi = 0, cap 0": Soil(0.0, 20e3, 30e6, 0.3, 0.0),
    "c = 0": Soil(np.radians(30.0), 0.0, 30e6, 0.3),
    "c, phi": Soil(np.radians(30.0), 20e3, 30e6, 0.3),
    "c, phi, nu = 0": Soil(np.radians(20.0), 10e3, 10e6, 0.0),
    "c, phi, cap": Soil(np.radians(30.0), 20e3, 30e6, 0.2, 5e3),
    "c, phi, cap 0": Soil(np.radians(38.0), 20e3, 30e6, 0.3, 0.0),
    "steep": Soil(np.radians(55.0), 5e3, 80e6, 0.25),
}
PATH_SOIL = Soil(np.radians(20.0), 10e3, 30e6, 0.2, 6e3)


def tensor(stress: np.ndarray) -> np.ndarray:
    """(N, 4) xx, yy, zz, xy as tensors (N, 3, 3)."""
    full = np.zeros((len(stress), 3, 3))
    full[:, 0, 0], full[:, 1, 1], full[:, 2, 2] = stress[:, 0], stress[:, 1], stress[:, 2]
    full[:, 0, 1] = full[:, 1, 0] = stress[:, 3]
    return full


def vector(full: np.ndarray) -> np.ndarray:
    """Tensors (N, 3, 3) as (N, 4) xx, yy, zz, xy."""
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 2, 2], full[:, 0, 1]], axis=1)


@dataclass
class Exact:
    """Independent return of N trials."""

    stress: np.ndarray  # (N, 4) [Pa]
    plastic: np.ndarray  # (N, 3): shear [-], opening [-], work [J/m3]
    region: np.ndarray  # (N,) names
    unmet: float  # largest condition not met, or difference of two answers, share of the scale


def exact_return(trial: np.ndarray, soil: Soil) -> Exact:
    """The independent return of trial stresses (N, 4) [Pa], by eigenvectors and enumeration."""
    values, axes = np.linalg.eigh(tensor(np.asarray(trial, float)))
    found = enumerate_return(values, soil)
    stress = vector(np.einsum("nij,nj,nkj->nik", axes, found.stress, axes))
    lost = values - found.stress
    strain = lost @ np.linalg.inv(soil.elasticity)
    ordered = np.sort(values, axis=1) - np.sort(found.stress, axis=1)
    shear = (ordered[:, 2] - ordered[:, 0]) / (2.0 * soil.shear_modulus)
    plastic = np.stack([shear, strain.sum(axis=1), np.sum(found.stress * strain, axis=1)], axis=1)
    unmet = np.maximum(found.violation, found.spread) / stress_scale(values, soil)
    return Exact(stress, plastic, region_names(found, soil), float(unmet.max()))


def exact_path(begin: np.ndarray, gradients: np.ndarray, soil: Soil) -> np.ndarray:
    """As `solver_path`, independently in float64."""
    stress = np.asarray(begin, float)
    history = [stress]
    for gradient in gradients:
        angle = np.arctan2(
            gradient[:, 1, 0] - gradient[:, 0, 1], 2.0 + np.trace(gradient, axis1=1, axis2=2)
        )
        turn = np.zeros((len(angle), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
        turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
        strain = np.zeros((len(angle), 3, 3))
        strain[:, :2, :2] = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        strain[:, :2, :2] += 0.5 * np.linalg.det(gradient)[:, None, None] * np.eye(2)
        lame = soil.bulk_modulus - 2.0 / 3.0 * soil.shear_modulus
        volumetric = np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        turned = turn @ tensor(stress) @ turn.transpose(0, 2, 1)
        trial = vector(turned + lame * volumetric + 2.0 * soil.shear_modulus * strain)
        stress = exact_return(trial, soil).stress
        history.append(stress)
    return np.stack(history)


def random_trials(soil: Soil, count: int, random: np.random.Generator) -> np.ndarray:
    """Trial stresses (count, 4) float32 [Pa] around the yield surface, axes turned at random."""
    size = max(soil.cohesion, 20e3) * 10.0 ** random.uniform(-0.7, 0.7, (count, 1))
    principal = size * (random.normal(0.0, 1.0, (count, 1)) + random.normal(0.0, 1.0, (count, 3)))
    pair = random.random(count) < 0.1  # two equal principal stresses, as in a K0 state
    principal[pair, 1] = principal[pair, 0]
    angle = random.uniform(0.0, np.pi, count)
    centre = 0.5 * (principal[:, 0] + principal[:, 1])
    half = 0.5 * (principal[:, 0] - principal[:, 1])
    turned = [centre + half * np.cos(2 * angle), centre - half * np.cos(2 * angle)]
    out = principal[:, 2]
    return np.stack([*turned, out, half * np.sin(2 * angle)], axis=1).astype(np.float32)


def errors_by_region(count: int) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Errors of the returned stress, share of the scale, by region; and other largest errors."""
    random = np.random.default_rng(1)
    errors: dict[str, list[np.ndarray]] = {}
    worst = {"unmet": 0.0, "shear": 0.0, "opening": 0.0, "work": 0.0}
    for soil in SOILS.values():
        trial = random_trials(soil, count, random)
        exact = exact_return(trial, soil)
        stress, plastic = solver_return(trial, soil)
        scale = stress_scale(trial.astype(float), soil)
        off = np.abs(stress - exact.stress).max(axis=1) / scale
        strain = scale / (2.0 * soil.shear_modulus)
        gaps = np.abs(plastic - exact.plastic) / np.stack([strain, strain, scale * strain], axis=1)
        for name, gap in zip(("shear", "opening", "work"), gaps.max(axis=0), strict=True):
            worst[name] = max(worst[name], float(gap))
        worst["unmet"] = max(worst["unmet"], exact.unmet)
        for region in np.unique(exact.region.astype(str)):
            errors.setdefault(region, []).append(off[exact.region == region])
    return {name: np.concatenate(parts) for name, parts in sorted(errors.items())}, worst


def error_of_random_paths(elements: int, steps: int) -> float:
    """Largest error along random strain paths that turn, share of the stress scale."""
    random, largest = np.random.default_rng(2), 0.0
    for soil in SOILS.values():
        drift = random.normal(0.0, 4e-5, (1, elements, 2, 2))
        gradients = (drift + random.normal(0.0, 4e-4, (steps, elements, 2, 2))).astype(np.float32)
        gradients[:, :, 1, 0] += (
            0.01  # each element also turns, by about a sixth of a degree a step
        )
        gradients[:, :, 0, 1] -= 0.01
        begin = np.tile(np.float32([-2e4, -5e4, -3e4, 0.0]), (elements, 1))
        begin = exact_return(begin, soil).stress
        exact = exact_path(begin, gradients.astype(float), soil)
        found = solver_path(begin, gradients, soil)
        scale = max(np.abs(exact).max(), soil.cohesion)
        largest = max(largest, float(np.abs(found - exact).max() / scale))
    return largest


def closed_forms() -> tuple[list[Row], dict[str, np.ndarray]]:
    """Strain paths from an isotropic pressure whose end is known in closed form."""
    soil, steps, pressure = PATH_SOIL, 400, -50e3
    sine, k = np.sin(soil.friction), 2.0 * soil.cohesion * np.cos(soil.friction)
    ends = {
        "no change of volume": (0.003, -0.003),
        "oedometer": (0.0, -0.008),
        "pull": (0.0, 0.004),
    }
    paths = {}
    for name, (across, upward) in ends.items():
        gradients = np.zeros((steps, 1, 2, 2))
        gradients[:, 0, 0, 0], gradients[:, 0, 1, 1] = across / steps, upward / steps
        paths[name] = solver_path(np.array([[pressure] * 3 + [0.0]]), gradients, soil)[:, 0]
    radius = soil.cohesion * np.cos(soil.friction) - pressure * sine
    mean = pressure + soil.bulk_modulus * ends["oedometer"][1]
    high = (k + 3.0 * mean * (1.0 - sine)) / (3.0 - sine)
    corner = (soil.cap * (1.0 + sine) - k) / (1.0 - sine)
    expected = {
        "no change of volume": ("sigma_xx - sigma_yy", [1, -1, 0, 0], 2.0 * radius),
        "oedometer": ("sigma_xx on the edge hi = mid", [1, 0, 0, 0], high),
        "pull": ("sigma_xx at the corner of shear and cap", [1, 0, 0, 0], corner),
    }
    rows = [
        Row("material_paths", f"{name}: {what}", float(paths[name][-1] @ np.array(part)) / 1e3,
            value / 1e3, TOLERANCE, "kPa")
        for name, (what, part, value) in expected.items()
    ]  # fmt: skip
    return rows, paths


def turn_gradient(angle: float) -> np.ndarray:
    """Displacement gradient (2, 2) of a rigid turn by `angle` [rad]: R - I."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine - 1.0, -sine], [sine, cosine - 1.0]])


def turn_once(steps: int) -> tuple[float, float]:
    """A full turn without strain: error of the stress at the end and of its invariants on the way.

    Both as shares of the stress.
    """
    begin = np.array([[-80e3, -30e3, -50e3, 15e3]])
    angle = 2.0 * np.pi / steps
    gradients = np.tile(turn_gradient(angle), (steps, 1, 1, 1))
    path = solver_path(begin, gradients, Soil(0.0, 1e9, 30e6, 0.3))[:, 0]
    centre = 0.5 * (path[:, 0] + path[:, 1])
    radius = np.hypot(0.5 * (path[:, 0] - path[:, 1]), path[:, 3])
    kept = [np.abs(values / values[0] - 1.0).max() for values in (centre, radius, path[:, 2])]
    return float(np.abs(path[-1] - begin[0]).max() / 80e3), float(max(kept))


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Compare, and draw the paths and the errors."""
    case = "material_paths"
    errors, worst = errors_by_region(400 if quick else 6000)
    rows = [
        Row(case, f"stress error, {name}", float(values.max()), TOLERANCE, 0.0, bound=True,
            note=f"{len(values)} trials")
        for name, values in errors.items()
    ]  # fmt: skip
    for name in ("shear", "opening", "work"):
        rows.append(Row(case, f"error of plastic {name}", worst[name], TOLERANCE, 0.0, bound=True))
    rows.append(
        Row(
            case,
            "reference: conditions unmet, or two answers",
            worst["unmet"],
            1e-9,
            0.0,
            bound=True,
        )
    )
    elements, steps = (20, 60) if quick else (100, 300)
    rows.append(
        Row(case, "random strain paths with rotation", error_of_random_paths(elements, steps),
            TOLERANCE, 0.0, bound=True, note=f"{len(SOILS)} soils x {elements} x {steps} steps")
    )  # fmt: skip
    known, paths = closed_forms()
    rows += known
    back, kept = turn_once(1000)
    rows.append(Row(case, "full turn without strain: stress", back, TOLERANCE, 0.0, bound=True))
    rows.append(Row(case, "full turn: invariants on the way", kept, TOLERANCE, 0.0, bound=True))
    if folder is not None:
        draw(folder / f"{case}.png", paths, errors)
    return rows


def draw(path: Path, paths: dict[str, np.ndarray], errors: dict[str, np.ndarray]) -> None:
    """Paths in the plane of the largest and smallest stress, and the errors by region."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), width_ratios=(1, 0.8))
    draw_paths(left, paths)
    draw_errors(right, errors)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_errors(axes: plt.Axes, errors: dict[str, np.ndarray]) -> None:
    """Median and largest error of each region."""
    floor = 1e-9
    for height, (name, values) in enumerate(errors.items()):
        label = f"{name} ({len(values)})"
        axes.text(0.6 * floor, height, label, ha="right", va="center", fontsize=8)
        middle, top = max(np.median(values), floor), values.max()
        if top <= floor:
            axes.text(1.3 * floor, height, "exact", va="center", fontsize=8, color="0.4")
            continue
        axes.plot([middle, top], [height, height], color="C0", linewidth=1.5)
        axes.plot(top, height, "o", color="C0", markersize=5)
        axes.plot(middle, height, "o", color="C0", markerfacecolor="white", markersize=5)
    axes.axvline(TOLERANCE, color="C3", linestyle="--")
    axes.text(0.8 * TOLERANCE, 0, "tolerance", color="C3", ha="right", va="center", fontsize=8)
    axes.set(xscale="log", xlim=(floor, 3e-4), ylim=(len(errors) - 0.4, -0.6), yticks=[])
    axes.set_xlabel("stress error / stress scale: median, largest")
    axes.set_title("Solver against enumeration, by region (trials)", fontsize=11)
    axes.grid(axis="x", color="0.9")


def draw_paths(axes: plt.Axes, paths: dict[str, np.ndarray]) -> None:
    """Strain paths and the yield surface, largest against smallest stress [kPa]."""
    soil = PATH_SOIL
    sine, k = np.sin(soil.friction), 2.0 * soil.cohesion * np.cos(soil.friction)
    low = np.linspace(-250e3, 2.0 * soil.cap, 200)
    shear = (k + low * (1.0 - sine)) / (1.0 + sine)
    surface = np.minimum(shear, soil.cap)
    shown = surface >= low
    axes.plot(low[shown] / 1e3, surface[shown] / 1e3, "k", linewidth=2, label="yield surface")
    axes.plot(low / 1e3, low / 1e3, color="0.6", linewidth=1)
    axes.set_aspect("equal")
    axes.fill_between(low[shown] / 1e3, low[shown] / 1e3, surface[shown] / 1e3, color="0.94")
    axes.text(-74, -84, "largest = smallest", color="0.5", rotation=45, fontsize=8)
    for number, (name, values) in enumerate(paths.items()):
        three = values[:, :3] / 1e3
        axes.plot(three.min(axis=1), three.max(axis=1), color=f"C{number}", linewidth=2, label=name)
        axes.plot(three[-1].min(), three[-1].max(), "o", color=f"C{number}")
    axes.set(xlim=(-230, 25), ylim=(-115, 45))
    axes.set(xlabel="smallest principal stress [kPa]", ylabel="largest principal stress [kPa]")
    axes.set_title("Strain paths: phi = 20°, c = 10 kPa, tension cap 6 kPa", fontsize=11)
    axes.legend(loc="upper left", fontsize=8)
