"""The answer of a back-analysis as a document: `result.json`, with its JSON schema.

Lengths in m, strengths in kPa, angles in degrees, times in s. Whatever depends on the clock or the
machine stands in `manifest`, `timings` and `iterations[].seconds`; all else is the same when a
question is asked again, or when a killed run is continued.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from inversion.back_analysis.result_checks import check_whole
from inversion.engines.small_cells import SmallCells
from inversion.estimation.data import Role, Targets
from inversion.problem.changes import StatedValue
from inversion.problem.question import Question
from pipeline.config import load_document
from pipeline.documents import StrictDocument, document_schema
from pipeline.files import write_json

FILE_NAME = "result.json"
SPACING = (
    "between the material points of its runs, m; coarse ones are moved so that they agree with the "
    "run at the answer's spacing at the answer; 0: the engine has none"
)


class ParameterAnswer(StrictDocument):
    """One unknown number."""

    name: str = Field(description="name in the question")
    label: str = Field(description="in words")
    zones: list[str] = Field(description="zones that share it")
    property: str = Field(description="of inversion.yaml, such as residual_strength_kpa")
    unit: str = Field(description="kPa, deg, kg/m3 or m; empty of a ratio")
    value: float = Field(description="the answer; of a strength in small cells")
    value_of_run: float | None = Field(
        None, description="what its run takes for it; null: `value` itself"
    )
    start: float = Field(description="first guess, of runs as asked")
    low: float = Field(description="lower bound of runs")
    high: float = Field(description="upper bound of runs")
    std_data: float = Field(
        description="standard deviation from the survey's error, the other parameters unknown too"
    )
    std_by_source: dict[str, float] = Field(
        description="change for one standard deviation of everything else that was tried, by name"
    )
    std_total: float = Field(description="root of the sum of the squares of all of them")
    interval_95: tuple[float, float] = Field(description="95 % of the total, cut at the bounds")
    lower_bound_95: float | None = Field(
        None,
        description="where no flow was measured and nothing else fitted: the strength is at least "
        "this, with 95 % confidence; `value` is then the smallest at which nothing runs. null: "
        "fitted to what ran",
    )
    equally_good_range: tuple[float, float] | None = Field(
        description="least and largest value among the equally good answers; null: not searched"
    )
    at_bound: Literal["low", "high"] | None = Field(description="the bound it rests on")
    determined: bool = Field(description="False: the data leave it as wide as it was before them")
    prior_std: float = Field(
        description="standard deviation beforehand: the prior's, or the bounds' width / sqrt(12)"
    )
    has_prior: bool = Field(description="the question gives a prior")
    sigma_v0_kpa: float | None = Field(
        description="mean vertical effective stress of its zones before failure: of an S_r by the "
        "weight above, of a strength_ratio the settled stress of the run; null: no strength"
    )
    sigma_v0_std_kpa: float | None = Field(description="spread of it within the zones")
    ratio: float | None = Field(
        description="value / sigma_v0_kpa; of a strength_ratio `value` itself"
    )
    ratio_std: float | None = Field(
        description="standard deviation of the ratio; an assumption that moves both is applied to "
        "both"
    )
    ratio_lower_bound_95: float | None = Field(
        None, description="lower_bound_95 as a ratio, with the standard deviation of the ratio"
    )
    strength_kpa: float | None = Field(
        None,
        description="of a strength_ratio: the mean S_r over its zones that it means, value x "
        "sigma_v0_kpa; null: no strength_ratio",
    )
    strength_std_kpa: float | None = Field(
        None, description="its standard deviation, std_total x sigma_v0_kpa"
    )

    @builtins.property  # the field of that name hides it here
    def as_run(self) -> float:
        """What a run takes for it."""
        return self.value if self.value_of_run is None else self.value_of_run


class Correlation(StrictDocument):
    """Correlation of the parameters' errors given the data."""

    names: list[str] = Field(description="parameters, in the order of rows and columns")
    matrix: list[list[float]] = Field(description="1 on the diagonal")


