"""Water as pressure in and on the soil: level table, thrust of a pool, seepage, rest under water.

Below the water line h(x) the pore pressure is u = rho_w g (h - y); soil feels - grad u.

- Level table: nothing acts along x, and pressure, with a fixed or a moving face, moves every point
  of a slump as buoyancy does, to the bit.
- Dry core with a pool of depth H on one side. Across a level y of the core, a bonded base having
  to hold it,

      T(y) = rho_w g (H - y)^2 / 2,   T(0) the shear force of the base;

  on a base without friction the core has the acceleration T(0) / m.
- The same core where the line begins to fall before it, as if it had lost its shell: the pool
  presses on the bare face and T is the same. With `water_face: fixed` it would be only that of the
  head at the face, T / 4 here.
- Steady seepage under a gradient i: a force rho_w g i per volume along x, and submerged weight
  rho' g. A block on a base of friction mu starts to slide at the critical gradient

      i_c = mu rho' / rho_w,   and beyond it a = (rho_w g / rho) (i - i_c),

  which is the critical gradient of a column, rho' / rho_w, on its side: the pressure below a water
  line is hydrostatic, and vertical seepage has no place in a scene.
- A slope that stands stays as it is under no, a partial and a deep pool, and its energy closes.

Limit: where the line falls right at the face of the soil, not inside, a part of the thrust would
fall on nodes that have little soil: 8 % of T at 8 cells to the width of the core.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.verification.lab import Lab
from benchmarks.verification.rows import Row
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.water import WATER_DENSITY
from pipeline.config import SimulationSettings

TITLE = "Water: thrust of a pool, seepage, rest"
TOLERANCE = 0.02
CASE = "water_pressure"

DENSITY, GRAVITY = 2000.0, 9.81
UNIT_WEIGHT = WATER_DENSITY * GRAVITY
STIFF = {"friction_deg": 0, "cohesion_kpa": 1e4, "density": DENSITY, "youngs_modulus_mpa": 100}

POOL, WIDTH, TOP = 10.0, 8.0, 12.0
"""Depth of the pool at the core, width and height of the core [m]."""
LEFT, COVER = 16.0, 2.0
"""Left face of the core, and how far inside it the line begins and ends to fall [m]."""
BARE = -6.0
"""Where it begins to fall before a bare face; halfway down at the face [m from the face]."""
PUSHED_S, BARE_S, SETTLING_S = 0.4, 0.8, 2.0

LENGTH, THICKNESS = 20.0, 2.0
"""Of the block in the seepage [m]."""
FRICTION = 0.3
CRITICAL = FRICTION * (DENSITY / WATER_DENSITY - 1.0)
SLIDING, RESTING = (1.1, 1.5, 2.0), (0.5, 0.9)
"""Gradients, as shares of the critical one."""
SEEPAGE_S = 2.0

FORMS = (
    {"water": "buoyant"},
    {"water": "pore_pressure", "water_face": "fixed"},
    {"water": "pore_pressure", "water_face": "moving"},
)
HEIGHT = 10.0
"""Of the slope at rest [m]."""
POOLS = (None, 5.0, 12.0)
"""Its pools: levels above the toe [m]."""
REST_S = 5.0


@dataclass
class Core:
    """A dry core between a pool and air."""

    spacing: float  # m
    level: np.ndarray  # (R,) elevations of the rows of points [m]
    shear: np.ndarray  # (R,) shear force across them [N/m]
    time: np.ndarray  # (T,) on the base without friction [s]
    travel: np.ndarray  # (T,) [m]

    @property
    def acceleration(self) -> float:
        """On the base without friction [m/s2]."""
        return 2.0 * float(np.polyfit(self.time, self.travel, 2)[0])


def thrust(level: np.ndarray | float) -> np.ndarray:
    """T of the water above a level [N/m]."""
    return 0.5 * UNIT_WEIGHT * np.maximum(POOL - np.asarray(level), 0.0) ** 2


def core_scene(spacing: float, ground: dict, falls_at: float = COVER) -> dict:
    """The core with the pool on its left.

    `ground`: contact of its base; `falls_at`: where the line begins to fall [m from the face].
    """
    right = LEFT + WIDTH
    return {
        "name": f"core at {spacing:g} m",
        "domain": {"x_min": 0, "x_max": 40, "y_max": TOP + 2},
        "ground": {"points": [[0, 0], [40, 0]], **ground},
        "zones": [
            {
                "name": "core",
                "polygon": [[LEFT, 0], [right, 0], [right, TOP], [LEFT, TOP]],
                "material": "rock",
            }
        ],
        "materials": {"rock": STIFF},
        "water_level": POOL,
        "phreatic_line": [[LEFT + falls_at, POOL], [right - COVER, 0.0]],
        "spacing": spacing,
    }


def push_core(spacing: float) -> Core:
    """Shear forces in the core on a rough base, and its way on one without friction."""
    lab = Lab(core_scene(spacing, {"contact": "rough"}), water="pore_pressure")
    lab.run(1)
    level, row = np.unique(np.round(lab.start[:, 1], 6), return_inverse=True)
    shear = np.bincount(row, weights=lab.stress[:, 3]) * spacing
    smooth = {"contact": "coulomb", "friction_coefficient": 0.0}
    lab = Lab(core_scene(spacing, smooth), water="pore_pressure", gravity_m_per_s2=GRAVITY)
    lab.run(0)
    time, travel = follow(lab, PUSHED_S)
    return Core(spacing, level, shear, time, travel)


def push_bare_face(spacing: float) -> tuple[float, float]:
    """Shear force of a rough base [N/m], and acceleration without friction [m/s2], bare face.

    The face is found at the first look after the start: the base is read when the core, damped,
    rests again, and the acceleration from then on.
    """
    rough = core_scene(spacing, {"contact": "rough"}, BARE)
    lab = Lab(rough, **FORMS[2], local_damping=0.5, gravity_m_per_s2=GRAVITY)
    lab.run(round(SETTLING_S / lab.frame_time))
    shear = float(lab.stress[lab.start[:, 1] < spacing, 3].sum()) * spacing
    smooth = {"contact": "coulomb", "friction_coefficient": 0.0}
    lab = Lab(core_scene(spacing, smooth, BARE), **FORMS[2], gravity_m_per_s2=GRAVITY)
    lab.run(0)
    time, travel = follow(lab, BARE_S)
    return shear, 2.0 * float(np.polyfit(time[3:], travel[3:], 2)[0])


def follow(lab: Lab, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and mean travel along x (T,) [m] of all points."""
    time, travel = [0.0], [0.0]
    while lab.time < seconds:
        lab.run(1)
        time.append(lab.time)
        travel.append(float(lab.displacement[:, 0].mean()))
    return np.array(time), np.array(travel)


