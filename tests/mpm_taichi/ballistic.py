"""A stand-in for the solver: points fly freely and stop on the ground. Fast, deterministic."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene, scene_from_mapping
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings

FAST = SimulationSettings(duration_s=2.0, frame_interval=0.4)


def make_scene(number: int = 0, *, width: float = 12.0, spacing: float = 1.0, water=None) -> Scene:
    """A block on a layer, thrown to the right; `number` changes its speed and its seed."""
    soil = {"friction_deg": 20, "cohesion_kpa": 0, "density": 1800}
    return scene_from_mapping(
        {
            "name": f"block_{number}",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 30},
            "ground": {"points": [[0, 2], [60, 2]]},
            "zones": [
                {
                    "name": "layer",
                    "polygon": [[5, 2], [5 + 2 * width, 2], [5 + 2 * width, 5], [5, 5]],
                    "material": "liquefied fill",
                },
                {
                    "name": "block",
                    "polygon": [[5, 5], [5 + width, 5], [5 + width, 11], [5, 11]],
                    "material": "shell",
                    "initial_velocity": [8.0 + number % 10, 4.0],
                },
            ],
            "materials": {
                "liquefied fill": {
                    **soil,
                    "friction_deg": 0,
                    "cohesion_kpa": 18.7,
                    "liquefied": True,
                },
                "shell": soil,
            },
            "water_level": water,
            "spacing": spacing,
            "seed": number,
        }
    )


def fly(scene: Scene, settings: SimulationSettings) -> Run:
    """The run of one scene."""
    gravity = settings.gravity_m_per_s2
    step = settings.frame_interval * np.sqrt(scene.spacing / gravity)
    time = np.arange(0.0, settings.duration_s + 0.5 * step, step)
    points = fill(scene)
    start, velocity = points.position, points.velocity
    moving = np.any(velocity != 0, axis=1)
    t = time[:, None, None]
    path = start + velocity * t - np.where(moving[:, None], [0.0, 0.5 * gravity], 0.0) * t**2
    landed = path[..., 1] < start[:, 1]
    path[..., 1] = np.where(landed, start[:, 1], path[..., 1])
    speed = np.linalg.norm(np.gradient(path, step, axis=0), axis=2)
    count = len(points)
    generator = np.random.default_rng(scene.seed)
    return Run(
        scene=scene,
        settings=settings,
        positions=path.astype(np.float32),
        time=time,
        material=points.material,
        zone=points.zone,
        kinematic=points.kinematic,
        velocity=velocity.astype(np.float32),
        stress=generator.normal(-1e5, 1e4, (count, 4)).astype(np.float32),
        initial_stress=generator.normal(-1e5, 1e4, (count, 4)).astype(np.float32),
        plastic_shear_strain=np.abs(generator.normal(0, 1, count)).astype(np.float32),
        initial_volume=points.volume.astype(np.float32),
        volume=points.volume.astype(np.float32),
        energy={"kinetic": 900.0 * (speed**2 * points.volume).sum(axis=1)},
        audit={"mass_kg_per_m": 1800.0 * float(points.volume.sum())},
        wall_contact={"right": 0.0} if scene.seed % 2 == 1 else {},
        wall_time_s=0.01,
        steps=1000,
    )


def simulate(
    scenes: Sequence[Scene],
    settings: SimulationSettings,
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_frame: Callable | None = None,
    on_finished: Callable[[int, Run], None] | None = None,
) -> list[Run]:
    """As `mpm_taichi.simulate.simulate`; seed 13 fails, seed 666 raises."""
    runs = []
    for position, scene in enumerate(scenes):
        if scene.seed == 666:
            raise RuntimeError("the grid\nis on fire")
        run = fly(scene, settings)
        if scene.seed == 13:
            run.status, run.reason = "failed", "energy balance off by 7 %"
            run.audit["failed_at_s"] = 1.25
        runs.append(run)
        if on_finished is not None:
            on_finished(position, run)
    return runs