class Undetermined(StrictDocument):
    """A direction in which the parameters can move without the data noticing."""

    direction: dict[str, float] = Field(
        description="components by parameter, in units of the standard deviation beforehand"
    )
    words: str = Field(description="the same in words")
    remaining: float = Field(
        description="standard deviation along it after the data / before; 1: they say nothing"
    )


class EquallyGood(StrictDocument):
    """Another set of values that fits as well."""

    along: int = Field(description="number of the direction in `undetermined` it was found along")
    values: dict[str, float] = Field(description="parameters by name")
    spacing_m: float = Field(description=SPACING)
    predicted: dict[str, float] = Field(description="fitted measurements by name")
    loss: float = Field(description="m2 for the paper's loss, else standardised")
    at_bound: list[str] = Field(description="parameters that rest on a bound there")


class FittedTo(StrictDocument):
    """The question that an answer is to: what was fitted, with which covariance."""

    measurements: list[str] = Field(description="those with a number that entered the fit")
    covariance: list[str] = Field(
        description="errors in the covariance C that weighs the differences; empty: differences in "
        "m count equally, as in the paper"
    )
    shares: dict[str, float] = Field(
        default_factory=dict,
        description="error -> its share of the variance of the fitted numbers, weighed as in the "
        "fit: trace(C^-1 C_error) / m. Empty where only one is known",
    )

    @property
    def words(self) -> str:
        """As part of a sentence."""
        many = len(self.measurements) > 4
        names = f"{len(self.measurements)} measurements" if many else ", ".join(self.measurements)
        if not self.covariance:
            return f"fitted to {names} alone, unweighted"
        return f"fitted to {names}, weighted by the covariance of {', '.join(self.covariance)}"


def fitted_to(
    targets: Targets,
    fitted: np.ndarray,
    errors: Sequence[str],
    shares: Mapping[str, float] | None = None,
) -> FittedTo:
    """The fitted data: `fitted` (m,) bool; `errors` in the covariance, and what each makes up."""
    groups = [targets.groups[place] for place in np.flatnonzero(fitted)]
    names = [targets.entries[group].name for group in dict.fromkeys(groups)]
    return FittedTo(measurements=names, covariance=list(errors), shares=dict(shares or {}))


class Answer(StrictDocument):
    """The answer."""

    fitted_to: FittedTo | None = Field(
        None, description="which data, with which covariance; null in files of earlier versions"
    )
    parameters: list[ParameterAnswer] = Field(description="in the question's order")
    loss: float = Field(description="at the answer")
    loss_unit: Literal["m2", "standardised"] = Field(
        description="m2: the paper's loss; standardised: sum of squared standard deviations"
    )
    tolerance: float = Field(description="loss at which the search may end")
    reached: bool = Field(description="the loss is below the tolerance")
    method: Literal["gauss_newton", "lbfgsb"] = Field(description="of the search")
    words: str = Field(description="how the search ended")
    correlation: Correlation = Field(description="of the parameters, given the data")
    undetermined: list[Undetermined] = Field(description="directions the data say nothing of")
    equally_good: list[EquallyGood] = Field(description="other values that fit as well")
    derivative: dict[str, dict[str, float]] = Field(
        description="measurement -> parameter -> derivative at the answer, m per outside unit"
    )
    derivative_resolved: dict[str, bool] = Field(
        description="parameter -> its steps changed some fitted measurement by 5 times the noise"
    )
    steps: dict[str, float] = Field(description="parameter -> finite-difference step, outside unit")
    small_cells: SmallCells | None = Field(
        None,
        description="what turned strengths of runs into all of those told here; null: they are as "
        "the runs had them",
    )


class HandCheck(StrictDocument):
    """What a hand calculation says of the answer."""

    name: str = Field(description="stability, or the ratio of a parameter")
    words: str = Field(description="the check and what it says")
    value: float = Field(description="factor of safety, or ratio")
    low: float | None = Field(description="lower end of what is expected; null: none")
    high: float | None = Field(description="upper end")
    agrees: bool = Field(description="False: the answer is doubted in the first line")