@dataclass
class Seepage:
    """A block in seepage along x."""

    share: float  # gradient over the critical one
    time: np.ndarray  # (T,) [s]
    travel: np.ndarray  # (T,) [m]
    spacing: float  # m

    @property
    def acceleration(self) -> float:
        """Of the parabola through the path [m/s2]."""
        return 2.0 * float(np.polyfit(self.time, self.travel, 2)[0])

    @property
    def found(self) -> float:
        """Critical gradient that gives the acceleration found."""
        return self.share * CRITICAL - self.acceleration * DENSITY / UNIT_WEIGHT


def seep(share: float, spacing: float) -> Seepage:
    """Put the block under a water line of one slope, which lies above it everywhere."""
    room = 60.0
    high = 2.0 * THICKNESS + room * share * CRITICAL
    scene = {
        "name": f"block, i = {share:g} i_c",
        "domain": {"x_min": 0, "x_max": room, "y_max": high + 1},
        "ground": {
            "points": [[0, 0], [room, 0]], "contact": "coulomb", "friction_coefficient": FRICTION
        },
        "zones": [
            {
                "name": "block",
                "polygon": [[8, 0], [8 + LENGTH, 0], [8 + LENGTH, THICKNESS], [8, THICKNESS]],
                "material": "rock",
            }
        ],
        "materials": {"rock": STIFF},
        "water_level": high,
        "phreatic_line": [[0, high], [room, 2.0 * THICKNESS]],
        "spacing": spacing,
    }  # fmt: skip
    lab = Lab(scene, **FORMS[1], gravity_m_per_s2=GRAVITY)
    lab.run(0)
    return Seepage(share, *follow(lab, SEEPAGE_S), spacing)


def slope_scene(spacing: float, level: float | None, **strength: float) -> dict:
    """A 2:1 slope that falls to the right, with a level water table."""
    toe = 15.0 + 2.0 * HEIGHT
    return {
        "name": "slope at rest" if level is None else f"slope at rest, pool at {level:g} m",
        "domain": {"x_min": 0, "x_max": toe + 8, "y_max": HEIGHT + 4},
        "ground": {"points": [[0, 0], [toe + 8, 0]]},
        "zones": [
            {
                "name": "slope",
                "polygon": [[0, 0], [toe, 0], [15, HEIGHT], [0, HEIGHT]],
                "material": "soil",
            }
        ],
        "materials": {"soil": {"density": DENSITY, "youngs_modulus_mpa": 100, **strength}},
        "water_level": level,
        "spacing": spacing,
    }


def difference_of_forms(spacing: float) -> float:
    """Largest difference [m] between the forms in a slump under a level water table."""
    scene = slope_scene(spacing, 0.6 * HEIGHT, friction_deg=0.0, cohesion_kpa=8.0)
    ends = []
    for form in FORMS:
        lab = Lab(scene, **form)
        lab.run(round(3.0 / lab.frame_time))
        ends.append(lab.displacement)
    if np.abs(ends[0]).max() < 0.1 * HEIGHT:
        raise RuntimeError("the slump does not move")
    return float(max(np.abs(end - ends[0]).max() for end in ends))


