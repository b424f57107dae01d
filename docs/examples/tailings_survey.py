"""What a survey would find after the tailings dam of `tailings_valley.py` has slid: a twin.

    python docs/examples/tailings_valley.py tailings      # first
    python docs/examples/tailings_survey.py tailings      # one simulation, then writes what follows
    flowslide invert tailings

The dam slides with 2.5 kPa in its slimes, on points that lie elsewhere than those of the
back-analysis. The surface after it is surveyed with errors of 0.3 m, the volume beyond the road and
the runout along the valley are kept to check the answer. `inversion.yaml` asks for the strength
that it is not told.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from geometry.scenes3d.scene3d import load_scene_3d
from geometry.terrain.raster import Raster, write_raster
from inversion.engines.body_engine import BodyStore
from inversion.engines.body_setup import BodySetup
from inversion.estimation.data import Targets
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import load_question
from pipeline.config import load_config
from pipeline.files import write_text, yaml_text

TRUE_KPA, SEED, ERROR_M = 2.5, 7, 0.3
SURVEYED = [[100.0, 20.0], [480.0, 20.0], [480.0, 220.0], [100.0, 220.0]]
QUESTION = {
    "parameters": [
        {
            "name": "residual_strength", "label": "S_r of the slimes", "zones": ["slimes"],
            "property": "residual_strength_kpa", "start": 4.0, "low": 1.0, "high": 10.0,
        }
    ],
    "loss": "misfit",
}  # fmt: skip


def write_survey(folder: Path) -> None:
    """Simulate the slide, and write `after.tif`, `measurements3d.yaml` and `inversion.yaml`."""
    write_text(folder / "inversion.yaml", yaml_text(QUESTION))
    scene = load_scene_3d(folder)
    parameters = Parameters(load_question(folder, scene.soil).parameters)
    settings = load_config(None).simulation.model_copy(
        update={"duration_s": scene.document.duration_s}
    )
    nothing = Targets([], [], np.zeros(0), np.zeros((0, 0)), [])
    setup = BodySetup(scene, settings, parameters, nothing, jitter=0.5, jitter_seed=SEED)
    values = np.array([TRUE_KPA])
    kept = BodyStore(folder / "truth").fetch(setup, values)
    deposit = setup.deposit_map(values, kept)
    (x, y), pixel = deposit.before.axes, deposit.before.spacing
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    surface = deposit.surface_at(places).reshape(len(x), len(y))
    errors = ERROR_M * np.random.default_rng(SEED).standard_normal(surface.shape)
    write_raster(Raster(deposit.before.origin, pixel, surface + errors), folder / "after.tif")
    trusted = {"confidence": "assumed", "source": "simulated with the strength to be found"}
    entries = [
        {
            "name": "surface", "type": "surface_after", "file": "after.tif", "every_m": 20.0,
            "std_m": ERROR_M, "correlation_length_m": 20.0, "plan": SURVEYED,
        },
        {
            "name": "road", "type": "crossed_volume", "line": "road", "std_m3": 3000.0,
            "value_m3": round(kept.readings["volume_across_road_m3"]), "held_out": True,
        },
        {
            "name": "valley", "type": "path_runout", "path": "valley", "std_m": 5.0,
            "value_m": round(kept.readings["runout_valley_m"], 1), "held_out": True,
        },
    ]  # fmt: skip
    survey = [{**one, **trusted} for one in entries]
    document = {"case": scene.name, "default_set": "survey", "sets": {"survey": survey}}
    write_text(folder / "measurements3d.yaml", yaml_text(document))


if __name__ == "__main__":
    write_survey(Path(sys.argv[1]))
