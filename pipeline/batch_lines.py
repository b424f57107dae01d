"""Progress of the forward runs: a bar for each batch on a terminal, a line at times in a log."""

from __future__ import annotations

import sys
import time

from pipeline.batch_bar import BatchBar

INTERVAL_S = 10.0


class BatchLines:
    """Told by a `RunStore` of each run of a batch."""

    def __init__(self, *, quiet: bool) -> None:
        self._bar = BatchBar(quiet=quiet)
        self._wanted = not quiet and not sys.stderr.isatty()
        self._began = self._told = time.monotonic()
        self._done = 0

    def __call__(self, done: int, of: int) -> None:
        """`done` of `of` runs of the present batch have ended."""
        self._bar(done, of)
        self._done += 1
        now = time.monotonic()
        if self._wanted and now - self._told >= INTERVAL_S:
            self._told = now
            print(
                f"simulated {self._done} runs in {now - self._began:.0f} s",
                file=sys.stderr,
                flush=True,
            )
