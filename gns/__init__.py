"""The learned simulator: a graph network that has seen the factory's runs (paper, Diff-GNS).

In: trajectory files of `mpm_taichi`. Out: packed data (`pack`), a trained model with its card
(`train`, `evaluate`), and rollouts of scenes that nobody simulated (`rollout`), which can be
differentiated with respect to every material parameter.

Nothing heavy is imported here: torch starts only when a module that computes with it is used.
"""

from __future__ import annotations

PHYSICS_VERSION = 2
"""Raised whenever the same trajectories give other packed numbers or the same model and scene
another rollout; part of every cache key."""
