"""Step 1: how far measurement and model may differ although nothing is missing.

C = C_meas + C_num. C_meas is the survey's (`Measured.covariance`). C_num is the model's own error
at its fit: where exactly the material points lie (replicates with other jitters, S), how velocities
pass between points and grid (a paired run with another scheme that passes the verification, b_t),
and the cell size. Runs with half the spacing differ from those with the spacing by b on average,
and the slide without cells by some multiple of it, k b: k is 2 for an error of first order, 4/3 for
one of second, 1 for a slide made by another code with cells of half the size. So k_0 b is added to
every prediction, and what k may be off by, s, is left in C, with the noise of the n fine runs:

    C_num = 0.7 S + 0.3 diag S + b_t b_t' + s^2 (0.7 b b' + 0.3 diag b^2) + k_0^2 S / n

Off-diagonals of S rest on few runs, so part of each is kept on the diagonal alone. Simulated data
hold the noise of a run of their own; predictions are means over several runs.

A measured slide that is itself the result of a simulation has a third part, C_source: how far codes
differ on one and the same slide (`SourceError`). It is stated, not found, and enlarges no bound.

Leaving C_num out makes every artefact of the grid a missing effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from geometry.survey.measured import Measured, exponential_correlation

#: Share of the covariances that is kept where few runs have shown them. By judgement: with all of
#: them nine runs leave most directions without any error; with half of them numbers that err
#: together are taken for witnesses of their own.
KEPT = 0.7
#: Noise of simulated data and of the prediction next to it, in that of one run: theirs, and what
#: the mean of four runs still has.
SYNTHETIC = 1.25


@dataclass(frozen=True)
class SourceError:
    """Error of the code that made a measured slide, in numbers of one type of measurement.

    Attributes:
        std: in the type's unit.
        correlation_length: of the errors along x [m] or time [s] within a measurement; None: they
            are independent.
    """

    std: float
    correlation_length: float | None = None


def source_covariance(entries: Sequence[Measured], errors: Mapping[str, SourceError]) -> np.ndarray:
    """C_source (m, m) of measurements, from the error of each type; 0 for types not named."""
    blocks = []
    for entry in entries:
        n = len(entry.values)
        error = errors.get(getattr(entry, "type", ""))
        if error is None:
            blocks.append(np.zeros((n, n)))
            continue
        length = error.correlation_length if entry.along is not None and n > 1 else None
        places = np.zeros(n) if entry.along is None else entry.along.place
        blocks.append(error.std**2 * exponential_correlation(places, length))
    return block_diag(*blocks)


@dataclass(frozen=True)
class Covariance:
    """The parts of C, each (m, m).

    Attributes:
        survey: C_meas.
        jitter: of the replicates, more for simulated data.
        transfer: of the transfer scheme.
        resolution: of the cell size, where predictions are corrected for it of the correction.
        source: of the code that made the measured slide.
        engine: of what an engine that has learned errs by, as it says itself.
    """

    survey: np.ndarray
    jitter: np.ndarray
    transfer: np.ndarray
    resolution: np.ndarray
    source: np.ndarray
    engine: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """C, (m, m)."""
        numerical = self.jitter + self.transfer + self.resolution
        return self.survey + numerical + self.source + self.engine


def covariance(
    survey: np.ndarray,
    *,
    replicates: np.ndarray | None = None,
    synthetic: bool = False,
    transfer: np.ndarray | None = None,
    finer: np.ndarray | None = None,
    factor: float = 1.0,
    finer_noise: float = 0.0,
    source: np.ndarray | None = None,
    engine_std: np.ndarray | None = None,
) -> Covariance:
    """Put C together.

    Args:
        survey: C_meas, (m, m).
        replicates: predictions with other jitters at one state, (n, m); rows of NaN failed.
        synthetic: the data were simulated.
        transfer: prediction with the second transfer scheme minus that with the first, (m,).
        finer: b, prediction with finer cells minus that with the cells of the model, (m,).
        factor: s, multiple of `finer` by which the model may be off.
        finer_noise: k_0^2 / n, the noise that a correction by n finer runs has brought, as a share
            of that of one run.
        source: C_source, (m, m); None: the slide was no simulation, or one of the same code.
        engine_std: standard deviations that an engine states of its own predictions, (m,), each
            independent; None, or NaN: none.
    """
    m = len(survey)
    nothing = np.zeros((m, m))
    jitter = nothing if replicates is None else jitter_covariance(replicates)
    resolution = finer_noise * jitter
    if finer is not None:
        resolution = resolution + partly(np.outer(*[factor * known(finer)] * 2))
    return Covariance(
        survey=survey,
        jitter=SYNTHETIC * jitter if synthetic else jitter,
        transfer=nothing if transfer is None else np.outer(known(transfer), known(transfer)),
        resolution=resolution,
        source=nothing if source is None else source,
        engine=nothing if engine_std is None else np.diag(np.nan_to_num(engine_std) ** 2),
    )


def not_less(own: Covariance, base: Covariance) -> np.ndarray:
    """C of a model that is granted at least what another is granted, (m, m).

    Each has shown its numerical error by few runs. Their correlations are the mean of both, the
    variance of every number is the larger one: nobody gains by a lucky lack of scatter.
    """
    found, known = (one.jitter + one.transfer + one.resolution + one.engine for one in (own, base))
    pooled = 0.5 * (found + known)
    larger = np.maximum(np.diag(found), np.diag(known))
    scale = np.sqrt(larger / np.maximum(np.diag(pooled), 1e-300))
    return own.survey + own.source + scale[:, None] * pooled * scale


def mean_of(rows: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Mean of the predictions (n, m) that could be read, (m,); NaN of none."""
    rows = np.asarray(rows)
    kept = rows[np.all(np.isfinite(rows), axis=1)]
    return kept.mean(axis=0) if len(kept) else np.full(rows.shape[1], np.nan)


def jitter_covariance(replicates: np.ndarray) -> np.ndarray:
    """0.7 S + 0.3 diag S of replicates (n, m); zero with fewer than two."""
    kept = replicates[np.all(np.isfinite(replicates), axis=1)]
    if len(kept) < 2:
        return np.zeros((replicates.shape[1], replicates.shape[1]))
    return partly(np.cov(kept, rowvar=False).reshape(kept.shape[1], kept.shape[1]))


def known(difference: np.ndarray) -> np.ndarray:
    """A paired difference (m,), zero where one of the two runs failed."""
    return np.nan_to_num(difference, nan=0.0, posinf=0.0, neginf=0.0)


def partly(matrix: np.ndarray) -> np.ndarray:
    """A covariance (m, m) that few runs have shown: its off-diagonals shrunk to `KEPT`."""
    return KEPT * matrix + (1.0 - KEPT) * np.diag(np.diag(matrix))
