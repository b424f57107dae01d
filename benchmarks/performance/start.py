"""Before it moves, nothing moves: the start of drawn scenes.

    python -m benchmarks.performance start [--scenes 100] [--scales large small coarse]

For each scene three figures: how far the points of the first frame are from the filling (they must
be there exactly), the unbalanced force left by settling as a share of the weight, and how far any
point has moved after a while where every soil is given a strength that cannot fail: what moves then
is the start's own fault, and must stay under 0.1 spacing.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks.performance import PROGRAM
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene
from pipeline.config import Config, load_config

STRONG_KPA = 1e6
FRAMES = 24


def strong(scene: Scene) -> Scene:
    """The scene at rest: soils that cannot fail, nothing thrown."""
    document = scene.model_dump()
    for material in document["materials"].values():
        material.update(friction_deg=0.0, cohesion_kpa=STRONG_KPA, tension_cap_kpa=None)
    for zone in document["zones"]:
        zone["initial_velocity"] = (0.0, 0.0)
    return Scene.model_validate(document)


def rests(scene: Scene) -> bool:
    """True where no zone is thrown or hangs in the air, so that rest can be asked for."""
    from mpm_taichi.solver.initial_state import resting_points

    return bool(resting_points(scene, fill(scene)).all())


def measure(config: Config, scale: str, number: int, threads: int | None = None) -> dict:
    """Largest figures over the first `number` scenes of a scale.

    Returns:
        scenes, resting (of them), first_frame and later shift [spacings], unbalanced [share].
    """
    from mpm_taichi.simulate import simulate

    settings = config.simulation_for(scale)
    spacing = config.scale(scale).spacing_m
    frame = settings.frame_interval * float(np.sqrt(spacing / settings.gravity_m_per_s2))
    settings = settings.model_copy(update={"duration_s": FRAMES * frame, "early_stop": False})
    scenes = [draw_scene(config, scale, index) for index in range(number)]
    resting = [scene for scene in scenes if rests(scene)]
    runs = simulate([strong(scene) for scene in resting], settings, threads=threads)
    first = [np.abs(run.positions[0] - fill(run.scene).position).max() for run in runs]
    later = [
        np.linalg.norm(run.positions - run.positions[0], axis=-1).max(initial=0.0) for run in runs
    ]
    return {
        "scenes": number,
        "resting": len(resting),
        "seconds": FRAMES * frame,
        "first_frame": max(first, default=0.0) / spacing,
        "later": max(later, default=0.0) / spacing,
        "unbalanced": max((run.audit["settle_unbalanced"] for run in runs), default=0.0),
    }


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog=f"{PROGRAM} start", description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--scales", nargs="+", default=["large", "small", "coarse"])
    options = parser.parse_args(argv)
    config = load_config(None)
    print("scale    scenes  at rest  largest shift at t = 0  and later      unbalanced force")
    for scale in options.scales:
        found = measure(config, scale, options.scenes)
        print(
            f"{scale:8} {found['scenes']:6} {found['resting']:8} "
            f"{found['first_frame']:12.1e} spacings {found['later']:9.4f} in "
            f"{found['seconds']:.1f} s  {found['unbalanced']:9.1e} of the weight",
            flush=True,
        )
