"""The folders that ship with the program: case histories, trained models, configurations.

In a clone they stand next to the packages; in an installed program they are package data. Neither
depends on the working directory.
"""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""Folder of the packages: the clone, or where packages are installed."""

DATA_PACKAGE = "flowslide_data"
CASES, MODELS = "case_histories", "models"


def shipped(name: str) -> Path:
    """A folder that ships with the program: `case_histories`, `models` or `config`."""
    # In an installed program a folder of that name next to the packages would be someone else's.
    installed = ROOT / DATA_PACKAGE / name
    return installed if installed.is_dir() else ROOT / name


def resolve(text: str | os.PathLike[str], name: str) -> Path:
    """A folder given by its path, or by its name in a folder such as `models`.

    A path that exists wins, then `<name>/<text>` under the current folder, then the one shipped
    with the program. The path as given where there is none, for the reader's message.
    """
    path = Path(text)
    for candidate in (path, Path(name) / path, shipped(name) / path):
        if candidate.is_dir():
            return candidate
    return path


def names_of(name: str, file: str) -> list[str]:
    """Names of the folders that hold a file, in `name` here and as shipped, in order."""
    folders = (Path(name), shipped(name))
    return sorted({path.parent.name for folder in folders for path in folder.glob(f"*/{file}")})