class Iteration(StrictDocument):
    """One look at the engine: a forward run with its derivative, or a run of the scan."""

    iteration: int = Field(description="0: the start, and the scan where there was one")
    kind: Literal["start", "scan", "lbfgsb", "gauss_newton", "limit"] = Field(
        description="what asked for it"
    )
    spacing_m: float = Field(description=SPACING)
    accepted: bool = Field(description="False: a step that made it worse and was taken back")
    values: dict[str, float] = Field(description="parameters by name, as its run took them")
    loss: float | None = Field(description="null: the run failed")
    predicted: dict[str, float] = Field(description="all measured quantities by name")
    runs_so_far: int = Field(description="simulations asked for up to here, noise seeds included")
    seconds: float = Field(description="since the beginning; near 0 where runs were kept")


class Start(StrictDocument):
    """The same question from another first guess."""

    start: dict[str, float] = Field(description="first guess")
    answer: dict[str, float] = Field(description="where its search ended")
    loss: float = Field(description="there")
    reached: bool = Field(description="the loss is below the tolerance")
    iterations: int = Field(description="after the start")
    runs: int = Field(description="simulations asked for")
    words: str = Field(description="how the search ended")
    spacing_m: float = Field(description=SPACING)


class VariantAnswer(StrictDocument):
    """The answer under another reading of the question."""

    name: str = Field(description="as in the question")
    words: str = Field(description="what is different")
    spacing_m: float = Field(description=SPACING)
    values: dict[str, float] = Field(description="parameters by name")
    coarse_values: dict[str, float] | None = Field(
        None, description="as found at the coarse spacing; null: not asked at both"
    )
    ratios: dict[str, float] = Field(description="strength / sigma'_v0 there, by name")
    loss: float = Field(description="at `values`")
    reached: bool = Field(description="the loss is below the tolerance")
    predicted: dict[str, float] = Field(description="measured quantities by name")
    measured: dict[str, float] = Field(description="fitted targets by name")
    at_bound: list[str] = Field(description="parameters that rest on a bound")
    words_end: str = Field(description="how its search ended")


class Side(StrictDocument):
    """One of the changes of a sensitivity, and the answer with it."""

    words: str = Field(description="what was changed, and by how much")
    spacing_m: float = Field(description=SPACING)
    values: dict[str, float] = Field(description="with the linear step that would be next")
    change: dict[str, float] = Field(
        description="values minus the answer's, each first corrected for what its fit still lacks"
    )
    coarse_change: dict[str, float] | None = Field(
        None, description="the change as found at the coarse spacing; null: not asked at both"
    )
    ratio_change: dict[str, float] = Field(description="change of strength / sigma'_v0")
    predicted_before: dict[str, float] = Field(
        description="fitted measurements with the change, at the answer's values"
    )
    predicted: dict[str, float] = Field(description="fitted measurements after the last run")
    loss: float = Field(description="of the last run")
    reached: bool = Field(description="False: only the linear estimate is known")


class SensitivityAnswer(StrictDocument):
    """Effect of one assumption on the answer."""

    name: str = Field(description="as in the question")
    kind: str = Field(description="as in the question")
    words: str = Field(description="what was changed")
    change: dict[str, float] = Field(description="of the side that changes the answer most")
    std: dict[str, float] = Field(description="its contribution: root mean square over the sides")
    sides: list[Side] = Field(description="each of the changes")


class MeasurementAnswer(StrictDocument):
    """Measured against predicted, one number."""

    name: str = Field(description="as in the engine; a profile has one line for each place")
    group: str = Field(description="name of the measurement it belongs to")
    type: str = Field(description="as in measurements.yaml")
    unit: str = Field(description="m, m/s or s")
    measured: float | None = Field(
        description="of a censored number its limit; null for a reading without a measurement"
    )
    censored: bool = Field(
        False, description="`measured` is an upper limit that was not exceeded (no_flow)"
    )
    low: float | None = Field(description="lower end of the stated range")
    high: float | None = Field(description="upper end of the stated range")
    std: float | None = Field(
        description="of the survey, with what the model is granted, and the error of the engine gns"
    )
    predicted: float = Field(description="at the answer")
    predicted_at_start: float = Field(description="before anything moved; nothing is subtracted")
    difference_in_std: float | None = Field(
        description="(predicted - measured) / std; 0 while a limit is kept"
    )
    role: Role = Field(description="what the search did with it")
    confidence: str = Field(description="how far the measured value may be trusted")
    source: str = Field(description="where it is written")
    by_eye: float | None = Field(description="the toe by the naked eye, for a toe")


