"""A shard: many runs in one NPZ file, of which any stretch of frames is read without the rest.

The file is an ordinary NPZ of plain arrays (`numpy.load(path, allow_pickle=False)`), but its
members are stored uncompressed and each holds its array in one piece. So the frames of a window
lie side by side at a known place of the file, and reading them is one `pread`, whatever the size of
the run. The bytes depend on the arrays alone, never on the clock.

A run is the arrays of `MEMBERS` under the name `run_NNNNN/`; T frames, N points, meanings and units
in `gns.data.scene_facts`:

    positions         (T, N, 2) float32 [m]
    type              (N,) int8
    properties        (N, 6) float32
    initial_velocity  (N, 2) float32 [m/s]
    zone              (N,) int16
    ground            (P, 2) float64 [m]
    phreatic_line     (L, 2) float64 [m]
    numbers           (16,) float64
    moments           (2, 5, 2) float64: of the moving points, `gns.data.statistics`
    scene             (bytes,) uint8: the scene's document, JSON in UTF-8

In addition to the runs: `layout_version`, `key` (hash of what the shard was made from),
`run_numbers`, `number_names`, `property_names`.
"""

from __future__ import annotations

import os
import struct
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from gns.data.scene_facts import NUMBERS, PROPERTIES, SceneFacts
from pipeline.cli import InputError
from pipeline.files import atomic_path

LAYOUT_VERSION = 3
"""Of shards and metadata; a file of another version is refused."""

MEMBERS: dict[str, tuple[type, tuple[int, ...]]] = {
    "positions": (np.float32, (-1, -1, 2)),
    "type": (np.int8, (-1,)),
    "properties": (np.float32, (-1, len(PROPERTIES))),
    "initial_velocity": (np.float32, (-1, 2)),
    "zone": (np.int16, (-1,)),
    "ground": (np.float64, (-1, 2)),
    "phreatic_line": (np.float64, (-1, 2)),
    "numbers": (np.float64, (len(NUMBERS),)),
    "moments": (np.float64, (2, 5, 2)),
    "scene": (np.uint8, (-1,)),
}
"""Arrays of a run: type and shape, -1 where any length goes."""

SPLITS = ("train", "valid", "test")

_LOCAL_HEADER = 30  # bytes of a zip member's header before its name
_MOST_HEADER = 256  # bytes that are read to find the header of an array

_sound: set[tuple[str, int, int, int]] = set()
"""Files whose checksums were right, by place, size, time and number on the disk."""


