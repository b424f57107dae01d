"""Steps 1 and 2: the base model brought to the measurements, and how far it may err there.

A scan over the strengths finds where the slide moves at all; searches from the best of it, and from
others, find the least misfit. There the replicates, the second transfer scheme and the finer cells
are run. What finer cells change is added to every prediction from there on (`CellCorrection`); C is
put together, and the fit is settled on the mean of the replicates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.hypotheses.model import Model
from diagnosis.options import Options
from inversion.estimation.budget import Runs
from inversion.estimation.covariance import (
    Covariance,
    covariance,
    jitter_covariance,
    known,
    mean_of,
    source_covariance,
)
from inversion.estimation.data import Data, Targets
from inversion.estimation.derivatives import (
    WIDEST,
    central_differences,
    first_steps,
    steps_above_noise,
)
from inversion.estimation.hold_out import Split, split
from inversion.estimation.misfit import total_of
from inversion.estimation.response_surface import Surface, Surrogate, spreads
from inversion.estimation.surface_search import SEEN, Fit, best_of, search, settled
from inversion.estimation.unknowns import Unknowns
from inversion.problem.state import Numerics, State
from pipeline.cli import WorkFailed
from pipeline.ties import ranked

#: Levels of the strengths in the scan, as shares of their bounds. By judgement: even steps; with
#: half of them the valley of the answer may lie between two.
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Times that the derivative is taken at most before C is known: again where the search has moved
#: farther than the widest step of a difference, beyond which a slope is that of another place. By
#: judgement: the search with all errors comes after it.
TIMES_ANEW = 3
#: The correction for the cells is found so often at most: again where the fit with it has moved
#: farther than the second. By judgement: a tenth of a strength is held to change the correction by
#: less than its own error, half of it (`Options.finer_share_std`).
TIMES_CORRECTED, FAR = 2, 0.1
#: Amplitude, as a share of that at which cells were measured, up to which they do more. By
#: judgement: farther out nothing says that they go on in proportion.
MOST_SHARE = 1.5
#: Variance of a run's noise as a share of the survey's, until it is measured. By judgement: with
#: less the first search follows the noise of single runs, with more it learns little from them.
ASSUMED_NOISE = 0.2


@dataclass
class CellCorrection:
    """What is added to predictions for the size of the cells.

    Attributes:
        targets: the measurements.
        missing: of the base model, (m,).
        models: effects -> their amplitudes at a fit, and what is missing there beyond that, (m,).
    """

    targets: Targets
    missing: np.ndarray
    models: dict[tuple[str, ...], tuple[Mapping[str, float], np.ndarray]] = field(
        default_factory=dict
    )

    def __call__(self, state: State, row: np.ndarray) -> np.ndarray:
        """The prediction (m,) of a state, corrected."""
        return self.targets.counted(row + self.of(state))

    def of(self, state: State) -> np.ndarray:
        """What a state's cells take from its prediction, (m,).

        Of the largest model measured whose effects it has, in proportion to the amplitudes.
        """
        there = dict(state.effects)
        known = [names for names in self.models if names and there.keys() >= set(names)]
        if not known:
            return self.missing
        amplitudes, more = self.models[max(known, key=len)]
        shares = [there[name] / amplitude for name, amplitude in amplitudes.items()]
        return self.missing + float(np.clip(min(shares), 0.0, MOST_SHARE)) * more


@dataclass(frozen=True)
class Base:
    """The calibrated base model.

    Attributes:
        runs: the model with its memory.
        split: fitted and held-out measurements.
        covariance: C by its parts.
        cells: what they take from a prediction; it is added to all of them.
        jitter: covariance of one run's numerical noise, (m, m).
        data: measurements with C.
        surface: response surface around the anchor; its prediction is the mean of the replicates.
        seeds: replicates behind that mean.
        fit: the answer.
    """

    runs: Runs
    split: Split
    covariance: Covariance
    cells: CellCorrection
    jitter: np.ndarray
    data: Data
    surface: Surface
    seeds: int
    fit: Fit


def calibrate(model: Model, options: Options) -> Base:
    """Fit the base model, find C there, and settle the fit.

    Args:
        model: the model to diagnose.
        options: what may be done otherwise.

    Raises:
        WorkFailed: no run gave a prediction of the fitted numbers, or the allowance does not cover
            the fit and its errors.
        InputError: the hold-out does not fit the measurements.
    """
    free = {candidate.name for candidate in model.candidates if candidate.free}
    runs = Runs(model, options.allowance, free)
    targets = model.targets
    space = Unknowns(model.parameters)
    scanned = runs.predict([space.state(x) for x in _scan(space)])
    parts = split(targets, options.hold_out, scanned)
    first = targets.data(split=parts)
    fit = _first_fit(runs, first, space, options)
    for _ in range(TIMES_CORRECTED):
        base = _with_errors(runs, targets, parts, space, fit, options)
        moved = np.max(np.abs(base.fit.x - base.surface.x))
        fit = base.fit
        if not options.finer_share or moved <= FAR:
            break
    if runs.cut_short:  # an unfinished fit would be taken for a model that does not fit
        raise WorkFailed(
            f"diagnosis.max_runs leaves {runs.allowance} runs, which do not cover the fit of the "
            f"base model and its errors: no {runs.cut_short[0]} after {runs.asked} runs; allow more"
        )
    return base


def _with_errors(
    runs: Runs, targets: Targets, parts: Split, space: Unknowns, first: Fit, options: Options
) -> Base:
    """Find C and the correction for the cells at a fit, and settle it with them.

    From here on every prediction of `runs` is corrected.
    """
    base = first.x
    runs.corrected = lambda state, row: row
    replicates = replicates_at(runs, space, base, options)
    cov, missing = errors_at(runs, targets, space.state(base), replicates, options)
    cells = CellCorrection(targets, missing)
    runs.corrected = cells
    replicates = replicates_at(runs, space, base, options)
    data = targets.data(cov.total, parts)
    data = replace(data, strength_error=options.source_strength)
    jitter = jitter_covariance(replicates)
    steps = steps_above_noise(space, data, first.derivative, jitter)
    slope = central_differences(runs, space, base, replicates[0], steps, "derivative at the fit")
    slope = first.derivative if slope is None else slope
    surface = Surface(space, base, mean_of(replicates), slope)
    seeds = len(replicates)
    noise = spreads(data, surface, space, jitter, anchored_by=seeds)
    surrogate = Surrogate(surface, space, noise)
    surrogate.recall(runs)
    fit = settled(data, surrogate, [base])
    if np.max(np.abs(fit.x - base)) > SEEN:
        found = search(
            runs, data, surrogate, [base], first=[], turns=3, what="the fit with all errors"
        )
        fit = fit if found is None else found
    return Base(runs, parts, cov, cells, jitter, data, surface, seeds, fit)


def _first_fit(runs: Runs, data: Data, space: Unknowns, options: Options) -> Fit:
    """The best of several searches by the survey's error alone."""
    guesses = _scan(space)
    rows = runs.predict([space.state(x) for x in guesses])
    totals = [total_of(data, space, row, x) for row, x in zip(rows, guesses, strict=True)]
    order = ranked(range(len(totals)), lambda place: -totals[place])
    if not np.isfinite(totals[order[0]]):
        raise WorkFailed("no run of the base model could be read; see the reasons of the runs")
    starts = [guesses[place] for place in order[: options.starts]]
    x, row = guesses[order[0]], rows[order[0]]
    fit: Fit | None = None
    for _ in range(TIMES_ANEW):
        slope = central_differences(runs, space, x, row, first_steps(space), "derivative")
        if slope is None:
            break
        surface = Surface(space, x, row, slope)
        guessed = spreads(data, surface, space, ASSUMED_NOISE * data.covariance, anchored_by=1)
        surrogate = Surrogate(surface, space, guessed)
        surrogate.recall(runs)
        valleys = best_of(data, surrogate, [x, *starts], options.starts)
        found = search(
            runs,
            data,
            surrogate,
            [x, *starts],
            first=[at for at, _ in valleys],
            turns=3,
            what="search of the base model",
        )
        if found is None:
            break
        moved, fit = np.max(np.abs(found.x - x)), found
        x, row = fit.x, runs.predict([space.state(fit.x)])[0]
        if moved <= WIDEST or not np.all(np.isfinite(row)):
            break
    if fit is None:
        raise WorkFailed(f"the allowance of {runs.allowance} runs does not cover one fit")
    return fit