class SeedAnswer(StrictDocument):
    """The answer on points that were jittered with another seed."""

    seed: int = Field(description="of the jitter")
    values: dict[str, float] = Field(description="with the linear step that would be next")
    predicted_before: dict[str, float] = Field(description="at the answer's values")
    loss: float = Field(description="of the last run")
    reached: bool = Field(description="the loss is below the tolerance")


class Noise(StrictDocument):
    """How much the numbers depend on where exactly the material points lie."""

    spacing_m: float = Field(description=SPACING)
    jitter: float = Field(description="each point moved by up to jitter x spacing / 2")
    seeds: list[int] = Field(description="whose runs finished")
    std: dict[str, float] = Field(description="standard deviation of each prediction at the answer")
    mean: dict[str, float] = Field(description="mean over the seeds")
    answers: list[SeedAnswer] = Field(description="the answer on each")
    answer_std: dict[str, float] = Field(description="scatter of the re-solved answers")


class EngineAnswer(StrictDocument):
    """The answer to the same question as one engine gives it, for comparison."""

    name: str = Field(description="in words")
    engine: str = Field(description="what simulated, as in `engine` of the result")
    note: str = Field(description="what it is")
    spacing_m: float = Field(description="between material points")
    values: dict[str, float] = Field(description="parameters by name")
    std: dict[str, float] = Field(description="std_total by name; empty: not the engine's answer")
    predicted: dict[str, float] = Field(description="measured quantities by name")
    loss: float | None = Field(description="at `values`; null: the run failed")


class RelationAnswer(StrictDocument):
    """What a published relation gives for the blow counts of a parameter's zones."""

    parameter: str = Field(description="name in the question")
    relation: str = Field(description="name in files, such as weber_2015")
    label: str = Field(description="in words")
    zones: list[str] = Field(description="those of the parameter that have a blow count")
    n1_60: float = Field(description="mean over them, by area")
    n1_60_of_zones: dict[str, float] = Field(description="zone -> its blow count")
    clean_sand: bool = Field(description="the relation asks for the clean-sand equivalent N1,60cs")
    other_kind: bool = Field(description="some zone has only the other kind of blow count")
    beyond: bool = Field(
        description="a blow count lies beyond the relation's data and counts as their largest"
    )
    confidence: list[str] = Field(description="of the blow counts")
    sigma_v0_kpa: float = Field(description="mean over the zones before failure, by area")
    value_kpa: float = Field(description="median S_r; of several zones the mean by area")
    weakest_kpa: float = Field(
        description="median S_r of the weakest zone, along which soil slides"
    )
    strongest_kpa: float = Field(description="median S_r of the strongest zone")
    low_kpa: float = Field(description="one standard deviation of its logarithm below")
    high_kpa: float = Field(description="one standard deviation of its logarithm above")
    scatter: str = Field(description="where that comes from")


class SurrogatePair(StrictDocument):
    """One state at which both engines ran."""

    values: dict[str, float] = Field(description="parameters by name")
    surrogate: dict[str, float] = Field(description="learned simulator, uncorrected, by name")
    mpm: dict[str, float] = Field(description="material point method, by name")


class Surrogate(StrictDocument):
    """The learned simulator's error, and how it was corrected."""

    model: str = Field(description="name of the model's folder")
    model_sha256: str = Field(description="of its weights")
    outside: list[str] = Field(description="what of the section its training had not")
    pairs: list[SurrogatePair] = Field(description="the answer's first")
    mean_difference: dict[str, float] = Field(
        description="material point method minus learned simulator, added to every prediction"
    )
    settled: bool = Field(
        False, description="that difference is the one at the answer, not the mean of all pairs"
    )
    std: dict[str, float] = Field(
        description="root of the diagonal of 1.2 cov + 0.1 diag of the differences, which is in "
        "the covariance of the fit"
    )
    answer_std: dict[str, float] = Field(
        description="parameter -> its standard deviation from that covariance"
    )
    runs_mpm: int = Field(description="runs of the material point method, cached ones included")


