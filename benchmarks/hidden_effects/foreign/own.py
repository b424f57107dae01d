"""The judge's own solver as a source: what its effects and scenes can hide; to compare codes with.

Its slides come by other cells and another time step than the judge's, as in the other sets.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout

import numpy as np

from benchmarks.hidden_effects.foreign.hidden import Hidden
from benchmarks.hidden_effects.foreign.loading import Loading
from benchmarks.hidden_effects.foreign.slide import Slide
from geometry.scenes.scene import Scene
from pipeline.cli import InputError, WorkFailed
from pipeline.config import SimulationSettings

COURANT = 0.2

#: Thing -> effects of the solver that are the same.
_EFFECTS: dict[str, Callable[[Hidden], dict[str, dict[str, float]]]] = {
    "viscosity": lambda one: {"bingham": {"amplitude": one.amplitude}},
    "softening": lambda one: {
        "strain_softening": {"amplitude": one.amplitude, "cell_exponent": 0.0, **one.numbers}
    },
    "shaking": lambda one: {"shaking": {"amplitude": one.amplitude, **one.numbers}},
    "depth": lambda one: {"overburden_strength": {"amplitude": one.amplitude}},
    "weak_base": lambda one: {"weak_base": {"amplitude": one.amplitude}},
}
_SCENES = ("pool", "soil_strength", "soil_density", "bump", "foreland", "boundary")
HIDES = (*_EFFECTS, *_SCENES, "sudden", "datum", "tilt")


def simulate(
    scene: Scene, hidden: Sequence[Hidden], *, duration_s: float, frames: int, seed: int,
    threads: int | None = None,
) -> Slide:  # fmt: skip
    """See `slide.Simulate`."""
    from mpm_taichi.simulate import simulate as run_of

    for one in hidden:
        if one.name not in HIDES:
            raise InputError(f"own: cannot hide {one.name}; it can hide {', '.join(HIDES)}")
    loading = Loading.of(scene, hidden, seed=seed)
    effects: dict[str, dict[str, float]] = {}
    for one in hidden:
        if one.name in _EFFECTS:
            effects |= _EFFECTS[one.name](one)
    settings = SimulationSettings(
        duration_s=duration_s,
        frame_interval=duration_s / frames / np.sqrt(scene.spacing / loading.gravity),
        courant=COURANT,
        initial_stress="settled" if loading.settled else "gravity_on",
        water="buoyant",
    )
    true = loading.scene.changed(effects=effects)
    # Taichi reports its start on the standard output, where results alone belong.
    with redirect_stdout(sys.stderr):
        (run,) = run_of([true], settings, threads=threads)
    if run.status == "failed":
        raise WorkFailed(f"own: {run.reason}")
    return Slide(true, run.zone, run.positions.astype(float), run.time, run.came_to_rest)
