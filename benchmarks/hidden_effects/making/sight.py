"""What a judge with perfect luck could see of a hidden effect.

The slide with the effect is simulated with the judge's own cells, without any error; the base model
is refitted to it; lambda is what is left, in the judge's own covariance at the refitted state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.base_model import JITTER, BaseModel, Read
from benchmarks.hidden_effects.making.detectability import BINS, Refit, find_amplitude, refit
from benchmarks.hidden_effects.making.laboratory import (
    Entry,
    Laboratory,
    Request,
    amplitude_of,
    times,
)
from benchmarks.hidden_effects.making.sections import Section
from geometry.survey.measured import Deposit
from mpm_taichi.effects import Amplitude
from mpm_taichi.effects import effect as effect_of
from pipeline.random_numbers import Stream

#: Runs behind a lambda while an amplitude is searched for, and behind the one that is written down.
LOOKS, LOOKS_FOR_GOOD = 2, 6
#: Runs behind what one of two effects does by itself.
LOOKS_BESIDE = 4
#: Seeds of their jitters begin here: others than those of the base model's replicates.
FIRST_SEED = 101
#: A truth is at most this many times as strong as the top rung of its effect's ladder, which the
#: effect's own author calls large: beyond it the physics is no longer believable.
BEYOND_LADDER = 3.0
#: Amplitudes at which one of two effects may stand for both, over its true one.
SHARES = (0.4, 0.7, 0.85, 1.0, 1.15, 1.4, 1.8)
#: Of these this many are simulated again, this many times, at the parameters of the refit.
RETURNED, RETURNS = 2, 2


def strongest(scale: Amplitude, sign: float = 1.0) -> float:
    """The largest magnitude that a truth may have."""
    limit = scale.high if sign > 0.0 else -scale.low
    return min(limit, BEYOND_LADDER * scale.ladder[-1])


@dataclass
class Sight:
    """A section at its true parameters.

    Attributes:
        laboratory: that simulates slides with effects.
        base: the base model that is refitted to them.
        survey: that reads them.
        values: true parameters (p,) in outside units.
    """

    laboratory: Laboratory
    base: BaseModel
    survey: str
    values: np.ndarray

    @property
    def section(self) -> Section:
        """The section."""
        return self.base.section

    def amplitude(
        self, name: str, wanted: float, stream: Stream, more: Mapping[str, float]
    ) -> tuple[float, float]:
        """The amplitude of an effect that gives lambda `wanted`, and the lambda it gives.

        Args:
            name: of the effect.
            wanted: lambda.
            stream: decides the sign where there are two.
            more: further numbers of the effect.
        """
        scale = effect_of(name).amplitude
        signs = [1.0]
        if scale.two_signed:
            first = 1.0 if stream.unit() < 0.5 else -1.0
            signs = [first, -first]
        best, least_off = (0.0, 0.0), np.inf
        for sign in signs:
            magnitude, seen = find_amplitude(
                lambda sizes, sign=sign: [
                    self.seen({name: {"amplitude": sign * a, **more}}) for a in sizes
                ],
                scale.ladder,
                strongest(scale, sign),
                wanted,
            )
            off = abs(np.log(seen / wanted)) if seen > 0.0 else np.inf
            if off < least_off:
                best, least_off = (sign * magnitude, seen), off
            if BINS[0] <= seen <= BINS[-1]:
                break
        return best

    def within(self, name: str, entry: Entry) -> Entry:
        """An effect's entry, no stronger than a truth may have it."""
        amplitude = amplitude_of(entry)
        most = strongest(effect_of(name).amplitude, amplitude)
        return times(entry, min(1.0, most / abs(amplitude)))

    def seen(self, effects: Mapping[str, Entry]) -> float:
        """Lambda of a set of effects; NaN where its run failed or is not a flow slide."""
        slides = self.slides(effects, LOOKS)
        found = None if slides is None else self.refit(slides, self.survey)
        return np.nan if found is None else found.seen

    def seen_for_good(self, effects: Mapping[str, Entry]) -> Refit | None:
        """The refitted base model, from more runs; None where it is not available."""
        slides = self.slides(effects, LOOKS_FOR_GOOD)
        return None if slides is None else self.refit(slides, self.survey)

    def beside(self, effects: Mapping[str, Entry]) -> float | None:
        """Lambda of the fainter of two effects given the other; None where it is not available.

        What is left once the base model and the other effect have been refitted, at no amplitude or
        any of `SHARES`.
        """
        whole = self.slides(effects, LOOKS_FOR_GOOD)
        if whole is None:
            return None
        toe = self._toe(whole)
        both = self._halves(whole, self.survey, toe)
        alone = None if both is None else self._refit(both, self.survey, toe)
        if both is None or alone is None:
            return None
        left = [alone.seen]
        for name, entry in effects.items():
            found = self._left_by(name, entry, both, toe)
            if found is None:
                return None
            left.append(found)
        return min(left)

    def _left_by(self, name: str, entry: Entry, both: np.ndarray, toe: float) -> float | None:
        """Lambda that one of two effects leaves when it stands for both; None where it has no run.

        What it does is simulated at the true parameters and taken off the slide (2, m), and the
        base model is refitted to the rest. Parameters that give way to it change what it does: the
        best amplitudes are simulated once more at those of the refit, and refitted again.
        """
        found = []
        for share in SHARES:
            part = {name: times(entry, share)}
            rest = self._rest(part, self.values, both, toe)
            if rest is not None:
                found.append((rest, part))
        found.sort(key=lambda pair: pair[0].seen)
        left = [rest.seen for rest, _ in found]
        for start, part in found[:RETURNED]:
            rest: Refit | None = start
            for _ in range(RETURNS):
                there = self.base.joined(rest.u, rest.held)
                rest = self._rest(part, there, both, toe)
                if rest is None:
                    break
                left.append(rest.seen)
        return min(left, default=None)

    def _rest(
        self, effects: Mapping[str, Entry], values: np.ndarray, both: np.ndarray, toe: float
    ) -> Refit | None:
        """The base model refitted to a slide (2, m) less what effects do at some parameters."""
        halves = []
        for entries in (effects, {}):
            deposits = self._deposits(entries, values, LOOKS_BESIDE)
            halves.append(None if deposits is None else self._halves(deposits, self.survey, toe))
        change, none = halves
        if change is None or none is None:
            return None
        return self._refit(both - change + none, self.survey, toe)

    def slides(self, effects: Mapping[str, Entry], number: int) -> list[Deposit] | None:
        """Slides with different jitters; None where one failed or is not a flow slide."""
        found = self._deposits(effects, self.values, number)
        if found is None or not all(is_slide(self.section, one) for one in found):
            return None
        return found

    def refit(self, slides: Sequence[Deposit], survey: str) -> Refit | None:
        """The base model that comes nearest to slides, and lambda; None where it cannot be read."""
        toe = self._toe(slides)
        halves = self._halves(slides, survey, toe)
        return None if halves is None else self._refit(halves, survey, toe)

    def _deposits(
        self, effects: Mapping[str, Entry], values: np.ndarray, number: int
    ) -> list[Deposit] | None:
        """Deposits with different jitters; None where one failed or cannot be asked for."""
        for name, entry in effects.items():
            scale = effect_of(name).amplitude
            if not scale.low <= amplitude_of(entry) <= scale.high:
                return None
        own = tuple(values.tolist())
        requests = [
            Request(own, effects, jitter=JITTER, seed=FIRST_SEED + k) for k in range(number)
        ]
        found = self.laboratory.deposits(self.section, requests)
        return None if any(one is None for one in found) else found

    def _toe(self, slides: Sequence[Deposit]) -> float:
        return float(np.mean([surveys.toe_of(self.section, one) for one in slides]))

    def _halves(self, slides: Sequence[Deposit], survey: str, toe: float) -> np.ndarray | None:
        """Readings in two halves of the runs, (2, m); None where one cannot be read."""
        places = self.base.places(survey, toe)
        read = [Read.of(self.section, one) for one in slides]
        readings = np.array([one.by(self.section, survey, places) for one in read if one])
        if len(readings) < len(slides) or not np.isfinite(readings).all():
            return None
        return np.array([readings[k::2].mean(axis=0) for k in (0, 1)])

    def _refit(self, halves: np.ndarray, survey: str, toe: float) -> Refit | None:
        try:
            curve = self.base.curve(survey, toe)
        except ValueError:
            return None
        return refit(halves, curve, *self.base.split(self.values))


def is_slide(section: Section, deposit: Deposit) -> bool:
    """The toe has run as far as a flow slide of this section may."""
    way = abs(surveys.toe_of(section, deposit) - deposit.foot[section.survey.side])
    least, most = section.survey.runouts_m
    return least <= way <= most
