"""An amortised classifier: a small network that has seen simulated slides of every candidate.

It is trained for each slide anew, on residuals that its signatures and its covariance say are
possible (no further runs): nothing missing in a third of them, else any candidate, its amplitude
from its prior or anywhere on its ladder; what an effect does is off by the stated share. All is
drawn afresh in every epoch. It sees what no change of the parameters imitates: asinh of the
projected residual, and the logarithm of its length. It answers with a probability of every
candidate and of nothing, and with a mean and a standard deviation of what ln S_r of the base model
is off by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from benchmarks.hidden_effects.baselines.answers import Answer, answer_of
from benchmarks.hidden_effects.baselines.network import Network
from benchmarks.hidden_effects.baselines.slide import Slide, Suspect
from pipeline.ties import largest_place

#: Share of the slides in which nothing is missing.
NOTHING = 1.0 / 3.0
SLIDES, EPOCHS, BATCH, WIDTH, RATE = 8000, 60, 250, 128, 1e-2
#: Amplitudes of each candidate.
AMPLITUDES = 100
#: Shares of an error of an effect that are the same in all numbers, and of each number alone.
TOGETHER = 0.7


@dataclass(frozen=True)
class Simulated:
    """Slides without noise, n of them.

    Attributes:
        kind: 0: nothing is missing; else the place of the candidate, from 1 on, (n,).
        changes: by what is missing, of the fitted numbers, (n, k).
    """

    kind: np.ndarray
    changes: np.ndarray


@dataclass(frozen=True)
class Simulator:
    """Makes slides near the fit of the base model.

    Attributes:
        slide: with the signatures of its candidates.
        changes: of the fitted numbers by each candidate at amplitudes that were drawn, (c, a, k).
    """

    slide: Slide
    changes: np.ndarray

    @classmethod
    def of(cls, slide: Slide, rng: np.random.Generator) -> Simulator:
        """Draw the amplitudes."""
        return cls(slide, np.array([
            [one.ladder.change(a) for a in amplitudes(one, AMPLITUDES, rng)]
            for one in slide.suspects
        ]))  # fmt: skip

    def draw(self, count: int, rng: np.random.Generator) -> Simulated:
        """So many slides: what is missing, and what it does."""
        number = len(self.changes)
        kind = np.where(rng.uniform(size=count) < NOTHING, 0, rng.integers(1, number + 1, count))
        changes = self.changes[kind - 1, rng.integers(0, AMPLITUDES, count)]
        changes[kind == 0] = 0.0
        common = rng.standard_normal((count, 1)) * TOGETHER**0.5
        alone = rng.standard_normal(changes.shape) * (1.0 - TOGETHER) ** 0.5
        return Simulated(kind, changes * (1.0 + self.slide.effects_error * (common + alone)))


def amplitudes(one: Suspect, count: int, rng: np.random.Generator) -> np.ndarray:
    """Amplitudes (count,) of a candidate: from its prior, else evenly over its ladder."""
    if one.switch:
        return np.full(count, one.rung)
    ladder = one.ladder
    ends = [ladder.scale.count(rung) for rung in (ladder.amplitudes[0], ladder.amplitudes[-1])]
    if one.prior is None:
        counts = rng.uniform(*ends, count)
    else:
        counts = np.clip(rng.normal(*one.prior, count), *ends)
    return np.array([ladder.scale.value(number) for number in counts])


def seen(slide: Slide, augmented: np.ndarray) -> np.ndarray:
    """What the network sees of augmented residuals (n, k + r): (n, k + r + 1)."""
    left = slide.system.project(augmented.T).T
    return np.hstack([np.arcsinh(left), np.log(np.linalg.norm(left, axis=1, keepdims=True))])


@dataclass(frozen=True)
class Trained:
    """A network that was trained for a slide.

    Attributes:
        slide: whose signatures and covariance it knows.
        network: what was trained.
        unit: of what ln S_r is off by, in the first unknown.
    """

    slide: Slide
    network: Network
    unit: float

    def says(self, augmented: np.ndarray) -> np.ndarray:
        """Of residuals (n, k + r): ln weights of the kinds, mean, ln std, (n, kinds + 2)."""
        return self.network.layers(seen(self.slide, augmented))[-1]


def trained(slide: Slide, *, slides: int = SLIDES, epochs: int = EPOCHS) -> Trained:
    """Train a network for a slide.

    Args:
        slide: with signatures and covariance.
        slides: that are simulated for an epoch.
        epochs: how often, each time anew.
    """
    rng = np.random.default_rng([slide.seed, 2])
    simulator, towards = Simulator.of(slide, rng), steps(slide)
    unit = max(float(np.std(noiseless(slide, simulator.draw(slides, rng)) @ towards)), 1e-6)
    network = Network.fresh((len(towards) + 1, WIDTH, WIDTH, len(slide.suspects) + 3), rng)
    batches = -(-slides // BATCH)
    for epoch in range(epochs):
        drawn = simulator.draw(slides, rng)
        noisy = noiseless(slide, drawn) + rng.standard_normal((slides, len(towards)))
        rows, off = seen(slide, noisy), -(noisy @ towards) / unit
        rate = 0.5 * RATE * (1.0 + np.cos(np.pi * epoch / epochs))
        for batch in np.array_split(np.arange(slides), batches):
            layers = network.layers(rows[batch])
            network.learn(layers, slope(layers[-1], drawn.kind[batch], off[batch]), rate)
    return Trained(slide, network, unit)


def slope(out: np.ndarray, kind: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Derivative of the loss by what the network puts out, (n, kinds + 2).

    The loss is the cross-entropy of the kinds, and -ln of the density of what S_r is off by.

    Args:
        out: ln weights of the kinds, mean, ln std, (n, kinds + 2).
        kind: that was so, (n,).
        off: likewise, (n,).
    """
    found = np.empty_like(out)
    found[:, :-2] = softmax(out[:, :-2], axis=1)
    found[np.arange(len(kind)), kind] -= 1.0
    z = (off - out[:, -2]) * np.exp(-out[:, -1])
    found[:, -2] = -z * np.exp(-out[:, -1])
    found[:, -1] = 1.0 - z**2
    return found / len(kind)


def noiseless(slide: Slide, drawn: Simulated) -> np.ndarray:
    """Augmented residuals (n, k + r) without noise."""
    whole = np.zeros((len(drawn.changes), len(slide.augmented)))
    whole[:, : len(slide.residual)] = drawn.changes @ slide.system.data.whitener.T
    return whole


def steps(slide: Slide) -> np.ndarray:
    """Step of the first unknown by which the base model meets each augmented number, (k + r,)."""
    linear = slide.system
    return np.array([linear.imitating(row)[0] for row in np.eye(len(slide.augmented))])


def classify(slide: Slide) -> Answer:
    """The most probable kind with ln of its odds, and S_r."""
    network = trained(slide)
    *ln_weights, mean, ln_std = network.says(slide.augmented[None])[0]
    first = largest_place(ln_weights)
    odds = float(ln_weights[first] - np.logaddexp.reduce(np.delete(ln_weights, first)))
    names = [slide.suspects[first - 1].name] if first else []
    strength = slide.strength(mean * network.unit, (np.exp(ln_std) * network.unit) ** 2)
    return answer_of(slide, names, odds, strength)
