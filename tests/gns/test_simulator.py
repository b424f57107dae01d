"""A step of the simulator, its files, and what it says of scenes it does not know."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gns.data.ranges import scene_ranges
from gns.data.scene_facts import first_window, start_of
from gns.network.simulator import Simulator, SimulatorConfig, kept_inside
from gns.network.units import scaled
from gns.training.noise import random_walk
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene, start


@pytest.fixture(scope="module")
def facts_and_start():
    return start()


def with_output(model: Simulator, value: tuple[float, float]) -> Simulator:
    """The same model whose network answers one value everywhere."""
    last = model.network.decoder.third
    last.weight.data.zero_()
    last.bias.data = torch.tensor(value).to(last.bias)
    return model


def test_a_step_is_the_formula(facts_and_start):
    """x(t + 1) = 2 x(t) - x(t - 1) + g a frame_time^2, for soil away from the ground."""
    facts, positions = facts_and_start
    window = first_window(positions, facts)
    model = with_output(simulator(torch.float64), (0.5, -2.0))
    after = model.step(window, facts)
    acceleration = (np.array([0.5, -2.0]) * 0.1 + [0.0, -0.05]) * 9.81
    expected = 2.0 * window[-1] - window[-2] + acceleration * facts.frame_time**2
    free = (facts.type == 0) & (positions[:, 1] > 4.0)
    assert np.allclose(after[free], expected[free], atol=1e-5)


def test_kinematic_points_stay_and_soil_stays_inside(facts_and_start):
    facts, positions = facts_and_start
    window = first_window(positions, facts)
    for output in ((-300.0, -900.0), (400.0, 900.0)):
        model = with_output(simulator(), output)
        after = model.step(window, facts)
        post = facts.type == 1
        assert post.any() and np.allclose(after[post], positions[post], atol=1e-5)
        # The ground is uneven: points may sink into it by a cell, less a little.
        depth = facts.ground_height(after[:, 0]) - after[:, 1]
        assert depth.max() <= 0.975 * 2.0 + 1e-5 and (output[1] > 0 or depth.max() > 1.9)
        assert after[:, 0].min() >= -1e-5 and after[:, 0].max() <= 30.0 + 1e-5
        assert after[:, 1].max() <= 20.0 + 1e-5


def test_an_open_domain_has_a_floor_alone():
    facts, _ = start(walls="open")
    scene = scaled(facts, dtype=torch.float64)
    there = torch.tensor([[-900.0, 5.0], [900.0, 1e4], [0.0, -3.0]], dtype=torch.float64)
    kept = kept_inside(there, scene)
    assert torch.equal(kept[:2], there[:2]) and kept[2, 1].item() == pytest.approx(
        1.75 - 0.975 * 2.0
    )
    level = dataclasses.replace(scene, ground=scene.ground * scene.ground.new_tensor([1.0, 0.0]))
    assert kept_inside(there, level)[2, 1] == 0.0


def test_several_windows_are_several_steps(facts_and_start):
    facts, positions = facts_and_start
    model = simulator()
    first = first_window(positions, facts)
    second = first + np.float32([0.3, 0.2])
    both = model.step(np.stack([first, second])[None], facts)
    assert both.shape == (1, 2, len(positions), 2)
    assert np.array_equal(both[0, 0], model.step(first, facts))
    assert np.array_equal(both[0, 1], model.step(second, facts))


def test_scenes_of_a_batch_do_not_feel_each_other():
    model = simulator(torch.float64)
    scenes, windows = [], []
    for changes in ({}, {"spacing": 0.5}, {"water": None}):
        facts, positions = start(**changes)
        scenes.append(model.scaled(facts))
        windows.append(scenes[-1].to_spacings(first_window(positions, facts)))
    together = model(windows, scenes)
    alone = [model([one], [two]) for one, two in zip(windows, scenes, strict=True)]
    assert torch.allclose(together, torch.cat(alone), rtol=1e-12, atol=1e-13)


def test_strength_and_water_are_seen(facts_and_start):
    """Every property given to the model changes its prediction."""
    facts, positions = facts_and_start
    model = simulator(torch.float64)
    scene = model.scaled(facts)
    window = scene.to_spacings(first_window(positions, facts))
    soil = ~scene.kinematic
    base = model([window], [scene])
    for other in (
        scene.with_strength(soil, cohesion_pa=3e3),
        scene.with_strength(soil, tan_friction=0.9),
        scene.with_water_raised(1.0),
        dataclasses.replace(scene, ground=scene.ground + scene.ground.new_tensor([0.0, 0.2])),
    ):
        assert not torch.allclose(model([window], [other]), base, rtol=1e-6)


def test_the_target_leads_to_the_next_positions_whatever_the_noise(facts_and_start):
    facts, positions = facts_and_start
    model = simulator(torch.float64)
    scene = model.scaled(facts)
    window = scene.to_spacings(first_window(positions, facts))
    generator = torch.Generator().manual_seed(4)
    after = window[-1] + 0.05 * torch.rand(window[-1].shape, generator=generator) + 0.2
    after = torch.where(scene.kinematic[:, None], window[-1], after)
    noisy = window + random_walk(6, scene, 0.05, generator)
    target = model.target(noisy[-2], noisy[-1], after, scene)
    reached = model.next_positions(target, noisy[-2], noisy[-1], scene)
    assert torch.allclose(reached, after, atol=1e-12)


def test_noise_is_a_random_walk_in_units_of_velocity(facts_and_start):
    facts, _ = facts_and_start
    scene = scaled(facts)
    generator = torch.Generator().manual_seed(0)
    walks = torch.stack([random_walk(6, scene, 0.02, generator) for _ in range(300)])
    assert walks.shape == (300, 6, scene.points, 2)
    assert torch.all(walks[:, 0] == 0) and torch.all(walks[:, :, scene.kinematic] == 0)
    velocities = walks[:, :, ~scene.kinematic].diff(dim=1) / 0.4
    spread = velocities.square().mean((0, 2, 3)).sqrt()
    expected = 0.02 * (torch.arange(1.0, 6.0) / 5).sqrt()
    assert torch.allclose(spread, expected, rtol=0.03)
    again = random_walk(6, scene, 0.02, torch.Generator().manual_seed(0))
    assert torch.equal(again, walks[0])


def test_files_keep_everything(tmp_path, facts_and_start):
    facts, positions = facts_and_start
    window = first_window(positions, facts)
    model = simulator(cutoff="smooth", strength="linear", ranges={"cohesion": (0.1, 2.0)})
    model.save(tmp_path / "model.pt", step=7)
    again = Simulator.load(tmp_path / "model.pt")
    assert again.config == model.config
    assert np.array_equal(again.step(window, facts), model.step(window, facts))
    document = torch.load(tmp_path / "model.pt", weights_only=True)
    assert document["step"] == 7


def test_wrong_files_are_refused_in_a_line(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Simulator.load(tmp_path / "none.pt")
    (tmp_path / "text.pt").write_text("no model")
    with pytest.raises(InputError, match="damaged or not a model"):
        Simulator.load(tmp_path / "text.pt")
    torch.save({"format_version": 99}, tmp_path / "other.pt")
    with pytest.raises(InputError, match="format"):
        Simulator.load(tmp_path / "other.pt")
    simulator().save(tmp_path / "cut.pt")
    document = torch.load(tmp_path / "cut.pt", weights_only=True)
    document["weights"].popitem()
    torch.save(document, tmp_path / "cut.pt")
    with pytest.raises(InputError, match="not a model of this program"):
        Simulator.load(tmp_path / "cut.pt")
    for weights, words in (
        (None, "weights: is NoneType, not names with tensors"),
        ({**document["weights"], "x": None}, "weights: x is NoneType, not a tensor"),
        ({"x": torch.tensor([1.0, float("nan")])}, "weights: x holds a value that is not finite"),
        ({"x": torch.ones(2)}, "not a model of this program"),
    ):
        torch.save({**document, "weights": weights}, tmp_path / "cut.pt")
        with pytest.raises(InputError, match=words):
            Simulator.load(tmp_path / "cut.pt")
    document["config"] = '{"width": 0}'
    torch.save(document, tmp_path / "cut.pt")
    with pytest.raises(InputError, match="width"):
        Simulator.load(tmp_path / "cut.pt")


def test_another_frame_interval_is_refused(facts_and_start):
    settings = SimulationSettings(frame_interval=0.5, water="buoyant")
    facts, positions = start_of(small_scene(), settings)
    with pytest.raises(InputError, match=r"0\.5; this model steps by 0\.4"):
        simulator().step(first_window(positions, facts), facts)


def test_a_model_says_what_it_has_not_seen(facts_and_start):
    facts, positions = facts_and_start
    seen = scene_ranges(positions, facts)
    model = Simulator(SimulatorConfig(width=4, ranges=seen, contacts=["rough"]))
    assert model.outside(positions, facts) == []
    weak = np.array(facts.properties)
    weak[facts.properties[:, 0] == 0, 1] = 100.0
    other = dataclasses.replace(
        facts, properties=weak, numbers={**facts.numbers, "ground_contact": 2.0, "walls_bonded": 1}
    )
    said = model.outside(positions, other)
    assert len(said) == 3
    assert said[0].startswith("cohesion / (rho g d): 0.00") and "outside" in said[0]
    assert "coulomb" in said[1] and "hold the soil" in said[2]
    assert SimulatorConfig().ranges == {} and simulator().outside(positions, other) == [said[2]]
