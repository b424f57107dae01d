"""Text files that people or programs hand in: read whole, or one line of why not."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline.cli import InputError


def read_text(path: str | os.PathLike[str], *, encoding: str = "utf-8") -> str:
    """The text of a file.

    Args:
        path: of the file.
        encoding: "utf-8", or "utf-8-sig" where a spreadsheet may have put a mark in front.

    Raises:
        InputError: no such file, one that cannot be read, or no text: one line.
    """
    try:
        return Path(path).read_text(encoding=encoding)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a UTF-8 text file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
