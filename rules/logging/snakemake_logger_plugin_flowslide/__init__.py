"""How `make` shows the workflow: what is being done, how far it is, and one line for what failed.

A logger plugin of Snakemake (`PYTHONPATH=rules/logging snakemake --logger flowslide -- TARGET`).
A job prints its progress into its log; on a terminal its bar shows as well (`pipeline.progress`),
elsewhere the lines of the log are repeated here as they come. Snakemake's own account is several
lines for each failure, or with `--quiet all` none.
"""

from __future__ import annotations

import re
import sys
from logging import ERROR, WARNING, LogRecord
from pathlib import Path
from threading import Event, RLock, Thread

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

LOOK_EVERY_S = 0.5
#: Beginnings of lines that say nothing of the work.
NOISE = ("[Taichi]",)


class LogHandler(LogHandlerBase):
    """Prints a line for each job, the lines of its log, and at the end what failed."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Start with nothing to follow and nothing failed."""
        self._followed: dict[int, Follower] = {}
        self._failed: list[str] = []
        self._errors: list[str] = []

    def emit(self, record: LogRecord) -> None:
        """Show a record, or keep it for the end."""
        event = getattr(record, "event", None)
        if event == LogEvent.JOB_INFO:
            _say(record.rule_msg or record.rule_name)
            if not sys.stderr.isatty():
                self._followed[record.jobid] = Follower(record.log, record.created)
        elif event == LogEvent.JOB_FINISHED:
            self._leave(record.job_id)
        elif event == LogEvent.JOB_ERROR:
            self._leave(record.jobid)
            self._failed.append(failure(record))
        elif record.levelno >= ERROR:
            self._errors.append(one_line(record.getMessage()))
        elif record.levelno == WARNING:
            _say(one_line(record.getMessage()))

    def _leave(self, job: int) -> None:
        if job in self._followed:
            self._followed.pop(job).close()

    def close(self) -> None:
        """Say what failed: of each job its own reason, else why there was no job."""
        for job in list(self._followed):
            self._leave(job)
        for line in self._failed or self._errors[:1]:
            _say(f"error: {line}")
        self._failed, self._errors = [], []
        super().close()


class Follower:
    """Repeats what is appended to the logs of a job.

    Args:
        paths: of the logs.
        since: when the job began; what an earlier job has left in its log is not shown.
    """

    def __init__(self, paths: list[str], since: float) -> None:
        self._since = since
        self._read = dict.fromkeys(map(Path, paths), 0)
        self._ended, self._lock = Event(), RLock()
        self._thread = Thread(target=self._follow, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Show the rest and stop."""
        self._ended.set()
        self._thread.join()
        self._show()

    def _follow(self) -> None:
        while not self._ended.wait(LOOK_EVERY_S):
            self._show()

    def _show(self) -> None:
        for path, read in self._read.items():
            try:
                if path.stat().st_mtime < self._since:
                    continue
                text = path.read_bytes()
            except OSError:
                continue
            whole = text.rfind(b"\n") + 1
            for line in text[read:whole].decode(errors="replace").splitlines():
                if line.strip() and not line.startswith("error: "):  # which comes at the end
                    _say(line)
            self._read[path] = whole


def failure(record: LogRecord) -> str:
    """What a job was to do, why it failed by the last line of its log, and where the log is."""
    what = record.rule_msg or record.rule_name
    for path in record.log:
        try:
            lines = Path(path).read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            continue
        said = [line.strip() for line in lines if line.strip()]
        if said:
            return f"{what}: {said[-1].removeprefix('error: ')} (log: {path})"
    return f"{what}: it was ended and said nothing (log: {', '.join(record.log) or 'none'})"


def one_line(text: str) -> str:
    """The message of an error without its class, the place in a rule file and its line breaks."""
    if text.startswith("MissingRuleException"):
        found = re.search(r"No rule to produce (\S+)", text)
        target = found[1] if found else "?"
        return f"{target}: no such target; `snakemake --list-target-rules` lists them"
    if text.startswith("LockException"):
        return (
            "another workflow works in this folder: wait for it or end it; if it was killed on "
            "another machine: snakemake --unlock"
        )
    if text.startswith(("Traceback", "Full Traceback")):
        text = text.strip().splitlines()[-1]
    text = re.sub(r"^\w+(Exception|Error)?( in (rule|file) .*?, line \d+)?:\s*\n", "", text)
    return " ".join(re.sub(r'\n  File ".*', "", text).split())


def _say(line: str) -> None:
    if not line.startswith(NOISE):
        print(line, file=sys.stderr, flush=True)
