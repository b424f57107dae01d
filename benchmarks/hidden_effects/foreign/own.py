"""The judge's own solver as a source: what its effects and scenes can hide; to compare codes with.

Its slides come by other cells and another time step than the judge's, as in the other sets.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.foreign.hidden import Hidden, liquefied_extent, outward
from benchmarks.hidden_effects.foreign.loading import Loading
from benchmarks.hidden_effects.foreign.slide import Slide
from geometry.scenes.scene import Scene
from mpm_taichi.effects import load_effects_file
from pipeline.cli import InputError, WorkFailed
from pipeline.config import SimulationSettings

COURANT = 0.2

#: Effects that no diagnosis knows.
_STRANGERS = Path(__file__).parents[1] / "outside_effects.py"


def _block(scene: Scene, one: Hidden) -> dict[str, dict[str, float]]:
    begin, end = one.numbers["from_m"], one.numbers["to_m"]
    return {"strength_contrast": {
        "amplitude": float(np.log(one.amplitude)), "x_m": 0.5 * (begin + end),
        "half_width_m": 0.5 * (end - begin), "edge": 0.01,
    }}  # fmt: skip


def _spreads(scene: Scene, one: Hidden) -> dict[str, dict[str, float]]:
    """Its amplitude is the time in which the front passes the liquefied soil."""
    first, last = liquefied_extent(scene)
    _, sign = outward(scene)
    return {"spreading_liquefaction": {
        "amplitude": one.amplitude / (last - first), "from_x_m": last if sign > 0.0 else first,
        "front_length_m": 0.01, "peak_ratio": 1.0 + one.numbers["excess"],
    }}  # fmt: skip


#: Thing -> effects of the solver that are the same, for a scene.
_EFFECTS: dict[str, Callable[[Scene, Hidden], dict[str, dict[str, float]]]] = {
    "viscosity": lambda scene, one: {"bingham": {"amplitude": one.amplitude}},
    "softening": lambda scene, one: {
        "strain_softening": {"amplitude": one.amplitude, "cell_exponent": 0.0, **one.numbers}
    },
    "shaking": lambda scene, one: {"shaking": {"amplitude": one.amplitude, **one.numbers}},
    "spreading_liquefaction": _spreads,
    "strong_block": _block,
    "weak_block": _block,
    "depth": lambda scene, one: {"overburden_strength": {"amplitude": one.amplitude}},
    "two_layers": lambda scene, one: {"two_layers": {"amplitude": one.amplitude}},
    "weak_base": lambda scene, one: {"weak_base": {"amplitude": one.amplitude}},
    "draining": lambda scene, one: {"reconsolidation": {"amplitude": one.amplitude}},
    "obstacles": lambda scene, one: {"obstacles": {"amplitude": one.amplitude}},
    "regaining": lambda scene, one: {"strength_in_time": {"amplitude": one.amplitude}},
    "foreland_drag": lambda scene, one: {"rough_foreland": {"amplitude": one.amplitude}},
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
    load_effects_file(_STRANGERS)
    effects: dict[str, dict[str, float]] = {}
    for one in hidden:
        if one.name in _EFFECTS:
            effects |= _EFFECTS[one.name](loading.scene, one)
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
