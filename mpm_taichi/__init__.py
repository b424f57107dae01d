"""Material point method: scenes in, trajectories out (paper, section on the data generation).

In: scene documents (`geometry.scenes.scene.Scene`) and `pipeline.config.SimulationSettings`.
Out: `trajectory.Run` objects and `batch_BBB.h5` files, pictures, animations and exports of them.

Nothing heavy is imported here: Taichi starts only when `mpm_taichi.simulate` is used.
"""

from __future__ import annotations

import os
import warnings

# Said by Python 3.12 and later when it compiles Taichi, which the first run does.
warnings.filterwarnings("ignore", category=SyntaxWarning, module=r".*[/\\]taichi[/\\]")

# Read by Taichi: no greeting, no guesses about an interactive shell, and no question to its makers'
# server, with a number of this machine, whether there is a newer version.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_ENABLE_PYBUF", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")

PHYSICS_VERSION = 7
"""Raised whenever the same scene and settings give other numbers; part of every cache key."""
