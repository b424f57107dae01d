"""Step 1: how far measurement and model may differ although nothing is missing.

C = C_meas + C_num. C_meas is the survey's (`Measured.covariance`). C_num is the model's own error
at its fit: where exactly the material points lie (replicates with other jitters, S), how velocities
pass between points and grid (a paired run with another scheme that passes the verification, b_t),
and the cell size (a paired run with spacing / 1.5, b):

    C_num = 0.7 S + 0.3 diag S + b_t b_t' + 0.7 b b' + 0.3 diag b^2,  b = c (f_fine - f)

Off-diagonals of S rest on few runs, so part of each is kept on the diagonal alone. Simulated data
hold the noise of a run of their own; predictions are means over several runs.

Leaving C_num out makes every artefact of the grid a missing effect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Share of the covariances that is kept where few runs have shown them.
KEPT = 0.7
#: Noise of simulated data and of the prediction next to it, in that of one run: theirs, and what
#: the mean of several runs still has.
SYNTHETIC = 1.25


@dataclass(frozen=True)
class Covariance:
    """The parts of C, each (m, m).

    Attributes:
        survey: C_meas.
        jitter: of the replicates, more for simulated data.
        transfer: of the transfer scheme.
        resolution: of the cell size.
    """

    survey: np.ndarray
    jitter: np.ndarray
    transfer: np.ndarray
    resolution: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """C, (m, m)."""
        return self.survey + self.jitter + self.transfer + self.resolution


def covariance(
    survey: np.ndarray,
    *,
    replicates: np.ndarray | None = None,
    synthetic: bool = False,
    transfer: np.ndarray | None = None,
    finer: np.ndarray | None = None,
    factor: float = 2.5,
) -> Covariance:
    """Put C together.

    Args:
        survey: C_meas, (m, m).
        replicates: predictions with other jitters at one state, (n, m); rows of NaN failed.
        synthetic: the data were simulated.
        transfer: prediction with the second transfer scheme minus that with the first, (m,).
        finer: prediction at spacing / 1.5 minus that at the spacing, same jitter seed, (m,).
        factor: c, share of `finer` that counts as bias; its size left from here to no cells at all
            is 2 for an error of first order.
    """
    m = len(survey)
    nothing = np.zeros((m, m))
    jitter = nothing if replicates is None else jitter_covariance(replicates)
    return Covariance(
        survey=survey,
        jitter=SYNTHETIC * jitter if synthetic else jitter,
        transfer=nothing if transfer is None else np.outer(known(transfer), known(transfer)),
        resolution=nothing if finer is None else _partly(np.outer(*[factor * known(finer)] * 2)),
    )


def jitter_covariance(replicates: np.ndarray) -> np.ndarray:
    """0.7 S + 0.3 diag S of replicates (n, m); zero with fewer than two."""
    kept = replicates[np.all(np.isfinite(replicates), axis=1)]
    if len(kept) < 2:
        return np.zeros((replicates.shape[1], replicates.shape[1]))
    return _partly(np.cov(kept, rowvar=False).reshape(kept.shape[1], kept.shape[1]))


def known(difference: np.ndarray) -> np.ndarray:
    """A paired difference (m,), zero where one of the two runs failed."""
    return np.nan_to_num(difference, nan=0.0, posinf=0.0, neginf=0.0)


def _partly(matrix: np.ndarray) -> np.ndarray:
    return KEPT * matrix + (1.0 - KEPT) * np.diag(np.diag(matrix))
