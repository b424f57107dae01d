"""Progress of long work: a bar on a terminal, plain lines in a log, nothing when told to be quiet.

Everything goes to the standard error stream; results alone go to the standard output.
"""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress

LOG_INTERVAL_S = 5.0


class Progress:
    """Counts finished pieces of work; use it as a context manager.

    Args:
        total: pieces of work in all.
        label: what they are, for instance "simulating large, batch 7".
        quiet: print nothing.
        stream: where to print; None: the standard error stream.
        log_interval_s: least time between two lines in a log, s.
    """

    def __init__(
        self,
        total: int,
        label: str,
        *,
        quiet: bool = False,
        stream: TextIO | None = None,
        log_interval_s: float = LOG_INTERVAL_S,
    ) -> None:
        self.total = total
        self.label = label
        self.done = 0
        self._stream = stream if stream is not None else sys.stderr
        self._quiet = quiet
        self._log_interval_s = log_interval_s
        self._started = time.monotonic()
        self._last_line = self._started
        self._bar: RichProgress | None = None
        self._task = None

    def __enter__(self) -> Progress:
        self._started = self._last_line = time.monotonic()
        if not self._quiet and self._stream.isatty():
            self._bar = _rich_bar(self._stream)
            self._task = self._bar.add_task(self.label, total=self.total, note="")
            self._bar.start()
        return self

    def advance(self, count: int = 1, note: str = "") -> None:
        """Record `count` more finished pieces; `note` is a few words beside the bar."""
        self.done += count
        if self._bar is not None:
            self._bar.update(self._task, advance=count, note=note)
            return
        now = time.monotonic()
        if self.done >= self.total or now - self._last_line >= self._log_interval_s:
            self._write_line(now, note)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
        elif kind is not None and self.done < self.total:
            self._write_line(time.monotonic(), "stopped")

    def _write_line(self, now: float, note: str) -> None:
        self._last_line = now
        if self._quiet:
            return
        elapsed = now - self._started
        line = f"{self.label}: {self.done}/{self.total}, {elapsed:.0f} s"
        if 0 < self.done < self.total:
            line += f", about {elapsed / self.done * (self.total - self.done):.0f} s left"
        if note:
            line += f", {note}"
        print(line, file=self._stream, flush=True)


def _rich_bar(stream: TextIO) -> RichProgress:
    return RichProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=Console(file=stream),
    )
