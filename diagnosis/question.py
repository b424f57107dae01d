"""Settings of a diagnosis: `diagnosis.yaml` of a case folder, all of it optional.

In: the document. Out: a checked `DiagnosisQuestion`. The calibrated parameters are in
`inversion.yaml`, the measurements in `measurements.yaml`; this file holds what an engineer knows of
the effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator, model_validator

from geometry.scenes.scene import Document, checked_document
from geometry.survey.registry import measurement_types
from inversion.estimation.covariance import SourceError
from inversion.estimation.hold_out import HoldOut
from pipeline.cli import say_once
from pipeline.files import read_yaml

FILE_NAME = "diagnosis.yaml"


class AmplitudePrior(Document):
    """What is known of an amplitude beforehand, as a normal distribution."""

    mean: float = Field(description="most likely amplitude, in the effect's unit")
    std: float = Field(gt=0, description="its standard deviation")


class CodeError(Document):
    """How far codes differ on one and the same slide, in numbers of one type of measurement."""

    std: float = Field(gt=0, description="in the unit of the type")
    correlation_length: float | None = Field(
        None, gt=0, description="along x [m] or time [s]; null: independent"
    )


def source_errors(stated: Mapping[str, CodeError]) -> dict[str, SourceError]:
    """Errors of a code by type of measurement, as the statistics take them."""
    return {name: SourceError(one.std, one.correlation_length) for name, one in stated.items()}


class HoldOutChoice(Document):
    """What no fit may see; takes the place of the flags in measurements.yaml."""

    groups: list[str] = Field(default_factory=list, description="names of whole measurements")
    blocks: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="measurement -> [from, to], x in m or time in s"
    )

    @field_validator("blocks")
    @classmethod
    def _ascending(cls, blocks: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for name, (first, last) in blocks.items():
            if last <= first:
                raise ValueError(f"{name}: from {first:g} to {last:g} must ascend")
        return blocks


class DiagnosisQuestion(Document):
    """The whole of `diagnosis.yaml`."""

    forbid: dict[str, str] = Field(
        default_factory=dict, description="effects that are ruled out -> why; or a list of names"
    )
    effects: list[str] | None = Field(
        None, min_length=1, description="the only effects to test; null: all that can act here"
    )
    priors: dict[str, AmplitudePrior] = Field(
        default_factory=dict, description="effect -> what is known of its amplitude"
    )
    parameters: dict[str, dict[str, float]] = Field(
        default_factory=dict, description="effect -> its further numbers, as in a scene"
    )
    hold_out: HoldOutChoice | None = Field(
        None,
        description="null or automatic: what measurements.yaml holds out; where that is nothing, a "
        "block of each long series and one of several measurements of a kind",
    )
    spacing_m: float | None = Field(
        None, gt=0, description="of material points; null: that of the back-analysis"
    )
    duration_s: float | None = Field(
        None, gt=0, description="motion simulated; null: that of the back-analysis"
    )
    replicates: int | None = Field(
        None, ge=2, description="jitters that measure the model's noise; null: as configured"
    )
    second_scheme: bool = Field(True, description="a run by the second transfer scheme enters C")
    finer_share: float | None = Field(
        None,
        ge=0,
        description="multiple of the difference to finer cells that is added to every prediction; "
        "null: as configured",
    )
    finer_share_std: float | None = Field(
        None,
        ge=0,
        description="its standard deviation; with both 0 no run has finer cells; null: as "
        "configured",
    )
    synthetic: bool = Field(
        False, description="the measurements were simulated, and hold numerical noise of their own"
    )
    source: dict[str, CodeError] = Field(
        default_factory=dict,
        description="the measured slide was made by another code: type of measurement -> its error",
    )
    source_strength: float = Field(
        0.0,
        ge=0.0,
        lt=1.0,
        description="how far the strengths differ by which codes imitate one and the same slide, "
        "as a share",
    )
    source_effects: float = Field(
        0.0,
        ge=0.0,
        lt=1.0,
        description="how far codes, or a law and the soil, differ in what an effect does, as a "
        "share of it",
    )
    validation_case: str | None = Field(
        None, description="case folder of a second section or event that judges the answer"
    )

    @model_validator(mode="before")
    @classmethod
    def _short_forms(cls, document: Any) -> Any:
        """`forbid: [shaking]` says no reason; `hold_out: automatic` is the default in words."""
        if not isinstance(document, Mapping):
            return document
        given = dict(document)
        if isinstance(given.get("forbid"), list):
            given["forbid"] = {str(name): "" for name in given["forbid"]}
        if given.get("hold_out") == "automatic":
            given["hold_out"] = None
        return given

    @model_validator(mode="after")
    def _consistent(self) -> DiagnosisQuestion:
        for name in self.effects or ():
            if name in self.forbid:
                raise ValueError(f"effects: {name!r} is also under forbid")
        return self

    @field_validator("source")
    @classmethod
    def _types(cls, source: dict[str, CodeError]) -> dict[str, CodeError]:
        for name in source:
            if name not in measurement_types():
                raise ValueError(f"no measurement type {name!r}: {', '.join(measurement_types())}")
        return source

    @property
    def source_errors(self) -> dict[str, SourceError]:
        """`source` as the statistics take it."""
        return source_errors(self.source)

    @property
    def held_out(self) -> HoldOut | None:
        """The choice as the statistics take it; None: automatic."""
        if self.hold_out is None:
            return None
        return HoldOut(tuple(self.hold_out.groups), dict(self.hold_out.blocks))

    @property
    def named_effects(self) -> dict[str, list[str]]:
        """Key of the document -> effects it names."""
        return {
            "forbid": list(self.forbid),
            "effects": list(self.effects or ()),
            "priors": list(self.priors),
            "parameters": list(self.parameters),
        }


#: Keys of older files -> what they are called now.
RENAMED = {"transfer": "second_scheme", "transfer_check": "validation_case"}


def _with_new_keys(document: Any, source: str) -> Any:
    """The document with its keys as they are called now; a line says what to write."""
    if not isinstance(document, Mapping):
        return document
    for old, new in RENAMED.items():
        if old in document and new not in document:
            say_once(f"{source}: {old}: is called {new} now")
    return {RENAMED.get(key, key): value for key, value in document.items()}


def load_diagnosis_question(folder: str | Path) -> DiagnosisQuestion:
    """Read `diagnosis.yaml` of a case folder; the defaults where there is none.

    Raises:
        InputError: no YAML, or a document that does not hold together; one line.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        return DiagnosisQuestion()
    document = _with_new_keys(read_yaml(path), str(path))
    if document is None:
        return DiagnosisQuestion()
    return checked_document(DiagnosisQuestion, document, path, "docs/method/diagnosis.md")