def _scan(space: Unknowns) -> list[np.ndarray]:
    """First guesses: the question's, and all strengths at several levels of their bounds."""
    parameters = space.parameters
    start = parameters.to_fitted(parameters.start)
    free = parameters.logarithmic & ~parameters.has_prior
    guesses = [start]
    if free.any():
        for level in LEVELS:
            x = start.copy()
            x[free] = (space.low + level * (space.high - space.low))[free]
            guesses.append(x)
    else:
        width = space.high - space.low
        for share in (-0.25, 0.25):
            guesses.append(np.clip(start + share * width, space.low, space.high))
    return guesses


def replicates_at(runs: Runs, space: Unknowns, x: np.ndarray, options: Options) -> np.ndarray:
    """Predictions at x with jitter seeds 0 to n, (n + 1, m)."""
    n = options.replicates if options.numerical_covariance else 0
    states = [space.state(x, seed=seed) for seed in range(n + 1)]
    if not runs.affords(states, "replicates"):
        states = states[: 1 + runs.left]
    return runs.predict(states)


def paired(own: State, options: Options) -> dict[Numerics, State]:
    """The same run with other numerics, as many of them as are asked for."""
    wanted: dict[Numerics, bool] = {
        "transfer": options.second_scheme,
        "fine": options.wants_finer,
    }
    return {kind: replace(own, numerics=kind) for kind, asked in wanted.items() if asked}


def errors_at(
    runs: Runs, targets: Targets, own: State, replicates: np.ndarray, options: Options
) -> tuple[Covariance, np.ndarray]:
    """C of a model at a state, and what the cells take from every prediction there, (m,).

    Args:
        runs: the model.
        targets: the measurements.
        own: the state.
        replicates: predictions there with other jitters, (n, m).
        options: which parts there are.
    """
    nothing = np.zeros(replicates.shape[1])
    source = source_covariance(targets.entries, options.source)
    survey = targets.covariance
    if not options.numerical_covariance:
        return covariance(survey, source=source), nothing
    kinds = {
        kind: state for kind, state in paired(own, options).items() if runs.model.simulates(state)
    }
    transfer = fine = None
    finer_noise = 0.0
    if "transfer" in kinds and runs.affords([kinds["transfer"]], "transfer"):
        transfer = runs.predict([kinds["transfer"]])[0] - runs.predict([own])[0]
    if "fine" in kinds:
        states = [replace(kinds["fine"], seed=seed) for seed in range(options.finer_runs)]
        if runs.affords(states, "finer cells"):
            fine = mean_of(runs.predict(states)) - mean_of(replicates)
            finer_noise = options.finer_noise
    found = covariance(
        survey,
        replicates=replicates,
        synthetic=options.synthetic,
        transfer=transfer,
        finer=fine,
        factor=options.finer_share_std,
        finer_noise=finer_noise,
        source=source,
        engine_std=runs.model.error_std(own),
    )
    return found, nothing if fine is None else options.finer_share * known(fine)
