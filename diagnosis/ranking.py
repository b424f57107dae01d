"""The ranking of hypotheses as it grows, for who watches a diagnosis.

In: what the scores promise after each batch of runs, and what refits find. Out: calls of `Ranked`
with the whole ranking so far. Nothing that is found depends on whether somebody watches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from diagnosis.hypotheses.model import Candidate
from pipeline.ties import ranked


@dataclass(frozen=True)
class Standing:
    """One hypothesis, or several together, against the base model.

    Attributes:
        names: of the hypotheses.
        words: what they are.
        promised: fall of chi2 that the score promises, of the runs so far; None: there is none.
        refitted: fall of chi2 that was found once all was calibrated again; None: not yet.
    """

    names: tuple[str, ...]
    words: str
    promised: float | None = None
    refitted: float | None = None

    @property
    def fall(self) -> float:
        """What is known best of the fall of chi2."""
        return self.refitted if self.refitted is not None else self.promised or 0.0


Ranked = Callable[[Sequence[Standing]], None]
"""Called with all hypotheses looked at so far, the largest fall of chi2 first."""


class Ranking:
    """Gathers standings and tells them.

    Args:
        tell: called at every change; None: nobody watches.
    """

    def __init__(self, tell: Ranked | None = None) -> None:
        self._tell = tell
        self._words: dict[str, str] = {}
        self._known: dict[tuple[str, ...], Standing] = {}

    @property
    def is_watched(self) -> bool:
        """Somebody watches."""
        return self._tell is not None

    def named(self, candidates: Iterable[Candidate]) -> None:
        """Learn what hypotheses are, in words."""
        self._words.update({one.name: one.words for one in candidates})

    def promise(self, falls: Mapping[str, float]) -> None:
        """What scores promise now: hypothesis -> fall of chi2."""
        for name, fall in falls.items():
            self._known[(name,)] = replace(self._of((name,)), promised=max(float(fall), 0.0))
        self._say()

    def refit(self, names: tuple[str, ...], fall: float) -> None:
        """What was found when hypotheses were fitted together."""
        if names:
            self._known[names] = replace(self._of(names), refitted=float(fall))
            self._say()

    def _of(self, names: tuple[str, ...]) -> Standing:
        words = " and ".join(self._words.get(name, name.replace("_", " ")) for name in names)
        return self._known.get(names, Standing(names, words))

    def _say(self) -> None:
        if self._tell is not None:
            self._tell(ranked(self._known.values(), lambda one: one.fall))
