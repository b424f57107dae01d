"""Progress of long work: a bar on a terminal, plain lines in a log, nothing when quiet.

Two halves that meet in one callback, `Report`. `Watch` is what work calls: it counts what is done,
asks whether it shall stop, and reports. `Progress` is what a command shows of that; a program that
calls `flowslide` as a library passes a function of its own instead. Everything is printed to the
standard error stream; results alone go to the standard output.

Where standard error goes into a file, as under Snakemake, the bar still appears on the terminal
that the environment variable FLOWSLIDE_TERMINAL names as HOST:DEVICE. `rules/common.smk` sets it
where the workflow was started from a terminal; a job on another host, as on a cluster, shows none.
"""

from __future__ import annotations

import fcntl
import os
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, RLock
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

LOG_INTERVAL_S = 5.0
TERMINAL = "FLOWSLIDE_TERMINAL"

Report = Callable[[int, int, str], None]
"""Called with (pieces of work done, in all, what is being done or was found); the number in all may
be an estimate that changes."""

Evaluated = Callable[[int, Mapping[str, float], float], None]
"""Called with (simulations so far, values that were tried by name, how far from the data they are);
not finite: the simulation failed."""

Cancel = Callable[[], bool] | Event
"""Asked between simulations whether to stop."""


class Cancelled(RuntimeError):
    """The caller asked the work to stop. What was finished is kept and is found again."""


class Watch:
    """Counts runs against a plan, reports them, and stops the work where the caller asks for it.

    Work may call it from several threads; the caller's functions are then called from them, one at
    a time.

    Args:
        report: called for each run and each line; None: nobody.
        cancel: a function that returns True, or an event that is set, to stop the work at the next
            run; None: never.
        evaluated: called for each evaluation of a search; None: nobody.
    """

    def __init__(
        self,
        report: Report | None = None,
        cancel: Cancel | None = None,
        evaluated: Evaluated | None = None,
    ) -> None:
        self._report = report
        self._cancel = cancel
        self._evaluated = evaluated
        self._plan: dict[str, int] = {}
        self._done, self._of = 0, -1
        self._before = 0  # runs that were done when the present stage began
        self._stage = ""
        self._one_at_a_time = RLock()

    def plan(self, runs: Mapping[str, int]) -> None:
        """Say which stages there will be, and about how many runs each of them takes."""
        self._plan = {name: max(number, 0) for name, number in runs.items()}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """A stage of the plan. After it the estimate has its real number of runs."""
        self._stage, self._before = name, self._done
        if self._plan.get(name, 1):
            self._tell(self._words())
        yield
        self._plan[name] = self._done - self._before

    def run_done(self, done: int = 0, of: int = 0) -> None:
        """A run has ended, `done` of the `of` runs of the present batch.

        Raises:
            Cancelled: the caller asks the work to stop.
        """
        with self._one_at_a_time:
            self._done += 1
            if self._stage:
                expected = self._done - self._before + max(of - done, 0)
                self._plan[self._stage] = max(self._plan.get(self._stage, 0), expected)
            self._tell(self._words())

    def frame_done(self, done: int, of: int) -> None:
        """A frame of a rollout has been computed: nothing to count, but a moment to stop at."""
        self._check()

    def reach(self, done: int, of: int, message: str) -> None:
        """So much of a single run is done; reported where it has changed."""
        self._check()
        if self._report is not None and (done, of) != (self._done, self._of):
            self._done, self._of = done, of
            self._report(done, of, message)

    def say(self, line: str) -> None:
        """Report a line.

        Raises:
            Cancelled: the caller asks the work to stop.
        """
        self._tell(line)

    def evaluated(self, runs: int, values: Mapping[str, float], loss: float) -> None:
        """A search has tried these values, by name, after so many simulations."""
        if self._evaluated is not None:
            with self._one_at_a_time:
                self._evaluated(runs, values, loss)

    def _words(self) -> str:
        stages = [name for name, runs in self._plan.items() if runs or name == self._stage]
        if len(stages) < 2 or self._stage not in stages:
            return self._stage or "simulating"
        return f"{self._stage} ({stages.index(self._stage) + 1} of {len(stages)})"

    def _check(self) -> None:
        cancel = self._cancel
        if cancel is not None and (cancel.is_set() if isinstance(cancel, Event) else cancel()):
            raise Cancelled("cancelled; what was finished is kept")

    def _tell(self, message: str) -> None:
        with self._one_at_a_time:
            self._check()
            if self._report is not None:
                self._report(self._done, max(sum(self._plan.values()), self._done), message)


