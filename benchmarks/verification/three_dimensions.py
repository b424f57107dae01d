"""The three-dimensional solver: stress, rest, sliding, the plane, collapse of a round column.

- **Return to yield.** Random trial stresses in all regions of the yield surface, against
  `mohr_coulomb_reference`; a full turn without strain about a skew axis must keep the stress.
- **Rest.** A settled elastic layer: sigma_z = rho g depth, and nu / (1 - nu) of it sideways.
- **Block on a plane** that falls along x, along y and between them: a = g (sin b - mu cos b).
- **The plane.** A bank of clay between smooth flanks is the two-dimensional run.
- **Free motion.** FLIP keeps angular momentum to the size of a cell only: 7.3 % are lost with four
  cells to the longest edge of a turning block, 2.3 % with eight.
- **Round column.** Sand (phi as in `granular_column`) next to two smooth walls is a quarter of a
  round column. Runout and height against the laws of Lube, Huppert, Sparks and Hallworth (2004,
  J. Fluid Mech. 508, 175) and of Lajeunesse, Mangeney-Castelnau and Vilotte (2004, Phys. Fluids 16,
  2371); the factors are recalled, not read in the sources. The front is where the deposit is one
  spacing thick, so the runout of flat columns is short of the law; it grows as points get smaller.
- **dt/2 and dx/2** of the bank.

Not covered: a cut of finite length in clay against its shape factor.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import taichi as ti
from matplotlib.ticker import FixedLocator, NullFormatter, ScalarFormatter

from benchmarks.verification.material_paths import SOILS
from benchmarks.verification.mohr_coulomb_reference import (
    Soil,
    enumerate_return,
    region_names,
    stress_scale,
)
from benchmarks.verification.rows import Row
from geometry.scenes.scene import Material, Scene
from geometry.survey.surface_profile import surface_profile
from geometry.terrain.raster import Raster
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import material_constants
from mpm_taichi.simulate import simulate
from mpm_taichi.simulate3d import simulate_3d
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver3d.layout import REAL, VEC6, VEC8, VEC9, vec4
from mpm_taichi.solver3d.problem import Problem3d, extruded
from mpm_taichi.solver3d.stress import elastic_trial, mohr_coulomb, volume_rate
from mpm_taichi.trajectory3d import Run3d
from pipeline.config import SimulationSettings

TITLE = "Three dimensions"
CASE = "three_dimensions"

GRAVITY = 9.81
PARTS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
REPOSE = np.radians(31.0)
LUBE = {"change": 1.7, "low": 1.24, "high": 1.6, "height": 0.88}
"""Runout / r0 = 1.24 a, beyond a = 1.7 1.6 a^(1/2); height / r0 = 0.88 a^(1/6). Recalled."""
LAJEUNESSE_HEIGHT = 0.74
"""Height / r0 = min(a, 0.74). Recalled."""
RATIOS, QUICK_RATIOS = (0.5, 1.0, 2.0, 4.0), (1.0,)
COLUMN_TOLERANCE = 0.20


# -- one point ----------------------------------------------------------------------------------


@ti.kernel
def _returns(stress: VEC6, elastic: VEC8, strength: VEC8):
    for p in stress:
        row = elastic[0]
        moduli = vec4(row[0], row[1], row[2], row[3])
        stress[p], _, _, _ = mohr_coulomb(stress[p], moduli, strength[0])


@ti.kernel
def _turns(stress: VEC6, gradient: VEC9, elastic: VEC8, strain: REAL, steps: ti.i32):
    for p in stress:
        row = elastic[0]
        moduli = vec4(row[0], row[1], row[2], row[3])
        for _ in range(steps):
            increment = strain[0] * volume_rate(gradient[p], 1.0)
            stress[p] = elastic_trial(stress[p], gradient[p], increment, 1.0, moduli)


def _rows_of(soil: Soil) -> tuple[np.ndarray, np.ndarray]:
    elastic = np.zeros((1, 8), np.float32)
    elastic[0, :4] = elastic_constants(
        youngs_modulus=soil.youngs_modulus, poisson_ratio=soil.poisson_ratio
    )
    strength = material_constants(
        friction_angle=soil.friction, cohesion=soil.cohesion, tension_cap=soil.tension_cap
    )
    return elastic, strength[None]


def tensors(stress: np.ndarray) -> np.ndarray:
    """(N, 6) xx, yy, zz, xy, yz, xz as tensors (N, 3, 3)."""
    full = np.zeros((len(stress), 3, 3))
    for column, (i, j) in enumerate(PARTS):
        full[:, i, j] = full[:, j, i] = stress[:, column]
    return full


def vectors(full: np.ndarray) -> np.ndarray:
    """Tensors (N, 3, 3) as (N, 6)."""
    return np.stack([full[:, i, j] for i, j in PARTS], axis=1)


def errors_of_returns(count: int) -> dict[str, np.ndarray]:
    """Errors of the returned stress, as shares of the stress, by region; `count` trials a soil."""
    start("cpu", None)
    random = np.random.default_rng(3)
    errors: dict[str, list[np.ndarray]] = {}
    for soil in SOILS.values():
        size = max(soil.cohesion, 20e3) * 10.0 ** random.uniform(-0.7, 0.7, (count, 1))
        values = size * (random.normal(size=(count, 1)) + random.normal(size=(count, 3)))
        pair = random.random(count) < 0.1  # two equal principal stresses, and nearly equal ones
        values[pair, 1] = values[pair, 0] * (1.0 + 10.0 ** random.uniform(-9, -2, pair.sum()))
        axes = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
        trial = vectors(np.einsum("nij,nj,nkj->nik", axes, values, axes)).astype(np.float32)
        values, axes = np.linalg.eigh(tensors(trial))
        found = enumerate_return(values, soil)
        exact = vectors(np.einsum("nij,nj,nkj->nik", axes, found.stress, axes))
        stress = trial.copy()
        _returns(stress, *_rows_of(soil))
        error = np.abs(stress - exact).max(axis=1) / stress_scale(values, soil)
        regions = region_names(found, soil)
        for region in np.unique(regions):
            errors.setdefault(str(region), []).append(error[regions == region])
    return {name: np.concatenate(parts) for name, parts in sorted(errors.items())}


def turned_about(axis: np.ndarray, steps: int) -> float:
    """Error of the stress after a full turn without strain, as a share of the stress."""
    start("cpu", None)
    n = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    angle = 2.0 * np.pi / steps
    turn = np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    begin = np.array([[-80e3, -30e3, -50e3, 15e3, -10e3, 5e3]], np.float32)
    stress = begin.copy()
    elastic, _ = _rows_of(Soil(0.0, 1e9, 30e6, 0.3))
    gradient = turn.reshape(1, 9).astype(np.float32)
    _turns(stress, gradient, elastic, np.ones(1, np.float32), steps)
    return float(np.abs(stress - begin).max() / 80e3)


# -- bodies -------------------------------------------------------------------------------------


def body(
    position: np.ndarray, spacing: float, material: Material, domain: tuple[float, ...], **more: Any
) -> Problem3d:
    """A problem of one soil whose points (N, 3) [m] lie `spacing` apart."""
    count = len(position)
    fields = {"base": Raster.level(0.0), **more}
    return Problem3d(
        name="body", spacing=spacing, position=position, volume=np.full(count, spacing**3),
        material=np.zeros(count, int), zone=np.zeros(count, int), materials=(material,),
        domain=domain, **fields,
    )  # fmt: skip


def lattice(lengths: tuple[float, float, float], spacing: float) -> np.ndarray:
    """Points of a box from the origin on (N, 3) [m]."""
    axes = [spacing * (np.arange(round(length / spacing)) + 0.5) for length in lengths]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def layer_at_rest(spacing: float) -> tuple[float, float, float]:
    """Errors of vertical and lateral stress of a settled layer, shares of the largest; its speed.

    Means over the points of a cell and its layer, since pressure is one number in a cell.
    """
    soil = Material(friction_deg=0, cohesion_kpa=1e4)
    points = lattice((8.0, 6.0, 10.0), spacing)
    problem = body(points, spacing, soil, (0.0, 8.0, 0.0, 6.0, 12.0))
    run = simulate_3d(problem, SimulationSettings(duration_s=0.5, early_stop=False))
    expected = -soil.density * GRAVITY * (10.0 - points[:, 2])
    ratio = soil.poisson_ratio / (1.0 - soil.poisson_ratio)
    layer = np.floor(points[:, 2] / (2.0 * spacing) + 0.5).astype(int)
    count = np.bincount(layer)

    def off(column: int, exact: np.ndarray) -> float:
        error = np.bincount(layer, weights=run.stress[:, column] - exact) / count
        return float(np.abs(error).max() / np.abs(exact).max())

    sideways = max(off(0, ratio * expected), off(1, ratio * expected))
    return off(2, expected), sideways, float(run.top_speed.max())


def block_slide(direction: float, spacing: float, *, friction: float) -> tuple[float, float]:
    """Acceleration along the fall line and share of the travel across it of a block on a plane.

    Args:
        direction: of the fall line in plan [degrees from x].
        spacing: between points [m].
        friction: coefficient of the plane, which falls by 25 degrees.
    """
    b, turn = np.radians(25.0), np.radians(direction)
    fall = np.array([np.cos(turn), np.sin(turn)])
    x, y = np.meshgrid(np.arange(-10.0, 41.0), np.arange(-10.0, 41.0), indexing="ij")
    base = Raster((-10.0, -10.0), 1.0, -np.tan(b) * (x * fall[0] + y * fall[1]))
    along = np.array([np.cos(b) * fall[0], np.cos(b) * fall[1], -np.sin(b)])
    across = np.array([-fall[1], fall[0], 0.0])
    points = lattice((8.0, 6.0, 2.0), spacing) - (4.0, 3.0, 0.0)
    axes = np.stack([along, across, np.cross(along, across)])
    points = points @ axes + (8.0, 8.0, -np.tan(b) * 8.0 * fall.sum())
    rock = Material(friction_deg=0, cohesion_kpa=1e4, youngs_modulus_mpa=100)
    problem = body(
        points, spacing, rock, (-6.0, 36.0, -6.0, 36.0, 6.0), base=base, contact="coulomb",
        friction_coefficient=friction,
    )  # fmt: skip
    run = simulate_3d(problem, SimulationSettings(duration_s=1.5, early_stop=False))
    centre = run.positions.astype(float).mean(axis=1)
    travel = (centre - centre[0]) @ along
    sideways = abs((centre[-1] - centre[0]) @ across) / travel[-1]
    return 2.0 * float(np.polyfit(run.time, travel, 2)[0]), float(sideways)


def slab_scene(spacing: float) -> dict[str, Any]:
    """A bank of clay on rough level ground next to a wall, as a two-dimensional scene."""
    return {
        "name": "bank",
        "spacing": spacing,
        "domain": {"x_min": 0, "x_max": 60, "y_max": 14},
        "ground": {"points": [[0, 0], [60, 0]], "contact": "rough"},
        "zones": [
            {"name": "bank", "material": "soil", "polygon": [[0, 0], [22, 0], [18, 10], [0, 10]]}
        ],
        "materials": {"soil": {"friction_deg": 0, "cohesion_kpa": 15}},
    }


def bank(spacing: float, **changes: Any) -> tuple[Scene, Run3d, SimulationSettings]:
    """The bank between smooth flanks six metres apart."""
    settings = SimulationSettings(duration_s=6.0, **changes)
    scene = Scene.model_validate(slab_scene(spacing))
    return scene, simulate_3d(extruded(scene, 6.0), settings), settings


def toe_of(places: np.ndarray) -> float:
    """Mean x [m] of the one per cent of the points (N, ...) that have come farthest."""
    ordered = np.sort(places[:, 0])
    count = max(len(ordered) // 100, 1)
    return float(ordered[-count:].mean())


def against_the_plane(spacing: float) -> tuple[float, float, np.ndarray, np.ndarray, np.ndarray]:
    """Runout of the bank in three dimensions over that in two, and profile error over its height.

    Also x, both profiles [m].
    """
    scene, solid, settings = bank(spacing)
    flat = simulate([scene], settings)[0]
    start_x = toe_of(flat.positions[0])
    section = solid.positions[-1][:, (0, 2)]
    runouts = [toe_of(places) - start_x for places in (section, flat.positions[-1])]
    x = np.arange(1.0, 50.0, 0.5)
    rows = round(6.0 / spacing)
    slices, volume = section.reshape(-1, rows, 2), flat.initial_volume
    profiles = np.mean(
        [surface_profile(slices[:, row], volume, x, spacing=spacing) for row in range(rows)],
        axis=0,
    )
    plane = surface_profile(flat.positions[-1], volume, x, spacing=spacing)
    soil = (plane > spacing) & (profiles > spacing)
    off = np.sqrt(np.mean((profiles - plane)[soil] ** 2)) / 10.0
    return runouts[0] / runouts[1], float(off), x, profiles, plane


def flight(spacing: float) -> dict[str, float]:
    """An elastic block thrown and turning for a second: what it loses, as shares."""
    points = lattice((4.0, 3.0, 2.0), spacing) - (2.0, 1.5, 1.0)
    spin = np.array([0.6, -0.9, 1.2])
    velocity = np.cross(spin, points) + (3.0, 2.0, 6.0)
    rubber = Material(friction_deg=0, cohesion_kpa=1e4, youngs_modulus_mpa=5)
    problem = body(
        points + (10.0, 10.0, 8.0), spacing, rubber, (0.0, 20.0, 0.0, 20.0, 16.0), velocity=velocity
    )
    settings = SimulationSettings(duration_s=1.0, early_stop=False, pic_rate_per_s=0.0)
    run = simulate_3d(problem, settings)
    time = run.time[-1]
    fall = np.array([0.0, 0.0, -GRAVITY * time])
    mean = run.velocity.mean(axis=0)
    place = run.positions[-1] - run.positions[-1].mean(axis=0)
    turning = [
        np.cross(arm, speed - speed.mean(axis=0)).sum(axis=0)
        for arm, speed in ((points, velocity), (place, run.velocity))
    ]
    total = [run.energy[n] for n in ("kinetic", "elastic", "potential")]
    energy = np.sum(total, axis=0)
    return {
        "momentum": float(np.abs(mean - (np.array([3.0, 2.0, 6.0]) + fall)).max() / 7.0),
        "angular momentum": float(
            np.linalg.norm(turning[1] - turning[0]) / np.linalg.norm(turning[0])
        ),
        "energy": float(abs(energy[-1] - energy[0]) / run.energy["kinetic"][0]),
    }


@cache
def round_column(ratio: float, cells: int) -> Run3d:
    """A quarter of a round column of radius 1 m, height `ratio`, `cells` points to the radius."""
    spacing = 1.0 / cells
    points = lattice((1.0, 1.0, ratio), spacing)
    points = points[np.hypot(points[:, 0], points[:, 1]) < 1.0]
    reach = 1.0 + 1.6 * runout_law(ratio)
    sand = Material(
        friction_deg=float(np.degrees(np.arcsin(np.tan(REPOSE)))), cohesion_kpa=0.0,
        density=1800, youngs_modulus_mpa=100 * 1800 * GRAVITY * ratio / 1e6,
    )  # fmt: skip
    problem = body(points, spacing, sand, (0.0, reach, 0.0, reach, 1.2 * ratio))
    duration = 6.0 * float(np.sqrt(ratio / GRAVITY)) + 0.5
    return simulate_3d(problem, SimulationSettings(duration_s=duration, early_stop=False))


def runout_law(ratio: float) -> float:
    """Runout over radius by Lube and others (2004)."""
    low = ratio < LUBE["change"]
    return LUBE["low"] * ratio if low else LUBE["high"] * float(np.sqrt(ratio))


def height_laws(ratio: float) -> tuple[float, float]:
    """Height over radius by Lube and others (2004) and by Lajeunesse and others (2004)."""
    return min(ratio, LUBE["height"] * ratio ** (1.0 / 6.0)), min(ratio, LAJEUNESSE_HEIGHT)


def ring_profile(run: Run3d, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Radii [m] and thickness [m] of the deposit in rings of a quarter circle."""
    radius = np.hypot(run.positions[-1][:, 0], run.positions[-1][:, 1])
    edges = np.arange(0.0, radius.max() + 2 * spacing, 1.5 * spacing)
    volume, _ = np.histogram(radius, edges, weights=np.full(len(radius), spacing**3))
    return 0.5 * (edges[1:] + edges[:-1]), volume / (0.25 * np.pi * np.diff(edges**2))


