"""Requirements on a score, figure by figure."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.hidden_effects.scoring.intervals import Share

#: The median error of S_r is asked to fall at least by this factor.
STRENGTH_FACTOR = 3.0
MISSED = "**missed**"


@dataclass(frozen=True)
class Asked:
    """A figure and what is asked of it.

    Attributes:
        name: of the share; words: what it is; limit: its bound; least: at least, or at most.
    """

    name: str
    words: str
    limit: float | None
    least: bool = True

    def verdict(self, share: Share) -> str:
        """Met, missed, or nothing where nothing is asked or known."""
        if self.limit is None or share.value is None:
            return ""
        met = share.value >= self.limit if self.least else share.value <= self.limit
        return "met" if met else MISSED

    @property
    def bound(self) -> str:
        """The requirement, in words."""
        if self.limit is None:
            return ""
        return f"{'at least' if self.least else 'at most'} {100 * self.limit:.0f} %"


ASKED = (
    Asked("false_attribution", "nulls to which an effect is attributed", 0.03, least=False),
    Asked("false_verdict", "nulls to which a name or a family is given", 0.03, least=False),
    Asked("false_alarm", "nulls with an alarm", 0.08, least=False),
    Asked("precision", "right, when one effect is named (singles and nulls)", 0.90),
    Asked("precision_all_kinds", "the same with pairs and strangers, which one name cannot "
          "describe", None),
    Asked("named_25", "named at lambda 25 and more, where no rival looks alike", 0.80),
    Asked("named_60", "named at lambda 60 and more, where no rival looks alike", 0.90),
    Asked("set_of_three_25", "look-alikes at lambda 25 and more: a 90 % set of at most three "
          "holds the truth", 0.80),
    Asked("set_of_three_60", "the same at lambda 60 and more", 0.90),
    Asked("set_holds_truth", "the 90 % set holds the truth, when effects are attributed", 0.90),
    Asked("held_out_falls", "held-out error falls, where the name is right", 0.90),
    Asked("strength_within_2_std", "S_r within two standard deviations, where the name is right",
          0.85),
    Asked("strength_within_2_std_all", "the same in all cases", None),
    Asked("pair_exact", "pairs found exactly", 0.50),
    Asked("pair_exact_25", "the same where the fainter of the two has lambda 25 and more given "
          "the other", None),
    Asked("pair_half", "pairs of which at least one effect is found", None),
    Asked("explained_away", "strangers explained away by effects of the library", 0.30,
          least=False),
    Asked("named_away", "strangers to which a name or a family is given", 0.10, least=False),
    Asked("explained_unlike", "the same without those whose law the named effect has, too", None),
    Asked("curve_recovered", "strangers that are a strength law: its curve recovered", None),
    Asked("law_found", "the same, or a law of the library named that runs like it", None),
    Asked("law_found_25", "a strength law found by curve or name, at lambda 25 and more", None),
)  # fmt: skip
