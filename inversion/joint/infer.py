"""The posterior of the relation, and what follows from it.

The answer is sampled by nested sampling. What is asked many times (slides left out, bounds left
out, a slope, other explanations) is integrated on the grid of `population.py`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from geometry.scenes.scene import MOST_STRENGTH_RATIO
from inversion.catalogue.ranges import RatioRange, geometric_mean
from inversion.joint.document import (
    BoundExplanation,
    CountSlope,
    JointRelation,
    LeftOutSlide,
    SecondaryRanges,
    SlideRow,
    StoodSlope,
)
from inversion.joint.evidence import SlideEvidence
from inversion.joint.population import (
    RATIOS,
    GridPosterior,
    PriorGrid,
    asked_of,
    at_shares,
    log_likelihoods,
    predicted_probability,
)
from inversion.posterior.document import Spread
from inversion.posterior.sampling import Sampled, nested, resampled
from inversion.posterior.summary import spread
from pipeline.config import PosteriorSettings

#: Prior probability that in a slope that stood another zone liquefied than the one that is drawn.
ZONE_DOUBT = 0.5
#: Evidence ratio from which a slope counts as told (strong, Kass and Raftery 1995).
STRONG = 10.0
#: Fewest slides that can tell of a slope: two lie on any line.
FEWEST_FOR_SLOPE = 3
QUANTILES = 400
#: Slides drawn for each draw of the relation.
REPLICATES = 10
GRID_DRAWS = 4000


@dataclass(frozen=True)
class InferredRelation:
    """The posterior of the relation, s draws of equal weight.

    Attributes:
        slides: that entered, bounds with their doubt.
        sampled: by the nested sampler.
        mu: ln of the median ratio, (s,).
        tau: scatter of ln ratio, (s,).
        ratios: of slides that are not known yet, (s x `REPLICATES`,).
        grid: the same posterior on the grid.
    """

    slides: list[SlideEvidence]
    sampled: Sampled
    mu: np.ndarray
    tau: np.ndarray
    ratios: np.ndarray
    grid: GridPosterior


def infer(slides: Sequence[SlideEvidence], settings: PosteriorSettings) -> InferredRelation:
    """Draw the relation.

    Args:
        slides: as read, with their widths and weights.
        settings: numbers of draws and live points, seed.
    """
    doubted = with_doubt(slides)

    def log_likelihood(shares: np.ndarray) -> float:
        return float(log_likelihoods(doubted, at_shares(shares)).sum())

    sampled = nested(
        log_likelihood,
        2,
        draws=settings.draws,
        live_points=settings.live_points,
        seed=settings.seed,
    )
    drawn = at_shares(sampled.shares.T[:2])
    random = np.random.default_rng(settings.seed)
    scores = random.standard_normal((REPLICATES, settings.draws))
    ratios = np.exp(drawn.mu + drawn.tau * scores).ravel()
    return InferredRelation(
        doubted,
        sampled,
        np.asarray(drawn.mu),
        np.asarray(drawn.tau),
        np.minimum(ratios, MOST_STRENGTH_RATIO),
        PriorGrid().posterior(doubted),
    )


def with_doubt(slides: Sequence[SlideEvidence], doubt: float = ZONE_DOUBT) -> list[SlideEvidence]:
    """The slides, bounds with a probability that they say nothing."""
    return [replace(one, doubt=doubt) if one.kind == "bound" else one for one in slides]


def answer(found: InferredRelation) -> JointRelation:
    """The relation by the nested sampler."""
    return JointRelation(
        name="bounds hold with probability 1/2" if _bounds(found.slides) else "all slides",
        slides=len(_telling(found.slides)),
        median=spread(np.exp(found.mu)),
        scatter=spread(found.tau),
        log_evidence=round(found.sampled.log_evidence, 4),
    )


def on_grid(name: str, slides: Sequence[SlideEvidence]) -> JointRelation:
    """The relation by the grid, of these slides; of none the prior."""
    found = PriorGrid().posterior(slides)
    return JointRelation(
        name=name,
        slides=len(_telling(slides)),
        median=_spread_on_grid(found, 0, np.exp),
        scatter=_spread_on_grid(found, 1),
        log_evidence=round(found.log_evidence, 4),
    )


def readings(slides: Sequence[SlideEvidence]) -> list[JointRelation]:
    """Bounds as stated, and without them; none where nothing stood."""
    if not _bounds(slides):
        return []
    without = [one for one in slides if one.kind != "bound"]
    return [on_grid("bounds as stated", slides), on_grid("without the bounds", without)]


def slide_row(slide: SlideEvidence, others: Sequence[SlideEvidence]) -> SlideRow:
    """What a slide says alone, and together with the others."""
    count = slide.blow_count
    low, middle, high = slide.quantiles((0.025, 0.5, 0.975))
    if slide.kind == "bound":
        low, high = math.exp(slide.mean - 1.645 * slide.log_std), MOST_STRENGTH_RATIO
    return SlideRow(
        case=slide.case,
        title=slide.title,
        kind=slide.kind,
        drawn=slide.drawn,
        source=slide.source,
        ratio=round(float(middle), 5),
        sigma_v0_kpa=round(slide.sigma_v0_kpa, 3),
        formal_log_std=round(slide.formal_std, 5),
        log_std=round(slide.log_std, 5),
        verdict=slide.verdict,
        factor=round(slide.factor, 4),
        weight=slide.weight,
        n1_60=None if count is None else round(count.value, 3),
        n1_60_recalled=count is not None and count.recalled,
        ratio_95=(round(float(low), 5), round(float(high), 5)),
        after=together(slide, others) if slide.tells else None,
    )


def together(slide: SlideEvidence, others: Sequence[SlideEvidence]) -> Spread:
    """The ratio of a slide once the others are known: shrunk towards their relation."""
    drawn = _predicted(PriorGrid().posterior(others), np.random.default_rng(0))
    weights = slide.likelihood(drawn, np.zeros(1))
    chosen = resampled(weights, len(drawn), np.random.default_rng(1))
    return spread(np.minimum(np.exp(drawn[chosen]), MOST_STRENGTH_RATIO))


def left_out(slides: Sequence[SlideEvidence]) -> list[LeftOutSlide]:
    """Each slide predicted from the others, bounds with their doubt among these."""
    found = []
    for slide in _telling(slides):
        others = with_doubt([one for one in slides if one is not slide])
        posterior = PriorGrid().posterior(others)
        drawn = np.exp(_predicted(posterior, np.random.default_rng(0)))
        drawn = np.minimum(drawn, MOST_STRENGTH_RATIO)
        low, median, high = np.percentile(drawn, (2.5, 50, 97.5))
        if slide.kind == "bound":
            chance = predicted_probability(slide, others)
        else:
            relation = posterior.grid.relation
            width = np.hypot(relation.tau, slide.log_std)
            below = posterior.mean(ndtr((slide.mean - relation.mu) / width))
            chance = 2.0 * min(below, 1.0 - below)
        found.append(
            LeftOutSlide(
                case=slide.case,
                title=slide.title,
                predicted_95=(round(float(low), 5), round(float(high), 5)),
                predicted_median=round(float(median), 5),
                chance=round(chance, 5),
            )
        )
    return found


def slope(slides: Sequence[SlideEvidence]) -> CountSlope:
    """Does the ratio rise with the blow count? Bounds have their doubt."""
    doubted = with_doubt(slides)
    asked = sum(map(asked_of, slides))
    with_slope, without = PriorGrid(slope=True).posterior(doubted), PriorGrid().posterior(doubted)
    factor = math.exp(with_slope.log_evidence - without.log_evidence)
    low, high = with_slope.quantiles(2, (0.025, 0.975))
    return CountSlope(
        slides=asked,
        per_blow=_spread_on_grid(with_slope, 2),
        bayes_factor=round(factor, 4),
        told=asked >= FEWEST_FOR_SLOPE and factor >= STRONG and bool(low > 0.0 or high < 0.0),
    )


def bounds(slides: Sequence[SlideEvidence], ranges: Sequence[RatioRange]) -> list[StoodSlope]:
    """Each slope that stood against the relation of the others."""
    mean, std = geometric_mean(ranges)
    found = []
    for slide in _bounds(slides):
        others = with_doubt([one for one in slides if one is not slide])
        stands = predicted_probability(slide, others)
        by_ranges = float(slide.likelihood(np.array(math.log(mean)), np.array(std)))
        doubt = ZONE_DOUBT / (ZONE_DOUBT + (1.0 - ZONE_DOUBT) * stands)
        found.append(
            StoodSlope(
                case=slide.case,
                title=slide.title,
                probability=float(f"{stands:.4g}"),
                probability_by_ranges=float(f"{by_ranges:.3g}"),
                zone_doubt=round(doubt, 5),
            )
        )
    return found


def explanations(slides: Sequence[SlideEvidence]) -> list[BoundExplanation]:
    """Ways in which slides and bounds agree; none where nothing stood.

    Where the zone that liquefied in a slope that stood is another, it stands anyway. Where it is
    another in a slide that ran, its ratio is anywhere in the prior's range, uniform in its
    logarithm.
    """
    if not _bounds(slides):
        return []
    ways = [("one relation gives all of them", PriorGrid().posterior(slides).log_evidence)]
    for slide in _telling(slides):
        rest = PriorGrid().posterior([one for one in slides if one is not slide]).log_evidence
        alone = 0.0 if slide.kind == "bound" else math.log(_anywhere(slide))
        ways.append((f"another zone liquefied in {slide.title}", rest + alone))
    logs = np.array([log for _, log in ways])
    shares = np.exp(logs - logs.max())
    shares /= shares.sum()
    return [
        BoundExplanation(
            words=words, log_evidence=round(log, 4), probability=round(float(share), 5)
        )
        for (words, log), share in zip(ways, shares, strict=True)
    ]


def secondary(ranges: Sequence[RatioRange], source: str) -> SecondaryRanges:
    """The secondary ranges in two numbers."""
    mean, std = geometric_mean(ranges)
    return SecondaryRanges(
        slides=len(ranges), geometric_mean=round(mean, 4), log_std=round(std, 4), source=source
    )


def quantiles(ratios: np.ndarray) -> list[float]:
    """Draws of equal weight in their order."""
    places = (np.arange(QUANTILES) + 0.5) / QUANTILES
    return [round(float(value), 6) for value in np.quantile(ratios, places)]


def _anywhere(slide: SlideEvidence) -> float:
    """Density of the evidence of a slide whose ratio is anywhere in the prior's range."""
    low, high = np.log(RATIOS)
    places = np.linspace(low, high, 400)
    return float(slide.likelihood(places, np.zeros(1)).mean())


def _predicted(found: GridPosterior, random: np.random.Generator) -> np.ndarray:
    """Ln ratio of new slides, (GRID_DRAWS,)."""
    places = resampled(found.mass.ravel(), GRID_DRAWS, random)
    relation = found.grid.relation
    scatter = relation.tau.ravel()[places] * random.standard_normal(GRID_DRAWS)
    return relation.mu.ravel()[places] + scatter


def _spread_on_grid(found: GridPosterior, axis: int, scale: np.ufunc | None = None) -> Spread:
    places = (np.arange(GRID_DRAWS) + 0.5) / GRID_DRAWS
    values = found.quantiles(axis, places)
    return spread(values if scale is None else scale(values))


def _bounds(slides: Sequence[SlideEvidence]) -> list[SlideEvidence]:
    return [one for one in slides if one.kind == "bound"]


def _telling(slides: Sequence[SlideEvidence]) -> list[SlideEvidence]:
    return [one for one in slides if one.tells]