def figures_of_column(run: Run3d, spacing: float) -> tuple[float, float]:
    """Runout and height of the deposit over the radius; the front is one spacing thick."""
    radius, thickness = ring_profile(run, spacing)
    last = np.flatnonzero(thickness > spacing)[-1]
    after = thickness[last + 1] if last + 1 < len(thickness) else 0.0
    share = (thickness[last] - spacing) / max(thickness[last] - after, 1e-12)
    front = radius[last] + share * 1.5 * spacing
    centre = np.hypot(run.positions[-1][:, 0], run.positions[-1][:, 1]) < 0.25
    height = float(np.quantile(run.positions[-1][centre, 2], 0.995)) + 0.5 * spacing
    return float(front) - 1.0, height


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """All figures of the three-dimensional solver."""
    errors = errors_of_returns(400 if quick else 6000)
    rows = [
        Row(CASE, f"stress error, {name}", float(values.max()), 1e-5, 0.0, bound=True,
            note=f"{len(values)} trials")
        for name, values in errors.items()
    ]  # fmt: skip
    back = turned_about(np.array([1.0, 2.0, -0.5]), 1000)
    rows.append(Row(CASE, "full turn about a skew axis: stress", back, 1e-4, 0.0, bound=True))
    vertical, lateral, speed = layer_at_rest(1.0 if quick else 0.5)
    rows += [
        Row(CASE, "settled layer: vertical stress", vertical, 0.02, 0.0, bound=True),
        Row(CASE, "settled layer: lateral stress", lateral, 0.02, 0.0, bound=True),
        Row(CASE, "settled layer: speed in 0.5 s", speed, 0.01, 0.0, "m/s", bound=True),
    ]
    b = np.radians(25.0)
    for direction in (30.0,) if quick else (0.0, 30.0, 45.0, 90.0):
        found, sideways = block_slide(direction, 1.0 if quick else 0.5, friction=0.2)
        exact = GRAVITY * float(np.sin(b) - 0.2 * np.cos(b))
        rows.append(Row(CASE, f"block, plane falls at {direction:g}°: acceleration", found, exact,
                        0.02, "m/s2"))  # fmt: skip
        rows.append(Row(CASE, f"block, plane falls at {direction:g}°: travel across", sideways,
                        0.01, 0.0, bound=True))  # fmt: skip
    spacing = 1.0 if quick else 0.5
    runout, profile, x, solid, plane = against_the_plane(spacing)
    rows += [
        Row(CASE, "bank between smooth flanks: runout over the plane's", runout, 1.0,
            0.01 if quick else 0.005),
        Row(CASE, "bank between smooth flanks: profile off the plane's, of height", profile, 0.005,
            0.0, bound=True),
    ]  # fmt: skip
    for name, loss in flight(0.5 if quick else 0.25).items():
        rows.append(Row(CASE, f"turning block in flight: {name} lost in 1 s", loss,
                        {"momentum": 1e-4}.get(name, 0.02), 0.0, bound=True))  # fmt: skip
    ratios = QUICK_RATIOS if quick else RATIOS
    cells = 8 if quick else 20
    columns = {a: round_column(a, cells) for a in ratios}
    for ratio, one in columns.items():
        travel, height = figures_of_column(one, 1.0 / cells)
        lube, lajeunesse = height_laws(ratio)
        tolerance = 0.6 if quick else COLUMN_TOLERANCE
        rows += [
            Row(CASE, f"round column, a = {ratio:g}: runout / r0", travel, runout_law(ratio),
                tolerance, note="Lube (2004), recalled"),
            Row(CASE, f"round column, a = {ratio:g}: height / r0", height, lube, tolerance,
                note=f"Lube (2004), recalled; Lajeunesse (2004) {lajeunesse:.2f}"),
        ]  # fmt: skip
    if not quick:
        rows += halved()
    if folder is not None:
        draw(folder / f"{CASE}.png", x, solid, plane, columns, cells)
    return rows


