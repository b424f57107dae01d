"""The score of a set whose truths are other codes' slides: names or families, family by family.

In: truths with a `source` and digests of verdicts. Out: shares with their intervals, and what
happened to S_r. A single is right if the verdict names a candidate or a family that stands for what
was hidden (`benchmarks.hidden_effects.foreign.hidden.THINGS`).
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import Any

from benchmarks.hidden_effects.foreign.hidden import FAMILIES, THINGS, Thing
from benchmarks.hidden_effects.scoring.asked import Asked
from benchmarks.hidden_effects.scoring.calibration import calibration
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.regions import regions
from benchmarks.hidden_effects.scoring.score import Judged

#: Ends of the bins of lambda; below the first inner one silence is right.
SEEN = (0.0, 10.0, 25.0, 60.0, math.inf)
ASKED = (
    Asked("nulls_attributed", "nulls to which something is attributed", 0.05, least=False),
    Asked("nulls_alarmed", "nulls with an alarm", None),
    Asked("right", "right name or family, of all single things", None),
    Asked("right_of_named", "right, when a name or a family is given (singles and nulls)", 0.85),
    Asked("held_out_falls", "held-out error falls, where the name is right", 0.90),
    Asked("strength_within_2_std", "S_r within two standard deviations, where right", 0.90),
    Asked("strength_within_2_std_null", "the same of nulls", None),
    Asked("explained_away", "strangers explained away", 0.15, least=False),
    Asked("explained_unlike", "the same without names that have the stranger's own law", None),
    Asked("pairs", "pairs found exactly", None),
)


@dataclass(frozen=True)
class ByCode:
    """A case of such a set.

    Attributes:
        judged: truth and digest.
    """

    judged: Judged

    @property
    def thing(self) -> Thing | None:
        """What was hidden; None: nothing."""
        names = list(self.judged.truth["effects"])
        return THINGS[names[0]] if names else None

    @property
    def families(self) -> frozenset[str]:
        """Families that the verdict gives, or those of the effects that it names."""
        digest = self.judged.digest
        named = digest.families or [digest.family_of.get(name, "") for name in digest.effects]
        return frozenset(named)

    @property
    def answers(self) -> bool:
        """The verdict gives one name, or a family."""
        digest = self.judged.digest
        one = len(digest.effects) == 1 or bool(digest.families)
        return digest.verdict == "identified" and one

    @property
    def right(self) -> bool:
        """What it gives stands for what was hidden, and nothing else is given."""
        digest = self.judged.digest
        if self.thing is None or not self.answers or len(self.judged.truth["effects"]) > 1:
            return False
        return right_for(self.thing, set(digest.effects), self.families, set(digest.members))

    @property
    def found_pair(self) -> bool:
        """Two effects are named, and each stands for another one of two hidden things."""
        digest = self.judged.digest
        things = [THINGS[name] for name in self.judged.truth["effects"]]
        if digest.verdict != "identified" or len(digest.effects) != 2 or len(things) != 2:
            return False
        return any(
            all(
                right_for(thing, {name}, frozenset({digest.family_of.get(name, "")}), {name})
                for thing, name in zip(things, names, strict=True)
            )
            for names in permutations(digest.effects)
        )

    @property
    def unlike(self) -> bool:
        """Of a stranger: it is explained by something whose law is not the stranger's."""
        named = set(self.judged.digest.effects)
        alike = self.thing.alike if self.thing is not None else frozenset()
        return self.judged.attributed and not (named and named <= alike)


def right_for(thing: Thing, named: set[str], families: frozenset[str], members: set[str]) -> bool:
    """Names, or families, stand for a thing and for nothing else.

    Physical effects are laws of their own: there the family alone says nothing, and one of its
    members that cannot be told apart must be right.
    """
    if thing.stranger:
        return False
    if named and named <= thing.right:
        return True
    if not families or not families <= thing.families:
        return False
    return "physics" not in families or bool((named | members) & thing.right)


def gives_name(one: Judged) -> bool:
    """A name, or of slides by the things of all families a family, is given."""
    return ByCode(one).answers if "source" in one.truth else one.named is not None


def is_right(one: Judged) -> bool:
    """What is given stands for what was hidden."""
    if "source" not in one.truth:
        return one.right
    return ByCode(one).right or ByCode(one).found_pair


