"""The relation of several slides as a document: `joint.json`, with its JSON schema.

Ratios are S_r / sigma'_v0; scatters are standard deviations of their natural logarithm. What
depends on the clock or the machine stands in `manifest`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from inversion.posterior.document import Spread
from pipeline.config import load_document
from pipeline.documents import StrictDocument, document_schema

FILE_NAME = "joint.json"
Kind = Literal["slide", "bound", "undetermined", "recalled"]


class SlideRow(StrictDocument):
    """What one slide says, before and after the others are known."""

    case: str
    title: str
    kind: Kind = Field(
        description="it ran; it stood, and has a least ratio; its data leave its strength open; it "
        "rests on recalled numbers, and enters no regression"
    )
    drawn: bool = Field(
        True, description="its section was drawn; else it is known by a few numbers"
    )
    source: str = Field(description="file that it was read from")
    ratio: float = Field(description="median; of a bound the least ratio at which nothing runs")
    sigma_v0_kpa: float = Field(description="mean vertical effective stress of its zones")
    formal_log_std: float = Field(description="of ln ratio, by the slide's own interval")
    log_std: float = Field(description="with the error of the model and the weight, as it enters")
    verdict: str = Field(description="on its model; empty: no diagnosis was at hand")
    factor: float = Field(description="within which nine of ten strengths with it lay")
    weight: float = Field(description="quality; the variance is divided by it")
    n1_60: float | None = Field(description="mean blow count of its zones; null: none is at hand")
    n1_60_recalled: bool = Field(description="known from memory alone: enters no regression")
    ratio_95: tuple[float, float] = Field(description="with 95 %; of a bound from its 5 %")
    after: Spread | None = Field(
        description="ratio once the other slides are known; null: it says nothing itself"
    )

    @property
    def tells(self) -> bool:
        """It says something of the relation."""
        return self.kind in ("slide", "bound")


class JointRelation(StrictDocument):
    """The relation: median ratio and scatter between slides."""

    name: str
    slides: int = Field(description="that say something")
    median: Spread = Field(description="ratio of half of all slides")
    scatter: Spread = Field(description="standard deviation of ln ratio between slides")
    log_evidence: float


class CountSlope(StrictDocument):
    """Does the ratio rise with N1,60?"""

    slides: int = Field(description="whose strength is known and whose blow count was read")
    per_blow: Spread = Field(description="change of ln ratio per blow")
    bayes_factor: float = Field(description="evidence with a slope over that without")
    told: bool = Field(description="strong evidence, and the interval of 95 % excludes 0")


class StoodSlope(StrictDocument):
    """A slope that stood, against the relation of all others."""

    case: str
    title: str
    probability: float = Field(description="that it stands, as the others predict")
    probability_by_ranges: float = Field(
        description="the same by a lognormal through the secondary ranges"
    )
    zone_doubt: float = Field(
        description="probability that the zone that liquefied is another, 0.5 before"
    )


class BoundExplanation(StrictDocument):
    """One way in which slides and bounds agree."""

    words: str
    log_evidence: float
    probability: float = Field(description="all ways equally probable before")


class LeftOutSlide(StrictDocument):
    """One slide predicted from the others."""

    case: str
    title: str
    predicted_95: tuple[float, float] = Field(description="of its ratio")
    predicted_median: float
    chance: float = Field(
        description="of a slide farther off, both sides; of a bound that it stands"
    )


class PublishedRatio(StrictDocument):
    """A published relation at the blow count and stress of a slide."""

    case: str
    label: str
    ratio: float
    beyond: bool = Field(description="the blow count lies beyond its data")
    recalled: bool = Field(description="the blow count is known from memory alone")


class Author(StrictDocument):
    """A strength that others found of the same zones."""

    case: str
    source: str
    part: str
    ratio: float = Field(description="by their stress, else by ours")
    own_stress: bool = Field(description="the stress is theirs")
    recalled: bool = Field(description="strength or stress is known from memory alone")


class SecondaryRanges(StrictDocument):
    """Ranges of flow slides that a secondary source transcribes; never an input."""

    slides: int
    geometric_mean: float
    log_std: float
    source: str


class JointDocument(StrictDocument):
    """`joint.json`."""

    slides: list[SlideRow]
    priors: dict[str, str]
    before: JointRelation
    relation: JointRelation = Field(description="the answer; each bound holds with probability 1/2")
    readings: list[JointRelation] = Field(description="with bounds as stated, and without them")
    log_evidence_std: float = Field(description="of the nested sampler")
    log_evidence_on_grid: float = Field(description="the same integral on a grid, as a check")
    ratio: Spread = Field(description="of a dam without a slide: the posterior predictive")
    ratio_quantiles: list[float] = Field(description="at (k + 1/2) / n: draws of equal weight")
    scatter_narrowed: float = Field(description="1 - (std after / std before)^2 of the scatter")
    slope: CountSlope
    bounds: list[StoodSlope]
    explanations: list[BoundExplanation] = Field(description="none without a bound")
    left_out: list[LeftOutSlide]
    published: list[PublishedRatio]
    authors: list[Author]
    secondary: SecondaryRanges
    remarks: list[str]
    manifest: dict[str, Any]


def load_joint(path: str | Path) -> JointDocument:
    """Read a `joint.json`, or the one in a folder.

    Raises:
        InputError: no such file, not JSON, or not of this schema; one line.
    """
    return load_document(JointDocument, path, FILE_NAME)


def schema_text() -> str:
    """The JSON schema, as text."""
    return document_schema(JointDocument, "flowslide joint")
