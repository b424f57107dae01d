"""A model that is given further inputs or grids, so that it can go on learning with them.

In: a trained simulator, and a configuration whose data hold more than it knows (the thrust of
water, densities or stiffnesses that vary), or that wants grids between all its message-passing
steps. Out: a simulator that has them and gives the same numbers: the weights of a new input, and
what a new grid adds to the points, are zero until it learns.
"""

from __future__ import annotations

import torch

from gns.network.simulator import Simulator, SimulatorConfig, feature_names
from pipeline.cli import InputError

INPUTS = ("thrust", "density", "stiffness")
"""Inputs that a model may get later."""
GROWS = (*INPUTS, "grid_everywhere", "symmetric")
"""All that it may get later."""
WEIGHTS = "network.point_encoder.first.weight"
"""Its columns are the inputs of a point."""


def grown(simulator: Simulator, wanted: SimulatorConfig) -> Simulator:
    """A copy that also has what of `GROWS` is wanted.

    Args:
        simulator: stays as it is; otherwise its form and normalisation are kept.
        wanted: says which inputs the data hold and what the settings ask for.

    Raises:
        InputError: it has no grid of which there could be more, or has not learned both sides.
    """
    own = simulator.config
    if wanted.grid_everywhere and own.grid_cell == 0.0:
        raise InputError("grid_everywhere: true; the model learned on from has no grid: only false")
    if wanted.symmetric and own.acceleration_mean[0] != 0.0:
        raise InputError("symmetric: true; the model learned on from knows one side: only false")
    more = {name: getattr(own, name) or getattr(wanted, name) for name in GROWS}
    result = Simulator(own.model_copy(update=more))
    for grid in result.network.more_grids.values():
        torch.nn.init.zeros_(grid.norm.weight)
    weights = {**result.state_dict(), **simulator.state_dict()}
    old, new = weights[WEIGHTS], torch.zeros_like(result.state_dict()[WEIGHTS])
    place = {name: column for column, name in enumerate(feature_names(result.config))}
    new[:, [place[name] for name in feature_names(own)]] = old
    result.load_state_dict({**weights, WEIGHTS: new})
    return result.to(next(simulator.parameters()))
