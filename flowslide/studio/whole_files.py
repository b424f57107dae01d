"""Folders and journals that are written whole or not at all, also on a full disk."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from pathlib import Path


def copy_case(source: Path, target: Path, *, without: Sequence[str]) -> None:
    """Copy the files of a case, without folders that are links: one to `/` would be the whole disk.

    Args:
        source: folder of the case.
        target: the copy, which is not there yet.
        without: names that are left out.

    Raises:
        OSError: a file cannot be copied; no part of the copy is left.
    """
    faults: list[OSError] = []

    def left_out(folder: str, names: list[str]) -> list[str]:
        places = [(name, Path(folder) / name) for name in names]
        return [
            name for name, one in places if name in without or (one.is_symlink() and one.is_dir())
        ]

    def copied(one: str, other: str) -> str:
        try:
            return str(shutil.copy2(one, other))
        except OSError as error:
            faults.append(error)
            raise

    temporary = target.with_name(f".{target.name}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        shutil.copytree(source, temporary, ignore=left_out, copy_function=copied)
        temporary.rename(target)
    except shutil.Error as error:  # all faults in one, which is no line for a person
        raise (faults or [error])[0] from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def append_line(path: Path, line: str) -> None:
    """Add a line to a file.

    Raises:
        OSError: it cannot be written to its end; the file is as it was.
    """
    content = f"{line}\n".encode()
    with path.open("ab", buffering=0) as file:
        end = file.tell()
        if file.write(content) != len(content):
            os.ftruncate(file.fileno(), end)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
