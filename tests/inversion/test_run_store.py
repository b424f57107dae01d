"""Kept runs: whatever happened to a file, it is read right or computed again."""

from __future__ import annotations

import numpy as np
import pytest

from inversion import assemble
from inversion.forward import Prediction
from inversion.run_store import KeptRun, load_kept, save_kept
from pipeline.config import SimulationSettings


@pytest.fixture
def kept() -> KeptRun:
    random = np.random.default_rng(0)
    return KeptRun(
        initial=random.normal(size=(50, 2)).astype(np.float32),
        final=random.normal(size=(50, 2)).astype(np.float32),
        zone=np.arange(50, dtype=np.int32),
        vertical_stress=random.normal(size=50).astype(np.float32),
        status="finished",
        reason="",
        end_s=12.5,
        at_rest=True,
        wall_time_s=0.3,
    )


def test_a_flipped_byte_is_noticed_or_does_no_harm(tmp_path, kept):
    path = tmp_path / "run.npz"
    save_kept(path, kept)
    whole = path.read_bytes()
    unreadable = 0
    for place in range(0, len(whole), 3):
        for flip in (1, 64, 255):
            damaged = bytearray(whole)
            damaged[place] ^= flip
            path.write_bytes(damaged)
            back = load_kept(path)
            unreadable += back is None
            if back is not None:
                assert back.status == "finished" and back.end_s == kept.end_s
                for name in ("initial", "final", "zone", "vertical_stress"):
                    assert np.array_equal(getattr(back, name), getattr(kept, name))
    assert unreadable > len(whole) / 2


def test_a_slide_that_was_cut_off_and_a_number_that_was_not_read_are_told():
    settings = SimulationSettings(duration_s=4.0)
    numbers = np.array([17.3, np.nan])
    still = Prediction(numbers[:1], np.zeros(1))
    assert assemble.doubts(still, settings) == []
    moving = Prediction(numbers, np.zeros(2), at_rest=False, reason="late toe: measured at 500 s")
    cut_off, not_read = assemble.doubts(moving, settings)
    assert "still moved after 4 s" in cut_off and "duration_s" in cut_off
    assert "late toe: measured at 500 s" in not_read
