"""How far the strength is off on slides by other codes, by what the diagnosis said of them.

    python -m benchmarks.studies.strength_by_verdict

A verdict can only doubt what is on its list. What that leaves open is found where somebody else
made the truth: from the records of the third to the seventh set of slides by other codes
(`benchmarks/hidden_effects/foreign_*_results.json`), each judged once and sealed before that. Of
what was named then and would not be now (`deserved_names`) the mixture of the base model and the
answer is taken: what else would be quoted is not in the records.
How much wider than its fits a strength is (`Worth.beyond`) is fitted to all sets in which anything
may be missing, and tried on each by the others.
Renews parts of docs/method/diagnosis.md, and what reports say of it (`diagnosis.track_record`).
What is said of slides to come is tried on each set by the record of those before it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from benchmarks.hidden_effects.scoring.digest import StageDigest
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.hidden_effects.scoring.sets import SETS as ALL
from benchmarks.studies.deserved_names import is_deserved
from diagnosis.track_record import FILE, TrackRecord, Worth
from diagnosis.verdict.fitted_models import WIDE
from pipeline.files import write_text, yaml_text

PAGE = ROOT / "docs" / "method" / "diagnosis.md"
SETS = ("third", "fourth", "fifth", "sixth", "seventh")
CLOSED = "physics"
"""The set whose hidden effects are all on the list, but for a few: no measure of what is not."""
STRENGTH = "residual_strength"
WIDTHS = [step / 40.0 for step in range(25)]
"""Standard deviations of ln S_r that are tried; as fine as some ten slides can tell."""
MOST_MISSED = 0.1
"""Share of truths that 95 % intervals may miss, one at least: twice what they say, as in a set that
is to come."""
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
        off, std: of the logarithm of S_r that is quoted, its error and standard deviation by the
            fits.
        base_off: error of that of the base model.
    """

    verdict: str
    hidden: bool
    off: float
    std: float
    base_off: float

    @property
    def factor(self) -> float:
        """By which it is off, less 1, either way."""
        return float(np.expm1(abs(self.off)))

    def held(self, beyond: float) -> bool:
        """The 95 % interval holds the truth, with a standard deviation beyond the fits."""
        return abs(self.off) <= WIDE * math.hypot(self.std, beyond)

    def crps(self, beyond: float) -> float:
        """Continuous ranked probability score of ln S_r, a Gaussian; less is better."""
        std = math.hypot(self.std, beyond)
        z = self.off / std
        density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        return std * (z * math.erf(z / math.sqrt(2.0)) + 2.0 * density - 1.0 / math.sqrt(math.pi))


def slide(one: Judged) -> Slide:
    """What is needed of a record."""
    digest, true = one.digest, math.log(one.truth["parameters"][STRENGTH])
    base, base_std = log_strength(digest.base)
    verdict = digest.verdict
    if verdict == "identified" and not is_deserved(one):
        verdict = "unknown_effect"
        answer, answer_std = log_strength(digest.final)
        middle = 0.5 * (base + answer)
        std = math.sqrt(0.5 * (base_std**2 + answer_std**2) + 0.25 * (base - answer) ** 2)
    else:
        low, high = map(math.log, digest.quoted[STRENGTH]["95%"])
        whole, middle = (high - low) / (2.0 * WIDE), 0.5 * (low + high)
        std = math.sqrt(max(whole**2 - digest.beyond.get(STRENGTH, 0.0) ** 2, 0.0))
    return Slide(verdict, one.truth["kind"] != "null", middle - true, std, base - true)


def log_strength(stage: StageDigest) -> tuple[float, float]:
    """Ln S_r of a model, and its standard deviation, widened where the model fails."""
    value, std = stage.values[STRENGTH], stage.std[STRENGTH]
    return math.log(value), math.sqrt(max(stage.chi2 / max(stage.dof, 1), 1.0)) * std / value


def slides_by_set() -> dict[str, list[Slide]]:
    """Of each set in which anything may be missing, in the order in which they were judged."""
    return {one.words: [slide(case) for case in one.cases()] for one in ALL if one.words != CLOSED}


def by_other_codes(sets: Mapping[str, Sequence[Slide]]) -> dict[str, Sequence[Slide]]:
    """The sets that show what a verdict is worth."""
    return {name: sets[name] for name in SETS}


def said(verdicts: Sequence[str], sets: Mapping[str, Sequence[Slide]]) -> list[Slide]:
    """The slides of which one of some verdicts was given."""
    return [one for some in sets.values() for one in some if one.verdict in verdicts]


