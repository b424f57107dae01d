"""Which transfer scheme, which ground: runout over two time steps and two cell sizes.

    python -m benchmarks.studies.transfer_study [--scenes slump column lsfd] [--redo]

Three scenes: a phi = 0 slump (c = 30 kPa), a frictional column (phi = 30, c = 0), the section of
the Lower San Fernando dam with its reservoir. For each scheme, on rough and on bonded ground:
toe runout at 1 m spacing, with the time step halved, and at 2 m. What is found is kept in
`transfer_study.json` run by run, so the study resumes where it stopped; at the end
it writes the table between the markers of `docs/records/transfer.md` and the picture next to it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.dam_section import dam_section
from benchmarks.generated_pages import RECORDS, ROOT, renew
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.toe_runout import toe_runout
from mpm_taichi import PHYSICS_VERSION
from pipeline.config import SimulationSettings
from pipeline.files import read_json, write_json

RECORD = Path(__file__).with_suffix(".json")
PAGE = RECORDS / "transfer.md"
PICTURE = ROOT / "docs/images/transfer.png"

SCHEMES = {
    "affine FLIP, 0.2 /s": {"transfer": "affine_flip", "pic_rate_per_s": 0.2},
    "affine FLIP, 1 /s (default)": {"transfer": "affine_flip", "pic_rate_per_s": 1.0},
    "affine FLIP, 5 /s": {"transfer": "affine_flip", "pic_rate_per_s": 5.0},
    "classical FLIP, 1 /s": {"transfer": "flip", "pic_rate_per_s": 1.0},
    "APIC": {"transfer": "apic"},
    "PIC": {"transfer": "pic"},
}
GROUNDS = ("rough", "no_slip")
VARIANTS = {"2 m": (2.0, 0.3), "1 m": (1.0, 0.3), "1 m, dt/2": (1.0, 0.15)}


def slump(spacing: float, ground: str) -> tuple[Scene, float, str]:
    """A 40 m high phi = 0 slope of 30 kPa, its foot and the side to which it runs."""
    return _simple([[0, 2], [140, 2], [80, 42], [0, 42]], 0, 30, spacing, ground), 140.0, "right"


def column(spacing: float, ground: str) -> tuple[Scene, float, str]:
    """A 40 m x 40 m column of phi = 30, c = 0 against a smooth wall."""
    return _simple([[0, 2], [40, 2], [40, 42], [0, 42]], 30, 0, spacing, ground), 40.0, "right"


def lsfd(spacing: float, ground: str) -> tuple[Scene, float, str]:
    """The Lower San Fernando section with its reservoir."""
    scene = dam_section()
    base = {"points": scene.ground.points, "contact": ground}
    return scene.changed(spacing=spacing, ground=base), scene.foot("left"), "left"


SCENES = {"slump": slump, "column": column, "lsfd": lsfd}


def _simple(polygon: list, phi: float, c: float, spacing: float, ground: str) -> Scene:
    return scene_from_mapping(
        {
            "name": "study",
            "domain": {"x_min": 0, "x_max": 300, "y_max": 62, "walls": "open"},
            "ground": {"points": [[0, 2], [300, 2]], "contact": ground},
            "zones": [{"name": "soil", "material": "soil", "polygon": polygon}],
            "materials": {"soil": {"friction_deg": phi, "cohesion_kpa": c}},
            "spacing": spacing,
        }
    )


def measure(scene_name: str, scheme: str, ground: str, variant: str) -> dict:
    """Runout [m], share of numerical dissipation, end of motion [s] and what moves at the end."""
    from mpm_taichi.simulate import simulate

    spacing, courant = VARIANTS[variant]
    scene, foot, side = SCENES[scene_name](spacing, ground)
    if side == "right":  # the wall on the left is part of these two scenes
        scene = scene.changed(domain={**scene.domain.model_dump(), "walls": "closed"})
    settings = SimulationSettings(courant=courant, **SCHEMES[scheme])
    run = simulate([scene], settings, threads=1)[0]
    if run.status != "finished":
        return {"failed": run.reason}
    runout = toe_runout(
        run.positions[-1].astype(float), spacing**2, spacing=spacing, side=side, initial_toe=foot
    )
    kinetic = run.energy["kinetic"]
    return {
        "runout_m": round(float(runout), 3),
        "numerical_share": round(float(run.audit["numerical_share"]), 4),
        "end_s": round(float(run.time[-1]), 2),
        "kinetic_left": float(kinetic[-1] / kinetic.max()),
        "wall_time_s": round(run.wall_time_s, 2),
    }


def collect(scenes: list[str], redo: bool) -> dict:
    """Measure what is not on record yet; the record grows run by run."""
    record = read_json(RECORD) if RECORD.exists() and not redo else {}
    if record.get("physics_version") != PHYSICS_VERSION:
        record = {"physics_version": PHYSICS_VERSION, "runs": {}}
    for name in scenes:
        for ground in GROUNDS:
            for scheme in SCHEMES:
                for variant in VARIANTS:
                    key = " | ".join((name, ground, scheme, variant))
                    if key not in record["runs"]:
                        record["runs"][key] = measure(name, scheme, ground, variant)
                        write_json(RECORD, record)
                        print(key, record["runs"][key], flush=True)
    return record["runs"]


def table(runs: dict) -> str:
    """The runs as Markdown: runouts, and their change with dt/2 and from 2 m to 1 m."""
    lines = [
        "| scene | ground | scheme | 2 m | 1 m | 1 m, dt/2 | dt/2 changes | 2 m to 1 m changes "
        "| numerical dissipation |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in SCENES:
        for ground in GROUNDS:
            for scheme in SCHEMES:
                found = [
                    runs.get(" | ".join((name, ground, scheme, v)), {}).get("runout_m", np.nan)
                    for v in VARIANTS
                ]
                if np.isnan(found).all():
                    continue
                coarse, fine, half = found
                share = runs[" | ".join((name, ground, scheme, "1 m"))].get("numerical_share")
                lines.append(
                    f"| {name} | {ground} | {scheme} | {coarse:.1f} m | {fine:.1f} m "
                    f"| {half:.1f} m | {100 * (half / fine - 1):+.1f} % "
                    f"| {100 * (fine / coarse - 1):+.1f} % | {100 * (share or np.nan):.1f} % |"
                )
    return "\n".join(lines)


def draw(runs: dict) -> None:
    """Runouts of all schemes at the three resolutions, one panel a scene and ground."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        len(GROUNDS), len(SCENES), figsize=(11, 6), sharey="col", layout="constrained"
    )
    colours = ["#0072B2", "#000000", "#56B4E9", "#E69F00", "#D55E00", "#CC79A7"]
    for column_axes, name in zip(axes.T, SCENES, strict=True):
        for ax, ground in zip(column_axes, GROUNDS, strict=True):
            for scheme, colour in zip(SCHEMES, colours, strict=True):
                values = [
                    runs.get(" | ".join((name, ground, scheme, v)), {}).get("runout_m", np.nan)
                    for v in VARIANTS
                ]
                width = 2.5 if "default" in scheme else 1.2
                ax.plot(list(VARIANTS), values, "o-", color=colour, lw=width, label=scheme)
            ax.set_title(f"{name}, {ground} ground", fontsize=10)
            ax.grid(alpha=0.3)
    for ax in axes[:, 0]:
        ax.set_ylabel("toe runout (m)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=3, loc="outside lower center", frameon=False)
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURE, dpi=110)


def main() -> None:
    """Measure, print, and bring the page up to date."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.transfer_study", description=__doc__
    )
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--redo", action="store_true", help="forget what is on record")
    options = parser.parse_args()
    runs = collect(options.scenes, options.redo)
    text = table(runs)
    print(text)
    draw(runs)
    renew(PAGE, table=text)


if __name__ == "__main__":
    main()
