"""An amortised classifier: a small network that has seen simulated slides of every candidate.

It is trained for each slide anew, on residuals that its signatures and its covariance say are
possible (no further runs): nothing missing in a third of them, else any candidate, its amplitude
from its prior or anywhere on its ladder; what an effect does is off by the stated share, and noise
is drawn afresh in every epoch. It sees what no change of the parameters imitates: the direction of
the projected residual, and the logarithm of its length. It answers with a probability of every
candidate and of nothing, and with a mean and a standard deviation of what ln S_r of the base model
is off by.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.hidden_effects.baselines.answers import Answer, answer_of
from benchmarks.hidden_effects.baselines.slide import Slide, Suspect
from pipeline.ties import largest_place

#: Share of the slides in which nothing is missing.
NOTHING = 1.0 / 3.0
SLIDES, EPOCHS, BATCH, WIDTH, RATE = 8000, 40, 250, 64, 3e-3
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


def simulate(slide: Slide, count: int, rng: np.random.Generator) -> Simulated:
    """Draw what is missing and what it does.

    Args:
        slide: with the signatures of its candidates.
        count: n.
        rng: draws.
    """
    number = len(slide.suspects)
    kind = np.where(rng.uniform(size=count) < NOTHING, 0, rng.integers(1, number + 1, count))
    changes = np.zeros((count, len(slide.residual)))
    for place, one in enumerate(slide.suspects, start=1):
        own = np.flatnonzero(kind == place)
        ladder = one.ladder
        for row, amplitude in zip(own, amplitudes(one, len(own), rng), strict=True):
            changes[row] = ladder.change(amplitude)
    common = rng.standard_normal((count, 1)) * TOGETHER**0.5
    alone = rng.standard_normal(changes.shape) * (1.0 - TOGETHER) ** 0.5
    return Simulated(kind, changes * (1.0 + slide.effects_error * (common + alone)))


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
    return np.array([ladder.scale.amplitude(number) for number in counts])


def seen(slide: Slide, augmented: np.ndarray) -> np.ndarray:
    """What the network sees of augmented residuals (n, k + r): (n, k + r + 1)."""
    left = slide.system.project(augmented.T).T
    length = np.linalg.norm(left, axis=1, keepdims=True)
    return np.hstack([left / length, np.log(length)])


def classify(slide: Slide, *, slides: int = SLIDES, epochs: int = EPOCHS) -> Answer:
    """Train a network for a slide, and ask it.

    Args:
        slide: to be answered.
        slides: that are simulated.
        epochs: times that the network sees each, with other noise.
    """
    import torch

    rng = np.random.default_rng([slide.seed, 2])
    drawn = simulate(slide, slides, rng)
    linear, k = slide.system, len(slide.residual)
    whole = np.zeros((slides, len(slide.augmented)))
    whole[:, :k] = drawn.changes @ linear.data.whitener.T
    # Change of the first unknown by the augmented residual: what the base model is off by.
    towards = np.array([linear.imitating(row)[0] for row in np.eye(whole.shape[1])])
    scale = max(float(np.std(whole @ towards)), 1e-6)
    width, kinds = whole.shape[1] + 1, len(slide.suspects) + 1
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(slide.seed)
        network = _network(width, kinds)
        optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
        plan = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, RATE, total_steps=epochs * -(-slides // BATCH)
        )
        for _ in range(epochs):
            noisy = whole + rng.standard_normal(whole.shape)
            off = -(noisy @ towards) / scale
            columns = (seen(slide, noisy), off, drawn.kind)
            for batch in np.array_split(rng.permutation(slides), -(-slides // BATCH)):
                loss = _loss(network, kinds, *(torch.tensor(one[batch]) for one in columns))
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                plan.step()
        with torch.no_grad():
            found = network(torch.tensor(seen(slide, slide.augmented[None])))[0].numpy()
    return _answer(slide, found, scale)


def _network(width: int, kinds: int) -> Any:
    from torch import nn

    return nn.Sequential(
        nn.Linear(width, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU(),
        nn.Linear(WIDTH, kinds + 2),
    ).double()  # fmt: skip


def _loss(network: Any, kinds: int, rows: Any, off: Any, kind: Any) -> Any:
    """Cross-entropy of the kinds, and -ln of the density of what S_r is off by."""
    from torch.nn import functional

    out = network(rows)
    mean, ln_std = out[:, kinds], out[:, kinds + 1]
    density = 0.5 * ((off - mean) * (-ln_std).exp()) ** 2 + ln_std
    return functional.cross_entropy(out[:, :kinds], kind) + density.mean()


def _answer(slide: Slide, found: np.ndarray, scale: float) -> Answer:
    """The most probable kind with ln of its odds, and S_r.

    Args:
        slide: that was asked of.
        found: what the network has put out, (kinds + 2,).
        scale: unit of what S_r is off by.
    """
    *ln_weights, mean, ln_std = found
    first = largest_place(ln_weights)
    odds = float(ln_weights[first] - np.logaddexp.reduce(np.delete(ln_weights, first)))
    names = [slide.suspects[first - 1].name] if first else []
    strength = slide.strength(mean * scale, (np.exp(ln_std) * scale) ** 2)
    return answer_of(slide, names, odds, strength)
