"""What the files of a benchmark must hold: hashes, truths, and the record of both.

In: documents as JSON has them. Out: the same documents, checked, since a seal is of a document as
it is; any other form is an `InputError` of one line, before anything is computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from benchmarks.hidden_effects.making.plan import Kind
from benchmarks.hidden_effects.scoring.digest import METHOD, Digest
from pipeline.cli import InputError
from pipeline.config import describe_error
from pipeline.files import read_json

_NUMBER_OF_EFFECTS = {"null": 0, "single": 1, "outside": 1, "pair": 2}
_Positive = Annotated[float, Field(gt=0)]


class _Checked(BaseModel):
    """Base: keys that nobody reads are let be, they are part of what was sealed."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, strict=True)


class _Named(_Checked):
    name: str = Field(min_length=1, description="of the case")


class _Sealed(_Named):
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of the truth")


class _Skipped(_Named):
    kind: Kind
    effects: list[str]
    section: str
    survey: str


class _Truth(_Named):
    kind: Kind = Field(description="of the case")
    section: str = Field(description="name of the section")
    survey: str = Field(description="name of the survey")
    effects: dict[str, float | dict[str, float]] = Field(description="what was hidden")
    parameters: dict[str, _Positive] = Field(
        min_length=1, description="by name, the strength first"
    )
    lambda_: float = Field(ge=0, alias="lambda", description="how well it can be seen")
    beside: float | None = Field(None, ge=0, description="lambda of the fainter of two")
    source: str = Field("own", description="name of the code that made the slide")
    spacing_factor: float = Field(gt=0, description="of the slide")
    jitter_seed: int = Field(ge=0, description="of the slide")

    @model_validator(mode="after")
    def _as_many_effects_as_the_kind_says(self) -> _Truth:
        wanted = _NUMBER_OF_EFFECTS[self.kind]
        if len(self.effects) != wanted:
            raise ValueError(
                f"effects: {len(self.effects)} of them; a case of kind {self.kind} has {wanted}"
            )
        return self


class _Row(_Checked):
    truth: _Truth
    sha256: str
    verdicts: dict[str, Digest]

    @model_validator(mode="after")
    def _judged_by_the_method(self) -> _Row:
        if METHOD not in self.verdicts:
            raise ValueError(f"verdicts: {METHOD} is missing, which every case was judged by")
        strength = next(iter(self.truth.parameters))
        for variant, digest in self.verdicts.items():
            for name in ("base", "final"):
                stage = getattr(digest, name)
                if not stage.values.get(strength, 0.0) > 0.0 or strength not in stage.std:
                    raise ValueError(
                        f"verdicts.{variant}.{name}: {strength} needs a value greater than 0 and a "
                        "standard deviation: the truth has it"
                    )
        return self


class _Seen(_Checked):
    of: list[str]
    lambda_: float = Field(ge=0, alias="lambda")


def read_sealed(path: Path) -> list[dict[str, Any]]:
    """The hashes of all truths.

    Raises:
        InputError: no such file, or not of this form.
    """
    return _named_once(_checked(list[_Sealed], read_json(path), str(path)), str(path))


def read_truth(path: Path) -> dict[str, Any]:
    """A truth, or what could not be made, with `skipped: true`.

    Raises:
        InputError: no such file, or not of this form.
    """
    document = read_json(path)
    skipped = isinstance(document, Mapping) and bool(document.get("skipped"))
    return _checked(_Skipped if skipped else _Truth, document, str(path))


def read_reach(path: Path) -> list[dict[str, Any]]:
    """How well each effect can be seen.

    Raises:
        InputError: no such file, or not of this form.
    """
    return _checked(list[_Seen], read_json(path), str(path))


def checked_rows(document: Any, source: str) -> list[dict[str, Any]]:
    """The rows of a record.

    Raises:
        InputError: not of this form, or a case that is there twice.
    """
    rows = _checked(list[_Row], document, source)
    _named_once([row["truth"] for row in rows], source)
    return rows


def _checked(form: Any, document: Any, source: str) -> Any:
    try:
        TypeAdapter(form).validate_python(document)
    except ValidationError as error:
        raise InputError(f"{source}: {describe_error(error)}") from None
    return document


def _named_once(cases: Sequence[Mapping[str, Any]], source: str) -> Any:
    ((name, count),) = Counter(case["name"] for case in cases).most_common(1) or [("", 0)]
    if count > 1:
        raise InputError(f"{source}: {name} is there {count} times")
    return cases
