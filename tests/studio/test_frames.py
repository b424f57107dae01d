from __future__ import annotations

import numpy as np

from flowslide.studio.frames import message
from tests.studio.messages import unpack


def test_a_message_comes_back_as_it_was():
    arrays = {
        "positions": np.arange(12, dtype="<f4").reshape(2, 3, 2),
        "zone": np.array([0, 1, 300], dtype="<u2"),
        "speed": np.zeros((2, 3), dtype="<f4"),
        "order": np.array([1, 65535, 3], dtype="<u2"),
    }
    header, found = unpack(message({"type": "deposit", "name": "é"}, arrays))
    assert header["type"] == "deposit" and header["name"] == "é"
    assert all(entry["offset"] % 4 == 0 for entry in header["arrays"])
    for name, array in arrays.items():
        assert np.array_equal(found[name], array) and found[name].dtype == array.dtype
