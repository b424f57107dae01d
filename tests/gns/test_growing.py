"""A model that gets further inputs: what it knew stays, and the new ones are learned."""

from __future__ import annotations

import pytest
import torch

from gns.data.scene_facts import first_window, start_of
from gns.network.growing import GROWS, WEIGHTS, grown
from gns.network.simulator import SimulatorConfig, feature_names
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene

BUOYANT = SimulationSettings(water="buoyant")
FIXED = SimulationSettings(water_face="fixed")
MORE = SimulatorConfig(thrust=True, density=True, stiffness=True)


@pytest.mark.parametrize("overburden", [False, True])
def test_a_grown_model_gives_the_same_numbers(overburden):
    old = simulator(overburden=overburden)
    new = grown(old, MORE)
    facts, start = start_of(small_scene(), BUOYANT)
    window = old.scaled(facts).to_spacings(first_window(start, facts))
    with torch.no_grad():
        before, after = (one.advance(window, one.scaled(facts)) for one in (old, new))
    torch.testing.assert_close(after, before)
    assert all(getattr(new.config, name) for name in GROWS)
    assert not any(getattr(old.config, name) for name in GROWS), "the model itself stays as it is"


def test_new_inputs_are_learned():
    new = grown(simulator(), MORE)
    facts, start = start_of(small_scene(), FIXED)
    window = new.scaled(facts).to_spacings(first_window(start, facts))
    new([window], [new.scaled(facts)]).square().sum().backward()
    slopes = dict(new.named_parameters())[WEIGHTS].grad
    for name in GROWS:
        assert slopes[:, feature_names(new.config).index(name)].abs().max() > 0


def test_what_a_model_knows_it_keeps():
    knows = simulator(thrust=True)
    same = grown(knows, SimulatorConfig())
    assert same.config == knows.config
    for name, value in knows.state_dict().items():
        assert torch.equal(same.state_dict()[name], value)
