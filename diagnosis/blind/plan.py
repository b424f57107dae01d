"""What is to be made: a row of cases of four kinds, each prefix of it balanced.

- single: one effect of the library; null: none; pair: two; outside: one that no library has.

Each twelve of the row hold five singles, five nulls, a pair and one outside the library, in random
order, so that any number of finished cases is a fair sample. Effects, sections, surveys and bins of
detectability are dealt from shuffled decks: all cards before any comes again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from diagnosis.blind.detectability import BINS
from geometry.random_numbers import Stream, number_of

Kind = Literal["single", "null", "pair", "outside"]
KINDS: tuple[Kind, ...] = ("single", "null", "pair", "outside")

#: Kinds of twelve cases that follow each other, before they are shuffled.
ROUND: tuple[Kind, ...] = ("single",) * 5 + ("null",) * 5 + ("pair", "outside")

Card = TypeVar("Card")


@dataclass(frozen=True)
class Planned:
    """A case to be made.

    Attributes:
        name: of the case; says nothing about what is hidden.
        kind: what is hidden.
        effects: names, as many as the kind has.
        section: name.
        survey: name of the set of measurements.
        bin: of detectability, from 0; of nulls without meaning.
    """

    name: str
    kind: Kind
    effects: tuple[str, ...]
    section: str
    survey: str
    bin: int


class Deck(Generic[Card]):
    """Cards dealt in random order; when all are dealt they are shuffled anew."""

    def __init__(self, cards: Sequence[Card], stream: Stream) -> None:
        self._cards, self._stream, self._left = list(cards), stream, []

    def deal(self) -> Card:
        """The next card; ValueError of an empty deck."""
        if not self._cards:
            raise ValueError("the deck is empty: there is nothing to hide")
        if not self._left:
            self._left = list(self._cards)
        return self._left.pop(self._stream.integer(0, len(self._left) - 1))


def plan(
    number: int,
    *,
    seed: int,
    effects: Sequence[str],
    outside: Sequence[str],
    where: dict[str, Sequence[str]],
    surveys: Sequence[str],
    bins: int = len(BINS) - 1,
) -> list[Planned]:
    """The first `number` cases of a benchmark.

    Args:
        number: of cases.
        seed: of all drawings.
        effects: of the library.
        outside: effects outside the library.
        where: effect -> sections in which it can do something; under "" all sections.
        surveys: sets of measurements.
        bins: number of bins of detectability.
    """
    stream = Stream(seed, number_of("plan"))
    kinds_of_effect = {"single": list(effects), "pair": list(effects), "outside": list(outside)}
    names = {kind: Deck(cards, stream) for kind, cards in kinds_of_effect.items()}
    places = {name: Deck(_joined(where[name], surveys), stream) for name in (*effects, *outside)}
    nulls = Deck(_joined(where[""], surveys), stream)
    pairs = Deck(surveys, stream)
    rungs = {name: Deck(range(bins), stream) for name in (*effects, *outside)}
    # A pair is hopeless where each of the two is barely visible.
    high = Deck(range(bins // 2, bins), stream)
    kinds = Deck(ROUND, stream)
    found = []
    for k in range(number):
        kind = kinds.deal()
        if kind == "null":
            chosen, (section, survey), rung = (), nulls.deal(), 0
        elif kind == "pair":
            chosen, section = _pair(names["pair"], where, stream)
            survey, rung = pairs.deal(), high.deal()
        else:
            name = names[kind].deal()
            chosen, (section, survey), rung = (name,), places[name].deal(), rungs[name].deal()
        found.append(Planned(f"case_{k + 1:04d}", kind, chosen, section, survey, rung))
    return found


def _joined(sections: Sequence[str], surveys: Sequence[str]) -> list[tuple[str, str]]:
    return [(section, survey) for section in sections for survey in surveys]


def _pair(
    deck: Deck[str], where: dict[str, Sequence[str]], stream: Stream
) -> tuple[tuple[str, ...], str]:
    """Two different effects that can both act in one section, and that section."""
    while True:
        first, second = deck.deal(), deck.deal()
        common = [section for section in where[first] if section in where[second]]
        if first != second and common:
            return tuple(sorted((first, second))), common[stream.integer(0, len(common) - 1)]
