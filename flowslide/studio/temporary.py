"""Folders that go with the server, and those that servers which were killed have left behind.

A folder is locked while somebody works in it; the system lets go of the lock when its process ends,
however it ends. So what is old and not locked belongs to nobody.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

PREFIX = "flowslide_studio_"
#: As `mkdtemp` makes them: a folder that somebody has named is not one of these.
NAME = re.compile(PREFIX + r"[a-z0-9_]{8}")
#: Younger ones may be about to be locked, or of a version that locks none [s].
OLD_S = 3600.0


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder that this user alone can read, and that goes at the end."""
    with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with suppress(OSError):  # a file system without locks: it is young enough anyway
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield Path(folder)
        finally:
            os.close(lock)


def clear_left_behind(folder: Path | None = None) -> None:
    """Remove the temporary folders of servers that have ended without doing so.

    One goes if it is this user's, older than an hour, and has what a server writes there alone:
    files and links, no folder. What cannot be removed stays.

    Args:
        folder: in which they lie; None: the system's for temporary files.
    """
    place = Path(tempfile.gettempdir()) if folder is None else folder
    for path in place.glob(f"{PREFIX}*"):
        with suppress(OSError):
            _clear(path)


def _clear(path: Path) -> None:
    if not NAME.fullmatch(path.name):
        return
    lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        about = os.fstat(lock)
        ours = about.st_uid == os.getuid() and stat.S_IMODE(about.st_mode) == 0o700
        if not ours or time.time() - about.st_mtime < OLD_S:
            return
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not any(one.is_dir() and not one.is_symlink() for one in path.iterdir()):
            shutil.rmtree(path)
    finally:
        os.close(lock)


@contextmanager
def ended_in_order() -> Iterator[None]:
    """End with `SystemExit` where a signal asks for it, so that what is temporary goes.

    Python ends without that at SIGTERM (`kill`), and at SIGHUP: the terminal is closed, the way
    here from another machine breaks. A server under `nohup` goes on.
    """

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    def as_terminated(*_: object) -> None:
        signal.raise_signal(signal.SIGTERM)  # the server of the page ends in order at this one

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number, act in ((signal.SIGTERM, end), (signal.SIGHUP, as_terminated)):
        if before[number] == signal.SIG_DFL:
            signal.signal(number, act)
    try:
        yield
    finally:
        for number, known in before.items():
            signal.signal(number, known)
