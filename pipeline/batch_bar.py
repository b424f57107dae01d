"""Progress of batches of simulations: a bar for each on a terminal, nothing in a log."""

from __future__ import annotations

import sys

from pipeline.progress import Progress


class BatchBar:
    """Told of each run of a batch or frame of a rollout; a log has the lines of the stages.

    Args:
        quiet: show nothing.
        label: what is counted.
    """

    def __init__(self, *, quiet: bool, label: str = "simulating") -> None:
        self._label = label
        self._wanted = sys.stderr.isatty() and not quiet
        self._progress: Progress | None = None

    def __call__(self, done: int, of: int) -> None:
        """`done` of `of` runs of the present batch have ended."""
        if not self._wanted:
            return
        if self._progress is None:
            self._progress = Progress(of, self._label).__enter__()
        self._progress.advance()
        if done >= of:
            self._progress.__exit__(None, None, None)
            self._progress = None
