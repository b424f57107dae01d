"""Pore water of the Lower San Fernando section through its slide: excess pressure and strength.

    python -m benchmarks.studies.pore_water_picture [--spacing M] [--permeability K]

Simulates the published section with a permeability of its hydraulic fill and draws excess pressure
over mean stress, and strength, at some times (`docs/images/pore_water.png`). It prints toe, crest
and duration for some permeabilities beside those of soil in which no water flows.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from geometry.scenes.scene import Scene, load_scene
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings
from pipeline.files import atomic_path
from pipeline.table import aligned

ROOT = Path(__file__).parents[2]
FILE = ROOT / "case_histories/lower_san_fernando/scene.yaml"
PICTURE = ROOT / "docs/images/pore_water.png"
STRENGTH_KPA = 20.0
SAND = ("liquefied_fill", "fill")
"""Soils through which water flows; core and rolled fill are clay, the dikes drain."""
DRAINS = ("starter_dike", "berm")
DRAIN_M_PER_S = 1e-3
FRICTION_DEG = 33.0
"""Friction angle of the fill that liquefied, once its water has drained."""
FOOT, CREST = 88.3, 47.0
"""x of the upstream foot and height of the crest [m]."""
PERMEABILITIES = (1e-15, 1e-6, 1e-5, 1e-4)
DILATANCIES = (0.0, 0.2)
"""Of the soil that does not liquefy: none, and that of dense sand."""
HEADS = ["k (m/s)", "dilatancy", "toe (m)", "crest sinks (m)", "starts (s)", "moves (s)",
         "ends (s)", "water out (m3/m)"]  # fmt: skip
STARTED = 0.1
"""Of the runout: the slide has begun."""
TIMES = (0.0, 6.0, 15.0, 60.0)
"""Times that are drawn [s]."""
SHOWN = (20.0, 230.0, 0.0, 50.0)


def section(spacing: float, permeability: float | None, dilatancy: float = 0.0) -> Scene:
    """The published section, with a permeability [m/s] of its fill; None: no water flows."""
    scene = load_scene(FILE)
    soils = scene.model_dump()["materials"]
    soils["liquefied_fill"]["cohesion_kpa"] = STRENGTH_KPA
    effects = {} if permeability is None else let_flow(soils, permeability, dilatancy)
    return scene.changed(spacing=spacing, materials=soils, effects=effects)


def let_flow(
    soils: dict[str, dict[str, Any]], permeability: float, dilatancy: float
) -> dict[str, Any]:
    """Give the soils of a San Fernando dam the numbers of their water; the effect that flows."""
    drained = {"friction_deg": FRICTION_DEG, "cohesion_kpa": 60.0}
    soils["liquefied_fill"]["pre_failure"] = drained
    for name in SAND:
        soils[name]["permeability_m_per_s"] = permeability
    for name in (one for one in DRAINS if one in soils):
        soils[name]["permeability_m_per_s"] = DRAIN_M_PER_S
    return {"pore_water": {"amplitude": 1.0, "dilatancy": dilatancy}}


def start_s(run: Run, foot: float) -> float:
    """When a tenth of the runout to the left of a foot [m] is there."""
    ran = np.maximum.accumulate(foot - run.positions[:, :, 0].min(axis=1))
    return float(np.interp(STARTED * ran[-1], ran, run.time))


def main() -> None:
    """Simulate, print, draw."""
    from mpm_taichi.simulate import simulate, simulate_each

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=2.0, help="of points [m]; default: 2")
    parser.add_argument("--permeability", type=float, default=1e-4, help="drawn [m/s]")
    parser.add_argument("--threads", type=int, help="default: all")
    parser.add_argument("--out", type=Path, default=PICTURE)
    arguments = parser.parse_args()
    flows = [(k, dilatancy) for dilatancy in DILATANCIES for k in PERMEABILITIES]
    scenes = [section(arguments.spacing, *flow) for flow in ((None,), *flows)]
    runs = simulate(scenes, SimulationSettings(), threads=arguments.threads)
    rows = [HEADS]
    for words, run in zip((("no flow", ""), *flows), runs, strict=True):
        rows.append([*(str(word) for word in words), *figures(run)])
    print(aligned(rows, left={0}))
    drawn = section(arguments.spacing, arguments.permeability)
    wanted = [
        (drawn, SimulationSettings(duration_s=max(time, 1e-3), early_stop=False)) for time in TIMES
    ]
    found = dict(simulate_each(wanted, threads=arguments.threads))
    draw([found[place] for place in range(len(TIMES))], drawn, arguments.out)
    print(f"wrote {arguments.out}")


def figures(run: Run) -> list[str]:
    """Toe, crest, when a tenth of the runout is there, when the motion and the run end, water out.

    Motion has ended with 0.1 % of its greatest kinetic energy.
    """
    end = run.positions[-1]
    kinetic = run.energy["kinetic"]
    moving = run.time[np.flatnonzero(kinetic > 1e-3 * kinetic.max())[-1]]
    toe = FOOT - end[:, 0].min()
    crest = CREST - end[:, 1].max() - 0.5 * run.scene.spacing
    water = run.audit.get("water_expelled_m2", 0.0)
    found = (toe, crest, start_s(run, FOOT), moving, run.time[-1])
    return [*(f"{number:.1f}" for number in found), f"{water:.2f}"]


def draw(runs: list[Run], scene: Scene, out: Path) -> None:
    """One row per time: excess pressure over mean stress, strength."""
    import matplotlib.pyplot as plt

    figure, rows = plt.subplots(
        len(runs), 2, figsize=(11, 1.75 * len(runs)), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    for (left, right), time, run in zip(rows, TIMES, runs, strict=True):
        x, y = run.positions[-1].T
        pressure = run.effect_fields["excess_pore_pressure_pa"]
        strength = run.effect_fields["strength_pa"]
        mean = np.maximum(-0.5 * (run.stress[:, 0] + run.stress[:, 1]), 1.0) + 1e3
        porous = [soil.permeability_m_per_s is not None for soil in scene.materials.values()]
        start = run.positions[0].astype(float)
        wet = np.array(porous)[run.material] & (start[:, 1] < scene.phreatic_level(start[:, 0]))
        for axes in (left, right):
            axes.scatter(x[~wet], y[~wet], s=3, c="#cccccc", linewidths=0)
            axes.set_aspect("equal")
            axes.axhline(scene.water_level, color="#3182bd", linewidth=0.6)
            axes.axis(SHOWN)
        ratio = left.scatter(
            x[wet], y[wet], s=4, c=np.clip(pressure[wet] / mean[wet], 0, 1), vmin=0, vmax=1,
            cmap="viridis", linewidths=0,
        )  # fmt: skip
        shear = right.scatter(
            x[wet], y[wet], s=4, c=strength[wet] / 1e3, vmin=0, vmax=120, cmap="magma",
            linewidths=0,
        )  # fmt: skip
        left.set_ylabel(f"{time:g} s" if time else "0 s")
    rows[0][0].set_title("excess pressure over mean stress", fontsize=10)
    rows[0][1].set_title("shear strength (kPa)", fontsize=10)
    figure.colorbar(ratio, ax=rows[:, 0], location="bottom", shrink=0.5, aspect=40)
    figure.colorbar(shear, ax=rows[:, 1], location="bottom", shrink=0.5, aspect=40)
    with atomic_path(out) as path:
        figure.savefig(path, dpi=110, format="png")
    plt.close(figure)


if __name__ == "__main__":
    main()
