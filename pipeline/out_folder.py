"""The folder of results, made and tried before the work begins whose results go there."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from pipeline.cli import InputError
from pipeline.files import make_folder


def ready_folder(path: str | os.PathLike[str], names: Iterable[str]) -> Path:
    """Make a folder in which files of these names can be written.

    Raises:
        InputError: it cannot be made or written, or a folder lies where a file is to be.
    """
    folder = make_folder(path)
    for name in names:
        if (folder / name).is_dir():
            raise InputError(f"{folder / name}: is a folder; a file is to be written there")
    return folder
