"""Material point method: scenes in, trajectories out (paper, section on the data generation).

In: scene documents (`geometry.scene.Scene`) and `pipeline.config.SimulationSettings`.
Out: `trajectory.Run` objects and `batch_BBB.h5` files, pictures, animations and exports of them.

Nothing heavy is imported here: Taichi starts only when `mpm_taichi.simulate` is used.
"""

from __future__ import annotations

PHYSICS_VERSION = 1
"""Raised whenever the same scene and settings give other numbers; part of every cache key."""
