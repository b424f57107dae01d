"""Numbers of scenes with effects, which must not change while their run keys stay.

As `test_golden`, for each effect of the library at the middle of its ladder. After a wanted change
raise the `version` of that effect, or where several change through their shared kernels
`effects.registry.KERNELS_VERSION`, and record again:

    PYTHONPATH=. python tests/mpm_taichi/test_golden_effects.py
"""

import hashlib
import json
from pathlib import Path

import numpy as np

from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.effects import effects
from mpm_taichi.effects.registry import KERNELS_VERSION
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.test_effects import slump
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
            "version": one.version,
            "sha256": hashlib.sha256(bits).hexdigest(),
            "mean_displacement_m": np.abs(run.positions[-1] - run.positions[0])
            .mean(axis=0)
            .tolist(),
        }
    return {
        "versions": [PHYSICS_VERSION, KERNELS_VERSION],
        "processor": processor(),
        "effects": found,
    }


def test_numbers_are_those_of_the_versions():
    recorded, now = json.loads(RECORD.read_text()), present()
    assert recorded["versions"] == now["versions"], "record again, see the docstring"
    assert list(recorded["effects"]) == list(now["effects"]), "record again, see the docstring"
    for name, old in recorded["effects"].items():
        new = now["effects"][name]
        assert old["version"] == new["version"], f"{name}: record again, see the docstring"
        assert np.allclose(
            old["mean_displacement_m"], new["mean_displacement_m"], rtol=0, atol=1e-3
        ), f"{name}: results changed: raise its version and record again"
        if recorded["processor"] == now["processor"]:
            assert old["sha256"] == new["sha256"], f"{name}: bits changed: raise its version"


if __name__ == "__main__":
    RECORD.write_text(json.dumps(present(), indent=1) + "\n")
