"""What a relation of several slides says, in sentences."""

from __future__ import annotations

import math

from inversion.joint.document import JointDocument, JointRelation, StoodSlope
from report.numbers import chance, number, percent, plural

#: Chance below which a slide left out counts as missed.
MISSED = 0.05
#: Odds of the ways in which slides and bounds agree, from which one is preferred.
PREFERRED = 0.8


def answer_sentence(document: JointDocument) -> str:
    """The relation, and the ratio of a dam without a slide."""
    low, high = document.ratio.interval_95
    return (
        f"Over {plural(document.relation.slides, 'slide')} the median of S_r/σ'_v0 is "
        f"{_median(document.relation)}, and a slide scatters about it by a factor "
        f"{_scatter(document.relation)}. A dam without a slide: "
        f"{document.ratio.median:.3f}, 95 % between {low:.3f} and {high:.3f}."
    )


def scatter_sentence(document: JointDocument) -> str:
    """How much of the scatter the slides tell."""
    return (
        f"Of the variance that the scatter had before, {percent(document.scatter_narrowed)} went: "
        f"before the slides it was a factor {_scatter(document.before)}."
    )


def bound_sentences(document: JointDocument) -> list[str]:
    """What a slope that stood makes of the relation; none where nothing stood."""
    found = [_bound_sentence(document, one) for one in document.bounds]
    if document.explanations:
        best = max(document.explanations, key=lambda one: one.probability)
        verdict = (
            "is preferred"
            if best.probability >= PREFERRED
            else "is the most probable, and none is preferred"
        )
        ways = "; ".join(
            f"{one.words} ({percent(one.probability)})" for one in document.explanations
        )
        found.append(
            f"Ways in which slides and bounds agree, each as probable as the others before: "
            f"{ways}. That {best.words} {verdict}."
        )
    if document.readings:
        with_, without = document.readings
        found.append(
            f"With bounds as stated the median is {_median(with_)} and the scatter a factor "
            f"{_scatter(with_)}; without them {_median(without)} and {_scatter(without)}."
        )
    return found


def slope_sentence(document: JointDocument) -> str:
    """Whether the ratio rises with the blow count."""
    slope = document.slope
    low, high = slope.per_blow.interval_95
    rise = (
        f"{100 * slope.per_blow.median:.1f} % per blow, {100 * low:.1f} to {100 * high:.1f} % "
        f"(95 %); evidence with a slope over that without {number(slope.bayes_factor, 2)}, by "
        f"{plural(slope.slides, 'slide')} whose blow count was read"
    )
    if slope.told:
        return f"The ratio changes with N1,60: {rise}."
    return f"Whether the ratio rises with N1,60 cannot be told: {rise}."


def left_out_sentence(document: JointDocument) -> str:
    """Which slides the others do not predict."""
    missed = [one for one in document.left_out if one.chance < MISSED]
    if not missed:
        return "Each slide is within what the others predict (chance above 5 %)."
    names = ", ".join(f"{one.title} ({chance(one.chance)})" for one in missed)
    return f"Not as the others predict: {names}."


def literature_sentence(document: JointDocument) -> str:
    """The ranges of a secondary source, and the authors of single slides."""
    one = document.secondary
    words = (
        f"{one.slides} flow slides of the literature have the geometric mean "
        f"{one.geometric_mean:.3f} and scatter by a factor {math.exp(one.log_std):.2f} "
        f"({one.source}); they are no input."
    )
    names = dict.fromkeys(author.case for author in document.authors)
    for case in names:
        own = [author.ratio for author in document.authors if author.case == case]
        title = next(row.title for row in document.slides if row.case == case)
        if len(own) > 1:
            words += (
                f" {title}: {len(own)} strengths of others span {min(own):.3f} to {max(own):.3f}."
            )
    return words


def check_sentence(document: JointDocument) -> str:
    """Whether sampler and grid agree."""
    return (
        f"ln Z = {document.relation.log_evidence:.2f} ± {document.log_evidence_std:.2f} by nested "
        f"sampling, {document.log_evidence_on_grid:.2f} on a grid."
    )


def _bound_sentence(document: JointDocument, one: StoodSlope) -> str:
    row = next(row for row in document.slides if row.case == one.case)
    return (
        f"{one.title} stood, for which its soil must have had at least {row.ratio_95[0]:.2f} "
        f"(95 %), had the drawn zone liquefied. As the others predict it stands with a probability "
        f"of {percent(one.probability)}; by the ranges of the literature of "
        f"{_small(one.probability_by_ranges)}. Either one relation does not give both, or another "
        f"zone liquefied: that it was another has a probability of {percent(one.zone_doubt)}, "
        "where 50 % were assumed before."
    )


def _small(share: float) -> str:
    return percent(share) if share >= 0.01 else f"{100 * share:.2g} %"


def _median(one: JointRelation) -> str:
    low, high = one.median.interval_95
    return f"{one.median.median:.3f} ({low:.3f} to {high:.3f})"


def _scatter(one: JointRelation) -> str:
    low, high = one.scatter.interval_95
    return f"{math.exp(one.scatter.median):.2f} ({math.exp(low):.2f} to {math.exp(high):.2f})"
