"""Making a case: parameters, amplitudes for a wanted detectability, the slide, its survey.

What decides the amplitude is simulated with the judge's own cells. The slide that is surveyed has
other cells, another time step and its points in other places: a judge that takes its own grid for
the truth finds effects where there are none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.base_model import JITTER, BaseModel
from benchmarks.hidden_effects.making.detectability import BINS, Refit, bin_of, middle_of
from benchmarks.hidden_effects.making.laboratory import Entry, Laboratory, Request, times
from benchmarks.hidden_effects.making.plan import Planned
from benchmarks.hidden_effects.making.seal import SALT, salt_of
from benchmarks.hidden_effects.making.sections import Section, normal
from benchmarks.hidden_effects.making.sight import Sight, is_slide
from pipeline.random_numbers import Stream, number_of

#: Spacing of the slide over that of the judge, between these; its Courant number.
FINER, COURANT = (0.75, 0.85), 0.2
#: Drawings of parameters before a case is given up.
DRAWS = 6
#: Runs from which on nothing is drawn again: for one effect, for two.
RUNS = {1: 80, 2: 300}
#: Times that two effects are made larger or smaller together.
PAIR_TRIES = 3
#: Share of the largest lambda that two effects together are brought to; a change of no account.
ROOM, LITTLE = 0.9, 0.05
#: Times amplitudes are made smaller where they can be seen too well together.
SMALLER = 5


@dataclass(frozen=True)
class Made:
    """A case that was made.

    Attributes:
        truth: the sealed document.
        entries: entries of `measurements.yaml`, with values.
        profile: places and elevations of the surveyed surface, (n, 2) [m].
    """

    truth: dict[str, Any]
    entries: list[dict[str, Any]]
    profile: np.ndarray


@dataclass(frozen=True)
class Drawn:
    """Truth of a case.

    Attributes:
        values: parameters (p,) in outside units.
        amplitudes: entries of the scene's effects.
        refit: the base model that comes nearest; None where nothing is hidden.
        beside: of two effects, lambda of the fainter given the other.
    """

    values: np.ndarray
    amplitudes: dict[str, Entry]
    refit: Refit | None
    beside: float | None = None

    @property
    def seen(self) -> float:
        """Lambda of what is to be found: of two effects, of the fainter given the other."""
        if self.beside is not None:
            return self.beside
        return 0.0 if self.refit is None else self.refit.seen


class Maker:
    """Makes the cases of a benchmark.

    Args:
        laboratory: that simulates.
        seed: of the benchmark.
        base: base model of a section.
        other_realisation: random effects, hidden with another seed than the judge's.
    """

    def __init__(
        self,
        laboratory: Laboratory,
        seed: int,
        base: Callable[[Section], BaseModel],
        other_realisation: Sequence[str] = (),
    ) -> None:
        self.laboratory = laboratory
        self.seed = seed
        self.base = base
        self.other_realisation = tuple(other_realisation)

    def make(self, planned: Planned, section: Section) -> Made | None:
        """Make a case; None where nothing that can be seen comes of several drawings.

        Drawings end with the first that falls into the bin that was dealt; where none does, the one
        that comes nearest is taken.
        """
        self.laboratory.forget()
        stream = Stream(self.seed, number_of(planned.name))
        others: list[Drawn] = []
        if planned.effects:
            self.base(section)  # its runs belong to all cases
        begin = self.laboratory.runs
        for _ in range(DRAWS):
            if self.laboratory.runs - begin >= RUNS[max(len(planned.effects), 1)]:
                break
            drawn = self._draw(planned, section, stream)
            if drawn is None:
                continue
            if planned.effects and bin_of(drawn.seen) != planned.bin:
                others.append(drawn)
                continue
            made = self._slide(planned, section, drawn, stream)
            if made is not None:
                return made
        wanted = middle_of(planned.bin)
        for drawn in sorted(others, key=lambda one: abs(math.log(one.seen / wanted))):
            made = self._slide(planned, section, drawn, stream)
            if made is not None:
                return made
        return None

    def _draw(self, planned: Planned, section: Section, stream: Stream) -> Drawn | None:
        """Parameters and amplitudes; None where what is hidden cannot be seen, or too well."""
        values = np.round(section.draw(stream), 6)  # as they are written down
        if not planned.effects:
            return Drawn(values, {}, None)
        sight = Sight(self.laboratory, self.base(section), planned.survey, values)
        amplitudes = self._amplitudes(planned, sight, stream)
        if amplitudes is None:
            return None
        if len(amplitudes) > 1:
            return self._pair(planned, sight, amplitudes)
        for _ in range(SMALLER):
            refit = sight.seen_for_good(amplitudes)
            if refit is None or refit.seen < BINS[0]:
                return None
            if refit.seen < BINS[-1]:
                return Drawn(values, amplitudes, refit)
            amplitudes = {name: times(entry, 0.7) for name, entry in amplitudes.items()}
        return None

    def _pair(self, planned: Planned, sight: Sight, amplitudes: dict[str, Entry]) -> Drawn | None:
        """Two effects, changed together until the fainter is seen given the other as was dealt."""
        wanted = middle_of(planned.bin)
        found: list[Drawn] = []
        for _ in range(PAIR_TRIES):
            refit = sight.seen_for_good(amplitudes)
            if refit is None or refit.seen < BINS[0]:
                break
            room = math.sqrt(ROOM * BINS[-1] / refit.seen)
            factor = room
            if refit.seen < BINS[-1]:
                beside = sight.beside(amplitudes)
                if beside is None:
                    break
                if beside >= BINS[0]:
                    found.append(Drawn(sight.values, amplitudes, refit, beside))
                if bin_of(beside) == planned.bin:
                    break
                factor = min(math.sqrt(wanted / max(beside, BINS[0])), room)
            changed = {name: sight.within(name, times(e, factor)) for name, e in amplitudes.items()}
            if changed == amplitudes or abs(math.log(factor)) < LITTLE:
                break
            amplitudes = changed
        return min(found, key=lambda one: abs(math.log(one.seen / wanted)), default=None)

    def _amplitudes(
        self, planned: Planned, sight: Sight, stream: Stream
    ) -> dict[str, Entry] | None:
        """Entries of the scene by name; None where one of them cannot be seen by itself."""
        found: dict[str, Entry] = {}
        for name in planned.effects:
            more = {}
            if name in self.other_realisation:
                more = {"seed": float(stream.integer(1000, 999_999))}
            amplitude, seen = sight.amplitude(name, middle_of(planned.bin), stream, more)
            if seen < BINS[0]:
                return None
            amplitude = float(f"{amplitude:.6g}")
            found[name] = {"amplitude": amplitude, **more} if more else amplitude
        return found

    def _slide(
        self,
        planned: Planned,
        section: Section,
        drawn: Drawn,
        stream: Stream,
    ) -> Made | None:
        """Simulate and survey the slide; None where it fails or cannot be read."""
        values = drawn.values
        request = slide_request(
            values.tolist(), drawn.amplitudes, round(stream.uniform(*FINER), 3), stream.seed()
        )
        (deposit,) = self.laboratory.deposits(section, [request])
        if deposit is None or not is_slide(section, deposit):
            return None
        places = surveys.profile_places(section, surveys.toe_of(section, deposit))
        entries = surveys.with_values(section, planned.survey, places, None)
        try:
            exact = surveys.reading(entries, deposit)
        except ValueError:
            return None
        lower = np.linalg.cholesky(surveys.covariance_of(entries))
        error = lower @ np.array([normal(stream) for _ in exact])
        measured = np.round(exact + error, 3)
        truth = {
            "name": planned.name,
            "kind": planned.kind,
            "section": planned.section,
            "survey": planned.survey,
            "effects": drawn.amplitudes,
            "parameters": dict(zip(section.parameters.names, values.tolist(),
                                   strict=True)),
            "lambda": 0.0 if drawn.refit is None else round(drawn.refit.seen, 4),
            **({} if drawn.beside is None else {"beside": round(drawn.beside, 4)}),
            "refitted": {} if drawn.refit is None else self._refitted(section, drawn.refit),
            "bin_wanted": planned.bin,
            "spacing_factor": request.spacing_factor,
            "jitter_seed": request.seed,
            "measured": measured.tolist(),
            "places": places.tolist(),
            SALT: salt_of(self.seed, planned.name),
        }  # fmt: skip
        documents = surveys.documents(section, planned.survey, measured, places)
        profile = np.column_stack([places, measured[: len(places)]])
        return Made(truth, documents, profile)

    def _refitted(self, section: Section, refit: Refit) -> dict[str, float]:
        """Parameters of the base model that comes nearest to the slide."""
        values = self.base(section).joined(refit.u, refit.held)
        return dict(zip(section.parameters.names, np.round(values, 4).tolist(), strict=True))


def slide_request(
    values: Sequence[float], effects: Mapping[str, Entry], spacing_factor: float, seed: int
) -> Request:
    """The run of the slide that is surveyed."""
    return Request(
        values=tuple(values),
        effects=effects,
        spacing_factor=spacing_factor,
        jitter=JITTER,
        seed=seed,
        courant=COURANT,
    )