def score_by_codes(judged: Sequence[Judged]) -> dict[str, Any]:
    """Every figure of a set: `shares`, `families`, `things` and `strength`, as JSON has it."""
    cases = [ByCode(one) for one in judged]
    shares = shares_of(cases)
    kinds = {kind: [one for one in cases if one.judged.truth["kind"] == kind] for kind in
             ("null", "single", "outside", "pair")}  # fmt: skip
    families = {
        family: Share.of(
            one.right for one in kinds["single"] if one.thing and family in one.thing.families
        ).document
        for family in FAMILIES
    }
    sources = sorted({one.judged.truth["source"] for one in cases})
    by_source = {
        name: {
            key: share.document
            for key, share in shares_of(
                [one for one in cases if one.judged.truth["source"] == name]
            ).items()
        }
        for name in sources
    }
    strength = {
        name: {
            stage: _median(abs(one.judged.strength_error(stage)) for one in members)
            for stage in ("base", "final")
        }
        for name, members in {**kinds, "right": [c for c in cases if c.right]}.items()
    }
    return {
        "counts": {kind: len(members) for kind, members in kinds.items()},
        "shares": {name: share.document for name, share in shares.items()},
        "families": families,
        "seen": _by_detectability(kinds["single"]),
        "sources": by_source,
        "strength_error": strength,
        "calibration": calibration(judged, stands_for_what_was_hidden).document,
        "regions": regions(judged),
        "cases": [_line(one) for one in cases],
    }


def stands_for_what_was_hidden(one: Judged, names: Sequence[str]) -> bool:
    """A right candidate of each thing of the truth and nothing else; none where none is hidden."""
    right = [THINGS[name].right for name in one.truth["effects"]]
    known = all(any(name in some for some in right) for name in names)
    return known and all(some & set(names) for some in right)


def shares_of(cases: Sequence[ByCode]) -> dict[str, Share]:
    """The figures of `ASKED`."""

    def of(kind: str) -> list[ByCode]:
        return [one for one in cases if one.judged.truth["kind"] == kind]

    def share(members: Sequence[ByCode], test: Callable[[ByCode], bool]) -> Share:
        return Share.of(test(one) for one in members)

    nulls, singles, strangers = of("null"), of("single"), of("outside")
    right = [one for one in singles if one.right]
    named = [one for one in (*singles, *nulls) if one.answers]
    return {
        "nulls_attributed": share(nulls, lambda one: one.judged.attributed),
        "nulls_alarmed": share(nulls, lambda one: one.judged.alarmed),
        "right": share(singles, lambda one: one.right),
        "right_of_named": share(named, lambda one: one.right),
        "held_out_falls": share(
            [one for one in right if one.judged.digest.base.held_out_n],
            lambda one: (
                one.judged.digest.final.held_out_chi2 < one.judged.digest.base.held_out_chi2
            ),
        ),
        "strength_within_2_std": share(right, lambda one: one.judged.strength_within),
        "strength_within_2_std_null": share(nulls, lambda one: one.judged.strength_within),
        "explained_away": share(strangers, lambda one: one.judged.attributed),
        "explained_unlike": share(strangers, lambda one: one.unlike),
        "pairs": share(of("pair"), lambda one: one.found_pair),
    }


def _by_detectability(singles: Sequence[ByCode]) -> list[dict[str, Any]]:
    """Singles by lambda: how many raise an alarm, are right, and bear a wrong name or family."""
    rows = []
    for low, high in pairwise(SEEN):
        members = [one for one in singles if low <= one.judged.truth["lambda"] < high]
        rows.append({
            "from": low,
            "to": high if math.isfinite(high) else None,
            "alarmed": Share.of(one.judged.alarmed for one in members).document,
            "right": Share.of(one.right for one in members).document,
            "wrong": Share.of(one.answers and not one.right for one in members).document,
        })  # fmt: skip
    return rows


def _line(one: ByCode) -> dict[str, Any]:
    """What was hidden and what was said of it, for a table."""
    truth, digest = one.judged.truth, one.judged.digest
    name = next(iter(truth["parameters"]))
    strengths = [truth["parameters"][name], digest.base.values[name], digest.final.values[name]]
    return {
        "name": truth["name"],
        "source": truth["source"],
        "hidden": list(truth["effects"]),
        "lambda": truth["lambda"],
        "verdict": digest.verdict,
        "named": list(digest.effects),
        "families": sorted(one.families),
        "right": one.right or one.found_pair,
        "strength": strengths,  # true, without what is named, with it
    }


def _median(values: Any) -> float | None:
    known = [value for value in values if math.isfinite(value)]
    return round(statistics.median(known), 5) if known else None
