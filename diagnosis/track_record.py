"""What verdicts have been worth: how far S_r was off on slides that other codes made.

In: a verdict. Out: `Worth` of those slides with the same one, from `track_record.yaml`, which
`python -m benchmarks.studies.strength_by_verdict` writes from sealed benchmarks. It belongs next to
every strength that is quoted: what a diagnosis does not know of is in no standard deviation.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

from pydantic import Field

from diagnosis.selection.decide import Verdicts
from pipeline.documents import StrictDocument
from pipeline.files import read_yaml

FILE = Path(__file__).parent / "track_record.yaml"


class Worth(StrictDocument):
    """Slides by other codes on which the same was said."""

    verdicts: list[Verdicts] = Field(description="that are counted together")
    slides: int = Field(ge=1)
    hidden: int = Field(ge=0, description="of them, that had something hidden in them")
    half_off: float = Field(ge=0, description="S_r was off by this factor, less 1, in half of them")
    most_off: float = Field(ge=0, description="and by this in nine of ten")
    held: int = Field(ge=0, description="of them, whose 95 % interval held S_r")

    def span(self, value: float) -> tuple[float, float]:
        """Between which S_r lay in nine of ten, had this been said of it."""
        return value / (1.0 + self.most_off), value * (1.0 + self.most_off)


class TrackRecord(StrictDocument):
    """Of all verdicts."""

    groups: list[Worth]


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


def worth_of(verdict: Verdicts) -> Worth | None:
    """What a verdict has been worth; None: it was never given."""
    return next((one for one in track_record().groups if verdict in one.verdicts), None)
