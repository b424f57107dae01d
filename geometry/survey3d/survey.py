"""The document `measurements3d.yaml`: what was measured in plan after a slide.

In: the file next to a `scene3d.yaml`, and the rasters it names. Out: a `Survey3d`, whose entries
know their values, their covariance and how the same is read on a simulated deposit. A new type is a
class in this folder and its place in `LIBRARY`. File format: docs/how-to/three-dimensions.md.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from geometry.scenes.scene import checked_document
from geometry.scenes3d.scene3d import PAGE, Scene3d
from geometry.survey.sets import Sets
from geometry.survey3d.deposit_edge import DepositEdge
from geometry.survey3d.measured import MapMeasured
from geometry.survey3d.numbers import CrossedVolume, InundatedArea, PathRunout
from geometry.survey3d.surface_after import SurfaceAfter
from pipeline.files import read_yaml

FILE_NAME = "measurements3d.yaml"
LIBRARY: tuple[type[MapMeasured], ...] = (
    SurfaceAfter,
    DepositEdge,
    PathRunout,
    InundatedArea,
    CrossedVolume,
)
if TYPE_CHECKING:
    Entry = MapMeasured
else:
    Entry = Annotated[reduce(or_, LIBRARY), Field(discriminator="type")]


class Survey3d(Sets):
    """The whole of `measurements3d.yaml`."""

    case: str = Field(description="name of the case")
    default_set: str = Field(description="the set used unless another is named")
    sets: dict[str, list[Entry]] = Field(min_length=1, description="sets of measurements")
    strength_published_kpa: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="residual strengths found by others; notes, no input"
    )


def load_survey(folder: Path, scene: Scene3d) -> Survey3d:
    """Read `measurements3d.yaml` of a folder, with its rasters, and check it against the scene.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    path = folder / FILE_NAME
    survey = checked_document(Survey3d, read_yaml(path), path, PAGE)
    for group, entries in survey.sets.items():
        for entry in entries:
            where = f"{path}: sets.{group}: {entry.name}"
            entry.read_files(folder, scene, where)
            entry.check_in(scene, where)
    return survey
