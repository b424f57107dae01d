"""A model that gets further inputs or grids: what it knew stays, and what is new is learned."""

from __future__ import annotations

import pytest
import torch

from gns.data.scene_facts import first_window, start_of
from gns.network.growing import GROWS, INPUTS, WEIGHTS, grown
from gns.network.simulator import SimulatorConfig, feature_names
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene

BUOYANT = SimulationSettings(water="buoyant")
FIXED = SimulationSettings(water_face="fixed")
MORE = SimulatorConfig(thrust=True, density=True, stiffness=True)
GRIDS = SimulatorConfig(grid_everywhere=True)


@pytest.mark.parametrize("overburden", [False, True])
def test_a_grown_model_gives_the_same_numbers(overburden):
    old = simulator(overburden=overburden)
    new = grown(old, MORE)
    facts, start = start_of(small_scene(), BUOYANT)
    window = old.scaled(facts).to_spacings(first_window(start, facts))
    with torch.no_grad():
        before, after = (one.advance(window, one.scaled(facts)) for one in (old, new))
    torch.testing.assert_close(after, before)
    assert all(getattr(new.config, name) for name in INPUTS)
    assert not any(getattr(old.config, name) for name in GROWS), "the model itself stays as it is"


def test_new_inputs_are_learned():
    new = grown(simulator(), MORE)
    facts, start = start_of(small_scene(), FIXED)
    window = new.scaled(facts).to_spacings(first_window(start, facts))
    new([window], [new.scaled(facts)]).square().sum().backward()
    slopes = dict(new.named_parameters())[WEIGHTS].grad
    for name in INPUTS:
        assert slopes[:, feature_names(new.config).index(name)].abs().max() > 0


def test_what_a_model_knows_it_keeps():
    knows = simulator(thrust=True)
    same = grown(knows, SimulatorConfig())
    assert same.config == knows.config
    for name, value in knows.state_dict().items():
        assert torch.equal(same.state_dict()[name], value)


def test_new_grids_say_nothing_at_first_and_are_learned():
    """Both those between the other steps and what they add; the grid halfway stays."""
    old = simulator(message_passing_steps=4, grid_cell=4.0)
    new = grown(old, GRIDS)
    assert sorted(new.network.more_grids) == ["2", "4"]
    facts, start = start_of(small_scene(), BUOYANT)
    window = old.scaled(facts).to_spacings(first_window(start, facts))
    with torch.no_grad():
        before, after = (one.advance(window, one.scaled(facts)) for one in (old, new))
    torch.testing.assert_close(after, before)
    new([window], [new.scaled(facts)]).square().sum().backward()
    for grid in new.network.more_grids.values():
        assert grid.norm.weight.grad.abs().max() > 0
    halfway = new.network.grid.state_dict()
    assert all(
        torch.equal(halfway[name], value) for name, value in old.network.grid.state_dict().items()
    )


@pytest.mark.parametrize(
    ("own", "wanted", "line"),
    [
        ({}, {"grid_everywhere": True}, "has no grid"),
        ({"acceleration_mean": (0.1, 0.0)}, {"symmetric": True}, "knows one side"),
    ],
)
def test_what_a_model_cannot_get_is_refused(own, wanted, line):
    with pytest.raises(InputError, match=line):
        grown(simulator(**own), SimulatorConfig(**wanted))
