"""How often a name is right, by what can be seen of its verdict without the truth.

    python -m benchmarks.studies.deserved_names

From every verdict of the opened sets, and of the slides judged without what is hidden in them, that
gives an explanation: `diagnosis.track_record.Figures` and whether it was right. A logistic law that
may only rise with each of them is fitted, and tried on what it has not seen: on every hidden thing
by the law of the others, and on every set. Renews a part of docs/records/hidden-effects.md and the
law that a diagnosis uses (`names.yaml` beside `diagnosis/track_record.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from scipy.optimize import minimize

from benchmarks.generated_pages import renew, table
from benchmarks.hidden_effects.scoring.by_other_codes import is_right, stands_for_what_was_hidden
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.hidden_effects.scoring.sets import PAGE, SETS
from benchmarks.hidden_effects.strangers import RECORD, load_twice
from diagnosis.options import Options
from diagnosis.track_record import NAMES, Figures, NameRecord, name_record
from pipeline.files import write_text, yaml_text

#: Weight of the squares of the law's slopes, next to the logarithm of the likelihood.
RIDGE = 0.05
#: Least chances for which the page says what would have been given.
LEAST = (0.0, 0.5, 0.65, 0.75, 0.8, 0.85)
#: Ends of the classes of chance that are held against what was right.
CLASSES = (0.0, 0.6, 0.7, 0.8, 1.0)


@dataclass(frozen=True)
class Given:
    """An explanation that was given of a slide whose truth is known.

    Attributes:
        of: its set; hidden: the things that were, joined.
        stranger: what was hidden was on no list; named: one explanation was given, and not several.
        figures: of the verdict; right: it stands for what was hidden, and for nothing else.
    """

    of: str
    hidden: str
    stranger: bool
    named: bool
    figures: Figures
    right: bool


def figures_of(one: Judged) -> Figures:
    """What the law sees of a verdict."""
    digest = one.digest
    leading = list(digest.effects) or digest.set_90[0]
    # Earlier records have no probabilities: several that share them have each as much.
    shares = digest.shares or [1.0 / len(digest.set_90)] * len(digest.set_90)
    return Figures.of(
        (digest.nearest.get(name, 0.0) for name in leading),
        digest.final.p,
        shares,
        together=bool(digest.families),
    )


def is_deserved(one: Judged) -> bool:
    """A name that was given would be given now."""
    return name_record().chance(figures_of(one)) >= Options().deserved


def explains(one: Judged) -> bool:
    """It has an explanation, given or withheld by an earlier law."""
    return one.attributed or one.digest.would_explain


def holds_truth(one: Judged) -> bool:
    """What was hidden is what was given, or is among the explanations of an ambiguous verdict."""
    hidden = set(one.truth["effects"])
    if one.digest.verdict == "identified" and is_right(one):
        return True
    answers = one.digest.set_90 if one.digest.verdict == "ambiguous" else [one.digest.effects]
    sets = [set(names) for names in answers]
    if "source" not in one.truth:
        return bool(hidden) and hidden in sets
    return any(names and stands_for_what_was_hidden(one, names) for names in sets)


def given_of(of: str, one: Judged, *, known: bool = True) -> Given:
    """A verdict with an explanation; `known`: what was hidden was on the list."""
    stranger = not known or one.truth["kind"] == "outside"
    hidden = " + ".join(sorted(one.truth["effects"]))
    named = one.digest.verdict != "ambiguous"
    return Given(of, hidden, stranger, named, figures_of(one), known and holds_truth(one))


def given() -> tuple[list[Given], int]:
    """Every explanation that was given, and how many slides had a stranger in them."""
    found, strangers = [], 0
    for one in SETS:
        verdicts = one.cases()
        strangers += sum(verdict.truth["kind"] == "outside" for verdict in verdicts)
        found += [given_of(one.words, verdict) for verdict in verdicts if explains(verdict)]
    for twice in load_twice(RECORD):  # by the whole library they are in their sets
        if twice.by_rest is not None and explains(twice.by_rest):
            found.append(given_of(f"{twice.of}, twice", twice.by_rest, known=False))
        strangers += twice.by_rest is not None
    return found, strangers


def fitted(known: Sequence[Given]) -> NameRecord:
    """The law of these."""
    seen = np.array([[1.0, *one.figures.logs] for one in known])
    right = np.array([one.right for one in known])

    def loss(law: np.ndarray) -> float:
        z = np.where(right, 1.0, -1.0) * (seen @ law)
        return float(np.logaddexp(0.0, -z).sum() + RIDGE * (law[1:] ** 2).sum())

    bounds = [(None, None), *[(0.0, None)] * (seen.shape[1] - 1)]
    law = minimize(loss, np.zeros(seen.shape[1]), bounds=bounds, method="L-BFGS-B", tol=1e-12).x
    intercept, apart, p_left, share = (round(float(number), 2) for number in law)
    return NameRecord(
        given=len(known),
        right=int(right.sum()),
        intercept=intercept,
        apart=apart,
        p_left=p_left,
        share=share,
    )


def unseen(known: Sequence[Given], by: Callable[[Given], str]) -> np.ndarray:
    """The chance of each by the law of those of other groups, (n,)."""
    laws = {
        group: fitted([one for one in known if by(one) != group]) for group in set(map(by, known))
    }
    return np.array([laws[by(one)].chance(one.figures) for one in known])


def share_of_others(known: Sequence[Given], by: Callable[[Given], str]) -> np.ndarray:
    """Of each the share of right ones in other groups, (n,): a law that looks at nothing."""
    right = np.array([one.right for one in known])
    groups = np.array(list(map(by, known)))
    return np.array([right[groups != group].mean() for group in groups])


def log_score(known: Sequence[Given], chance: np.ndarray) -> float:
    """Mean logarithm of the probability of what came out, less is worse."""
    right = np.array([one.right for one in known])
    return float(np.mean(np.log(np.where(right, chance, 1.0 - chance))))


def classes(known: Sequence[Given], chance: np.ndarray) -> Iterator[list[str]]:
    """Of each class of chance: how many, what was said, what was right."""
    right = np.array([one.right for one in known])
    for low, high in zip(CLASSES, CLASSES[1:], strict=False):
        inside = (chance >= low) & (chance < high)
        if inside.any():
            yield [
                f"{100 * low:.0f} to {100 * high:.0f} %", str(inside.sum()),
                f"{100 * chance[inside].mean():.0f} %", f"{100 * right[inside].mean():.0f} %",
            ]  # fmt: skip


def least_chances(
    known: Sequence[Given], strangers: int, chance: np.ndarray
) -> Iterator[list[str]]:
    """Of each least chance: which names would have been given."""
    for least in LEAST:
        kept = [
            one for one, found in zip(known, chance, strict=True) if one.named and found >= least
        ]
        whole = [one for one in kept if one.of != SETS[0].words]
        yield [
            f"{least:g}" + (" (taken)" if least == Options().deserved else ""), _right_of(kept),
            _right_of(whole), f"{sum(one.stranger for one in kept)} of {strangers}",
        ]  # fmt: skip


def _right_of(some: Sequence[Given]) -> str:
    return f"{sum(one.right for one in some)} of {len(some)}"


def shown(known: Sequence[Given], strangers: int) -> str:
    """The part of the page."""
    hidden, of = attrgetter("hidden"), attrgetter("of")
    by_thing, by_set = unseen(known, hidden), unseen(known, of)
    law = fitted(known)
    scores = [
        f"{log_score(known, chance):.2f} ({log_score(known, share_of_others(known, by)):.2f})"
        for by, chance in ((hidden, by_thing), (of, by_set))
    ]
    said = (
        f"ln(odds) = {law.intercept:g} + {law.apart:g} ln(1 - c²) + {law.p_left:g} ln p - "
        f"{law.share:g} (1 - s). Mean ln of the probability of what came out, on hidden things "
        f"that the law was not fitted to, {scores[0]}, and on such sets {scores[1]}; in brackets "
        "by the share of right ones among the others."
    )
    header = ["least chance", "names: right", "with all families on trial",
              "strangers explained away"]  # fmt: skip
    kept = table(header, list(least_chances(known, strangers, by_thing)), "lrrr")
    sure = table(
        ["chance", "explanations", "said, mean", "right"], list(classes(known, by_thing)), "lrrr"
    )
    return f"{said}\n\n{kept}\n\n{sure}"


if __name__ == "__main__":
    known, strangers = given()
    renew(PAGE, names=shown(known, strangers))
    made = "# Made by python -m benchmarks.studies.deserved_names\n"
    write_text(NAMES, made + yaml_text(fitted(known).model_dump()))
