"""Volume released through a line over time, and the discharge that has this volume.

A discharge is tabulated at fixed times and joined linearly between them, as a flood model reads it.
Central differences of the volume passed, from one step before the slide to one after its end, give
ordinates whose integral is the volume exactly.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inversion.engines.body_setup import STEP_S

#: Volumes that so many per cent of the slides stay below.
PERCENT = (5, 50, 95)
#: Digits of a number in the table.
FIGURES = 7


def discharge(volume: np.ndarray) -> np.ndarray:
    """Ordinates (..., k + 2) [volume/s] from one step before the first time of a volume (..., k).

    The volume begins with 0 and stays what it is after its end.
    """
    ends = [(0, 0)] * (volume.ndim - 1) + [(2, 2)]
    padded = np.pad(volume, ends, mode="edge")
    return (padded[..., 2:] - padded[..., :-2]) / (2.0 * STEP_S)


def passed(ordinates: np.ndarray) -> float:
    """Volume under the ordinates of a discharge (k,), joined linearly."""
    return float(np.trapezoid(ordinates, dx=STEP_S))


def hydrograph(
    line: str, smooth: np.ndarray, at_end: np.ndarray, *, units: tuple[str, str], **more: Any
) -> dict[str, Any]:
    """What `prediction.json` holds of a line.

    Each slide's volumes are in proportion to its volume at the end, numerical noise included. At
    each time the volumes are sorted; the discharge is that of the sorted volumes.

    Args:
        line: its name.
        smooth: volumes passed of s slides at k times from the start, (s, k), without noise.
        at_end: the same at the end, with the noise, (s,).
        units: of volume and discharge.
        more: further keys.
    """
    final = smooth[:, -1]
    share = np.divide(at_end, final, out=np.ones_like(final), where=final > 0.0)
    volumes = np.percentile(smooth * share[:, None], PERCENT, axis=0)
    times = STEP_S * np.arange(-1, smooth.shape[1] + 1)
    return {
        "line": line,
        **more,
        "step_s": STEP_S,
        "time_s": times.tolist(),
        "volume_unit": units[0],
        "discharge_unit": units[1],
        "volume": {
            str(percent): _rounded(np.concatenate([[0.0], row, row[-1:]]))
            for percent, row in zip(PERCENT, volumes, strict=True)
        },
        "discharge": {
            str(percent): _rounded(discharge(row))
            for percent, row in zip(PERCENT, volumes, strict=True)
        },
    }


def hydrograph_csv(found: Sequence[Mapping[str, Any]]) -> str:
    """The table of `hydrograph.csv`: a time a row, a discharge a column.

    Args:
        found: of `hydrograph`, all at the same times; at least one.
    """
    columns = [
        (f"{_column(one['line'])}_{percent}", one["discharge"][str(percent)])
        for one in found
        for percent in PERCENT
    ]
    lines = [",".join(["time_s", *(name for name, _ in columns)])]
    for number, time in enumerate(found[0]["time_s"]):
        values = (time, *(ordinates[number] for _, ordinates in columns))
        lines.append(",".join(f"{value:.{FIGURES}g}" for value in values))
    return "\n".join(lines) + "\n"


def _column(line: str) -> str:
    """Name of a line that holds no comma and no space."""
    return re.sub(r"[^\w.]+", "_", line)


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.{FIGURES}g}") for value in values]
