"""What verdicts have been worth on slides whose truth is known.

- How far S_r was off. In: a verdict. Out: `Worth` of the slides by other codes with the same one,
  from `track_record.yaml`, which `python -m benchmarks.studies.strength_by_verdict` writes from
  sealed benchmarks. It belongs next to every strength that is quoted: what a diagnosis does not
  know of is in no standard deviation.
- How often an explanation was right. In: `Figures` of a verdict. Out: a chance, by `names.yaml`,
  which `python -m benchmarks.studies.deserved_names` writes. The probability of an explanation is
  one among those that were tried; this chance counts the slides where none of them was true.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from pydantic import Field

from pipeline.documents import StrictDocument
from pipeline.files import read_yaml

Verdicts = Literal["adequate", "suspect", "identified", "ambiguous", "unknown_effect"]

FILE = Path(__file__).parent / "track_record.yaml"
NAMES = Path(__file__).parent / "names.yaml"
#: Least 1 - c^2 and p that are told apart: beyond, signatures and misfits are as good as the same.
#: By judgement: such a p is 4 of 4,000 draws.
LEAST = 1e-3


class Worth(StrictDocument):
    """Slides by other codes on which the same was said."""

    verdicts: list[Verdicts] = Field(description="that are counted together")
    slides: int = Field(ge=1)
    hidden: int = Field(ge=0, description="of them, that had something hidden in them")
    half_off: float = Field(ge=0, description="S_r was off by this factor, less 1, in half of them")
    most_off: float = Field(ge=0, description="and by this in nine of ten")
    held: int = Field(ge=0, description="of them, whose 95 % interval held S_r")
    beyond: float = Field(
        ge=0,
        description="standard deviation of ln S_r which, added to that of the fits, lets intervals "
        "hold S_r as often as they say",
    )

    def span(self, value: float) -> tuple[float, float]:
        """Between which S_r lay in nine of ten, had this been said of it."""
        return value / (1.0 + self.most_off), value * (1.0 + self.most_off)


class TrackRecord(StrictDocument):
    """Of all verdicts."""

    groups: list[Worth]


@dataclass(frozen=True)
class Figures:
    """What is seen of an explanation without the truth.

    Attributes:
        nearest: largest |cosine| of one of its effects to any other candidate.
        p_left: combined p of the tests of its model.
        share: of the probability among all that were tried.
    """

    nearest: float
    p_left: float
    share: float

    @classmethod
    def of(
        cls, nearest: Iterable[float], p_left: float, shares: Sequence[float], *, together: bool
    ) -> Figures:
        """Those of an explanation.

        Args:
            nearest: of each of its effects the largest |cosine| with an effect outside.
            p_left: combined p of the tests of its model.
            shares: of the probability, of the explanations that have some, the best first.
            together: they are one answer.
        """
        share = sum(shares) if together else shares[0]
        return cls(max(nearest, default=0.0), p_left, min(share, 1.0))

    @property
    def logs(self) -> tuple[float, float, float]:
        """As the law takes them: the larger, the better an explanation."""
        apart = max(1.0 - self.nearest**2, LEAST)
        return math.log(apart), math.log(max(self.p_left, LEAST)), self.share - 1.0


class NameRecord(StrictDocument):
    """How often an explanation was right: a logistic law that rises with each of its figures."""

    given: int = Field(ge=1, description="explanations whose truth is known")
    right: int = Field(ge=0, description="of them")
    intercept: float = Field(description="ln of the odds of one that nothing else looks like")
    apart: float = Field(ge=0, description="rise with ln(1 - c^2), c the largest |cosine|")
    p_left: float = Field(ge=0, description="rise with ln p of what is left")
    share: float = Field(ge=0, description="rise with the share of the probability")

    def chance(self, figures: Figures) -> float:
        """That an explanation with such figures is right."""
        slopes = (self.apart, self.p_left, self.share)
        rise = sum(slope * log for slope, log in zip(slopes, figures.logs, strict=True))
        return 1.0 / (1.0 + math.exp(-(self.intercept + rise)))


@cache
def name_record() -> NameRecord:
    """As it is kept."""
    return NameRecord.model_validate(read_yaml(NAMES))


def mean_worth() -> float:
    """Factor within which nine of ten strengths lay, whatever was said: mean over the slides."""
    groups = track_record().groups
    logs = sum(one.slides * math.log1p(one.most_off) for one in groups)
    return math.exp(logs / sum(one.slides for one in groups))


@cache
def track_record() -> TrackRecord:
    """As it is kept."""
    return TrackRecord.model_validate(read_yaml(FILE))


def factor_of(verdict: Verdicts | None) -> float:
    """Factor within which nine of ten strengths lay; that of all verdicts where this tells none."""
    known = None if verdict is None else worth_of(verdict)
    return mean_worth() if known is None else 1.0 + known.most_off


def beyond_list(verdict: Verdicts) -> float:
    """Standard deviation of ln S_r for what no list holds, where a verdict is given."""
    found = worth_of(verdict)
    return max(one.beyond for one in track_record().groups) if found is None else found.beyond


def worth_of(verdict: Verdicts) -> Worth | None:
    """What a verdict has been worth; None: it was never given."""
    return next((one for one in track_record().groups if verdict in one.verdicts), None)
