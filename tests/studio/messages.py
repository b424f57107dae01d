"""Messages of the studio as its page reads them (`page/api.js`)."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from flowslide.studio.frames import DTYPES


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and the arrays of a message."""
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + length])
    arrays = {}
    for entry in header["arrays"]:
        dtype = DTYPES[entry["dtype"]]
        count = int(np.prod(entry["shape"], dtype=int))
        found = np.frombuffer(data, dtype, count, 4 + length + entry["offset"])
        arrays[entry["name"]] = found.reshape(entry["shape"])
    return header, arrays
