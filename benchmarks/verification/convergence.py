"""The same runout with the time step halved and with the cell halved; the numerical strength.

Three scenes, default settings, from 1 m spacing (quick: the slump from 2 m): a phi = 0 slump, a
frictional column, and the Lower San Fernando section with its reservoir. A change of the runout is
also given as the S_r that would cause it, from a run with 5 % more S_r: the effective numerical
strength, which should stay under 2 % of S_r.

The front of the column, soil without cohesion, ends in a layer as thin as the threshold of the toe,
so its two rows pass or fail at random. The reach of 99 % of the soil is therefore given as well.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.dam_section import dam_section
from benchmarks.verification.rows import Row
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from pipeline.config import SimulationSettings

TITLE = "Time step and cell halved"

#: Material whose strength is the scene's S_r, and the strength [kPa]; the column has none.
LIQUEFIED = {"slump": ("soil", 30.0), "lsfd": ("liquefied_hydraulic_fill", 21.5)}
MORE = 1.05
COURANT = 0.3
MOST_SOIL = 0.99


def slump(spacing: float) -> tuple[Scene, float, str]:
    """A 40 m high phi = 0 slope of 30 kPa, its foot and the side to which it runs."""
    return _simple([[0, 2], [140, 2], [80, 42], [0, 42]], 0, 30, spacing), 140.0, "right"


def column(spacing: float) -> tuple[Scene, float, str]:
    """A 40 m x 40 m column of phi = 30, c = 0 against a smooth wall."""
    return _simple([[0, 2], [40, 2], [40, 42], [0, 42]], 30, 0, spacing), 40.0, "right"


def lsfd(spacing: float) -> tuple[Scene, float, str]:
    """The Lower San Fernando section with its reservoir."""
    scene = dam_section()
    ground = {"points": scene.ground.points, "contact": "rough"}
    return scene.changed(spacing=spacing, ground=ground), scene.foot("left"), "left"


SCENES = {"slump": slump, "column": column, "lsfd": lsfd}


def _simple(polygon: list, phi: float, c: float, spacing: float) -> Scene:
    return scene_from_mapping(
        {
            "name": "study",
            "domain": {"x_min": 0, "x_max": 300, "y_max": 62, "walls": "open"},
            "ground": {"points": [[0, 2], [300, 2]], "contact": "rough"},
            "zones": [{"name": "soil", "material": "soil", "polygon": polygon}],
            "materials": {"soil": {"friction_deg": phi, "cohesion_kpa": c}},
            "spacing": spacing,
        }
    )


def _closed(scene: Scene, side: str) -> Scene:
    if side == "left":
        return scene
    return scene.changed(domain={**scene.domain.model_dump(), "walls": "closed"})


def _runs(name: str, spacing: float) -> dict[str, tuple[float, np.ndarray, Scene]]:
    """Runout [m], final positions (N, 2) and scene of each variant of one scene."""
    from mpm_taichi.simulate import simulate

    variants: dict[str, tuple[Scene, float]] = {}
    for label, step, courant in (
        ("base", spacing, COURANT),
        ("dt/2", spacing, COURANT / 2),
        ("dx/2", spacing / 2, COURANT),
    ):
        scene, foot, side = SCENES[name](step)
        variants[label] = (_closed(scene, side), courant)
    if name in LIQUEFIED:
        material, strength = LIQUEFIED[name]
        stronger = variants["base"][0].with_strength(material, cohesion_kpa=MORE * strength)
        variants["more S_r"] = (stronger, COURANT)
    found = {}
    for label, (scene, courant) in variants.items():
        run = simulate([scene], SimulationSettings(courant=courant), threads=1)[0]
        if run.failed:
            raise RuntimeError(f"{name}, {label}: {run.reason}")
        position, volume = run.positions[-1].astype(float), run.bulk_volume
        # One threshold for both cells: the toe of the finer run is read where the coarse one is.
        runout = toe_runout(position, volume, spacing=spacing, side=side, initial_toe=foot)
        found[label] = (float(runout), position, volume, scene)
    return found


def _rows(name: str, spacing: float, found: dict) -> list[Row]:
    base = found["base"][0]
    rows = []
    for label, tolerance in (("dt/2", 0.02), ("dx/2", 0.03)):
        value = found[label][0]
        rows.append(
            Row("convergence", f"{name}, {spacing:g} m: runout with {label}", value, base,
                tolerance, "m")
        )  # fmt: skip
    if name == "column":
        foot = SCENES[name](spacing, "rough")[1]
        most = {k: float(np.quantile(v[1][:, 0], MOST_SOIL)) - foot for k, v in found.items()}
        for label, tolerance in (("dt/2", 0.02), ("dx/2", 0.03)):
            rows.append(
                Row("convergence", f"{name}, {spacing:g} m: reach of 99 % of it with {label}",
                    most[label], most["base"], tolerance, "m")
            )  # fmt: skip
    if name in LIQUEFIED:
        strength = LIQUEFIED[name][1]
        slope = (found["more S_r"][0] - base) / ((MORE - 1.0) * strength)  # m per kPa
        for label in ("dt/2", "dx/2"):
            kpa = abs((found[label][0] - base) / slope)
            rows.append(
                Row("convergence", f"{name}, {spacing:g} m: S_r worth of {label}", kpa,
                    0.02 * strength, 0.0, "kPa", bound=True, note=f"{100 * kpa / strength:.1f} %")
            )  # fmt: skip
    return rows


def run(folder: Path | None, quick: bool = False) -> list[Row]:
    """Rows of all scenes; picture: the final surfaces of the three resolutions."""
    spacing = 2.0 if quick else 1.0
    names = ["slump"] if quick else list(SCENES)
    rows, all_found = [], {}
    for name in names:
        all_found[name] = _runs(name, spacing)
        rows += _rows(name, spacing, all_found[name])
    if folder is not None:
        _draw(folder / "convergence.png", all_found, spacing)
    return rows


def _draw(path: Path, all_found: dict, spacing: float) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        len(all_found), 1, figsize=(10.5, 2.5 * len(all_found)), layout="constrained", squeeze=False
    )
    styles = {"base": ("k", "-"), "dt/2": ("#0072B2", "--"), "dx/2": ("#D55E00", "-"),
              "more S_r": ("#999999", ":")}  # fmt: skip
    names = {"base": "base", "dt/2": "dt/2", "dx/2": "dx/2", "more S_r": "5 % more S_r"}
    for ax, (name, found) in zip(axes[:, 0], all_found.items(), strict=True):
        for label, (runout, position, volume, scene) in found.items():
            colour, line = styles[label]
            x, y = _surface(position, volume, scene, spacing)
            ax.plot(x, y, line, color=colour, label=f"{names[label]}: runout {runout:.1f} m")
        ax.set_title(f"{name}, from {spacing:g} m", loc="left", fontsize=10)
        ax.set_ylabel("y (m)")
        ax.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))
        ax.grid(alpha=0.3)
    axes[-1, 0].set_xlabel("x (m); heights are drawn larger than lengths")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _surface(
    position: np.ndarray, volume: np.ndarray, scene: Scene, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Final surface, x and y [m]; a closed wall on the left is a mirror for the smoothing."""
    left = position[:, 0].min()
    wall = scene.domain.x_min
    if scene.domain.walls == "closed" and left < wall + 2 * spacing:
        position = np.concatenate([position, (2 * wall, 0.0) + position * (-1.0, 1.0)])
        volume = np.tile(volume, 2)
        left = wall
    x = np.linspace(left, position[:, 0].max() + 2, 400)
    base = scene.ground.lowest
    return x, surface_profile(position, volume, x, spacing=spacing, ground=base)
