"""Newton as a source of truth: a block that slides, water, and a slide next to the judge's own."""

import os

import numpy as np
import pytest

from benchmarks.hidden_effects.foreign import newton_mpm
from benchmarks.hidden_effects.foreign.hidden import THINGS, Hidden
from benchmarks.hidden_effects.foreign.loading import Loading
from benchmarks.hidden_effects.foreign.slide import SOURCES, source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.sections import load_section
from geometry.scenes.scene import scene_from_mapping
from pipeline.cli import InputError

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(SOURCES["newton"].missing) and not os.environ.get("CI"),
        reason=SOURCES["newton"].missing,
    ),
    pytest.mark.long,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
SECTION = load_section("benchmarks/hidden_effects/sections/embankment")


def _block(cohesion_kpa):
    return scene_from_mapping({
        "name": "block",
        "domain": {"x_min": 0.0, "x_max": 200.0, "y_max": 60.0, "walls": "open"},
        "ground": {"points": [[0.0, 0.0], [200.0, 0.0]], "contact": "rough"},
        "zones": [{"name": "block", "material": "soil",
                   "polygon": [[20.0, 0.0], [60.0, 0.0], [60.0, 4.0], [20.0, 4.0]]}],
        "materials": {"soil": {"friction_deg": 0.0, "cohesion_kpa": cohesion_kpa,
                               "density": 2000.0, "liquefied": True}},
        "spacing": 1.0,
    })  # fmt: skip


def test_block_is_held_back_by_the_strength_of_its_base():
    """A block of 4 m that slides loses tau / (rho h) of its speed, without moving in itself."""
    # A strong block on a base of a hundredth of its strength: tau = 10 kPa.
    loading = Loading.of(_block(1000.0), [Hidden("weak_base", 0.99)], seed=1, jitter=0.2)
    slab = newton_mpm._Slab(loading)
    slab.now.particle_qd.numpy()[:, 0] = 5.0
    speeds = []
    for _ in range(16):
        slab._step(0.05)
        speeds.append(slab.velocity[:, 0].mean())
    lost = (speeds[3] - speeds[-1]) / (12 * 0.05)
    # S2's nodes at the base carry three quarters: no code's contact is the continuum's.
    assert 0.65 < lost / (1e4 / (2000.0 * 4.0)) < 1.1
    assert np.ptp(slab.velocity[:, 0]) < 0.1
    assert np.abs(slab.now.particle_q.numpy()[:, 2]).max() == 0.0  # it stays in its plane


def _read(name, hidden, strength=18.0):
    scene = SECTION.parameters.scene(SECTION.scene, np.array([strength, 32.0]))
    scene = scene.changed(spacing=1.4)
    slide = source(name).simulate(scene, hidden, duration_s=20.0, frames=40, seed=3, threads=1)
    return slide, SECTION.scene.foot("left") - surveys.toe_of(SECTION, slide.deposit(scene))


def test_slide_agrees_with_the_judge_and_a_strong_block_shortens_it():
    own, far = _read("own", [])
    slide, way = _read("newton", [])
    assert slide.area_kept > 0.97
    assert way == pytest.approx(far, abs=6.0)
    assert np.isclose(slide.final[:, 1].max(), own.final[:, 1].max(), atol=1.5)
    _, short = _read("newton", [Hidden("strong_block", 4.0, {"from_m": 115.0, "to_m": 135.0})])
    assert short < way - 2.0


def test_what_it_cannot_hide_is_refused():
    assert set(THINGS) - set(newton_mpm.HIDES) == {"sudden"}
    with pytest.raises(InputError, match="newton: cannot hide sudden"):
        _read("newton", [Hidden("sudden", 1.0)])
