"""The verdict as a document: `verdict.json`, with its JSON schema, and the shorter ones before it.

Lengths in m, strengths in kPa, angles in degrees; amplitudes in the unit that is named. What
depends on the clock, the machine or what was kept before (`seconds`, `runs.computed`) is null in a
file and stands in `timing.json`: a file is the same when a diagnosis is repeated, or continued
after it was killed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from diagnosis.hypotheses.model import Family
from diagnosis.reason import WhyNot
from diagnosis.track_record import Verdicts
from inversion.back_analysis.result import FittedTo
from inversion.estimation.data import Role
from pipeline.config import load_document
from pipeline.documents import StrictDocument, document_schema
from pipeline.files import write_json

FILE_NAME = "verdict.json"
COMPARE_FILE = "compare.json"
EXPLAIN_FILE = "explain.json"
SOLVER_ERRORS = (
    "the place of the material points",
    "the transfer scheme",
    "the size of the cells",
)
"""Errors in the covariance that another spacing of the points changes."""


class ParameterWords(StrictDocument):
    """A calibrated parameter in words; its values stand in the stages, by name."""

    name: str = Field(description="name of the parameter")
    words: str = Field(description="what it is")
    unit: str = Field(description="kPa, deg or kg/m3")
    strength: bool = Field(description="a cohesion: S_r where friction is 0")
    low: float = Field(description="lower bound")
    high: float = Field(description="upper bound")


class EffectAnswer(StrictDocument):
    """An effect of the answer with its amplitude."""

    name: str = Field(description="name of the effect")
    amplitude: float = Field(description="best amplitude")
    std: float = Field(description="its standard deviation, parameters unknown too")
    interval_95: tuple[float, float] = Field(description="cut at the bounds")
    unit: str = Field(description="of the amplitude; empty: a pure number")
    words: str = Field(description="what the effect is")


class NamedSet(StrictDocument):
    """One explanation: effects that together explain the measurements."""

    names: list[str] = Field(description="effects; empty: none, the base model")
    probability: float = Field(description="among all explanations that were tried")
    values: dict[str, float] = Field(
        default_factory=dict, description="parameters by name; empty in files of earlier versions"
    )
    interval_95: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="of the same, cut at the bounds"
    )


class Answer(StrictDocument):
    """What the diagnosis answers."""

    effects: list[EffectAnswer] = Field(description="of the best explanation; empty: none")
    set_90: list[NamedSet] = Field(
        description="most probable explanations, together 90 % at least; ascending in rank"
    )
    families: list[Family] = Field(
        default_factory=list,
        description="of the answer, where the data cannot tell their members apart; empty: a name",
    )
    members: list[str] = Field(
        default_factory=list, description="of these families, the best first; each would do as well"
    )
    not_enough: WhyNot = Field(
        None, description="why what was accepted is not the answer; null: it is"
    )
    by_chance: list[str] = Field(
        default_factory=list,
        description="random patterns that were accepted, each one of many, and name nothing",
    )
    untried: list[list[str]] = Field(
        default_factory=list, description="rivals that the runs allowed did not suffice to try"
    )
    chance: float | None = Field(
        None,
        description="that an explanation like this is right, where the truth is known; null: "
        "nothing explains",
    )

    @property
    def would_explain(self) -> bool:
        """It explains, and is not given: such explanations were too often wrong."""
        return self.not_enough is not None and self.chance is not None


class QuotedValue(StrictDocument):
    """The value of a parameter to use, with all that is known of its error."""

    value: float = Field(description="outside units")
    std: float = Field(description="standard deviation")
    intervals: dict[str, tuple[float, float]] = Field(
        description="that hold 50 %, 80 %, 95 % of the probability, cut at the bounds"
    )
    models: list[NamedSet] = Field(description="models it is a mixture of, with their weights")
    beyond: float = Field(
        0.0,
        ge=0.0,
        description="of `std`, what stands for causes that no list holds, by the record of such "
        "verdicts; of the strength's logarithm, 0 in files of earlier versions",
    )
    at_least: float | None = Field(
        None,
        description="one-sided 95 % lower bound of a strength, its assumed errors counted, where "
        "all that is fitted are limits that were kept; null elsewhere",
    )


class Check(StrictDocument):
    """One test of adequacy."""

    name: str = Field(description="chi2, autocorrelation, group <name>, score, held_out")
    statistic: float = Field(description="value")
    p: float = Field(description="share of simulated noise that is at least as far out")


class Group(StrictDocument):
    """How far one measurement as a whole is from the prediction."""

    name: str = Field(description="name of the measurement")
    z: float = Field(description="standardised excess of its sum of squares; noise: about 0 +- 1")
    chi2: float = Field(description="its sum of squared whitened residuals")
    expected: float = Field(description="of noise, the fitted parameters taken into account")
    n: int = Field(description="fitted numbers in it")


class Window(StrictDocument):
    """The contiguous stretch of one measurement with the worst disagreement."""

    measurement: str = Field(description="name of the measurement")
    axis: Literal["x_m", "time_s", "none"] = Field(description="what the stretch is measured in")
    first: str = Field(description="name of the first number in it")
    last: str = Field(description="name of the last number in it")
    x_from: float | None = Field(description="where it begins, in the unit of `axis`")
    x_to: float | None = Field(description="where it ends")
    n: int = Field(description="numbers in it")
    chi2: float = Field(description="sum of squared whitened residuals in it")
    p: float = Field(description="that noise has anywhere a stretch as bad")


class HeldOut(StrictDocument):
    """Data that no fit has seen."""

    chi2: float = Field(description="misfit of the prediction conditional on the fitted residuals")
    n: int = Field(description="held-out numbers")
    p: float | None = Field(description="of noise; null: nothing was held out")
    mover: str = Field("", description="the hypothesis that moves them most; empty: not known")
    moved: float | None = Field(
        None,
        description="by how much, in standard deviations, once the parameters have met it; null: "
        "not known. Below 1 the held-out data can tell nothing",
    )


class AskedStrength(StrictDocument):
    """The strength at which a model would meet one measurement best."""

    parameter: str = Field(description="name of the strength")
    measurement: str = Field(description="name of the measurement")
    role: Role = Field(description="of its numbers: fitted or held out")
    value: float = Field(description="outside units, within the bounds")
    interval_95: tuple[float, float] = Field(description="cut at the bounds")


class FittedModelSummary(StrictDocument):
    """One model, calibrated and judged."""

    effects: dict[str, float] = Field(description="amplitudes by name; empty: the base model")
    values: dict[str, float] = Field(description="parameters by name, outside units")
    std: dict[str, float] = Field(
        description="standard deviations of the same; of the final model with the error that its "
        "effects bring"
    )
    std_assumed: dict[str, float] = Field(
        default_factory=dict,
        description="the same with what is assumed of other soils, section, survey as uncertain as "
        "it is stated to be; empty: not known",
    )
    interval_95: dict[str, tuple[float, float]] = Field(description="cut at the bounds")
    chi2: float = Field(description="of the fitted data and the priors")
    dof: int = Field(description="degrees of freedom: the noise level of chi2")
    p_combined: float = Field(description="min(1, number of tests x least p)")
    tests: list[Check] = Field(description="tests of adequacy")
    groups: list[Group] = Field(description="by measurement")
    window: Window | None = Field(description="where it fails worst; null: no series was measured")
    held_out: HeldOut = Field(description="on held-out data")
    asked: list[AskedStrength] = Field(
        default_factory=list,
        description="what each measurement alone asks for, linear at the fit; without those that "
        "do not notice the strength. Empty in files of earlier versions",
    )


class WaterfallStep(StrictDocument):
    """One model on the way, for the waterfall of the error."""

    round: int = Field(description="0: the base model")
    hypothesis: str = Field(description="name of its file")
    effects: dict[str, float] = Field(description="amplitudes by name")
    values: dict[str, float] = Field(description="parameters by name")
    std: dict[str, float] = Field(description="standard deviations of the same")
    chi2: float = Field(description="fitted data and priors")
    dof: int = Field(description="degrees of freedom: the noise level of chi2")
    held_out_chi2: float | None = Field(description="null: nothing was held out")
    held_out_n: int = Field(description="held-out numbers: the noise level of held_out_chi2")
    ln_evidence: float | None = Field(description="relative to the base model, odds included")
    note: str = Field(description="what was done")


class Refit(StrictDocument):
    """The model with this effect, calibrated again."""

    effects: dict[str, float] = Field(description="all amplitudes, earlier effects included")
    amplitude: float = Field(description="of this effect")
    std: float = Field(description="its standard deviation")
    values: dict[str, float] = Field(description="parameters by name")
    chi2: float = Field(description="fitted data and priors")
    drop: float = Field(description="fall of chi2 below the model before")
    ln_evidence: float = Field(description="gain over the model before, odds included")
    held_out_chi2: float | None = Field(description="null: nothing was held out")
    accepted: bool = Field(description="passes every condition")
    why_not: WhyNot = Field(description="the condition that failed; null if accepted")


class CandidateVerdict(StrictDocument):
    """What was found of one candidate, against the base model."""

    name: str = Field(description="name of the effect")
    family: Family = Field(description="physics, or which of the model's assumptions it doubts")
    switch: bool = Field(False, description="on or off: its amplitude is 1 and has no error")
    words: str = Field(description="what it is")
    unit: str = Field(description="of the amplitude; empty: a pure number")
    z: float | None = Field(description="score of the residual along its signature")
    expected_drop: float | None = Field(description="of chi2, by the score: max(z, 0)^2")
    p_family: float | None = Field(
        description="that noise gives any candidate at any amplitude a score as large"
    )
    amplitude_by_score: float | None = Field(description="amplitude that the score suggests")
    visible_fraction: float | None = Field(
        description="share of its signature that no change of the parameters imitates"
    )
    smallest_detectable: float | None = Field(
        description="amplitude found with near certainty; null: none between its bounds"
    )
    strength_bias_if_missed: dict[str, float] = Field(
        description="parameter -> change [%] that it hides while it remains undetected"
    )
    resolved: bool | None = Field(description="a second seed has the same signature; null: untried")
    refit: Refit | None = Field(description="of the first round; null: it was not refitted")
    left_out: str = Field(description="why it was not tested: forbidden, ...; else empty")


class Confounding(StrictDocument):
    """Which candidates look alike to these measurements."""

    names: list[str] = Field(description="candidates, in the order of rows and columns")
    cosine: list[list[float]] = Field(
        description="of the signatures after the parameters have done what they can; |1|: the same"
    )


class Signature(StrictDocument):
    """What an effect of one amplitude changes, parameters unchanged and refitted."""

    name: str = Field(description="name of the effect")
    amplitude: float = Field(description="signed")
    change: list[float] = Field(description="of each measured number, in its unit")
    standardised: list[float] = Field(description="the same in total standard deviations")
    left_after_refit: list[float] = Field(
        description="what remains once the parameters have imitated it, in the same units"
    )


class Signatures(StrictDocument):
    """Fingerprints of the candidates at the base model's fit."""

    names: list[str] = Field(description="candidates")
    measurements: list[str] = Field(description="measured numbers, as the lists that follow")
    entries: list[Signature] = Field(description="one for each candidate and amplitude")