class Progress:
    """Shows finished pieces of work; use it as a context manager.

    Args:
        total: pieces of work in all; 0: not known yet.
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
        self._started = self._last_line = time.monotonic()
        self._said: set[str] = set()
        self._terminal: TextIO | None = None
        self._bar: RichProgress | None = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        self._started = self._last_line = time.monotonic()
        if self._quiet:
            return self
        on_terminal = self._stream.isatty()
        if not on_terminal:
            self._terminal = _other_terminal()
        if on_terminal or self._terminal is not None:
            self._bar = _rich_bar(self._terminal or self._stream)
            self._task = self._bar.add_task(self.label, total=self.total or None, note="")
            self._bar.start()
        return self

    def advance(self, count: int = 1, note: str = "") -> None:
        """Record `count` more finished pieces; `note` is a few words next to the bar."""
        self.done += count
        if self._bar is not None:
            self._bar.update(self._task, completed=self.done, note=note)
        now = time.monotonic()
        if self.done >= self.total or now - self._last_line >= self._log_interval_s:
            self._write_line(now, note)

    def report(self, done: int, total: int, message: str) -> None:
        """Show a `Report`: a bar; in a log every new message, and a line at times."""
        new = message not in self._said
        self._said.add(message)
        self.done, self.total = done, total
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total or None, note=message)
        if self._quiet:
            return
        now = time.monotonic()
        if new:
            self._print(message)
        elif now - self._last_line >= self._log_interval_s:
            self._write_line(now, message)

    def say(self, line: str) -> None:
        """Print a line, in a log or above the bar."""
        if not self._quiet:
            self._print(line)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
        if kind is not None and self.done < self.total:
            self._write_line(time.monotonic(), "stopped")
        if self._terminal is not None:
            self._terminal.close()

    def _print(self, line: str) -> None:
        if self._bar is not None and self._terminal is None:
            self._bar.console.print(line, markup=False, highlight=False, soft_wrap=True)
        else:
            print(line, file=self._stream, flush=True)

    def _write_line(self, now: float, note: str) -> None:
        """A line of a log; a terminal has the bar."""
        self._last_line = now
        if self._quiet or (self._bar is not None and self._terminal is None):
            return
        elapsed = now - self._started
        line = f"{self.label}: {self.done}/{self.total}, {elapsed:.0f} s"
        if 0 < self.done < self.total:
            line += f", about {elapsed / self.done * (self.total - self.done):.0f} s left"
        if note:
            line += f", {note}"
        print(line, file=self._stream, flush=True)


def _other_terminal() -> TextIO | None:
    """The terminal that FLOWSLIDE_TERMINAL names; None: there is none, or another job has it.

    Of several jobs at a time the first one to ask has the terminal: two bars would overwrite each
    other.
    """
    host, _, name = os.environ.get(TERMINAL, "").partition(":")
    if not name or host != socket.gethostname():
        return None
    try:
        terminal = open(os.open(name, os.O_WRONLY | os.O_NOCTTY), "w", encoding="utf-8")
    except OSError:
        return None
    try:
        if terminal.isatty():
            fcntl.flock(terminal, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return terminal
    except OSError:
        pass
    terminal.close()
    return None


def _rich_bar(stream: TextIO) -> RichProgress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress
    from rich.table import Column

    try:
        width = os.get_terminal_size(stream.fileno()).columns or None
    except OSError:
        width = None
    whole = Column(no_wrap=True)
    return RichProgress(
        TextColumn("{task.description}", markup=False, table_column=whole),
        BarColumn(bar_width=16),
        MofNCompleteColumn(table_column=whole),
        TimeRemainingColumn(compact=True, table_column=whole),
        TextColumn("left", table_column=whole),
        TextColumn(
            "{task.fields[note]}",
            markup=False,
            table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1),
        ),
        console=Console(file=stream, force_terminal=True, width=width),
        expand=True,
        redirect_stdout=False,  # results go to standard output, wherever that is
        redirect_stderr=False,
    )
