"""A small network of rectified layers, trained by Adam (Kingma and Ba 2015)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

#: Of Adam: how long its two means remember, and what keeps it from dividing by nothing.
MEAN, SQUARE, LEAST = 0.9, 0.999, 1e-8
#: A longer slope of a batch is cut to this length.
LONGEST = 5.0


@dataclass
class Network:
    """Layers one after another, all but the last rectified.

    Attributes:
        weights: of each layer, its constant in the last row, (inputs + 1, outputs).
        means: of the slopes so far, and of their squares, for each layer.
        steps: so far.
    """

    weights: list[np.ndarray]
    means: list[list[np.ndarray]] = field(init=False)
    steps: int = 0

    def __post_init__(self) -> None:
        self.means = [[np.zeros_like(one), np.zeros_like(one)] for one in self.weights]

    @classmethod
    def fresh(cls, sizes: Sequence[int], rng: np.random.Generator) -> Network:
        """With random weights (He et al. 2015) and no constants; `sizes`: inputs to outputs."""
        weights = []
        for inputs, outputs in zip(sizes, sizes[1:], strict=False):
            own = rng.standard_normal((inputs, outputs)) * np.sqrt(2.0 / inputs)
            weights.append(np.vstack([own, np.zeros(outputs)]))
        return cls(weights)

    def layers(self, rows: np.ndarray) -> list[np.ndarray]:
        """What goes into each layer (n, inputs), and what comes out of the last (n, outputs)."""
        found = [rows]
        for number, weights in enumerate(self.weights, start=1):
            out = found[-1] @ weights[:-1] + weights[-1]
            found.append(out if number == len(self.weights) else np.maximum(out, 0.0))
        return found

    def slopes(self, layers: Sequence[np.ndarray], slope: np.ndarray) -> list[np.ndarray]:
        """Derivative of a loss by all weights.

        Args:
            layers: of some rows.
            slope: of the loss by what comes out, (n, outputs).
        """
        found = []
        for rows, weights in zip(layers[-2::-1], self.weights[::-1], strict=True):
            found.append(np.vstack([rows.T @ slope, slope.sum(axis=0)]))
            slope = (slope @ weights[:-1].T) * (rows > 0.0)
        return found[::-1]

    def learn(self, layers: Sequence[np.ndarray], slope: np.ndarray, rate: float) -> None:
        """One step; arguments as of `slopes`."""
        self.steps += 1
        slopes = self.slopes(layers, slope)
        cut = min(LONGEST / max(np.sqrt(sum(np.sum(one**2) for one in slopes)), 1e-12), 1.0)
        for weights, own, means in zip(self.weights, slopes, self.means, strict=True):
            for place, (kept, new) in enumerate(((MEAN, own * cut), (SQUARE, (own * cut) ** 2))):
                means[place] = kept * means[place] + (1.0 - kept) * new
            mean, square = (
                one / (1.0 - kept**self.steps)
                for one, kept in zip(means, (MEAN, SQUARE), strict=True)
            )
            weights -= rate * mean / (np.sqrt(square) + LEAST)
