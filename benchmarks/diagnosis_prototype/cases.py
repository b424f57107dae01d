"""Blind cases whose truth is known: another cell size and jitter than the diagnosing model's.

The amplitude of the hidden effect is chosen so that lambda, chi2 of the noise-free residual after
the base model has been refitted, falls where it is wanted: an effect that the measurements cannot
show can be found by nobody.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis_prototype import slide
from benchmarks.diagnosis_prototype.model import (
    OUTSIDE,
    STD,
    SURVEYS,
    Prototype,
    library,
    simulate,
    survey,
)
from benchmarks.diagnosis_prototype.slide import Numerics
from diagnosis.fitting.covariance import covariance
from diagnosis.hypotheses.model import Candidate, State

#: Bins of lambda.
BINS = ((3.0, 10.0), (10.0, 25.0), (25.0, 60.0), (60.0, 200.0))
#: Cell size of the truths, the diagnosing model's being 1.
TRUTH_CELLS = (0.6, 0.75)
#: Largest amplitudes of what is outside the library.
OUTSIDE_HIGH = {"outside_speed": 0.8, "outside_healing": 1.5, "outside_ridge": 1.2}


@dataclass(frozen=True)
class Case:
    """One blind case.

    Attributes:
        name: unique; its seed follows from it.
        kind: null, single, pair, outside.
        effects: hidden amplitudes by name.
        values: true S_r [kPa] and friction [degrees].
        detectability: lambda.
        survey: its kind.
        model: what the diagnosis sees.
    """

    name: str
    kind: str
    effects: dict[str, float]
    values: tuple[float, float]
    detectability: float
    survey: str
    model: Prototype


@dataclass(frozen=True)
class Setting:
    """How noisy the world of a study is.

    Attributes:
        noise: size of the disturbance by the points' positions.
        rough: share of it without memory of the state.
        surveys: kinds of surveys.
    """

    noise: float = 1.0
    rough: float = 0.5
    surveys: tuple[str, ...] = SURVEYS


def make_case(kind: str, number: int, setting: Setting) -> Case:
    """A case of a kind; the same number gives the same case."""
    words = {"null": 1, "single": 2, "pair": 3, "outside": 4}
    draw = np.random.default_rng([words[kind], number])
    what = setting.surveys[number % len(setting.surveys)]
    values = (float(draw.uniform(9.0, 18.0)), float(draw.uniform(29.0, 35.0)))
    numerics = Numerics(float(draw.uniform(*TRUTH_CELLS)))
    candidates = library()
    effects: dict[str, float] = {}
    detectability = 0.0
    place = draw.integers(len(BINS))
    wanted = float(np.exp(draw.uniform(*np.log(BINS[place]))))
    for attempt in range(40):
        if kind == "null":
            break
        if attempt:
            # What one section and survey cannot show, another may.
            values = (float(draw.uniform(9.0, 18.0)), float(draw.uniform(29.0, 35.0)))
            what = str(draw.choice(setting.surveys))
        names = _hidden(kind, candidates, draw)
        effects, detectability = _amplitude(names, candidates, values, what, wanted, setting, draw)
        if effects:
            break
    seed = int(draw.integers(1000, 2**31))
    every = _read(candidates, values, effects, numerics, seed, setting)
    readings = _surveyed(every, effects.get("datum_shift", 0.0), what, draw)
    model = Prototype(survey(what, readings), noise=setting.noise, rough=setting.rough)
    return Case(f"{kind} {number}", kind, effects, values, detectability, what, model)


def _hidden(kind: str, candidates: Sequence[Candidate], draw: np.random.Generator) -> list[str]:
    if kind == "outside":
        return [str(draw.choice(OUTSIDE))]
    names = [candidate.name for candidate in candidates]
    return [str(name) for name in draw.choice(names, 2 if kind == "pair" else 1, replace=False)]


def _amplitude(names, candidates, values, what, wanted, setting, draw):
    """Amplitudes that give the wanted lambda, and it; none where no amplitude does."""
    highs, signs = [], []
    for name in names:
        known = [c for c in candidates if c.name == name]
        high = known[0].high if known else OUTSIDE_HIGH[name]
        high = 1.0 if name == "datum_shift" else high
        highs.append(0.95 * high)
        signs.append(draw.choice([-1.0, 1.0]) if known and known[0].two_signed else 1.0)
    shares = np.geomspace(0.02, 1.0, 16)
    tried = [
        {n: float(s * share * h) for n, s, h in zip(names, signs, highs, strict=True)}
        for share in shares
    ]
    found = detectabilities(tried, values, what, setting)
    # A slide that no longer resembles one is no case: its toe must stay within the profile.
    above = np.flatnonzero(found >= wanted)
    if not len(above) or above[0] == 0:
        return {}, 0.0
    last = above[0]
    share = np.interp(np.log(wanted), np.log(np.maximum(found[last - 1 : last + 1], 1e-9)),
                      np.log(shares[last - 1 : last + 1]))  # fmt: skip
    chosen = {n: float(s * np.exp(share) * h) for n, s, h in zip(names, signs, highs, strict=True)}
    truth = float(detectabilities([chosen], values, what, setting)[0])
    every = _read(candidates, values, chosen, Numerics(), 0, Setting(noise=0.0))
    if not (truth <= 200.0 and 4.0 < every[slide.TOE] < 26.0):
        return {}, 0.0
    return chosen, truth


def detectabilities(
    tried: Sequence[dict[str, float]], values: tuple[float, float], what: str, setting: Setting
) -> np.ndarray:
    """Lambda of several truths, (n,): the misfit left when the base model imitates them."""
    candidates = library()
    quiet = Prototype(survey(what, np.ones(slide.SIZE)), noise=0.0)
    states = [State(values).with_effects(e) for e in tried]
    target = quiet.predict(states)
    noisy = Prototype(quiet.observed, noise=setting.noise, rough=setting.rough)
    replicates = noisy.predict([State(values, (), seed) for seed in range(1, 25)])
    own, other, finer = quiet.predict(
        [State(values, (), 0, numerics) for numerics in ("own", "transfer", "fine")]
    )
    total = covariance(
        quiet.targets.covariance, replicates=replicates, synthetic=True,
        transfer=other - own, finer=finer - own,
    ).total  # fmt: skip
    root = np.linalg.cholesky(np.linalg.inv(total)).T
    start = quiet.parameters.to_fitted(np.array(values))
    low, high = quiet.parameters.fitted_low, quiet.parameters.fitted_high
    x = np.repeat(start[None, :], len(tried), axis=0)
    prior = quiet.parameters.to_fitted(quiet.parameters.start)
    best = np.full(len(tried), np.inf)
    for _ in range(8):
        points = [x]
        for column in range(2):
            for sign in (-1.0, 1.0):
                moved = x.copy()
                moved[:, column] += sign * 0.03
                points.append(moved)
        rows = simulate(
            candidates,
            [State(tuple(quiet.parameters.to_values(p))) for block in points for p in block],
            quiet.numerics, [0] * (5 * len(tried)), 0.0, 0.5,
        )[:, quiet.observed.index].reshape(5, len(tried), -1)  # fmt: skip
        for row in range(len(tried)):
            residual = root @ (target[row] - rows[0, row])
            best[row] = min(best[row], float(residual @ residual))
            slope = np.stack(
                [(rows[2 + 2 * c, row] - rows[1 + 2 * c, row]) / 0.06 for c in range(2)], axis=1
            )
            matrix = np.vstack([root @ slope, [0.0, 1.0]])
            right = np.append(residual, prior[1] - x[row, 1])
            step = np.linalg.lstsq(matrix, right, rcond=None)[0]
            x[row] = np.clip(x[row] + np.clip(step, -0.4, 0.4), low, high)
    return best


def _read(candidates, values, effects, numerics, seed, setting) -> np.ndarray:
    """What happened, (SIZE,), without the survey's errors."""
    kept = {name: a for name, a in effects.items() if name != "datum_shift"}
    return simulate(
        candidates, [State(values).with_effects(kept)], numerics, [seed], setting.noise,
        setting.rough,
    )[0]  # fmt: skip


def _surveyed(every: np.ndarray, shift: float, what: str, draw: np.random.Generator) -> np.ndarray:
    """With the survey's errors."""
    found = every.copy()
    template = survey("full", every)
    factor = np.linalg.cholesky(template.targets.covariance)
    found[template.index] += factor @ draw.standard_normal(len(template.index))
    rest = np.setdiff1d(np.arange(slide.SIZE), template.index)
    found[rest] += STD["marker"] * draw.standard_normal(len(rest))
    found[slide.PROFILE] += shift
    return found
