"""When a training ends before its last step: SIGTERM, a time limit, the end of a Slurm job.

A training asks after every step and then keeps its state; several processes agree, so that all stop
at the same step.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from types import FrameType

MARGIN_S = 120.0
"""Time before the end of a Slurm job at which a training stops by itself [s]."""


class StopRequest:
    """Context in which SIGTERM is noted and does not kill.

    Args:
        minutes: stop after this time; None: no limit but that of a Slurm job.
    """

    def __init__(self, minutes: float | None = None) -> None:
        self._signalled = False
        self._previous: object = None
        self._active = threading.current_thread() is threading.main_thread()
        self._limit = None if minutes is None else time.monotonic() + 60.0 * minutes
        end = os.environ.get("SLURM_JOB_END_TIME", "")
        self._job_end = float(end) - MARGIN_S if end.isdigit() else None

    def __enter__(self) -> StopRequest:
        if self._active:
            self._previous = signal.signal(signal.SIGTERM, self._note)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._active:
            signal.signal(signal.SIGTERM, self._previous)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._signalled = True

    @property
    def cut_short(self) -> bool:
        """Stopped from outside: by SIGTERM or the end of the job."""
        ends = self._job_end is not None and time.time() >= self._job_end
        return self._signalled or ends

    @property
    def wanted(self) -> bool:
        """True once the training is to stop."""
        return self.cut_short or (self._limit is not None and time.monotonic() >= self._limit)