class WaterfallBar(StrictDocument):
    """The parameter under one reading."""

    name: str = Field(description="what was changed, in words")
    words: str = Field(description="all that differs from the case as it is")
    case: str = Field(description="name of the folder with the section")
    spacing_m: float = Field(description="between material points, m")
    value: float = Field(description="with the linear step that would be next")
    predicted: dict[str, float] = Field(description="measured quantities by name")
    loss: float = Field(description="at `value`")
    reached: bool = Field(description="the loss is below the tolerance")
    at_bound: str | None = Field(description="the bound it rests on: low or high")


class WaterfallAnswer(StrictDocument):
    """How one parameter gets from another reading to the answer."""

    parameter: str = Field(description="name in the question")
    stated: StatedValue | None = Field(description="found by somebody else: the first bar")
    bars: list[WaterfallBar] = Field(description="in order, the answer's last")


class Result(StrictDocument):
    """The whole of `result.json`."""

    case: str = Field(description="name of the folder")
    title: str = Field(description="name in words")
    measurement_set: str = Field(description="the set that was fitted")
    engine: str = Field(description="mpm, gns: a learned simulator, or mpm3d: over a width")
    spacing_m: float = Field(description="between material points, m: of the answer")
    coarse_spacing_m: float | None = Field(
        None,
        description="of the runs that say how the answer changes; null: all are as the answer's",
    )
    manifest: dict[str, Any] = Field(description="settings, versions, seeds, machine, time")
    question: Question = Field(description="as asked")
    answer: Answer = Field(description="what was found")
    iterations: list[Iteration] = Field(description="the way to it")
    starts: list[Start] = Field(description="the same from other first guesses, its own first")
    variants: list[VariantAnswer] = Field(description="under other readings of the question")
    sensitivities: list[SensitivityAnswer] = Field(description="under changed assumptions")
    waterfall: WaterfallAnswer | None = Field(
        None, description="from another reading to the answer; null: not asked"
    )
    measurements: list[MeasurementAnswer] = Field(description="measured against predicted")
    noise: Noise | None = Field(description="on jittered points; null: not measured")
    classical: list[dict[str, Any]] = Field(description="as the classical methods write them")
    relations: list[RelationAnswer] = Field(
        default_factory=list,
        description="published relations with blow count; empty: the case has no blow_counts.yaml",
    )
    engines: list[EngineAnswer] = Field(
        default_factory=list, description="the engines side by side; empty: one alone has answered"
    )
    surrogate: Surrogate | None = Field(
        None, description="of the engine gns; null: the material point method answered"
    )
    hand_checks: list[HandCheck] = Field(
        default_factory=list, description="what can be said without a simulation"
    )
    remarks: list[str] = Field(description="what could not be had, and why")
    published: dict[str, dict[str, Any]] = Field(description="strengths found by others, kPa")
    timings: dict[str, float] = Field(description="wall time by stage, s")
    runs: int = Field(description="simulations asked for, cached ones included")
    runs_to_answer: int = Field(description="of these, until the search for the answer ended")

    @model_validator(mode="after")
    def _whole(self) -> Result:
        check_whole(self)
        return self


def load_result(path: str | Path) -> Result:
    """Read a `result.json`, or the one in a folder.

    Raises:
        InputError: no such file, not JSON, or not of this schema; one line.
    """
    return load_document(Result, path, FILE_NAME)


def save_result(result: Result, folder: str | Path) -> Path:
    """Write `result.json` into a folder; the file appears when whole."""
    path = Path(folder) / FILE_NAME
    write_json(path, result.model_dump(mode="json"))
    return path


def schema_text() -> str:
    """The JSON schema of a result, as text."""
    return document_schema(Result, "flowslide back-analysis")
