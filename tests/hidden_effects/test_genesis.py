"""Genesis as a source of truth: a block that slides, and a slide next to the judge's own."""

import numpy as np
import pytest

from benchmarks.hidden_effects.foreign import genesis_mpm
from benchmarks.hidden_effects.foreign.hidden import Hidden
from benchmarks.hidden_effects.foreign.loading import Loading
from benchmarks.hidden_effects.foreign.slide import SOURCES, source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.sections import load_section
from geometry.scenes.scene import scene_from_mapping

# Genesis compiles for one to three minutes before the first step; a slide takes two to five more.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(SOURCES["genesis"].missing), reason=SOURCES["genesis"].missing),
]
SECTION = load_section("benchmarks/hidden_effects/sections/embankment")


def test_block_is_held_back_by_the_strength_of_its_base():
    """A block of 4 m that slides loses tau / (rho h) of its speed, and nothing on smooth ground."""
    scene = scene_from_mapping({
        "name": "block",
        "domain": {"x_min": 0.0, "x_max": 200.0, "y_max": 60.0, "walls": "open"},
        "ground": {"points": [[0.0, 0.0], [200.0, 0.0]], "contact": "rough"},
        "zones": [{"name": "block", "material": "soil",
                   "polygon": [[20.0, 0.0], [60.0, 0.0], [60.0, 4.0], [20.0, 4.0]]}],
        "materials": {"soil": {"friction_deg": 0.0, "cohesion_kpa": 1000.0, "density": 2000.0,
                               "liquefied": True}},
        "spacing": 1.0,
    })  # fmt: skip
    # A strong block on a base of a hundredth of its strength: tau = 10 kPa.
    loading = Loading.of(scene, [Hidden("weak_base", 0.99)], seed=1, jitter=0.2)
    with genesis_mpm._Body(loading, 0.5) as body:
        strength, still = np.full(len(body.position), 1e6), np.zeros_like(body.position)
        smooth, rough = np.zeros(len(body.nodes)), body._base(strength, still)
        body._order(1, strength, smooth, still + [5.0 / body.step, 0.0], 1.0)
        body._order(50, strength, smooth, still, 1.0)
        # It swings under its own weight, but nothing holds all of it.
        assert body.velocity[:, 0].mean() == pytest.approx(5.0, abs=1e-2)
        body._order(20, strength, rough, still, 1.0)
        before = body.velocity[:, 0].mean()
        body._order(50, strength, rough, still, 1.0)
        lost = (before - body.velocity[:, 0].mean()) / (50 * body.step)
        # The nodes above the line carry some of it and move faster than the soil on it.
        assert 0.9 < lost / (1e4 / (2000.0 * 4.0)) < 1.25


def _read(name, hidden):
    ground = SECTION.scene.ground.model_dump() | {"contact": "rough"}
    scene = SECTION.parameters.scene(SECTION.scene, np.array([18.0, 32.0]))
    scene = scene.changed(spacing=1.4, ground=ground)
    slide = source(name).simulate(scene, hidden, duration_s=20.0, frames=40, seed=3, threads=1)
    return slide, SECTION.scene.foot("left") - surveys.toe_of(SECTION, slide.deposit(scene))


def test_slide_agrees_with_the_judge_and_a_strong_block_shortens_it():
    own, far = _read("own", [])
    slide, way = _read("genesis", [])
    assert slide.area_kept > 0.97
    assert way == pytest.approx(far, rel=0.12)
    assert np.isclose(slide.final[:, 1].max(), own.final[:, 1].max(), atol=1.5)
    _, short = _read("genesis", [Hidden("strong_block", 4.0, {"from_m": 115.0, "to_m": 135.0})])
    assert short < way - 2.0
