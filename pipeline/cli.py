"""Command lines: one way to parse, one way to fail.

Every command ends with 0, with 1 when the work failed, or with 2 when the input was
wrong; in the last case one line names the file, the field, the value and what is allowed.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NoReturn

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143

WORKFLOW = "FLOWSLIDE_WORKFLOW"
GRACE_S = 10.0
"""Time to tidy up once the workflow has gone [s]; a kernel that computes hears no signal."""


class InputError(ValueError):
    """Bad input. The message is one line for a person: file, field, value, what is allowed."""


class WorkFailed(RuntimeError):
    """The input was good and the work failed. The message says what can be done."""


class CommandParser(argparse.ArgumentParser):
    """An argument parser whose errors are one line and whose options are never abbreviated."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs.setdefault("allow_abbrev", False)
        super().__init__(*args, **kwargs)

    def error(self, message: str) -> NoReturn:
        """Print `message` on one line and leave with exit code 2."""
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {_one_line(message)} (see {self.prog} --help)\n")


def base_parser(prog: str, description: str) -> CommandParser:
    """A parser for `prog`, for instance "python -m benchmarks.gpu"; add options to it."""
    return CommandParser(prog=prog, description=description)


def add_common(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Add `--config`, `--set` (as `overrides`) and `--quiet`, the options of every command."""
    group = parser.add_argument_group("common options")
    group.add_argument(
        "--config",
        metavar="FILE",
        default=None,
        help="YAML file with the settings that differ from config/config.yaml",
    )
    group.add_argument(
        "--set",
        dest="overrides",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="one setting, such as simulation.courant=0.2; may be repeated, wins over --config",
    )
    group.add_argument("--quiet", action="store_true", help="no progress, only results and errors")
    return parser


def at_least_one(option: str, number: int) -> int:
    """The number that an option gives.

    Raises:
        InputError: it is less than 1.
    """
    if number < 1:
        raise InputError(f"{option} {number}: at least 1")
    return number


@cache
def say_once(line: str) -> None:
    """Print a line on the standard error; a file that is read again does not repeat it."""
    print(line, file=sys.stderr, flush=True)


def main_exit(
    func: Callable[[Sequence[str] | None], int | None], argv: Sequence[str] | None = None
) -> NoReturn:
    """Run `func(argv)` and leave the process with the house's exit codes.

    Args:
        func: a package's `main`; returns an exit code, or None for success.
        argv: the arguments; None takes them from the command line.
    """
    heard: list[int] = []
    _end_when_asked(heard)
    _end_with_workflow()
    _open_streams()
    try:
        code = func(argv) or 0
        sys.stdout.flush()
    except InputError as error:
        code = _complain(error, EXIT_BAD_INPUT)
    except WorkFailed as error:
        code = _complain(error, EXIT_FAILED)
    except KeyboardInterrupt:
        code = _complain("interrupted", EXIT_INTERRUPTED)
    except BrokenPipeError:  # the reader (head, less) has gone
        _drop_output()
        code = EXIT_FAILED
    except OSError as error:
        # Errors that no reader or writer has reported itself: rights, a name too long, a full disk.
        if error.errno is None:
            raise
        code = _complain(_described(error), EXIT_BAD_INPUT)
        try:
            sys.stdout.flush()
        except OSError:
            _drop_output()
    except Exception:
        # A library that is interrupted while it loads may say that it cannot be loaded.
        if not heard:
            raise
        asked = heard[-1]
        code = _complain("interrupted", EXIT_INTERRUPTED) if asked == signal.SIGINT else 128 + asked
    sys.exit(code)


def _described(error: OSError) -> str:
    """The file and what the system says of it."""
    file = "" if error.filename is None else f"{error.filename}: "
    return f"{file}{error.strerror}"


def _drop_output() -> None:
    """Let what is still to be printed vanish; Python would complain of it once more at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _open_streams() -> None:
    """Of a shell that closes them (`>&-`) Python makes None, which nothing can be printed to."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


def _end_when_asked(heard: list[int]) -> None:
    """Let the ends that are asked for unwind the stack, so that part files are tidied up.

    SIGINT is Ctrl-C, SIGTERM a walltime limit or `kill`, SIGHUP a terminal that is closed; what a
    parent has ignored (`nohup`) stays so.

    Args:
        heard: takes the signals that came.
    """

    def leave(signum: int, frame: object) -> NoReturn:
        heard.append(signum)
        if signum == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + signum)

    if threading.current_thread() is threading.main_thread():
        for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(signum) != signal.SIG_IGN:
                signal.signal(signum, leave)


def _end_with_workflow() -> None:
    """End soon after the workflow that started this process, if it ends by whatever cause.

    `rules/common.smk` names in FLOWSLIDE_WORKFLOW, as HOST:FILE, a file whose lock the workflow
    holds while it lives. A job of a cluster, on another host, outlives it.
    """
    host, _, name = os.environ.get(WORKFLOW, "").partition(":")
    if not name or host != socket.gethostname():
        return
    try:
        lock = open(name)
    except OSError:  # tidied away by a later workflow: the one that was named has ended
        raise SystemExit(EXIT_TERMINATED) from None

    def wait() -> None:
        with lock:
            fcntl.flock(lock, fcntl.LOCK_SH)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(GRACE_S)
        os._exit(EXIT_TERMINATED)

    threading.Thread(target=wait, daemon=True).start()


def _complain(problem: object, code: int) -> int:
    print(f"error: {_one_line(str(problem))}", file=sys.stderr)
    return code


def _one_line(text: str) -> str:
    return " ".join(text.split())
