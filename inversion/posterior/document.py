"""The summary of a posterior as a document: `posterior.json`, with its JSON schema.

Lengths in m, strengths in kPa. What depends on the clock or the machine stands in `timings` and
`manifest`; all else is the same when a posterior is asked for again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from geometry.dimensions.stated import SlideDimensions
from inversion.engines.small_cells import SmallCells
from inversion.estimation.data import Role
from pipeline.config import load_document
from pipeline.documents import StrictDocument, document_schema

FILE_NAME = "posterior.json"


class Spread(StrictDocument):
    """A distribution in a few numbers."""

    mean: float
    std: float
    median: float
    interval_50: tuple[float, float] = Field(description="25 and 75 % quantiles")
    interval_95: tuple[float, float] = Field(description="2.5 and 97.5 % quantiles")


class SobolShare(StrictDocument):
    """What one input contributes to the posterior variance of a parameter."""

    name: str = Field(description="an unknown, or the errors of a fitted measurement")
    first: float = Field(description="share of the variance that goes if this becomes known")
    total: float = Field(description="share that stays if everything else becomes known")


class UnknownAnswer(StrictDocument):
    """One unknown before and after the data."""

    name: str = Field(description="of the parameter or the sensitivity in inversion.yaml")
    label: str = Field(description="in words")
    kind: Literal["parameter", "nuisance"] = Field(
        description="asked for, or a sensitivity with a standard deviation"
    )
    property: str = Field(description="of a parameter, as in inversion.yaml; else empty")
    zones: list[str] = Field(description="of a parameter; else none")
    dimension: str = Field(
        "", description="key in dimensions.yaml, of a section that nobody drew; else empty"
    )
    unit: str = Field(description="kPa, deg, kg/m3, m; std: in standard deviations about 0")
    prior: str = Field(description="in words")
    before: Spread
    after: Spread
    ratio: Spread | None = Field(
        description="of a residual strength: divided by the vertical effective stress before "
        "failure, mean over its zones; of a strength_ratio itself; else null"
    )
    strength_kpa: Spread | None = Field(
        None,
        description="of a strength_ratio: the mean S_r over its zones that it means; else null",
    )
    narrowed: float = Field(description="1 - (std after / std before)^2; 0: the data say nothing")
    sobol: list[SobolShare] = Field(
        description="of a parameter: shares of the variance of its logarithm (an angle's: of "
        "itself), the largest total first"
    )


class PredictedNumber(StrictDocument):
    """A measured number as the posterior predicts it."""

    name: str
    group: str = Field("", description="name of the measurement it belongs to; empty: its own")
    unit: str
    role: Role
    measured: float
    censored: bool = Field(description="an upper limit that was not exceeded")
    std: float = Field(description="of the survey's error and what the model is granted")
    before: Spread = Field(description="as the prior predicts it, all errors of the model included")
    after: Spread = Field(description="as the posterior predicts it, the same")
    difference_in_std: float = Field(
        description="(measured - mean) / root of the variances of both"
    )
    share_below: float = Field(description="of predictions with survey errors that are smaller")
    left_out_std: float = Field(
        description="root mean square error of the emulator at coarse runs where the posterior is, "
        "each without that run"
    )
    correction: float | None = Field(
        description="mean of fine less coarse runs; null: there is one spacing"
    )
    correction_std: float | None = Field(description="scatter of it about its trend")


class Evidence(StrictDocument):
    """Of the model with its prior."""

    log_evidence: float = Field(description="ln of the density of the fitted measurements")
    log_evidence_std: float
    information_nats: float = Field(description="how much the data narrow the prior")


class ConfirmedNumber(StrictDocument):
    """A fitted number by the solver at draws of a posterior that a learned model found."""

    name: str
    runs: int = Field(description="draws that were simulated and could be read")
    difference: float = Field(description="mean of the solver's less the predicted number")
    scatter: float = Field(description="standard deviation of that difference")
    stated_std: float = Field(description="error of model and emulator that was reckoned with")


class RunCounts(StrictDocument):
    """Simulations behind the emulator."""

    coarse: int
    refined: int
    fine: int
    other_ways: int
    failed: int = Field(description="failed, could not be read, or no such section")
    simulated_now: int = Field(description="of all of them; the others were kept")


class PosteriorDocument(StrictDocument):
    """`posterior.json`."""

    case: str
    title: str
    measurement_set: str
    engine: str = Field("mpm", description="what predicted")
    spacing_m: float = Field(description="of the answer")
    coarse_spacing_m: float | None = Field(description="of the coarse runs; null: the same")
    physics: dict[str, int]
    settings: dict[str, int]
    unknowns: list[UnknownAnswer]
    numbers: list[PredictedNumber]
    other_ways: dict[str, dict[str, float]] = Field(
        description="change of the numbers with each other way to simulate; errors of the model"
    )
    small_cells: SmallCells | None = Field(
        None,
        description="what turned strengths of runs into all of those told here, its error among "
        "theirs; null: they are as the runs had them",
    )
    section: SlideDimensions | None = Field(
        None, description="what is stated of a section that nobody drew; null: it was drawn"
    )
    correlation: list[list[float]] = Field(description="of the unknowns after the data")
    confirmation: list[ConfirmedNumber] = Field(
        default_factory=list,
        description="of a learned model: runs of the solver at draws of the posterior",
    )
    evidence: Evidence
    runs: RunCounts
    remarks: list[str]
    timings: dict[str, float] = Field(description="of the stages, s")
    manifest: dict[str, Any]

    @property
    def parameters(self) -> list[UnknownAnswer]:
        """What was asked for."""
        return [one for one in self.unknowns if one.kind == "parameter"]

    @property
    def nuisances(self) -> list[UnknownAnswer]:
        """What is unknown besides."""
        return [one for one in self.unknowns if one.kind == "nuisance"]


def load_posterior(path: str | Path) -> PosteriorDocument:
    """Read a `posterior.json`, or the one in a folder.

    Raises:
        InputError: no such file, not JSON, or not of this schema; one line.
    """
    return load_document(PosteriorDocument, path, FILE_NAME)


def schema_text() -> str:
    """The JSON schema, as text."""
    return document_schema(PosteriorDocument, "flowslide posterior")
