"""The score: what a judge said of sealed cases, held against what is true.

In: truths and digests of verdicts, in pairs. Out: a `Score`, every figure a share with its Wilson
interval or a median. A case whose truth cannot be seen well is not left out: figures are binned by
its detectability lambda.

*Named* means one single name, the right one, of a verdict `identified`. It is asked for where the
truth's signature differs from every rival's (largest |cosine| below 0.95); elsewhere success is a
90 % set of at most three explanations that holds the truth. Both are reported.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.hidden_effects.making.benchmark import Bound
from benchmarks.hidden_effects.making.detectability import BINS, bin_of
from benchmarks.hidden_effects.scoring.digest import Digest
from benchmarks.hidden_effects.scoring.intervals import Share
from pipeline.cli import InputError

#: |cosine| from which two effects are the same to the data; most explanations of a useful set.
INSEPARABLE, MOST = 0.95, 3
#: Verdicts that attribute the misfit to effects.
ATTRIBUTED = ("identified", "ambiguous")
#: Combined p of the base model below which it is inadequate: an alarm.
ALARM_P = 0.05


@dataclass(frozen=True)
class Judged:
    """A truth and what was said of it.

    Attributes:
        truth: the opened document.
        digest: of the verdict.
        curve_found: of a strength law outside the library: its curve was recovered; None: no law,
            or no curve was asked for.
        like_law: of the same: a law of the library was named that runs like it.
    """

    truth: Mapping[str, Any]
    digest: Digest
    curve_found: bool | None = None
    like_law: bool = False

    @property
    def hidden(self) -> frozenset[str]:
        """Names of what was hidden."""
        return frozenset(self.truth["effects"])

    @property
    def attributed(self) -> bool:
        """The misfit is attributed to effects, one or several that cannot be distinguished."""
        digest = self.digest
        return digest.verdict in ATTRIBUTED and bool(digest.effects or any(digest.set_90))

    @property
    def alarmed(self) -> bool:
        """The base model is called inadequate, whatever is said of the cause."""
        return self.digest.base.p < ALARM_P

    @property
    def named(self) -> str | None:
        """The single effect that the verdict names, or None; a family is no name."""
        names = list(self.digest.effects)
        one = self.digest.verdict == "identified" and len(names) == 1 and not self.digest.families
        return names[0] if one else None

    @property
    def right(self) -> bool:
        """One effect was hidden, and it alone was named."""
        return self.named is not None and self.hidden == {self.named}

    @property
    def explained_away(self) -> bool:
        """Effects are named for what was hidden, and not it; of a stranger.

        The library has one stranger under its own name: spatial variability, whose fields are
        random. To name it is right, although the hidden field is another than the named.
        """
        return self.attributed and not self.right

    @property
    def law_found(self) -> bool:
        """Of a strength law outside the library: its curve was drawn, or a law like it named."""
        return bool(self.curve_found or self.right or (self.attributed and self.like_law))

    @property
    def found_exactly(self) -> bool:
        """The verdict names the effects that were hidden and no other."""
        return self.attributed and set(self.digest.effects) == self.hidden

    @property
    def found_half(self) -> bool:
        """The verdict names one of the effects that were hidden."""
        return self.attributed and bool(set(self.digest.effects) & self.hidden)

    @property
    def beside(self) -> float | None:
        """Of two effects, lambda of the fainter given the other; None where it was not recorded.

        Given the other at no amplitude at all it is lambda of both.
        """
        found = self.truth.get("beside")
        return None if found is None else min(float(found), self.seen)

    @property
    def set_holds(self) -> bool:
        """The 90 % set holds exactly what was hidden."""
        return any(set(names) == self.hidden for names in self.digest.set_90)

    @property
    def useful_set(self) -> bool:
        """It does, and has at most three explanations."""
        return self.set_holds and len(self.digest.set_90) <= MOST

    @property
    def separable(self) -> bool:
        """No rival looks like what was hidden; of one effect."""
        (name,) = self.hidden
        return self.digest.nearest.get(name, 0.0) < INSEPARABLE

    @property
    def seen(self) -> float:
        """Lambda."""
        return float(self.truth["lambda"])

    @property
    def bin(self) -> int:
        """Bin of lambda; of a case at the very end of the last, that."""
        return _bin(self.seen)

    def strength_error(self, stage: str) -> float:
        """Ln of the first parameter over the truth, of the `base` or the `final` model."""
        name = next(iter(self.truth["parameters"]))
        found = getattr(self.digest, stage).values[name]
        return math.log(found / self.truth["parameters"][name])

    @property
    def strength_within(self) -> bool:
        """The truth lies within two standard deviations of the final first parameter."""
        name = next(iter(self.truth["parameters"]))
        final = self.digest.final
        return abs(final.values[name] - self.truth["parameters"][name]) <= 2.0 * final.std[name]


def _bin(seen: float) -> int:
    found = bin_of(seen)
    return len(BINS) - 2 if found is None else found


@dataclass(frozen=True)
class Score:
    """Figures of a benchmark; `benchmarks.hidden_effects.scoring.asked` says what is asked of them.

    Attributes:
        shares: name -> share.
        medians: name -> median, None of nothing.
        bins: name -> share in each bin of lambda.
        counts: cases of each kind.
    """

    shares: dict[str, Share]
    medians: dict[str, float | None]
    bins: dict[str, list[Share]]
    counts: dict[str, int]

    @property
    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "counts": self.counts,
            "shares": {name: share.document for name, share in self.shares.items()},
            "medians": self.medians,
            "bins": {
                name: [share.document for share in shares] for name, shares in self.bins.items()
            },
        }


def score(judged: Sequence[Judged]) -> Score:
    """Every figure of a row of judged cases."""
    kinds = {
        kind: [one for one in judged if one.truth["kind"] == kind]
        for kind in ("single", "null", "pair", "outside")
    }
    singles, nulls, pairs, outside = kinds.values()
    clear = [one for one in singles if one.separable]
    alike = [one for one in singles if not one.separable]
    answered = [one for one in singles if one.attributed]
    right = [one for one in singles if one.right]
    named = [one for one in (*singles, *nulls) if one.named is not None]
    held = [one for one in right if one.digest.base.held_out_n]
    laws = [one for one in outside if one.curve_found is not None]
    shares = {
        "false_attribution": Share.of(one.attributed for one in nulls),
        "false_verdict": Share.of(one.digest.verdict == "identified" for one in nulls),
        "false_alarm": Share.of(one.alarmed for one in nulls),
        "precision": Share.of(one.right for one in named),
        "precision_all_kinds": Share.of(one.right for one in judged if one.named is not None),
        "named_25": _share(clear, lambda one: one.right, 25.0),
        "named_60": _share(clear, lambda one: one.right, 60.0),
        "set_of_three_25": _share(alike, lambda one: one.useful_set, 25.0),
        "set_of_three_60": _share(alike, lambda one: one.useful_set, 60.0),
        "set_holds_truth": Share.of(one.set_holds for one in answered),
        "held_out_falls": Share.of(
            one.digest.final.held_out_chi2 < one.digest.base.held_out_chi2 for one in held
        ),
        "strength_within_2_std": Share.of(one.strength_within for one in right),
        "strength_within_2_std_all": Share.of(one.strength_within for one in judged),
        "pair_exact": Share.of(one.found_exactly for one in pairs),
        "pair_exact_25": Share.of(one.found_exactly for one in pairs if (one.beside or 0.0) >= 25),
        "pair_half": Share.of(one.found_half for one in pairs),
        "explained_away": Share.of(one.explained_away for one in outside),
        "named_away": Share.of(
            one.digest.verdict == "identified" and not one.right for one in outside
        ),
        "explained_unlike": Share.of(one.explained_away and not one.like_law for one in outside),
        "curve_recovered": Share.of(one.curve_found for one in laws),
        "law_found": Share.of(one.law_found for one in laws),
        "law_found_25": _share(laws, lambda one: one.law_found, 25.0),
    }
    medians = {
        "strength_error_base": _median(abs(one.strength_error("base")) for one in right),
        "strength_error_final": _median(abs(one.strength_error("final")) for one in right),
        "strength_error_base_all": _median(abs(one.strength_error("base")) for one in singles),
        "strength_error_final_all": _median(abs(one.strength_error("final")) for one in singles),
        "held_out_base": _median(_per_number(one, "base") for one in held),
        "held_out_final": _median(_per_number(one, "final") for one in held),
        "set_size": _median(float(len(one.digest.set_90)) for one in answered),
        "runs": _median(float(one.digest.runs) for one in judged),
        "seconds": _median(one.digest.seconds for one in judged),
    }
    bins = {
        "named": _binned(clear, lambda one: one.right),
        "set_of_three": _binned(alike, lambda one: one.useful_set),
        "named_or_set": _binned(
            singles, lambda one: one.right if one.separable else one.useful_set
        ),
        "right": _binned(singles, lambda one: one.right),
        "alarm": _binned(singles, lambda one: one.alarmed),
        "set_holds": _binned(singles, lambda one: one.set_holds),
        "wrong_name": _binned(singles, lambda one: one.named is not None and not one.right),
        "pair_exact": _beside(pairs, lambda one: one.found_exactly),
        "pair_half": _beside(pairs, lambda one: one.found_half),
    }
    counts = {kind: len(members) for kind, members in kinds.items()}
    return Score(shares, medians, bins, counts)


def _per_number(one: Judged, stage: str) -> float:
    part = getattr(one.digest, stage)
    return part.held_out_chi2 / part.held_out_n


def _share(cases: Sequence[Judged], test: Callable[[Judged], bool], least: float) -> Share:
    return Share.of(test(one) for one in cases if one.seen >= least)


def _binned(cases: Sequence[Judged], test: Callable[[Judged], bool]) -> list[Share]:
    return [
        Share.of(test(one) for one in cases if one.bin == number) for number in range(len(BINS) - 1)
    ]


def _beside(pairs: Sequence[Judged], test: Callable[[Judged], bool]) -> list[Share]:
    """By the bin of the fainter effect given the other."""
    return [
        Share.of(
            test(one) for one in pairs if one.beside is not None and _bin(one.beside) == number
        )
        for number in range(len(BINS) - 1)
    ]


def _median(values: Any) -> float | None:
    known = [float(value) for value in values]
    return round(statistics.median(known), 5) if known else None


def broken(promises: Mapping[str, Bound], found: Score) -> list[str]:
    """A line for each figure of a score that is not as its plan promises.

    Raises:
        InputError: there is no such figure.
    """
    lines = []
    for name, bound in promises.items():
        if name not in found.shares:
            raise InputError(f"promises: {name}: allowed are {', '.join(found.shares)}")
        hits = found.shares[name].hits
        if bound.at_least is not None and hits < bound.at_least:
            lines.append(f"{name}: {hits} of {found.shares[name].n}, at least {bound.at_least}")
        if bound.at_most is not None and hits > bound.at_most:
            lines.append(f"{name}: {hits} of {found.shares[name].n}, at most {bound.at_most}")
    return lines
