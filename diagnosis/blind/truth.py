"""Making a case: parameters, amplitudes for a wanted detectability, the slide, its survey.

What decides the amplitude is simulated with the judge's own cells. The slide that is surveyed has
other cells, another time step and its points in other places: a judge that takes its own grid for
the truth finds effects where there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.blind import surveys
from diagnosis.blind.detectability import BINS, detectability, find_amplitude, middle_of
from diagnosis.blind.laboratory import Entry, Laboratory, Request
from diagnosis.blind.plan import Planned
from diagnosis.blind.seal import SALT, salt_of
from diagnosis.blind.sections import Section, normal
from diagnosis.covariance import covariance
from geometry.measured import Deposit
from geometry.random_numbers import Stream, number_of
from mpm_taichi.effects import effect as effect_of

#: Spacing of the slide over that of the judge, between these; its Courant number; its jitter.
FINER, COURANT, JITTER = (0.75, 0.85), 0.2, 0.5
#: Runs with other jitters behind the detectability; the second transfer scheme; the finer cells.
REPLICATES, TRANSFER, RESOLUTION = 8, "flip", 1.5
#: Steps of the derivative, in fitted units.
STEP = 0.25
#: Drawings of parameters before a case is given up.
DRAWS = 4


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


class Maker:
    """Makes the cases of a benchmark.

    Args:
        laboratory: that simulates.
        seed: of the benchmark.
        other_realisation: random effects, hidden with another seed than the judge's.
    """

    def __init__(
        self, laboratory: Laboratory, seed: int, other_realisation: Sequence[str] = ()
    ) -> None:
        self.laboratory = laboratory
        self.seed = seed
        self.other_realisation = tuple(other_realisation)

    def make(self, planned: Planned, section: Section) -> Made | None:
        """Make a case; None where nothing that can be seen comes of several drawings."""
        stream = Stream(self.seed, number_of(planned.name))
        for _ in range(DRAWS):
            values = section.draw(stream)
            amplitudes, seen = {}, 0.0
            if planned.effects:
                scene = _Sight.at(self.laboratory, section, planned.survey, values)
                if scene is None:
                    continue
                amplitudes, seen = self._amplitudes(planned, scene, stream)
                if not BINS[0] <= seen <= BINS[-1]:
                    continue
            made = self._slide(planned, section, values, amplitudes, seen, stream)
            if made is not None:
                return made
        return None

    def _amplitudes(
        self, planned: Planned, sight: _Sight, stream: Stream
    ) -> tuple[dict[str, Entry], float]:
        """Entries of the scene by name, and lambda of all of them together."""
        wanted, found, seen = middle_of(planned.bin), {}, 0.0
        more = {
            name: {"seed": float(stream.integer(1000, 999_999))}
            for name in planned.effects
            if name in self.other_realisation
        }
        for name in planned.effects:
            found[name], seen = sight.amplitude(name, wanted, stream, more.get(name, {}))
        if len(found) > 1:
            for _ in range(3):
                (seen,) = sight.lambdas([found])
                if np.isfinite(seen) and seen <= BINS[-1]:
                    break
                found = {name: 0.7 * a for name, a in found.items()}
        found = {name: float(f"{a:.6g}") for name, a in found.items()}
        joined = {
            name: {"amplitude": a, **more[name]} if name in more else a for name, a in found.items()
        }
        return joined, seen if np.isfinite(seen) else 0.0

    def _slide(
        self,
        planned: Planned,
        section: Section,
        values: np.ndarray,
        amplitudes: dict[str, Entry],
        seen: float,
        stream: Stream,
    ) -> Made | None:
        """Simulate and survey the slide; None where it fails or cannot be read."""
        request = Request(
            values=tuple(values.tolist()),
            effects=amplitudes,
            spacing_factor=round(stream.uniform(*FINER), 3),
            jitter=JITTER,
            seed=stream.seed(),
            courant=COURANT,
        )
        (deposit,) = self.laboratory.deposits(section, [request])
        if deposit is None:
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
            "effects": amplitudes,
            "parameters": dict(zip(section.parameters.names, np.round(values, 6).tolist(),
                                   strict=True)),
            "lambda": round(seen, 4),
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


@dataclass
class _Sight:
    """What a judge with perfect luck would see at a base state.

    Attributes:
        base, steps: deposits without effects at the parameters and one step of each.
        replicates: deposits with other jitters; transfer, plain_fine: for the model's own error.
    """

    laboratory: Laboratory
    section: Section
    survey: str
    values: np.ndarray
    base: Deposit
    steps: list[Deposit]
    replicates: list[Deposit]
    transfer: Deposit | None
    finer: Deposit | None

    @classmethod
    def at(
        cls, laboratory: Laboratory, section: Section, survey: str, values: np.ndarray
    ) -> _Sight | None:
        """Simulate what is needed at `values` (p,); None where the section cannot be simulated."""
        own, parameters = tuple(values.tolist()), section.parameters
        fitted = parameters.to_fitted(values)
        moved = [
            tuple(parameters.to_values(fitted + STEP * unit).tolist())
            for unit in np.eye(len(values))
        ]
        requests = [
            Request(own),
            *(Request(there) for there in moved),
            Request(own, transfer=TRANSFER),
            Request(own, spacing_factor=1.0 / RESOLUTION),
            *(Request(own, jitter=JITTER, seed=k) for k in range(1, REPLICATES + 1)),
        ]
        base, *rest = laboratory.deposits(section, requests)
        steps = rest[: len(values)]
        if base is None or any(step is None for step in steps):
            return None
        transfer, finer, *replicates = rest[len(values) :]
        kept = [deposit for deposit in replicates if deposit is not None]
        return cls(laboratory, section, survey, values, base, steps, kept, transfer, finer)

    def amplitude(
        self, name: str, wanted: float, stream: Stream, more: dict[str, float]
    ) -> tuple[float, float]:
        """The amplitude of an effect that gives lambda `wanted`, and the lambda it gives."""
        scale = effect_of(name).amplitude
        signs = [1.0]
        if scale.two_signed:
            first = 1.0 if stream.unit() < 0.5 else -1.0
            signs = [first, -first]
        best = (0.0, 0.0)
        for sign in signs:
            highest = scale.high if sign > 0 else -scale.low
            magnitude, seen = find_amplitude(
                lambda sizes, sign=sign: self.lambdas(
                    [{name: {"amplitude": sign * a, **more}} for a in sizes]
                ),
                scale.ladder,
                highest,
                wanted,
            )
            best = (sign * magnitude, seen)
            if BINS[0] <= seen <= BINS[-1]:
                break
        return best

    def lambdas(self, effects: Sequence[dict[str, Entry]]) -> list[float]:
        """What can be seen of each set of effects; NaN where its run failed."""
        requests = [Request(tuple(self.values.tolist()), one) for one in effects]
        return [
            np.nan if deposit is None else self._lambda(deposit)
            for deposit in self.laboratory.deposits(self.section, requests)
        ]

    def _lambda(self, deposit: Deposit) -> float:
        entries = surveys.entries_of(
            self.section, self.survey, surveys.toe_of(self.section, deposit)
        )
        try:
            change = surveys.reading(entries, deposit) - surveys.reading(entries, self.base)
            here = surveys.reading(entries, self.base)
            derivative = np.column_stack(
                [(surveys.reading(entries, step) - here) / STEP for step in self.steps]
            )
            others = [surveys.reading(entries, one) for one in self.replicates]
            differences = [
                None if one is None else surveys.reading(entries, one) - here
                for one in (self.transfer, self.finer)
            ]
        except ValueError:
            return np.nan
        total = covariance(
            surveys.covariance_of(entries),
            replicates=np.array(others),
            synthetic=True,
            transfer=differences[0],
            finer=differences[1],
        ).total
        known = self.section.parameters.has_prior
        return detectability(change, derivative, total, np.eye(len(known))[known])
