"""Python processes of the program, none of which imports from the folder one stands in.

`python -m` and `python -c` put the working directory before Python's own modules, so that a file
`signal.py` in a case from somewhere else would be executed. Every Python process of flowslide is
started by what is here, with Python's safe path (`-P`, or PYTHONSAFEPATH for one that a library
starts).
"""

from __future__ import annotations

import os
import site
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from pipeline.places import ROOT

if TYPE_CHECKING:
    from loky import ProcessPoolExecutor

SAFE = "PYTHONSAFEPATH"


def python_command(*arguments: object) -> list[str]:
    """A command of this Python, such as `python_command("-m", "flowslide", "check")`."""
    return [sys.executable, "-P", *map(str, arguments)]


def python_environment(own: Mapping[str, object] | None = None) -> dict[str, str]:
    """The environment of such a command: this process's and `own`.

    A clone need not be installed: it may have been found because it is the working directory, which
    the command leaves out. Its folder is named, so that the command runs the code of this process.
    """
    found = {**os.environ, **{name: str(value) for name, value in (own or {}).items()}}
    if str(ROOT) not in (*site.getsitepackages(), site.getusersitepackages()):
        before = found.get("PYTHONPATH")
        found["PYTHONPATH"] = os.pathsep.join([str(ROOT), *([before] if before else [])])
    return found


def process_pool(number: int, **options: Any) -> ProcessPoolExecutor:
    """A pool of processes; `options` are those of loky's.

    The processes take over the path of this one once they have started.
    """
    from multiprocessing import resource_tracker

    from loky import ProcessPoolExecutor

    with _safe_path():  # the trackers are processes, too: loky starts its own here
        resource_tracker.ensure_running()
        return ProcessPoolExecutor(number, env={SAFE: "1"}, **options)


@contextmanager
def _safe_path() -> Iterator[None]:
    """What starts meanwhile has the safe path; what the user starts later is left as it was."""
    before = os.environ.get(SAFE)
    os.environ[SAFE] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE]
        else:
            os.environ[SAFE] = before
