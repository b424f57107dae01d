"""A slide of some dozens of points, its measurements, and an untrained simulator that moves it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import yaml

from geometry.scenes.scene import load_scene
from geometry.survey.crest_settlement import CrestSettlement
from geometry.survey.marker_displacement import MarkerDisplacement
from geometry.survey.profiles import Profile
from geometry.survey.surface_profile import SurfaceProfile
from geometry.survey.toe_history import ToeHistory
from geometry.survey.toe_runout import ToeRunout
from geometry.survey.velocity import Velocity
from gns.data.scene_facts import start_of
from gns.network.simulator import Simulator, SimulatorConfig
from inversion.engines.trained_model import TrainedModel
from inversion.estimation.data import make_targets
from inversion.estimation.forward import SectionSetup
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import ParameterSpec
from pipeline.config import SimulationSettings
from tests.gns.scenes import small_scene

SAID = {"confidence": "paper", "source": "test"}
INTERVAL = 0.4
"""Of the model's frames."""

SPECS = [
    ParameterSpec(
        name="S_r", zones=["foot"], property="residual_strength_kpa", start=18, low=2, high=60
    ),
    ParameterSpec(name="phi", zones=["block"], property="friction_deg", start=30, low=5, high=50),
    ParameterSpec(name="c", zones=["block"], property="cohesion_kpa", start=1, low=0.1, high=9),
    ParameterSpec(name="rho", zones=["block"], property="density", start=1800, low=1500, high=2200),
    ParameterSpec(name="pool", property="water_level", start=4.4, low=3, high=6),
]


def measured() -> list:
    """A toe, a crest, a marker, a profile, and two readings of the history."""
    profile = SurfaceProfile(
        type="surface_profile", name="surface", file="surface.csv", std_m=0.5, **SAID
    )
    profile.attach(Profile(np.array([3.0, 6.0, 9.0]), np.array([4.0, 3.5, 3.0]), ["all"] * 3))
    return [
        ToeRunout(type="toe_runout", name="toe", side="left", value_m=1.0, std_m=0.3, **SAID),
        CrestSettlement(
            type="crest_settlement", name="crest", at="crest_points", value_m=1.0, std_m=0.3, **SAID
        ),
        MarkerDisplacement(
            type="marker_displacement", name="marker", x_m=10, y_m=6, dx_m=0.1, dy_m=-0.2,
            std_m=0.2, **SAID,
        ),
        profile,
        ToeHistory(
            type="toe_history", name="way", side="left", times_s=[0.3, 0.5], values_m=[0.1, 0.2],
            std_m=0.3, held_out=True, **SAID,
        ),
        Velocity(
            type="velocity", name="speed", x_m=10, at_s=0.5, value_m_per_s=1, std_m_per_s=0.2,
            **SAID,
        ),
    ]  # fmt: skip


def setup(specs: list[ParameterSpec] = SPECS, *, duration_s: float = 0.9, **more) -> SectionSetup:
    """The question; eight frames."""
    scene = small_scene()
    settings = SimulationSettings(
        duration_s=duration_s, early_stop=False, **{"water": "buoyant", **more}
    )
    targets = make_targets(measured(), fit=None, loss="misfit", source="test")
    foot = {side: scene.foot(side) for side in ("left", "right")}
    return SectionSetup(scene, settings, Parameters(list(specs)), targets, foot)


def simulator(dtype: torch.dtype = torch.float64, **changes) -> Simulator:
    """Random weights that move points by a few hundredths of a spacing a frame."""
    torch.manual_seed(3)
    config = {
        "width": 8, "message_passing_steps": 2, "cutoff": "smooth", "frame_interval": INTERVAL,
        "velocity_std": (0.5, 0.5), "acceleration_mean": (-0.02, -0.05),
        "acceleration_std": (0.3, 0.3), **changes,
    }  # fmt: skip
    return Simulator(SimulatorConfig(**config)).to(dtype)


def model(dtype: torch.dtype = torch.float64, **changes) -> TrainedModel:
    """The same as a model of the back-analysis."""
    return TrainedModel(simulator(dtype, **changes), "untrained", "0" * 64)


# -- a block of liquefied soil, and a simulator that was taught to slide it -----------------------

BLOCK = {
    "name": "block",
    "domain": {
        "x_min": -100.0,
        "x_max": 100.0,
        "y_max": 50.0,
        "walls": "open",
        "left": "free",
        "right": "free",
    },
    "ground": {"points": [[-100.0, 0.0], [100.0, 0.0]]},
    "zones": [
        {
            "name": "soil",
            "polygon": [[0.0, 0.0], [12.0, 0.0], [12.0, 5.0], [0.0, 5.0]],
            "material": "soil",
        }
    ],
    "materials": {"soil": {"friction_deg": 0.0, "cohesion_kpa": 9.0, "liquefied": True}},
    "spacing": 1.0,
}
SURVEY = {
    "case": "block",
    "upstream": "left",
    "initial": {"toe_left_x_m": 0.0},
    "default_set": "field",
    "sets": {
        "field": [
            {"name": "toe", "type": "toe_runout", "side": "left", "value_m": 7.0, "std_m": 0.5}
            | SAID,
            {"name": "marker", "type": "marker_displacement", "x_m": 4.0, "y_m": 2.0,
             "dx_m": -3.0, "std_m": 1.0} | SAID,
        ]
    },
}  # fmt: skip
ASKED = {
    "parameters": [
        {"name": "S_r", "zones": ["soil"], "property": "residual_strength_kpa",
         "start": 12.0, "low": 6.0, "high": 15.0},
    ],
    "loss": "runout",
    "duration_s": 6.0,
}  # fmt: skip


def write_case(folder: Path, **more) -> Path:
    """The case folder of the block; `more` are keys of its question."""
    folder.mkdir(parents=True)
    documents = {"scene": BLOCK, "measurements": SURVEY, "inversion": {**ASKED, **more}}
    for name, document in documents.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(document))
    return folder


def taught(case: Path, steps: int = 150) -> Simulator:
    """A simulator that slides the block to the left, the faster the weaker it is.

    It stands in for a trained one: it has learned a law made up here, not what soil does.
    """
    facts, positions = start_of(
        load_scene(case / "scene.yaml"),
        SimulationSettings(frame_interval=INTERVAL, water="buoyant"),
    )
    model = simulator(
        torch.float32, acceleration_mean=(0.0, 0.0), acceleration_std=(0.2, 0.2), width=16
    )
    base = model.scaled(facts)
    soil = ~base.kinematic
    place = base.to_spacings(positions)
    graph = model.graph(place)
    back = INTERVAL * torch.arange(5, -1, -1)[:, None, None]
    optimiser = torch.optim.Adam(model.parameters(), lr=5e-3)
    draw = torch.Generator().manual_seed(0)
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = 5e-3 * (1.0 - step / steps)
        windows, scenes, wanted = [], [], []
        for cohesion in 5e3 * 4.0 ** torch.rand(6, generator=draw):
            goal = torch.tensor([-0.6, 0.0]) * (6e3 / cohesion) ** 1.7
            velocity = goal * 1.5 * torch.rand(1, generator=draw)
            velocity = velocity + 0.05 * torch.randn(place.shape, generator=draw)
            windows.append(place - back * velocity)
            scenes.append(base.with_strength(soil, cohesion_pa=cohesion))
            wanted.append((goal - velocity) / 1.5 / model.acceleration_std)
        output = model(windows, scenes, [graph] * len(windows))
        loss = (output - torch.cat(wanted)).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return model
