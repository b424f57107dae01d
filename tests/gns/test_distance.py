"""The distance of a scene to those that a model has learned from."""

from __future__ import annotations

import numpy as np
import pytest

from gns.data.distance import KnownScenes, Neighbours, described
from gns.data.scene_facts import start_of
from gns.network.simulator import Simulator
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene
from tests.mpm_taichi.ballistic import make_scene

SETTINGS = SimulationSettings(water="buoyant")


def scene(kpa: float):
    one = small_scene()
    return one.with_strength("liquefied", cohesion_kpa=kpa)


def known(*strengths: float) -> KnownScenes:
    return KnownScenes.of([described(*of(scene(kpa))) for kpa in strengths])


def of(one):
    facts, start = start_of(one, SETTINGS)
    return start, facts


def test_what_was_learned_from_is_near_and_other_scenes_are_farther():
    learned = known(10.0, 14.0, 20.0, 28.0, 40.0)
    assert learned.distance(*of(scene(20.0))) == pytest.approx(0.0, abs=1e-9)
    near, far = learned.distance(*of(scene(17.0))), learned.distance(*of(scene(1.0)))
    assert 0.0 < near < 1.0 < far
    assert learned.distance(*of(make_scene(3))) > 1.0, "another section"


def test_what_was_learned_from_before_stays_known():
    first = known(10.0, 14.0, 20.0, 28.0, 40.0)
    near_copies = [described(*of(scene(kpa))) for kpa in (20.0, 20.1, 20.2)]
    both = first.joined(near_copies)
    assert both.distance(*of(scene(40.0))) < 1e-3 and both.holds(*of(scene(10.0)))
    assert len(both.features) == 2 * 7, "20 kPa counts once"
    assert both.distance(*of(scene(24.0))) < 2.0, "three near copies do not make the unit small"
    assert not both.holds(*of(scene(24.0)))


def test_left_and_right_are_alike():
    start, facts = of(scene(20.0))
    one, other = described(start, facts)
    assert one.shape == other.shape and not np.allclose(one, other)
    learned = KnownScenes.of([np.stack([other, one]), np.stack([other + 0.5, one + 0.5])])
    assert learned.distance(start, facts) == pytest.approx(0.0, abs=1e-9)


def test_it_is_kept_with_the_weights(tmp_path):
    model = simulator()
    assert model.distance(*of(scene(20.0))) is None, "a model that does not say"
    model.save(tmp_path / "old.pt")
    assert Simulator.load(tmp_path / "old.pt").known is None
    model.known = known(10.0, 20.0, 40.0)
    model.save(tmp_path / "model.pt")
    again = Simulator.load(tmp_path / "model.pt")
    expected = model.distance(*of(scene(25.0)))
    assert again.distance(*of(scene(25.0))) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("alike", [1, 2])
def test_the_unit_is_what_hardly_any_scene_is_from_its_nearest_other(alike):
    points = np.random.default_rng(0).standard_normal((400, 3))
    points[1::2] = points[::2] + (1e-3 if alike == 2 else 1.0)
    unit = Neighbours(points).unit(alike)
    gaps = np.sqrt(np.mean((points[:, None] - points) ** 2, axis=2))
    scene = np.arange(len(points)) // alike
    away = np.where(scene[:, None] == scene, np.inf, gaps).min(axis=1)
    assert np.mean(away <= unit) == pytest.approx(0.99, abs=0.005)
    assert Neighbours(points).distance(points[0] + 50.0) == pytest.approx(
        np.sqrt(np.mean((points - points[0] - 50.0) ** 2, axis=1)).min()
    )
    assert Neighbours(points[:alike]).unit(alike) == 1.0, "no other scene"