def rest(spacing: float, level: float | None) -> tuple[float, float]:
    """Largest displacement [spacings] of a slope that stands, and its drift of energy.

    The drift is that of the whole account, as a share of the potential energy at the start.
    """
    scene = scene_from_mapping(slope_scene(spacing, level, friction_deg=35.0, cohesion_kpa=5.0))
    settings = SimulationSettings(water="pore_pressure", duration_s=REST_S, early_stop=False)
    run = simulate([scene], settings, threads=1)[0]
    energy = run.energy
    kept = ("kinetic", "potential", "elastic", "plastic", "contact_loss")
    account = sum(energy[name] for name in kept) - energy["water_work"]
    moved = float(np.abs(run.positions - run.positions[0]).max()) / spacing
    return moved, float(np.abs(account - account[0]).max() / energy["potential"][0])


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Level table, core, seepage and rest; compare, draw."""
    spacings = (0.5,) if quick else (0.5, 0.25)
    spacing = spacings[-1]
    cores = [push_core(one) for one in spacings]
    seepages = [seep(share, spacing) for share in (*RESTING, *SLIDING)]
    shear, acceleration = push_bare_face(spacing)
    core, mass = cores[-1], DENSITY * WIDTH * TOP
    cells = f"{POOL / (2 * spacing):.0f} cells to H"
    rows = [
        Row(CASE, "level table: displacement, largest difference of forms",
            difference_of_forms(spacing), 0.0, 0.0, "m", bound=True),
        Row(CASE, f"thrust of a pool, reaction of the base, {cells}", core.shear[0] / 1e3,
            float(thrust(0.0)) / 1e3, TOLERANCE, "kN/m"),
        Row(CASE, f"thrust of a pool, acceleration without friction, {cells}",
            core.acceleration, float(thrust(0.0)) / mass, TOLERANCE, "m/s2"),
        Row(CASE, f"pool on a bare face, reaction of the base, {cells}", shear / 1e3,
            float(thrust(0.0)) / 1e3, TOLERANCE, "kN/m"),
        Row(CASE, f"pool on a bare face, acceleration without friction, {cells}",
            acceleration, float(thrust(0.0)) / mass, TOLERANCE, "m/s2"),
    ]  # fmt: skip
    for seepage in seepages:
        if seepage.share > 1.0:
            rows.append(
                Row(CASE, f"critical gradient, sliding at {seepage.share:g} i_c", seepage.found,
                    CRITICAL, TOLERANCE)
            )  # fmt: skip
        else:
            rows.append(
                Row(CASE, f"travel in {SEEPAGE_S:g} s at {seepage.share:g} i_c",
                    float(np.abs(seepage.travel).max()) / spacing, 0.01, 0.0, "spacings",
                    bound=True)
            )  # fmt: skip
    for level in POOLS:
        words = "dry" if level is None else f"pool at {level / HEIGHT:g} H"
        moved, drift = rest(spacing, level)
        rows += [
            Row(CASE, f"slope at rest, {words}: displacement in {REST_S:g} s", moved, 0.01, 0.0,
                "spacings", bound=True),
            Row(CASE, f"slope at rest, {words}: drift of energy / potential energy", drift, 1e-4,
                0.0, bound=True),
        ]  # fmt: skip
    if folder is not None:
        draw(folder / f"{CASE}.png", cores, seepages)
    return rows


def draw(path: Path, cores: list[Core], seepages: list[Seepage]) -> None:
    """Shear force over the height of the core, its way without friction, seepage."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.8))
    level = np.linspace(0.0, POOL, 100)
    time = np.linspace(0.0, max(core.time[-1] for core in cores), 50)
    for number, core in enumerate(cores):
        label = f"points {core.spacing:g} m apart"
        left.plot(core.shear / 1e3, core.level, "o", markersize=3, color=f"C{number}", label=label)
        middle.plot(core.time, core.travel, "o", markersize=3, color=f"C{number}", label=label)
    left.plot(thrust(level) / 1e3, level, "k-", linewidth=1, label="ρ g (H - y)² / 2")
    left.set(xlabel="shear force across a level [kN/m]", ylabel="y [m]")
    left.set_title("dry core on a rough base", fontsize=10)
    left.legend(fontsize=8)
    mass = DENSITY * WIDTH * TOP
    middle.plot(time, 0.5 * thrust(0.0) / mass * time**2, "k-", linewidth=1, label="½ T t² / m")
    middle.set(xlabel="time [s]", ylabel="travel [m]")
    middle.set_title("the same on a base without friction", fontsize=10)
    middle.legend(fontsize=8)
    share = np.linspace(0.4, 2.1, 200)
    exact = np.maximum(share - 1.0, 0.0) * CRITICAL * WATER_DENSITY / DENSITY
    right.plot(share, exact, "k-", linewidth=1, label="(i - i_c) ρ_w / ρ")
    found = [(s.share, s.acceleration / GRAVITY) for s in seepages]
    right.plot(*np.array(found).T, "o", markersize=5, color="C1", label="solver")
    right.set(xlabel="gradient / critical gradient", ylabel="acceleration / g")
    right.set_title("block in seepage", fontsize=10)
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
