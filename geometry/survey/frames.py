"""All frames of a run, for measurements that are read on its history.

Frames are interpolated linearly in time. A derivative is given for the two frames it needs.
"""

from __future__ import annotations

import numpy as np

from geometry.survey.measured import Deposit
from pipeline.cli import InputError


def frames_of(deposit: Deposit, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, N, 2) [m] and times (T,) [s] of the frames, for the measurement `name`.

    Raises:
        ValueError: the deposit has the last frame alone.
    """
    if deposit.positions is None or deposit.time is None:
        raise ValueError(f"{name}: needs all frames of the run; only one is known")
    return deposit.positions, np.asarray(deposit.time, dtype=float)


def check_end(deposit: Deposit, name: str, last: float) -> None:
    """Refuse to read a run that was cut off in motion before the last time measured [s].

    Raises:
        InputError: one line.
    """
    _, time = frames_of(deposit, name)
    end = float(time[-1])
    if last > end and not deposit.at_rest:
        raise InputError(
            f"{name}: measured at {last:g} s, but the run was stopped in motion at {end:g} s; "
            "give it a longer duration_s"
        )


def frames_around(time: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (M, 2) of the frames around each time and their shares (M, 2)."""
    time, times = np.asarray(time, dtype=float), np.asarray(times, dtype=float)
    if len(time) < 2:
        raise ValueError(f"a history needs at least two frames, but there are {len(time)}")
    outside = (times < time[0]) | (times > time[-1])
    if outside.any():
        raise ValueError(
            f"t = {times[outside][0]:g} s lies outside the run, {time[0]:g} to {time[-1]:g} s"
        )
    after = np.clip(np.searchsorted(time, times, side="right"), 1, len(time) - 1)
    later = (times - time[after - 1]) / (time[after] - time[after - 1])
    return np.stack([after - 1, after], axis=1), np.stack([1.0 - later, later], axis=1)
