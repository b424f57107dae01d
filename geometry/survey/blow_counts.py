"""Blow counts of a case: what borings say of the soil before it liquefied.

In: `blow_counts.yaml` of a case folder, which a case may have. Out: one `BlowCount` for each zone
that it names. The relations of `inversion.catalogue.correlations` turn them into strengths. Kinds:
N1,60, corrected to one atmosphere and 60 % of the energy; N1,60cs, the clean-sand equivalent for
residual strengths. File format: docs/method/measurements.md.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, model_validator

from geometry.scenes.scene import Document, Scene, checked_document
from geometry.survey.quantity import Confidence
from pipeline.cli import InputError
from pipeline.files import read_yaml

FILE_NAME = "blow_counts.yaml"


class BlowCount(Document):
    """The blow count of a layer: one zone, or several of the same soil."""

    zones: list[str] = Field(min_length=1, description="zones of the scene")
    n1_60: float | None = Field(None, ge=0, le=60, description="N1,60")
    n1_60cs: float | None = Field(
        None, ge=0, le=60, description="clean-sand equivalent for residual strengths"
    )
    confidence: Confidence = Field(description="how far the value may be trusted")
    source: str = Field(min_length=1, description="where the value is written")

    @model_validator(mode="after")
    def _one_is_given(self) -> BlowCount:
        if self.n1_60 is None and self.n1_60cs is None:
            raise ValueError("n1_60, n1_60cs: give at least one of them")
        return self

    def of_kind(self, clean_sand: bool) -> float:
        """N1,60cs or N1,60; where only the other was counted, that one."""
        pair = (self.n1_60cs, self.n1_60) if clean_sand else (self.n1_60, self.n1_60cs)
        return next(count for count in pair if count is not None)

    def is_other_kind(self, clean_sand: bool) -> bool:
        """The kind asked for was not counted."""
        return (self.n1_60cs if clean_sand else self.n1_60) is None


class BlowCounts(Document):
    """The whole of `blow_counts.yaml`."""

    layers: list[BlowCount] = Field(min_length=1, description="layers with a blow count")

    @model_validator(mode="after")
    def _each_zone_once(self) -> BlowCounts:
        named = [zone for layer in self.layers for zone in layer.zones]
        for zone in named:
            if named.count(zone) > 1:
                raise ValueError(f"layers: zone {zone!r} is given two blow counts")
        return self


def load_blow_counts(folder: str | Path, scene: Scene) -> dict[str, BlowCount]:
    """Zone -> its blow count; empty: the case has no file.

    Raises:
        InputError: no YAML, a document that does not hold together, or a zone that the scene does
            not have; one line.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        return {}
    counts = checked_document(BlowCounts, read_yaml(path), path, "docs/method/measurements.md")
    known = [zone.name for zone in scene.zones]
    for layer in counts.layers:
        for zone in layer.zones:
            if zone not in known:
                raise InputError(
                    f"{path}: layers: no zone {zone!r} in the scene; known are {', '.join(known)}"
                )
    return {zone: layer for layer in counts.layers for zone in layer.zones}
