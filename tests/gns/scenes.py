"""Small scenes and simulators with random weights, for tests of the learned simulator."""

from __future__ import annotations

import numpy as np
import torch

from geometry.scenes.scene import Scene, scene_from_mapping
from gns.data.scene_facts import SceneFacts, start_of
from gns.network.simulator import Simulator, SimulatorConfig
from pipeline.config import SimulationSettings

SETTINGS = SimulationSettings(water="buoyant")


def small_scene(*, spacing: float = 1.0, water: float | None = 4.4, walls: str = "closed") -> Scene:
    """Two soils on ground that slopes and steps, a kinematic block, water; 70 points."""
    soil = {"friction_deg": 30, "cohesion_kpa": 1.0, "density": 1800}
    d = spacing

    def at(points):
        return [[x * d, y * d] for x, y in points]

    return scene_from_mapping(
        {
            "name": "small",
            "domain": {"x_min": 0, "x_max": 30 * d, "y_max": 20 * d, "walls": walls},
            "ground": {"points": at([[0, 1], [8, 1], [16, 3], [30, 2]])},
            "zones": [
                {
                    "name": "foot",
                    "polygon": at([[1, 1], [8, 1], [8, 6], [1, 6]]),
                    "material": "liquefied",
                },
                {
                    "name": "block",
                    "polygon": at([[8, 3.2], [14, 3.2], [14, 8], [8, 8]]),
                    "material": "shell",
                    "initial_velocity": [1.5, -0.5],
                },
                {
                    "name": "post",
                    "polygon": at([[18, 3.2], [20, 3.2], [20, 6], [18, 6]]),
                    "material": "shell",
                    "kinematic": True,
                },
            ],
            "materials": {
                "liquefied": {
                    "friction_deg": 0,
                    "cohesion_kpa": 18.7 * d,
                    "density": 1900,
                    "saturated_density": 2000,
                    "liquefied": True,
                },
                "shell": soil,
            },
            "water_level": None if water is None else water * d,
            "phreatic_line": None if water is None else at([[0, 4.4], [10, 4.4], [20, 2.5]]),
            "spacing": d,
        }
    )


def start(**changes) -> tuple[SceneFacts, np.ndarray]:
    """Facts and first positions of the small scene."""
    return start_of(small_scene(**changes), SETTINGS)


def simulator(dtype: torch.dtype = torch.float32, seed: int = 0, **changes) -> Simulator:
    """A simulator whose random weights move points by a few hundredths of a spacing a frame."""
    torch.manual_seed(seed)
    config = {
        "width": 8,
        "message_passing_steps": 2,
        "velocity_std": (0.5, 0.5),
        "acceleration_mean": (0.0, -0.05),
        "acceleration_std": (0.1, 0.1),
        **changes,
    }
    return Simulator(SimulatorConfig(**config)).to(dtype)