@dataclass(frozen=True)
class PackedRun:
    """One run as it is stored."""

    positions: np.ndarray  # (T, N, 2) float32 [m]
    facts: SceneFacts
    moments: np.ndarray  # (2, 5, 2) float64
    scene: str  # the scene's document, JSON

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of MEMBERS by name."""
        facts = self.facts
        values = {
            "positions": self.positions,
            "type": facts.type,
            "properties": facts.properties,
            "initial_velocity": facts.initial_velocity,
            "zone": facts.zone,
            "ground": facts.ground,
            "phreatic_line": facts.phreatic_line,
            "numbers": facts.stored_numbers(),
            "moments": self.moments,
            "scene": np.frombuffer(self.scene.encode("utf-8"), dtype=np.uint8),
        }
        return {
            name: np.ascontiguousarray(values[name], dtype=dtype)
            for name, (dtype, _) in MEMBERS.items()
        }


def run_name(number: int) -> str:
    """Name of a run in a shard, as in the trajectory files."""
    return f"run_{number:05d}"


def shard_name(split: str, place: int) -> str:
    """File name of the shard number `place` of a split."""
    return f"{split}_{place:03d}.npz"


def write_shard(path: str | Path, key: str, numbers: list[int], runs: Iterator[PackedRun]) -> None:
    """Write a shard run by run; the file appears when whole.

    Args:
        path: the file.
        key: hash of all that the shard depends on.
        numbers: of the runs, in the order of `runs`.
        runs: taken one at a time, so that one run is in memory.
    """
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        head = {
            "layout_version": np.array(LAYOUT_VERSION),
            "key": np.array(key),
            "run_numbers": np.array(numbers, dtype=np.int64),
            "number_names": np.array(NUMBERS),
            "property_names": np.array(PROPERTIES),
        }
        for name, values in head.items():
            write_member(archive, name, values)
        for number, run in zip(numbers, runs, strict=True):
            for name, values in run.arrays().items():
                write_member(archive, f"{run_name(number)}/{name}", values)


def write_member(archive: zipfile.ZipFile, name: str, values: np.ndarray) -> None:
    """Add one array to an open NPZ file, uncompressed and without the time of day."""
    with open_member(archive, name) as file:
        npy.write_array(file, values, allow_pickle=False)


@contextmanager
def open_member(archive: zipfile.ZipFile, name: str) -> Iterator[Any]:
    """A member of an NPZ file, uncompressed and without the time of day, to write to."""
    entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_STORED
    with archive.open(entry, "w", force_zip64=True) as file:
        yield file


class Shard:
    """A shard that is open for reading. Of a run it remembers where it lies, nothing else.

    Args:
        path: the file.

    Raises:
        InputError: no such file, damaged, or of another layout.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file: int | None = None
        try:
            places = _places(self.path)
            self._descriptor()
            self._check_version(places)
            numbers = self._array(places["run_numbers"])
            self.key = str(self._array(places["key"]))
            self.run_numbers = [int(number) for number in numbers]
            self._places = np.array(
                [
                    [places[f"{run_name(number)}/{name}"] for name in MEMBERS]
                    for number in self.run_numbers
                ],
                dtype=np.int64,
            ).reshape(-1, len(MEMBERS))
        except FileNotFoundError:
            raise InputError(f"{self.path}: no such file") from None
        except KeyError as error:
            raise InputError(
                f"{self.path}: has no {error.args[0]}; is it a shard of packed data?"
            ) from None
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, struct.error) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{self.path}: cannot be read, damaged or not packed data "
                f"({' '.join(str(error).split())[:120]})"
            ) from None
        self._row = {number: row for row, number in enumerate(self.run_numbers)}

    def __getstate__(self) -> dict[str, Any]:
        """Without the open file, for another process."""
        return {**self.__dict__, "_file": None}

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; reading opens it again."""
        if getattr(self, "_file", None) is not None:
            os.close(self._file)
            self._file = None

    def shape(self, number: int, name: str = "positions") -> tuple[int, ...]:
        """Shape of an array of a run, read from its header."""
        return self._header(self._place(number, name), name)[0]

    def positions(self, number: int, first: int = 0, stop: int | None = None) -> np.ndarray:
        """Frames `first` to `stop` (not included) of a run, (frames, N, 2) float32 [m].

        Raises:
            InputError: no such run or frames.
        """
        place = self._place(number, "positions")
        (frames, points, _), _, start = self._header(place, "positions")
        stop = frames if stop is None else stop
        if not 0 <= first <= stop <= frames:
            raise InputError(
                f"{self.path}: run {number}: frames {first} to {stop} of {frames} frames"
            )
        values = np.empty((stop - first, points, 2), np.float32)
        self._read(values, start + first * points * 8)
        return values

    def array(self, number: int, name: str) -> np.ndarray:
        """One whole array of a run, of MEMBERS."""
        return self._array(self._place(number, name), name)

    def facts(self, number: int) -> SceneFacts:
        """Facts of a run's scene."""
        values = {
            name: self.array(number, name)
            for name in ("type", "properties", "initial_velocity", "zone", "ground")
        }
        return SceneFacts(
            **values,
            phreatic_line=self.array(number, "phreatic_line"),
            numbers=dict(zip(NUMBERS, self.array(number, "numbers").tolist(), strict=True)),
        )

    def scene(self, number: int) -> str:
        """The scene's document, JSON."""
        return self.array(number, "scene").tobytes().decode("utf-8")

    def read_run(self, number: int) -> PackedRun:
        """All of a run."""
        return PackedRun(
            positions=self.positions(number),
            facts=self.facts(number),
            moments=self.array(number, "moments"),
            scene=self.scene(number),
        )

    def check(self) -> None:
        """Read every byte against its checksum, once for a file that stays as it is.

        Reading a stretch of frames does not notice flipped bytes.

        Raises:
            InputError: the file is damaged.
        """
        state = self.path.stat()
        mark = (str(self.path.resolve()), state.st_size, state.st_mtime_ns, state.st_ino)
        if mark in _sound:
            return
        try:
            with zipfile.ZipFile(self.path) as archive:
                bad = archive.testzip()
        except (OSError, zipfile.BadZipFile, NotImplementedError) as error:
            bad = " ".join(str(error).split())[:120]
        if bad is not None:
            raise InputError(
                f"{self.path}: is damaged, bytes are not what was written ({bad}): pack again"
            )
        _sound.add(mark)

    # --- where things lie ---

    def _check_version(self, places: Mapping[str, int]) -> None:
        version = int(self._array(places["layout_version"]))
        if version != LAYOUT_VERSION:
            raise InputError(
                f"{self.path}: layout_version: {version}; this program reads {LAYOUT_VERSION}: "
                "pack the trajectories again"
            )

    def _place(self, number: int, name: str) -> int:
        if number not in self._row:
            raise InputError(f"{self.path}: no run {number}; it holds {_some(self.run_numbers)}")
        return int(self._places[self._row[number], list(MEMBERS).index(name)])

    def _descriptor(self) -> int:
        if self._file is None:
            self._file = os.open(self.path, os.O_RDONLY)
        return self._file

    def _read(self, values: np.ndarray, offset: int) -> None:
        """Fill `values` from the file."""
        view = memoryview(values).cast("B") if values.size else memoryview(b"")
        done = 0
        while done < len(view):
            count = os.preadv(self._descriptor(), [view[done:]], offset + done)
            if count == 0:
                raise InputError(
                    f"{self.path}: ends too early, at byte {offset + done}; pack again"
                )
            done += count

    def _header(self, place: int, name: str = "") -> tuple[tuple[int, ...], np.dtype, int]:
        """Shape, type and first byte of the array whose member starts at `place`."""
        raw = os.pread(self._descriptor(), _MOST_HEADER, place)
        shape, dtype, length = _parse_header(raw)
        if name:
            expected, lengths = MEMBERS[name]
            fits = len(shape) == len(lengths) and all(
                want in (-1, have) for want, have in zip(lengths, shape, strict=True)
            )
            if dtype != expected or not fits:
                raise InputError(
                    f"{self.path}: {name} is {dtype} {shape}, not of this layout: pack again"
                )
        return shape, dtype, place + length

    def _array(self, place: int, name: str = "") -> np.ndarray:
        shape, dtype, start = self._header(place, name)
        values = np.empty(shape, dtype)
        if values.dtype.kind == "U":  # a buffer of characters cannot be cast to bytes
            raw = np.empty(values.nbytes, np.uint8)
            self._read(raw, start)
            return np.frombuffer(raw.tobytes(), dtype).reshape(shape)
        self._read(values, start)
        return values


