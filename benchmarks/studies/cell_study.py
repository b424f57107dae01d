"""What halving the cell still changes, and in which scenes.

    python -m benchmarks.studies.cell_study [--coarse]

Seven scenes between the phi = 0 slump of `benchmarks.studies.transfer_study`, which does not care,
and the section of the Lower San Fernando dam, which does: layers of unequal strength, the dam's
outline in one soil, with its reservoir, and next to a part that stays. Prints a table and draws
`docs/images/cells.png`; `--coarse` leaves out 0.5 m (four minutes).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.studies.transfer_study import lsfd, slump
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.toe_runout import toe_runout
from pipeline.config import SimulationSettings

PICTURE = Path(__file__).parents[2] / "docs/images/cells.png"
SPACINGS = (2.0, 1.0, 0.5)
THICKNESS = SPACINGS[0]
"""The toe is read where the deposit is this thick [m], whatever the spacing."""
LAYER = 16.0
"""Height of the soft layer of the slumps [m]."""
STAYS = ("downstream_shell", "berm")

Build = Callable[[float], tuple[Scene, float, str]]


def clay(cohesion_kpa: float) -> dict[str, float]:
    """Strength of a phi = 0 soil."""
    return {"friction_deg": 0.0, "cohesion_kpa": cohesion_kpa}


def layered(above: dict[str, float]) -> Build:
    """The slump of 30 kPa with another soil above its lowest `LAYER` metres."""

    def build(spacing: float) -> tuple[Scene, float, str]:
        scene, foot, side = slump(spacing, "rough")
        document = scene.model_dump()
        top, edge = 2.0 + LAYER, foot - 60.0 * LAYER / 40.0
        document["domain"]["walls"] = "closed"
        low = [[0, 2], [foot, 2], [edge, top], [0, top]]
        high = [[0, top], [edge, top], [80, 42], [0, 42]]
        document["zones"] = [
            {"name": "layer", "material": "soft", "polygon": low},
            {"name": "above", "material": "above", "polygon": high},
        ]
        document["materials"] = {"soft": clay(30.0), "above": above}
        return scene_from_mapping(document), foot, side

    return build


def outline(
    cohesion_kpa: float, *, stays_kpa: float | None = None, reservoir: bool = True
) -> Build:
    """The dam in one phi = 0 soil; optionally stronger downstream, or without the reservoir."""

    def build(spacing: float) -> tuple[Scene, float, str]:
        scene, foot, side = lsfd(spacing, "rough")
        document = scene.model_dump()
        for name, material in document["materials"].items():
            strong = stays_kpa is not None and name in STAYS
            material.update(clay(stays_kpa if strong else cohesion_kpa))
        if not reservoir:
            document["water_level"] = None
        return scene_from_mapping(document), foot, side

    return build


SCENES: dict[str, Build] = {
    "slump, 30 kPa": layered(clay(30.0)),
    "slump, 30 below 60 kPa": layered(clay(60.0)),
    "slump, 30 kPa below phi = 35°": layered({"friction_deg": 35.0, "cohesion_kpa": 1.0}),
    "dam outline, 40 kPa, dry": outline(40.0, reservoir=False),
    "dam outline, 21.5 kPa, reservoir": outline(21.5),
    "the same, downstream part of 100 kPa": outline(21.5, stays_kpa=100.0),
    "Lower San Fernando": lambda spacing: lsfd(spacing, "rough"),
}


def measure(build: Build, spacing: float) -> tuple[float, float]:
    """Toe runout [m] and mean horizontal displacement [m] of one scene at one spacing."""
    from mpm_taichi.simulate import simulate

    scene, foot, side = build(spacing)
    run = simulate([scene], SimulationSettings(), threads=1)[0]
    if run.status != "finished":
        raise RuntimeError(f"{scene.name} at {spacing:g} m: {run.reason}")
    start, end = run.positions[0].astype(float), run.positions[-1].astype(float)
    moved = float(np.abs(end[:, 0] - start[:, 0]).mean())
    runout = toe_runout(end, spacing**2, spacing=THICKNESS, side=side, initial_toe=foot)
    return float(runout), moved


def table(found: dict[str, dict[float, tuple[float, float]]]) -> str:
    """Toe runouts, and the changes of toe and mean displacement from each spacing to its half."""
    spacings = list(next(iter(found.values())))
    pairs = list(zip(spacings, spacings[1:], strict=False))
    head = ["scene", *(f"toe at {s:g} m" for s in spacings)]
    head += [f"{a:g} to {b:g} m: toe, mean displacement" for a, b in pairs]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name, values in found.items():
        cells = [name, *(f"{values[s][0]:.1f} m" for s in spacings)]
        for old, new in pairs:
            toe, mean = (100 * (b / a - 1) for a, b in zip(values[old], values[new], strict=True))
            cells.append(f"{toe:+.1f} %, {mean:+.1f} %")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(found: dict[str, dict[float, tuple[float, float]]], path: Path) -> None:
    """Toe runout over that at 1 m, against the cell."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.6, 3.9), layout="constrained")
    for marker, (name, values) in zip("osdv^<P", found.items(), strict=True):
        spacings = np.array(list(values))
        toes = np.array([values[spacing][0] for spacing in spacings])
        axes.plot(2 * spacings, 100 * (toes / values[1.0][0] - 1), marker + "-", label=name)
    axes.axhspan(-3, 3, color="0.93", zorder=0)
    axes.set(xscale="log", xlabel="cell (m)", ylabel="toe runout against cells of 2 m (%)")
    ticks = [2 * spacing for spacing in SPACINGS]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(color="0.88")
    figure.legend(loc="outside right", fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main() -> None:
    """Measure, print the table, draw the picture."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.cell_study")
    parser.add_argument("--coarse", action="store_true", help="leave out the finest spacing")
    options = parser.parse_args()
    spacings = SPACINGS[:-1] if options.coarse else SPACINGS
    found = {
        name: {spacing: measure(build, spacing) for spacing in spacings}
        for name, build in SCENES.items()
    }
    print(table(found))
    if not options.coarse:
        draw(found, PICTURE)


if __name__ == "__main__":
    main()
