"""Optimisers: Adam (paper), or Muon for the matrices inside a network.

Muon makes the momentum of a matrix orthogonal before it is subtracted (Jordan et al. 2024), so that
all its directions are learned alike. In a short training on two cores the same loss was reached in
two thirds of the steps (docs/method/gns.md). Adam still updates vectors, what is no matrix and
narrow matrices (`LEAST_SIDE`: of outputs and of few features).
"""

from __future__ import annotations

from typing import Any

import torch
from torch import nn

LEAST_SIDE = 16
"""Matrices with a shorter side are left to Adam."""


class Optimizers:
    """One or two optimisers that step together.

    Args:
        parameters: of the model.
        rate: learning rate of Adam.
        muon_rate: of Muon; None: Adam updates all.
        decay: of the weights, decoupled from the gradient (Loshchilov and Hutter 2019).
        as_adam: steps of Muon are as large as those of Adam at the same rate (Liu et al. 2025).
    """

    def __init__(
        self,
        parameters: list[nn.Parameter],
        *,
        rate: float,
        muon_rate: float | None = None,
        decay: float = 0.0,
        as_adam: bool = False,
    ) -> None:
        own = [p for p in parameters if muon_rate is not None and _is_inner_matrix(p)]
        chosen = {id(p) for p in own}
        others = [p for p in parameters if id(p) not in chosen]
        self.rates = {"adam": rate}
        self.of: dict[str, torch.optim.Optimizer] = {
            "adam": torch.optim.AdamW(others, lr=rate, weight_decay=decay)
        }
        if own:
            self.rates["muon"] = muon_rate
            self.of["muon"] = torch.optim.Muon(
                own,
                lr=muon_rate,
                weight_decay=decay,
                adjust_lr_fn="match_rms_adamw" if as_adam else "original",
            )

    def set_rate(self, share: float) -> None:
        """Learning rates from now on, as a share of the first."""
        for name, optimizer in self.of.items():
            for group in optimizer.param_groups:
                group["lr"] = share * self.rates[name]

    def zero_grad(self) -> None:
        """Forget the gradients."""
        for optimizer in self.of.values():
            optimizer.zero_grad(set_to_none=True)

    def step(self) -> None:
        """Take a step."""
        for optimizer in self.of.values():
            optimizer.step()

    def state_dict(self) -> dict[str, Any]:
        """State needed to continue."""
        return {name: optimizer.state_dict() for name, optimizer in self.of.items()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from there."""
        for name, optimizer in self.of.items():
            optimizer.load_state_dict(state[name])


def _is_inner_matrix(parameter: nn.Parameter) -> bool:
    return parameter.ndim == 2 and min(parameter.shape) >= LEAST_SIDE
