"""Numbers that must not change without a new PHYSICS_VERSION.

A run of three drawn scenes is compared with what is recorded in `golden.json`: to the bit on every
processor of the architecture that recorded it, whatever vector instructions it has (sums are formed
in the order in which they are written, without fused products), to a millimetre elsewhere. After a
wanted change of the physics raise `mpm_taichi.PHYSICS_VERSION`, run

    PYTHONPATH=. python tests/mpm_taichi/test_golden.py
"""

import hashlib
import json
import platform
from pathlib import Path

import numpy as np

from geometry.random_scenes.templates import draw_scene
from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.simulate import simulate
from pipeline.config import load_config

RECORD = Path(__file__).with_name("golden.json")
INDICES = (0, 4, 7)
SECONDS = 1.5


def processor() -> str:
    """Architecture, and the instructions by which the C library's functions differ."""
    flags: set[str] = set()
    info = Path("/proc/cpuinfo")
    if info.exists():
        line = next((s for s in info.read_text().splitlines() if s.startswith("flags")), "")
        flags = {"fma", "avx2", "avx512f", "avx512_bf16"} & set(line.split())
    return " ".join([platform.machine(), *sorted(flags)])


def present() -> dict:
    """What the three scenes give now."""
    size = "scales.coarse."  # as it was when the record was made
    config = load_config(None, [f"{size}material_ranges=large", f"{size}enlarged_share=0"])
    scenes = [draw_scene(config, "coarse", index) for index in INDICES]
    settings = config.simulation_for("coarse").model_copy(update={"duration_s": SECONDS})
    digest = hashlib.sha256()
    means = []
    for run in simulate(scenes, settings, threads=1):
        assert run.status == "finished", run.reason
        digest.update(run.positions.tobytes())
        digest.update(run.stress.tobytes())
        means.append(np.abs(run.positions[-1] - run.positions[0]).mean(axis=0).tolist())
    return {
        "physics_version": PHYSICS_VERSION,
        "processor": processor(),
        "sha256": digest.hexdigest(),
        "mean_displacement_m": means,
    }


def test_numbers_are_those_of_this_physics_version():
    recorded, now = json.loads(RECORD.read_text()), present()
    assert recorded["physics_version"] == PHYSICS_VERSION, "record again, see the docstring"
    assert np.allclose(
        recorded["mean_displacement_m"], now["mean_displacement_m"], rtol=0, atol=1e-3
    ), "results changed: raise PHYSICS_VERSION and record again"
    if recorded["processor"].split()[0] == now["processor"].split()[0]:
        assert recorded["sha256"] == now["sha256"], "bits changed: raise PHYSICS_VERSION"


if __name__ == "__main__":
    RECORD.write_text(json.dumps(present(), indent=2) + "\n")
