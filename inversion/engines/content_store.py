"""What is kept by content: a key that hashes all that decides a result, in memory and in a file."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Generic, TypeVar

import numpy as np
from numpy.lib import format as npy

from pipeline.files import atomic_path

Kept = TypeVar("Kept")

#: What zipfile and numpy raise on a file that is cut short or damaged, depending on where; an error
#: of memory where a header claims more than there is.
DAMAGE = (
    OSError,
    KeyError,
    ValueError,
    EOFError,
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
)


class ContentStore(Generic[Kept]):
    """Results by key.

    A result goes at once into a small file, so that work which was killed continues where it
    stopped, and a question that is asked again costs nothing.

    Args:
        folder: of the files; None: in memory alone.
        read: a result from the arrays of its file; what it raises of `DAMAGE` means that the file
            is damaged, and so not there.
        arrays: of a result, by name.
    """

    def __init__(
        self,
        folder: str | Path | None,
        read: Callable[[dict[str, np.ndarray]], Kept],
        arrays: Callable[[Kept], Mapping[str, np.ndarray]],
    ) -> None:
        self.folder = None if folder is None else Path(folder)
        self._read, self._arrays = read, arrays
        self._kept: dict[str, Kept] = {}
        self._keeping = Lock()

    def get(self, key: str, *, holds: Callable[[Kept], bool] = lambda kept: True) -> Kept | None:
        """The result of a key; None: it was not computed, or its file is damaged.

        Args:
            key: of the result.
            holds: whether what a file has is what belongs to the key.
        """
        if key not in self._kept and (path := self.path(key)) is not None:
            found = read_arrays(path, self._read)
            if found is not None and holds(found):
                self._kept[key] = found
        return self._kept.get(key)

    def put(
        self, key: str, kept: Kept, *, join: Callable[[Kept, Kept], Kept] = lambda old, new: new
    ) -> Kept:
        """Keep a result.

        Args:
            key: of the result.
            kept: what has just been computed.
            join: of what was there and the new one, what is kept.
        """
        with self._keeping:
            if key in self._kept:
                kept = join(self._kept[key], kept)
            self._kept[key] = kept
        if (path := self.path(key)) is not None:
            write_arrays(path, self._arrays(kept))
        return kept

    def __getitem__(self, key: str) -> Kept:
        """A result that is in memory."""
        return self._kept[key]

    def path(self, key: str) -> Path | None:
        """File of a result; None: it is kept in memory alone."""
        return None if self.folder is None else self.folder / f"{key}.npz"


def read_arrays(path: Path, read: Callable[[dict[str, np.ndarray]], Kept]) -> Kept | None:
    """What an NPZ file holds; None: there is none, or it is damaged."""
    try:
        # Opened here: numpy leaves a damaged file open.
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            return read({name: file[name] for name in file.files})
    except DAMAGE:
        return None


def write_arrays(path: str | Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an NPZ file, atomically, whose bytes depend on the arrays alone.

    `numpy.savez` puts the time of day into the file; a killed and continued back-analysis must
    leave the same bytes.
    """
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, values in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w", force_zip64=True) as file:
                npy.write_array(file, np.asanyarray(values), allow_pickle=False)
