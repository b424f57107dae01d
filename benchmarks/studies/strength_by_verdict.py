"""How far the strength is off on slides by other codes, by what the diagnosis said of them.

    python -m benchmarks.studies.strength_by_verdict

A verdict can only doubt what is on its list. What that leaves open is found where somebody else
made the truth: from the records of the third to the sixth set of slides by other codes
(`benchmarks/hidden_effects/foreign_*_results.json`), each judged once and sealed before that. Of
what was named then and would not be now (`deserved_names`) the base model's strength is taken: what
would be quoted is not in the records.
Renews parts of docs/method/diagnosis.md, and what reports say of it (`diagnosis.track_record`).
What is said of slides to come is tried on each set by the record of those before it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from benchmarks.hidden_effects.scoring.digest import METHOD, Digest
from benchmarks.hidden_effects.scoring.opened import Row, load_rows
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.studies.deserved_names import is_deserved
from diagnosis.track_record import FILE, TrackRecord, Worth
from diagnosis.verdict.fitted_models import WIDE
from pipeline.files import write_text, yaml_text

PAGE = ROOT / "docs" / "method" / "diagnosis.md"
FOLDER = Path(__file__).resolve().parent.parent / "hidden_effects"
SETS = ("third", "fourth", "fifth", "sixth")
STRENGTH = "residual_strength"
#: Verdicts as the page groups them, and how.
SAID = {
    "adequate": ("adequate",),
    "identified": ("identified",),
    "suspect, unknown effect": ("suspect", "unknown_effect"),
    "ambiguous": ("ambiguous",),
}


@dataclass(frozen=True)
class Slide:
    """A slide by another code, and what was said of it.

    Attributes:
        verdict: of the diagnosis; hidden: something was.
        true: S_r of the slide; low, high: quoted 95 % interval; base: of the base model [kPa].
    """

    verdict: str
    hidden: bool
    true: float
    low: float
    high: float
    base: float

    @property
    def off(self) -> float:
        """Of the middle of the interval, as a logarithm."""
        return float(np.log(np.sqrt(self.low * self.high) / self.true))

    @property
    def factor(self) -> float:
        """By which it is off, less 1, either way."""
        return float(np.expm1(abs(self.off)))

    @property
    def base_off(self) -> float:
        """Of the base model, as a logarithm."""
        return float(np.log(self.base / self.true))

    @property
    def held(self) -> bool:
        """The interval holds the truth."""
        return self.low <= self.true <= self.high


def slide(row: Row) -> Slide:
    """What is needed of a record."""
    truth, digest = row["truth"], Digest.model_validate(row["verdicts"][METHOD])
    base, std = digest.base.values[STRENGTH], digest.base.std[STRENGTH]
    low, high = digest.quoted[STRENGTH]["95%"]
    verdict = digest.verdict
    if verdict == "identified" and not is_deserved(Judged(truth, digest)):
        verdict = "unknown_effect"
        far = math.exp(WIDE * std / base)
        low, high = base / far, base * far
    return Slide(verdict, truth["kind"] != "null", truth["parameters"][STRENGTH], low, high, base)


def slides_by_set() -> dict[str, list[Slide]]:
    """Of each set, in the order in which they were judged."""
    return {
        name: [slide(row) for row in load_rows(FOLDER / f"foreign_{name}_results.json")]
        for name in SETS
    }


def slides() -> list[Slide]:
    """All of the sets."""
    return [one for some in slides_by_set().values() for one in some]


def shown(found: Sequence[Slide]) -> str:
    """The part of the page."""
    nulls = [one for one in found if not one.hidden]
    groups = {"nothing was hidden": nulls, "something was": [one for one in found if one.hidden]}
    groups |= {
        f"said: {words}": [one for one in found if one.verdict in verdicts]
        for words, verdicts in SAID.items()
    }
    header = ["", "slides", "S_r off, half of them", "nine of ten", "by the base model, half",
              "nine of ten", "in the 95 % interval"]  # fmt: skip
    groups = {words: some for words, some in groups.items() if some}
    rows = [
        [words, str(len(some)), *_spread([one.off for one in some]),
         *_spread([one.base_off for one in some]),
         f"{sum(one.held for one in some)}"]
        for words, some in groups.items()
    ]  # fmt: skip
    return table(header, rows, "lrrrrrr")


def worth(found: Sequence[Slide]) -> TrackRecord:
    """What each verdict was worth."""
    groups = []
    for verdicts in SAID.values():
        some = [one for one in found if one.verdict in verdicts]
        if some:
            half, most = _factors([one.off for one in some])
            groups.append(
                Worth(
                    verdicts=list(verdicts),
                    slides=len(some),
                    hidden=sum(one.hidden for one in some),
                    half_off=round(half, 3),
                    most_off=round(most, 3),
                    held=sum(one.held for one in some),
                )
            )
    return TrackRecord(groups=groups)


def foretold(sets: Mapping[str, Sequence[Slide]]) -> str:
    """Each set by the record of those before it: the part of the page."""
    header = ["set", "slides", "within what half were off by", "within nine of ten",
              "in the 95 % interval"]  # fmt: skip
    rows, before = [], []
    for name, some in sets.items():
        if before:
            groups = worth(before).groups
            known = [
                (one, group) for one in some for group in groups if one.verdict in group.verdicts
            ]
            half, most = (
                sum(one.factor <= getattr(group, bound) for one, group in known)
                for bound in ("half_off", "most_off")
            )
            held = sum(one.held for one, _ in known)
            rows.append([name, *map(str, (len(known), half, most, held))])
        before = [*before, *some]
    return table(header, rows, "lrrrr")


def _factors(off: Sequence[float]) -> list[float]:
    """By which factor, less 1, half of some logarithms are off at most, and nine of ten."""
    return [float(np.expm1(np.quantile(np.abs(off), share))) for share in (0.5, 0.9)]


def _spread(off: Sequence[float]) -> list[str]:
    return [f"{100 * one:.0f} %" for one in _factors(off)]


if __name__ == "__main__":
    sets = slides_by_set()
    known = [one for some in sets.values() for one in some]
    renew(PAGE, strength=shown(known), foretold=foretold(sets))
    made = "# Made by python -m benchmarks.studies.strength_by_verdict\n"
    write_text(FILE, made + yaml_text(worth(known).model_dump()))
