"""Numbers of scenes with effects, which must not change while their run keys stay.

As `test_golden`, for each effect of the library at the middle of its ladder. After a wanted change
raise `mpm_taichi.effects.PHYSICS_VERSION` and record again:

    PYTHONPATH=. python tests/mpm_taichi/test_golden_effects.py
"""

import hashlib
import json
from pathlib import Path

import numpy as np

import mpm_taichi
from mpm_taichi.effects import PHYSICS_VERSION, effects
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.test_golden import processor

RECORD = Path(__file__).with_name("golden_effects.json")


def present() -> dict:
    """What every effect gives now."""
    library = list(effects().values())
    scenes = [slump({one.name: one.amplitude.ladder[1]}) for one in library]
    runs = simulate(scenes, SimulationSettings(duration_s=2.0, early_stop=False), threads=1)
    found = {}
    for one, run in zip(library, runs, strict=True):
        assert run.status == "finished", run.reason
        bits = run.positions.tobytes() + run.stress.tobytes()
        found[one.name] = {
            "sha256": hashlib.sha256(bits).hexdigest(),
            "mean_displacement_m": np.abs(run.positions[-1] - run.positions[0])
            .mean(axis=0)
            .tolist(),
        }
    return {
        "versions": [mpm_taichi.PHYSICS_VERSION, PHYSICS_VERSION],
        "processor": processor(),
        "effects": found,
    }


def test_numbers_are_those_of_the_versions():
    recorded, now = json.loads(RECORD.read_text()), present()
    assert recorded["versions"] == now["versions"], "record again, see the docstring"
    assert list(recorded["effects"]) == list(now["effects"]), "record again, see the docstring"
    for name, old in recorded["effects"].items():
        new = now["effects"][name]
        assert np.allclose(
            old["mean_displacement_m"], new["mean_displacement_m"], rtol=0, atol=1e-3
        ), f"{name}: results changed and record again"
        if recorded["processor"] == now["processor"]:
            assert old["sha256"] == new["sha256"], f"{name}: bits changed"


if __name__ == "__main__":
    RECORD.write_text(json.dumps(present(), indent=1) + "\n")