class MeasurementVerdict(StrictDocument):
    """One measured number against the base and the final model."""

    name: str = Field(description="name of the number")
    measurement: str = Field(description="name of the measurement it belongs to")
    axis: Literal["x_m", "time_s", "none"] = Field(description="what `place` is")
    place: float | None = Field(description="where or when along its series")
    unit: str = Field(description="m, or m/s")
    measured: float = Field(description="value")
    censored: bool = Field(False, description="`measured` is an upper limit that was not exceeded")
    std_total: float = Field(description="survey and model error together")
    std_survey: float = Field(description="of the survey, and what the model was granted")
    predicted_base: float | None = Field(description="by the base model")
    predicted_final: float | None = Field(description="by the final model")
    residual_base: float | None = Field(description="(measured - predicted) / std_total")
    residual_final: float | None = Field(description="the same for the final model")
    role: Role = Field(description="fitted, held out, compared or constructed")


class UnknownCurve(StrictDocument):
    """The strength curve that would explain the misfit. No strength is reported from it."""

    variable: str = Field(description="what the strength is made a function of")
    words: str = Field(description="the same in words")
    unit: str = Field(description="of the variable")
    knots: list[float] = Field(description="places of the coefficients")
    multiplier: list[float] = Field(description="of the strength, at the knots")
    low: list[float] = Field(description="16 % limit of the same")
    high: list[float] = Field(description="84 % limit of the same")
    chi2: dict[str, float] = Field(description="variable -> chi2 of its curve")
    ln_evidence: dict[str, float] = Field(description="variable -> gain over the model before")


