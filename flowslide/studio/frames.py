"""A simulated slide as the page gets it: one binary message.

`uint32` length of the header (little endian) | header, JSON padded with spaces to a multiple of
four | arrays, one after another, each padded likewise. The header names each array with dtype
("f4", "u2", "u1"), shape and offset from the end of the header.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from geometry.case import Case
from geometry.scenes.doubts import Doubt, soil_doubts
from mpm_taichi.comparison import ComparedReading, label
from mpm_taichi.trajectory import Run
from pipeline.units import with_signs

#: Most frames of a film: two a second of a slide of half a minute.
FRAMES = 60
DTYPES = {"f4": np.dtype("<f4"), "u2": np.dtype("<u2"), "u1": np.dtype("u1")}


def message(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """Pack a header and arrays whose dtypes are those of `DTYPES`."""
    known = {dtype: name for name, dtype in DTYPES.items()}
    entries, parts, offset = [], [], 0
    for name, array in arrays.items():
        data = np.ascontiguousarray(array).tobytes()
        data += b"\0" * (-len(data) % 4)
        entries.append(
            {
                "name": name,
                "dtype": known[array.dtype],
                "shape": list(array.shape),
                "offset": offset,
            }
        )
        parts.append(data)
        offset += len(data)
    text = json.dumps({**header, "arrays": entries}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(parts)


def deposit(
    case: Case, run: Run, readings: list[ComparedReading], *, film: bool, **more: Any
) -> bytes:
    """The message of a run: the last frame, or with `film` at most `FRAMES` of all.

    Args:
        case: that was simulated.
        run: of it.
        readings: of its measurements.
        film: send the way there.
        more: of the header.
    """
    last = run.frames - 1
    places = np.array([last])
    if film:
        places = np.unique(np.linspace(0, last, min(FRAMES, run.frames)).round().astype(int))
    positions = run.positions[places]
    arrays = {
        "positions": positions.astype("<f4"),
        "initial": run.positions[0].astype("<f4"),
        "zone": run.zone.astype("<u2"),
        "speed": _speed(run, places).astype("<f4"),
        "plastic_strain": run.plastic_shear_strain.astype("<f4"),
    }
    header = {
        "type": "deposit",
        "spacing_m": case.scene.spacing,
        "points": run.points,
        "times": [round(float(run.time[k]), 3) for k in places],
        "came_to_rest": run.came_to_rest,
        "computed_s": round(run.wall_time_s, 4),
        "readings": [_reading(one) for one in readings],
        "doubts": [doubt_message(one) for one in soil_doubts(case.scene)],
        **more,
    }
    return message(header, arrays)


def doubt_message(line: Doubt) -> dict[str, Any]:
    """A doubt as the page has it: like a fault, at its field where there is one."""
    part, *field = line.field or ("scene",)
    # Options of commands are not the page's.
    return {"document": part, "message": line.replace(" (--unit)", ""), "field": field}


def _speed(run: Run, places: np.ndarray) -> np.ndarray:
    """Speed at the frames (k, N) [m/s], over the frame before; at the last that of the solver."""
    speed = np.zeros((len(places), run.points))
    for row, k in enumerate(places):
        if k == run.frames - 1:
            speed[row] = np.hypot(*run.velocity.T)
        elif k:
            moved = run.positions[k] - run.positions[k - 1]
            speed[row] = np.hypot(*moved.T) / (run.time[k] - run.time[k - 1])
    return speed


def _reading(one: ComparedReading) -> dict[str, Any]:
    measured = one.measurement
    return {
        "name": one.name,
        "label": label(one),
        "unit": with_signs(one.unit),
        "simulated": _number(one.simulated),
        "measured": one.measured,
        "below": one.below,
        "std": None if measured is None else measured.std,
        "in_std": one.difference_in_std,
        "confidence": None if measured is None else measured.confidence,
        "held_out": bool(measured is not None and measured.held_out),
        "trouble": one.trouble,
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
