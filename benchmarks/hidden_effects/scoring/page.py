"""The page of a score: what was asked, what was reached, every miss.

In: the record's rows. Out: Markdown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.making.detectability import BINS
from benchmarks.hidden_effects.run import METHOD
from benchmarks.hidden_effects.scoring.asked import ASKED, MISSED, STRENGTH_FACTOR
from benchmarks.hidden_effects.scoring.calibration import (
    LEVELS,
    STATED,
    calibration,
    in_band,
)
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.score import Judged, Score

ENDS = [f"{low:g}-{high:g}" for low, high in zip(BINS, BINS[1:], strict=False)]
"""The bins of lambda, in words."""
NONE_QUOTED = (
    " These verdicts quote none: intervals by the standard deviation of the final model, without "
    "the error of its effects."
)
VARIANT_WORDS = {
    METHOD: "the method",
    "no_model_error": "without the model's own error (C_num)",
    "no_projection": "without projection",
    "tangent_only": "smallest amplitude alone (tangent)",
}


def generated(
    method: Score, ablations: Mapping[str, Score], judged: Sequence[Judged], pictures: str
) -> str:
    """All of it.

    Args:
        method: score of the method.
        ablations: variant -> its score, the method among them, all on the same cases; may be empty.
        judged: cases as the method judged them.
        pictures: folder of the pictures, as the page sees it.
    """
    counts = method.counts
    parts = [
        f"{sum(counts.values())} cases: {counts['single']} with one effect, {counts['null']} with "
        f"none, {counts['pair']} with two, {counts['outside']} with a stranger to the library. "
        f"Median of {method.medians['runs']:.0f} forward runs a case. Intervals: 95 %, Wilson.",
        "### What was asked", _asked(method),
        f"![Every figure with its interval and what is asked of it]({pictures}/asked.png)",
        f"![Named and alarmed over detectability]({pictures}/detectability.png)",
        "### By detectability", _bins(method),
        "### Pairs", _pairs(method),
        f"![What was hidden and what was said]({pictures}/confusion.png)",
        "### By effect", _effects(judged),
        f"![Error of S_r before and after]({pictures}/strength.png)",
        "### Calibration", calibration_text(judged),
        f"![Stated probabilities and levels against what was so]({pictures}/calibration.png)",
        "### Ablations", _ablations(ablations),
        "### Every miss", _misses(judged),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _asked(method: Score) -> str:
    rows = [
        (one.words, method.shares[one.name].words, one.bound,
         one.verdict(method.shares[one.name]))
        for one in ASKED
    ]  # fmt: skip
    before, after = (method.medians[f"strength_error_{stage}"] for stage in ("base", "final"))
    if before is not None and after is not None:
        factor = before / max(after, 1e-9)
        met = "met" if factor >= STRENGTH_FACTOR else MISSED
        rows.append(
            ("median error of ln S_r before and after, where the name is right",
             f"{before:.3f} -> {after:.3f}, {factor:.1f} times less",
             f"at least {STRENGTH_FACTOR:.0f} times less", met)
        )  # fmt: skip
    everywhere = [method.medians[f"strength_error_{stage}_all"] for stage in ("base", "final")]
    if None not in everywhere:
        rows.append(("the same in all singles", f"{everywhere[0]:.3f} -> {everywhere[1]:.3f}",
                     "", ""))  # fmt: skip
    held = [method.medians[f"held_out_{stage}"] for stage in ("base", "final")]
    if None not in held:
        rows.append(("median of held-out chi2 per number, before and after",
                     f"{held[0]:.2f} -> {held[1]:.2f}", "", ""))  # fmt: skip
    return table(("figure", "measured", "asked", ""), rows)


def _bins(method: Score) -> str:
    words = {
        "alarm": "alarm",
        "named": "named, where no rival looks alike",
        "set_of_three": "look-alikes: set of at most three holds the truth",
        "named_or_set": "either of the two, as it applies",
        "set_holds": "the 90 % set holds the truth",
        "wrong_name": "a wrong name alone",
    }
    ends = [f"lambda {end}" for end in ENDS]
    rows = [(words[name], *(share.words for share in method.bins[name])) for name in words]
    return table(("singles", *ends), rows)


def _pairs(method: Score) -> str:
    words = {"pair_exact": "both found, and nothing else", "pair_half": "at least one of the two"}
    rows = [(words[name], *(share.words for share in method.bins[name])) for name in words]
    return (
        "By lambda of the fainter effect given the other: what is left of the slide once the base "
        "model and the other effect have been refitted.\n\n"
    ) + table(("pairs", *ENDS), rows)


def calibration_text(judged: Sequence[Judged]) -> str:
    """Coverage of the quoted intervals, and reliability of the probabilities where there are."""
    whole = calibration(judged)
    quoted = any(one.digest.quoted for one in judged)
    parts = [
        whole,
        calibration([one for one in judged if one.truth["kind"] == "null"]),
        calibration([one for one in judged if one.right]),
    ]
    rows = [
        (level, *(_in_words(level, part.coverage[level]) for part in parts)) for level in LEVELS
    ]
    said = [
        "Intervals of S_r that the verdicts quote; missed: the level lies outside the 95 % "
        f"interval of the share.{'' if quoted else NONE_QUOTED}",
        table(("interval holds the truth", "all", "nulls", "where the name is right"), rows),
    ]
    if any(one.right.n for one in whole.reliability):
        ends = [f"{low:g}-{high:g}" for low, high in zip(STATED, STATED[1:], strict=False)]
        stated = [
            (end, "-" if one.stated is None else f"{one.stated:.2f}", one.right.words)
            for end, one in zip(ends, whole.reliability, strict=True)
        ]
        said += [
            "Explanations of the 90 % sets by the probability they were given.",
            table(("probability", "mean stated", "right"), stated),
        ]
    return "\n\n".join(said)


def _in_words(level: str, share: Share) -> str:
    return f"{share.words} {MISSED}" if in_band(level, share) is False else share.words


def _effects(judged: Sequence[Judged]) -> str:
    """By effect and bin of lambda: how many were named, of how many."""
    singles = [one for one in judged if one.truth["kind"] == "single"]
    rows = []
    for name in sorted({min(one.hidden) for one in singles}):
        own = [one for one in singles if one.hidden == {name}]
        wrong = [one.named for one in own if one.named is not None and not one.right]
        nearest = max(one.digest.nearest.get(name, 0.0) for one in own)
        rows.append(
            (name, *(_of([one for one in own if one.bin == k]) for k in range(len(BINS) - 1)),
             f"{sum(one.useful_set for one in own)} of {len(own)}", f"{nearest:.2f}",
             ", ".join(sorted(set(wrong))) or "none")
        )  # fmt: skip
    header = ("hidden", *(f"named at lambda {end}" for end in ENDS), "set of three holds it",
              "largest cosine to a rival", "wrong names")  # fmt: skip
    return table(header, rows)


def _of(cases: Sequence[Judged]) -> str:
    """How many were named, of how many; a dash of none."""
    return f"{sum(one.right for one in cases)} of {len(cases)}" if cases else "-"


def _ablations(scores: Mapping[str, Score]) -> str:
    if not scores:
        return "None was run."
    n = sum(next(iter(scores.values())).counts.values())
    chosen = ("false_attribution", "false_alarm", "precision", "named_25", "set_of_three_25",
              "set_holds_truth", "pair_exact", "explained_away")  # fmt: skip
    words = {one.name: one.words for one in ASKED}
    rows = [
        (VARIANT_WORDS.get(variant, variant), *(found.shares[name].words for name in chosen))
        for variant, found in scores.items()
    ]
    return f"All on the same {n} cases.\n\n" + table(("", *(words[name] for name in chosen)), rows)


def _misses(judged: Sequence[Judged]) -> str:
    tests: dict[str, Callable[[Judged], bool]] = {
        "null": lambda one: one.attributed or one.alarmed,
        "single": lambda one: (
            one.seen >= BINS[2]
            and not (one.right if one.separable else one.useful_set)
            or (one.named is not None and not one.right)
        ),
        "pair": lambda one: not one.found_exactly,
        "outside": lambda one: one.explained_away,
    }
    rows = [
        (one.truth["name"], one.truth["section"], one.truth["survey"],
         " + ".join(sorted(one.hidden)) or "nothing", _lambda(one),
         one.digest.verdict.replace("_", " "), " + ".join(sorted(one.digest.effects)) or "none",
         "; ".join(" + ".join(names) or "none" for names in one.digest.set_90[:3]))
        for one in judged
        if tests[one.truth["kind"]](one)
    ]  # fmt: skip
    header = ("case", "section", "survey", "hidden", "lambda", "verdict", "effects", "90 % set")
    note = (
        "Nulls with an alarm or an attribution; singles that bear a wrong name, and from lambda 25 "
        "on those that were neither named nor held by a useful set; pairs not found exactly; "
        "strangers explained away."
    )
    return f"{note}\n\n{table(header, rows)}" if rows else "None."


def _lambda(one: Judged) -> str:
    if one.beside is None:
        return f"{one.seen:.0f}"
    return f"{one.seen:.0f}, {one.beside:.0f} given the other"