class PredictedReading(StrictDocument):
    """What an explanation says that a measurement would read."""

    names: list[str] = Field(description="its effects; empty: the base model")
    values: list[float] = Field(description="of the measurement's numbers")
    std: list[float] = Field(description="of the difference to what is read")


class NextMeasurement(StrictDocument):
    """A measurement that would tell the surviving explanations apart."""

    name: str = Field(description="name of the number")
    words: str = Field(description="what, where or when, how well")
    gain: float = Field(
        description="expected separation by it and those before it, in squared standard deviations"
    )
    parts: list[str] = Field(
        default_factory=list, description="names of its numbers; empty: it has one"
    )
    unit: str = Field("", description="of its numbers")
    outcomes: list[PredictedReading] = Field(
        default_factory=list,
        description="by the explanations, the most probable first; empty in earlier files",
    )


class ValidationCase(StrictDocument):
    """The answer on a second section or event, which no fit has seen."""

    case: str = Field(description="name of the other case")
    n: int = Field(description="its measured numbers: the noise level of the chi2")
    chi2_base: float = Field(description="by the base model with the parameters found here")
    chi2_final: float = Field(description="by the model of the answer")


class Runs(StrictDocument):
    """Forward runs."""

    asked: int = Field(description="all that the diagnosis needed, kept ones included")
    computed: int | None = Field(
        description="of these, simulated now; null in a file, which is the same however often its "
        "making was interrupted: timing.json has it"
    )
    allowed: int = Field(description="the allowance")
    cut_short: list[str] = Field(description="what was left out because the allowance ran out")


