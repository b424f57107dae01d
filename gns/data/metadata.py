"""`metadata.json` of packed data: what is in it, where, in which units, and where it came from.

In: a folder of packed data. Out: a checked `Metadata`. The file is written last, so a folder
without it is not whole; the same trajectories and settings give the same bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from gns.data.scene_facts import CONTACTS, NUMBERS, PROPERTIES
from gns.data.shard import LAYOUT_VERSION
from gns.data.statistics import SLOWEST, Moments
from pipeline.cli import InputError, WorkFailed
from pipeline.config import describe_error
from pipeline.documents import StrictDocument
from pipeline.files import content_hash, read_json, write_json

METADATA_FILE = "metadata.json"

UNITS = {
    "positions": "m",
    "initial_velocity": "m/s",
    "ground, phreatic_line": "m",
    "tan_friction": "-",
    "cohesion": "Pa",
    "head": "m; elevation to which water stands over a point at t = 0, 0 without water",
    "density": "kg/m3; saturated below the phreatic line at t = 0",
    "body_force_x, body_force_y": "g; weight and force of the water per mass, at t = 0",
    "numbers": "SI; spacing, cell, x_min, x_max, y_max in m; frame_time in s; gravity in m/s2; "
    "youngs_modulus in Pa; ground_contact: place in contacts; walls_*, thrust, "
    "moving_face: 1 is yes; pool_level in m",
    "statistics, ranges": "lengths in spacings d, time in sqrt(d / g), strength in rho g d",
}


class RunEntry(StrictDocument):
    """One run."""

    run: int
    template: str
    points: int
    frames: int


class ShardEntry(StrictDocument):
    """One file and its runs, in the order in which they lie there."""

    file: str
    key: str
    runs: list[RunEntry]


class LeftOut(StrictDocument):
    """A run that is not in the data, and why."""

    run: int
    reason: str


class Statistics(StrictDocument):
    """Of the moving points of the training runs; x and y."""

    count: int
    velocity_mean: tuple[float, float]
    velocity_std: tuple[float, float]
    acceleration_mean: tuple[float, float]
    acceleration_std: tuple[float, float]
    slowest: float  # speed above which a point moves

    @classmethod
    def of(cls, velocity: Moments, acceleration: Moments) -> Statistics:
        """From the moments of the runs, merged.

        Raises:
            WorkFailed: no point moves.
        """
        if velocity.count == 0:
            raise WorkFailed("nothing moves in the training runs: there is nothing to learn from")
        return cls(
            count=velocity.count,
            velocity_mean=tuple(velocity.mean.tolist()),
            velocity_std=tuple(velocity.std.tolist()),
            acceleration_mean=tuple(acceleration.mean.tolist()),
            acceleration_std=tuple(acceleration.std.tolist()),
            slowest=SLOWEST,
        )


class Metadata(StrictDocument):
    """The whole file."""

    layout_version: Literal[3] = LAYOUT_VERSION
    scale: str  # "" for scenes made by hand
    spacing_m: float
    gravity_m_per_s2: float
    frame_interval: float  # time between frames in sqrt(d / g)
    frame_time_s: float
    water: str
    splits: dict[str, list[ShardEntry]]
    left_out: list[LeftOut]
    statistics: Statistics
    ranges: dict[str, tuple[float, float]]  # of the training runs, `gns.data.ranges.MEANINGS`
    inputs: list[dict[str, str]]  # trajectory files: name, sha256
    data_hash: str
    units: dict[str, str] = UNITS
    number_names: list[str] = list(NUMBERS)
    property_names: list[str] = list(PROPERTIES)
    contacts: list[str] = list(CONTACTS)
    manifest: dict[str, Any]

    def runs(self, split: str) -> list[RunEntry]:
        """The runs of a split, in the order of its shards."""
        return [entry for shard in self.splits[split] for entry in shard.runs]

    def write(self, folder: str | Path) -> None:
        """Write the file; it appears when whole."""
        write_json(Path(folder) / METADATA_FILE, self.model_dump(mode="json"))


def data_hash(shards: list[ShardEntry]) -> str:
    """Hash of the content of a data set: of what its shards were made from."""
    return content_hash([[shard.file, shard.key] for shard in shards])


def read_metadata(folder: str | Path) -> Metadata:
    """Read and check the file of a folder.

    Raises:
        InputError: no packed data there, not whole, or of another layout.
    """
    path = Path(folder) / METADATA_FILE
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; {folder} holds no packed data, or packing has not ended "
            "(flowslide gns pack)"
        )
    document = read_json(path)
    if not isinstance(document, dict):
        raise InputError(f"{path}: is not the metadata of packed data")
    version = document.get("layout_version")
    if version != LAYOUT_VERSION:
        raise InputError(
            f"{path}: layout_version: {version!r}; this program reads {LAYOUT_VERSION}: pack the "
            "trajectories again"
        )
    try:
        return Metadata.model_validate(document)
    except ValidationError as error:
        raise InputError(f"{path}: {describe_error(error, Metadata)}") from None