def halved() -> list[Row]:
    """Change of the runout of the bank with half of the time step, and of the cell."""
    toes = []
    for spacing, courant in ((1.0, 0.3), (1.0, 0.15), (0.5, 0.3)):
        _, one, _ = bank(spacing, courant=courant)
        ends = [toe_of(one.positions[frame]) for frame in (0, -1)]
        toes.append(ends[1] - ends[0])
    return [
        Row(CASE, "bank: runout with dt/2", toes[1] / toes[0], 1.0, 0.01),
        Row(CASE, "bank: runout with dx/2", toes[2] / toes[0], 1.0, 0.05),
    ]


def draw(
    path: Path, x: np.ndarray, solid: np.ndarray, plane: np.ndarray, columns: dict[float, Run3d],
    cells: int,
) -> None:  # fmt: skip
    """Profiles of the bank; deposits of the columns; their runout and height against the laws."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 4.0))
    left.plot(x, plane, color="0.6", lw=4, label="two dimensions")
    left.plot(x, solid, "C0", lw=1, label="three, smooth flanks")
    left.set(xlabel="x [m]", ylabel="surface [m]", title="Bank of clay after 6 s")
    left.legend(fontsize=8)
    figures = []
    for number, (ratio, one) in enumerate(columns.items()):
        radius, thickness = ring_profile(one, 1.0 / cells)
        middle.plot(radius, thickness, f"C{number}", label=f"a = {ratio:g}")
        figures.append(figures_of_column(one, 1.0 / cells))
    middle.set(xlabel="radius / r0", ylabel="thickness / r0", title="Deposits of round columns")
    middle.legend(fontsize=8)
    a = np.geomspace(0.3, 6.0, 200)
    right.loglog(a, [runout_law(one) for one in a], "k-", lw=1, label="runout, Lube (2004)")
    right.loglog(a, [height_laws(one)[0] for one in a], "k--", lw=1, label="height, Lube (2004)")
    right.loglog(a, [height_laws(one)[1] for one in a], "k:", lw=1, label="height, Lajeunesse")
    right.loglog(list(columns), [one[0] for one in figures], "C0o", label="runout")
    right.loglog(list(columns), [one[1] for one in figures], "C1s", label="height")
    for axis in (right.xaxis, right.yaxis):
        axis.set_major_locator(FixedLocator([0.3, 0.5, 1.0, 2.0, 4.0]))
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    right.set(xlabel="a = h0 / r0", ylabel="of the deposit / r0", title="Against the laws")
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