class _Document(StrictDocument):
    """What all documents have."""

    case: str = Field(description="name of the case")
    title: str = Field(description="name in words")

    @model_validator(mode="before")
    @classmethod
    def _of_earlier_files(cls, raw: Any) -> Any:
        """In files of earlier versions the finding is a sentence as well."""
        return {k: v for k, v in raw.items() if k != "sentence"} if isinstance(raw, dict) else raw


class CompareDocument(_Document):
    """`compare.json`: is the base model adequate, and where does it fail?"""

    alarm: Literal["adequate", "suspect", "alarm"] = Field(description="by the combined p")
    parameters: list[ParameterWords] = Field(
        default_factory=list, description="what is calibrated, in words"
    )
    fitted_to: FittedTo | None = Field(
        None, description="which data, with which covariance; null in files of earlier versions"
    )
    base: FittedModelSummary = Field(description="the base model, calibrated")
    measurements: list[MeasurementVerdict] = Field(description="number by number")
    runs: Runs = Field(description="forward runs")


class ExplainDocument(_Document):
    """`explain.json`: ranked candidates, what looks alike, what could hide."""

    parameters: list[ParameterWords] = Field(
        default_factory=list, description="what is calibrated, in words"
    )
    base: FittedModelSummary = Field(description="the base model, calibrated")
    candidates: list[CandidateVerdict] = Field(description="best score first")
    confounding: Confounding = Field(description="which look alike")
    signatures: Signatures = Field(description="fingerprints")
    hidden: dict[str, dict[str, float]] = Field(
        description="parameter -> effect -> change [%] that it hides while undetected"
    )
    runs: Runs = Field(description="forward runs")


class Verdict(_Document):
    """The whole of `verdict.json`."""

    verdict: Verdicts = Field(description="among the effects tested")
    tested: list[str] = Field(description="effects that were tested")
    forbidden: list[str] = Field(description="effects that the engineer ruled out")
    answer: Answer = Field(description="effects of the answer, and the 90 % set")
    parameters: list[ParameterWords] = Field(
        default_factory=list, description="what is calibrated, in words"
    )
    fitted_to: FittedTo | None = Field(
        None, description="which data, with which covariance; null in files of earlier versions"
    )
    base: FittedModelSummary = Field(description="the base model")
    final: FittedModelSummary = Field(
        description="the model of the answer; the base model where there is none"
    )
    quoted: dict[str, QuotedValue] = Field(
        default_factory=dict,
        description="parameter -> what to use: of all explanations of the answer; where none "
        "explains, of all models that were tried, widened. Empty in files of earlier versions",
    )
    steps: list[WaterfallStep] = Field(description="every model that was adopted, in order")
    candidates: list[CandidateVerdict] = Field(description="best score first")
    confounding: Confounding = Field(description="which candidates look alike")
    signatures: Signatures = Field(description="fingerprints at the base model's fit")
    measurements: list[MeasurementVerdict] = Field(description="number by number")
    hidden: dict[str, dict[str, float]] = Field(
        description="parameter -> effect -> change [%] that it hides while undetected"
    )
    unknown_curve: UnknownCurve | None = Field(description="only where nothing in the list passes")
    next_measurement: list[NextMeasurement] = Field(description="best first")
    refutation: NextMeasurement | None = Field(
        None,
        description="by which the answer could be refuted; gain: mean separation from candidates, "
        "each at most 9; null: there is no answer, none is proposed, or an earlier file",
    )
    validation_case: ValidationCase | None = Field(
        None, description="on a second section or event; null: none was given"
    )
    runs: Runs = Field(description="forward runs")
    seconds: float | None = Field(description="wall time; null in a file: timing.json has it")
    hashes: dict[str, str] = Field(description="of what went in")
    manifest: dict[str, Any] = Field(description="settings, versions, seeds, machine, time")


def load_verdict(path: str | Path) -> Verdict:
    """Read a `verdict.json`, or the one in a folder.

    Raises:
        InputError: no such file, not JSON, or not of this schema; one line.
    """
    return load_document(Verdict, path, FILE_NAME)


def save_document(document: StrictDocument, path: str | Path) -> Path:
    """Write a verdict, a comparison or an explanation; the file appears when whole."""
    write_json(Path(path), document.model_dump(mode="json"))
    return Path(path)


def schema_text() -> str:
    """The JSON schema of a verdict, as text."""
    return document_schema(Verdict, "flowslide diagnosis")
