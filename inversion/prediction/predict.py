"""From strengths that are known with a standard deviation to the distribution of the runout.

A strength is back-analysed in order to predict. A few runs at chosen strengths give a smooth
response (`inversion.prediction.response`); the distribution is that of many strengths put through
it, each with the numerical noise of a simulation, which runs with jittered points measure. No
engine is named here: whatever predicts measurements can be asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.survey.surface_profile import surface_profile
from inversion.engines.small_cells import InSmallCells, SmallCells
from inversion.estimation.forward import Forward, Prediction, Setup
from inversion.prediction.first_order import FirstOrder, first_order, mean_scores
from inversion.prediction.known_strength import KnownStrength, sampled_scores, widened
from inversion.prediction.response import JoinedSurfaces, Response, design, response
from pipeline.cli import WorkFailed

#: Scores at which jittered points measure the noise.
NOISE_SCORES = (-1.0, 0.0, 1.0)
#: Quantiles of the final sections and of the numbers, %.
ENVELOPE, QUANTILES = (5, 50, 95), (5, 25, 50, 75, 95)
#: Samples of which the envelope is made; it needs no more.
ENVELOPE_SAMPLES = 2000
#: More runs than this share may not fail.
MOST_FAILED = 0.25


@dataclass(frozen=True)
class Distribution:
    """Result of a prediction; n runs of p strengths predict m numbers, s samples.

    Attributes:
        names: of the numbers, (m,).
        strengths: (n, p) of the runs that finished, each in its unit.
        scores: their standard normal scores (n, p).
        runs: their numbers (n, m).
        predictions: the same runs, whole.
        cells: what turned the strengths into those that the runs took; None: nothing.
        failed: runs that a guard stopped, left out.
        noise: standard deviation over the place of the points, (m,).
        missed: standard deviation of the runs about the smooth response, (m,).
        engine_std: of the engine's own error at the runs, (n, m); 0: it states none.
        response: the smooth response.
        sample_scores: (s, p).
        samples: the numbers (s, m).
        first_order: their mean and standard deviation by the derivative at the mean.
    """

    names: list[str]
    strengths: np.ndarray
    scores: np.ndarray
    runs: np.ndarray
    predictions: list[Prediction]
    cells: SmallCells | None
    failed: int
    noise: np.ndarray
    missed: np.ndarray
    engine_std: np.ndarray
    response: Response
    sample_scores: np.ndarray
    samples: np.ndarray
    first_order: FirstOrder

    def of(self, places: Sequence[int]) -> Distribution:
        """Some of the numbers, by their places; the response remains that of all."""
        some, own = list(places), self.engine_std
        return replace(
            self,
            names=[self.names[place] for place in some],
            runs=self.runs[:, some],
            noise=self.noise[some],
            missed=self.missed[some],
            engine_std=own[:, some] if own.ndim > 1 else own,
            samples=self.samples[:, some],
            first_order=FirstOrder(self.first_order.mean[some], self.first_order.std[some]),
        )

    def quantiles(self, percent: Sequence[float] = QUANTILES) -> np.ndarray:
        """Quantiles of the numbers, (q, m)."""
        return np.percentile(self.samples, percent, axis=0)

    def exceedance(self, number: int, beyond: np.ndarray) -> np.ndarray:
        """Probability that a number is larger than each of `beyond` (k,)."""
        ordered = np.sort(self.samples[:, number])
        return 1.0 - np.searchsorted(ordered, beyond, side="right") / len(ordered)


def predict(
    engine: Forward,
    setup: Setup,
    strengths: Sequence[KnownStrength],
    *,
    cells: SmallCells | None = None,
    jittered: Sequence[Setup] = (),
    samples: int = 20_000,
    seed: int = 0,
) -> Distribution:
    """The distribution of everything the engine predicts.

    Args:
        engine: predicts.
        setup: its parameters are the strengths, in their order.
        strengths: p of them; draws of a posterior together, others independent of each other.
        cells: of the runs, where the strengths are those in small cells; None: they are as runs
            have them.
        jittered: setups that differ in the seed of the jitter alone; fewer than two: no noise.
        samples: strengths that are put through the response.
        seed: of the samples.

    Raises:
        WorkFailed: more than a quarter of the runs failed.
    """
    if cells is not None:
        engine = InSmallCells(engine, cells)
        strengths = [widened(one, cells.log_std) for one in strengths]
    scores = design(len(strengths))
    requests = [setup.at(one) for one in values_at(strengths, scores)]
    predictions = engine.predict(requests)
    kept = np.array([not prediction.failed for prediction in predictions])
    if np.mean(~kept) > MOST_FAILED:
        reason = next(p.reason for p in predictions if p.failed)
        raise WorkFailed(f"{np.sum(~kept)} of {len(kept)} simulations failed: {reason}")
    scores, predictions = scores[kept], [p for p in predictions if not p.failed]
    runs = np.array([prediction.values for prediction in predictions])
    finished = [one for one, good in zip(requests, kept, strict=True) if good]
    own = np.array([engine.error_std(one) for one in finished])
    names = list(setup.targets.names)
    noise = noise_at(engine, jittered, strengths, len(names))
    smooth = response(scores, runs, np.array(setup.targets.groups))
    generator = np.random.default_rng(seed)
    drawn = sampled_scores(strengths, samples, generator)
    # The runs scatter about the response by the noise too: the larger of both, not their sum.
    std = at_mean = np.maximum(noise, smooth.missed)
    if own.any():
        own_at = JoinedSurfaces(scores, own)
        std = np.hypot(std, np.maximum(own_at(drawn), 0.0))
        at_mean = np.hypot(at_mean, np.maximum(own_at(mean_scores(strengths)[None])[0], 0.0))
    scatter = std * generator.standard_normal((samples, len(noise)))
    return Distribution(
        names=names,
        strengths=values_at(strengths, scores),
        scores=scores,
        runs=runs,
        predictions=predictions,
        cells=cells,
        failed=int(np.sum(~kept)),
        noise=noise,
        missed=smooth.missed,
        engine_std=own,
        response=smooth,
        sample_scores=drawn,
        samples=smooth(drawn) + scatter,
        first_order=first_order(strengths, smooth, at_mean),
    )


def values_at(strengths: Sequence[KnownStrength], scores: np.ndarray) -> np.ndarray:
    """Strengths (n, p), each in its unit, of scores (n, p)."""
    return np.stack([s.at(scores[:, place]) for place, s in enumerate(strengths)], axis=1)


def noise_at(
    engine: Forward, jittered: Sequence[Setup], strengths: Sequence[KnownStrength], numbers: int
) -> np.ndarray:
    """Standard deviation of each number over the jittered setups, (m,), at three strengths."""
    if len(jittered) < 2:
        return np.zeros(numbers)
    scores = np.tile(np.array(NOISE_SCORES)[:, None], len(strengths))
    found = engine.predict(
        [setup.at(values) for values in values_at(strengths, scores) for setup in jittered]
    )
    squares, freedom = np.zeros(numbers), 0
    for first in range(0, len(found), len(jittered)):
        group = [p.values for p in found[first : first + len(jittered)] if not p.failed]
        if len(group) > 1:
            squares += np.sum((np.array(group) - np.mean(group, axis=0)) ** 2, axis=0)
            freedom += len(group) - 1
    return np.sqrt(squares / max(freedom, 1))


@dataclass(frozen=True)
class Envelope:
    """Final sections: elevations [m] at places x (k,) [m], one row a quantile."""

    x: np.ndarray
    surfaces: np.ndarray


def envelope(
    found: Distribution, *, spacing: float, ground: np.ndarray, places: int = 240
) -> Envelope | None:
    """Surfaces that 5, 50 and 95 % of the slides stay below, place by place.

    Args:
        found: with the final positions of the runs; None is returned where it has none.
        spacing: of the material points [m].
        ground: polyline of the base (P, 2) [m].
        places: at which the surfaces are read.
    """
    deposits = [(p.positions.astype(float), p.volume) for p in found.predictions]
    if not deposits or any(len(points) == 0 for points, _ in deposits):
        return None
    ends = np.array([(points[:, 0].min(), points[:, 0].max()) for points, _ in deposits])
    x = np.linspace(ends[:, 0].min() - spacing, ends[:, 1].max() + spacing, places)
    surfaces = np.array(
        [
            surface_profile(points, volume, x, spacing=spacing, ground=ground)
            for points, volume in deposits
        ]
    )
    sampled = JoinedSurfaces(found.scores, surfaces)(found.sample_scores[:ENVELOPE_SAMPLES])
    return Envelope(x, np.percentile(sampled, ENVELOPE, axis=0))