def beyond(found: Sequence[Slide]) -> float:
    """Of the standard deviations with which few 95 % intervals miss, that of the least CRPS."""
    if not found:
        return 0.0
    most = max(round(MOST_MISSED * len(found)), 1)
    enough = [std for std in WIDTHS if sum(not one.held(std) for one in found) <= most]
    return min(enough or WIDTHS, key=lambda std: float(np.mean([one.crps(std) for one in found])))


def tried(words: str, sets: Mapping[str, Sequence[Slide]]) -> dict[str, list[tuple[Slide, float]]]:
    """Slides of which something was said, by set, with what is beyond the fits by all others."""
    found = {}
    for name, some in sets.items():
        rest = {other: slides for other, slides in sets.items() if other != name}
        std = beyond(said(SAID[words], rest))
        found[name] = [(one, std) for one in some if one.verdict in SAID[words]]
    return found


def widened(sets: Mapping[str, Sequence[Slide]]) -> str:
    """What widening does, each set widened by the others: the part of the page."""
    header = ["said", "slides", "added to the std of ln S_r", "in the 95 % interval, before",
              "after", "CRPS, before", "after"]  # fmt: skip
    rows = []
    for words, verdicts in SAID.items():
        pairs = [pair for some in tried(words, sets).values() for pair in some]
        before = np.mean([[one.held(0.0), one.crps(0.0)] for one, _ in pairs], axis=0)
        after = np.mean([[one.held(std), one.crps(std)] for one, std in pairs], axis=0)
        rows.append(
            [words, str(len(pairs)), f"{beyond(said(verdicts, sets)):.3f}",
             f"{100 * before[0]:.0f} %", f"{100 * after[0]:.0f} %",
             f"{before[1]:.3f}", f"{after[1]:.3f}"]
        )  # fmt: skip
    return table(header, rows, "lrrrrrr")


def shown(sets: Mapping[str, Sequence[Slide]]) -> str:
    """The part of the page on what verdicts are worth."""
    found = [one for some in sets.values() for one in some]
    nulls = [one for one in found if not one.hidden]
    groups = {"nothing was hidden": nulls, "something was": [one for one in found if one.hidden]}
    groups |= {
        f"said: {words}": [one for one in found if one.verdict in verdicts]
        for words, verdicts in SAID.items()
    }
    header = ["", "slides", "S_r off, half of them", "nine of ten", "by the base model, half",
              "nine of ten"]  # fmt: skip
    groups = {words: some for words, some in groups.items() if some}
    rows = [
        [words, str(len(some)), *_spread([one.off for one in some]),
         *_spread([one.base_off for one in some])]
        for words, some in groups.items()
    ]  # fmt: skip
    return table(header, rows, "lrrrrr")


def worth(sets: Mapping[str, Sequence[Slide]]) -> TrackRecord:
    """What each verdict was worth on slides by other codes, and how much wider all make it."""
    groups = []
    for words, verdicts in SAID.items():
        pairs = tried(words, sets)
        some = [pair for name in SETS if name in sets for pair in pairs[name]]
        if some:
            half, most = _factors([one.off for one, _ in some])
            groups.append(
                Worth(
                    verdicts=list(verdicts),
                    slides=len(some),
                    hidden=sum(one.hidden for one, _ in some),
                    half_off=round(half, 3),
                    most_off=round(most, 3),
                    held=sum(one.held(std) for one, std in some),
                    beyond=beyond(said(verdicts, sets)),
                )
            )
    return TrackRecord(groups=groups)


def foretold(sets: Mapping[str, Sequence[Slide]]) -> str:
    """Each set by the record of those before it: the part of the page."""
    header = ["set", "slides", "within what half were off by", "within nine of ten"]
    rows = []
    for place, name in enumerate(SETS[1:], 1):
        groups = worth({one: sets[one] for one in SETS[:place]}).groups
        known = [
            (one, group) for one in sets[name] for group in groups if one.verdict in group.verdicts
        ]
        half, most = (
            sum(one.factor <= getattr(group, bound) for one, group in known)
            for bound in ("half_off", "most_off")
        )
        rows.append([name, *map(str, (len(known), half, most))])
    return table(header, rows, "lrrr")


def _factors(off: Sequence[float]) -> list[float]:
    """By which factor, less 1, half of some logarithms are off at most, and nine of ten."""
    return [float(np.expm1(np.quantile(np.abs(off), share))) for share in (0.5, 0.9)]


def _spread(off: Sequence[float]) -> list[str]:
    return [f"{100 * one:.0f} %" for one in _factors(off)]


if __name__ == "__main__":
    every = slides_by_set()
    renew(
        PAGE,
        strength=shown(by_other_codes(every)),
        widened=widened(every),
        foretold=foretold(every),
    )
    made = "# Made by python -m benchmarks.studies.strength_by_verdict\n"
    write_text(FILE, made + yaml_text(worth(every).model_dump()))