def _places(path: Path) -> dict[str, int]:
    """Where the data of each member of an NPZ file start, by name without `.npy`."""
    places = {}
    with path.open("rb") as raw, zipfile.ZipFile(raw) as archive:
        for entry in archive.infolist():
            if entry.compress_type != zipfile.ZIP_STORED:
                raise InputError(f"{path}: {entry.filename} is compressed; pack again")
            raw.seek(entry.header_offset)
            head = raw.read(_LOCAL_HEADER)
            name_length, extra_length = struct.unpack("<HH", head[26:30])
            start = entry.header_offset + _LOCAL_HEADER + name_length + extra_length
            places[entry.filename.removesuffix(".npy")] = start
    return places


def _parse_header(raw: bytes) -> tuple[tuple[int, ...], np.dtype, int]:
    """Shape, type and length of the header of an array in NPY format."""
    from io import BytesIO

    file = BytesIO(raw)
    version = npy.read_magic(file)
    if version != (1, 0):
        raise ValueError(f"an array of NPY version {version}")
    shape, fortran, dtype = npy.read_array_header_1_0(file)
    if fortran or dtype.hasobject:
        raise ValueError("an array that is not plain")
    return shape, dtype, file.tell()


def _some(numbers: list[int]) -> str:
    """Numbers in few words."""
    if not numbers:
        return "none"
    return f"{len(numbers)} runs, {min(numbers)} to {max(numbers)}"
