"""Plan of a benchmark: a row of cases of four kinds, each prefix of it balanced.

- single: one effect of the library; null: none; pair: two; outside: one that no library has.

Each sixteen of the row hold seven nulls, seven singles, a pair and one outside the library, in
random order, so that any number of finished cases is a fair sample. Nulls are many: a rare
accusation takes many to be measured, and a null is made in a single run. Effects, sections, surveys
and bins of detectability are dealt from shuffled decks: all cards before any comes again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from benchmarks.hidden_effects.making.detectability import BINS
from pipeline.random_numbers import Stream, number_of

Kind = Literal["single", "null", "pair", "outside"]
KINDS: tuple[Kind, ...] = ("single", "null", "pair", "outside")

#: Kinds of sixteen cases that follow each other, before they are shuffled.
ROUND: tuple[Kind, ...] = ("null",) * 7 + ("single",) * 7 + ("pair", "outside")

Card = TypeVar("Card")


@dataclass(frozen=True)
class Planned:
    """A case to be made.

    Attributes:
        name: of the case; says nothing about what is hidden.
        kind: of the hidden effects.
        effects: names, as many as the kind has.
        section: name.
        survey: name of the set of measurements.
        bin: of detectability, from 0; of two effects, of the fainter given the other; of nulls
            without meaning.
    """

    name: str
    kind: Kind
    effects: tuple[str, ...]
    section: str
    survey: str
    bin: int


class Deck(Generic[Card]):
    """Cards dealt in random order; when all are dealt they are shuffled again."""

    def __init__(self, cards: Sequence[Card], stream: Stream) -> None:
        self._cards, self._stream, self._left = list(cards), stream, []

    def deal(self) -> Card:
        """The next card; ValueError of an empty deck."""
        if not self._cards:
            raise ValueError("the deck is empty: there is nothing to hide")
        if not self._left:
            self._left = list(self._cards)
        return self._left.pop(self._stream.integer(0, len(self._left) - 1))


#: An effect reaches a bin where its largest lambda is this many times the bin's lower end.
REACHES = 1.2

Reach = Mapping[tuple[str, str, str], float]
"""(effect, section, survey) -> the largest lambda that its amplitudes give."""


def reaches(seen: float, rung: int) -> bool:
    """An effect with this largest lambda can be hidden in a bin."""
    return seen >= REACHES * BINS[rung]


def plan(
    number: int,
    *,
    seed: int,
    effects: Sequence[str],
    outside: Sequence[str],
    sections: Sequence[str],
    surveys: Sequence[str],
    reach: Reach,
    kinds: Sequence[Kind] = ROUND,
    bins: int = len(BINS) - 1,
) -> list[Planned]:
    """The first `number` cases of a benchmark.

    The bin of a case is dealt first, then an effect that reaches it: bins are full evenly, and an
    effect that is faint whatever its amplitude fills the low ones alone.

    Args:
        number: of cases.
        seed: of all drawings.
        effects: of the library.
        outside: effects outside the library.
        sections: of the benchmark.
        surveys: sets of measurements.
        reach: effects that can act on the section.
        kinds: of the cases of a round, before they are shuffled.
        bins: number of bins of detectability.

    Raises:
        ValueError: no effect reaches any bin.
    """
    stream = Stream(seed, number_of("plan"))
    dealer = _Dealer(stream, reach, bins)
    everywhere = [(section, survey) for section in sections for survey in surveys]
    nulls, kind_deck = Deck(everywhere, stream), Deck(kinds, stream)
    found = []
    for k in range(number):
        kind = kind_deck.deal()
        if kind == "null":
            chosen, (section, survey), rung = (), nulls.deal(), 0
        elif kind == "pair":
            chosen, (section, survey), rung = dealer.pair(effects)
        else:
            chosen, (section, survey), rung = dealer.single(
                kind, effects if kind == "single" else outside
            )
        found.append(Planned(f"case_{k + 1:04d}", kind, chosen, section, survey, rung))
    return found


class _Dealer:
    """Deals bins, effects that reach them, and places where they do."""

    def __init__(self, stream: Stream, reach: Reach, bins: int) -> None:
        self.stream = stream
        self.bins = bins
        self.reach = reach
        self._decks: dict[tuple, Deck] = {}
        self._used: Counter[tuple[str, str]] = Counter()

    def single(
        self, kind: str, names: Sequence[str]
    ) -> tuple[tuple[str, ...], tuple[str, str], int]:
        """An effect with its place and bin; of those that reach the bin the one used least."""
        reached = [b for b in range(self.bins) if any(self._places(n, b) for n in names)]
        rung = self._deck((kind, "bin"), reached).deal()
        able = [name for name in names if self._places(name, rung)]
        least = min(self._used[kind, name] for name in able)
        rarest = [name for name in able if self._used[kind, name] == least]
        name = rarest[self.stream.integer(0, len(rarest) - 1)]
        self._used[kind, name] += 1
        return (name,), self._deck((kind, name, rung), self._places(name, rung)).deal(), rung

    def pair(self, names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, str], int]:
        """Two effects that each reach a dealt bin alone; a lower bin where no two do."""
        rung = self._deck(("pair", "bin"), range(min(1, self.bins - 1), self.bins)).deal()
        while rung >= 0:
            places = {name: self._places(name, rung) for name in names}
            couples = [
                (one, other)
                for k, one in enumerate(names)
                for other in names[k + 1 :]
                if set(places[one]) & set(places[other])
            ]
            if couples:
                one, other = self._deck(("pair", rung), couples).deal()
                common = [place for place in places[one] if place in places[other]]
                place = common[self.stream.integer(0, len(common) - 1)]
                return tuple(sorted((one, other))), place, rung
            rung -= 1
        raise ValueError("no two effects can be seen in the same place")

    def _places(self, name: str, rung: int) -> list[tuple[str, str]]:
        """Where an effect reaches a bin."""
        return [
            (section, survey)
            for (effect, section, survey), seen in self.reach.items()
            if effect == name and reaches(seen, rung)
        ]

    def _deck(self, key: tuple, cards: Sequence) -> Deck:
        return self._decks.setdefault(key, Deck(cards, self.stream))
