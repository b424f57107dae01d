"""What the score needs of a verdict: small enough to be kept for every case of a benchmark."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, model_validator

from diagnosis.verdict.verdict import FittedModelSummary, Verdict, Verdicts
from pipeline.config import validate_settings
from pipeline.documents import StrictDocument
from pipeline.files import read_json

#: Significant digits that are kept.
DIGITS = 5
#: The variant of a verdict that every case has: no ablation.
METHOD = "method"


class StageDigest(StrictDocument):
    """One calibrated model."""

    values: dict[str, float] = Field(description="parameters by name, outside units")
    std: dict[str, float] = Field(description="their standard deviations")
    chi2: float = Field(description="fitted data and priors")
    dof: int = Field(description="degrees of freedom")
    p: float = Field(description="combined p of its tests")
    held_out_chi2: float = Field(description="on data that no fit has seen")
    held_out_n: int = Field(description="how many they are")


class CurveDigest(StrictDocument):
    """The curve of an unknown effect."""

    variable: str = Field(description="what the strength depends on")
    knots: list[float] = Field(min_length=1, description="places")
    multiplier: list[float] = Field(description="of the strength there")

    @model_validator(mode="after")
    def _one_at_each_place(self) -> CurveDigest:
        if len(self.multiplier) != len(self.knots):
            raise ValueError(f"multiplier: {len(self.multiplier)} for {len(self.knots)} knots")
        return self


class WindowDigest(StrictDocument):
    """Where and when the base model fails worst."""

    measurement: str = Field(description="a series: the profile, or the toe in time")
    begin: float = Field(description="first place in it [m or s]")
    end: float = Field(description="last place in it")
    p: float = Field(description="that noise has anywhere a stretch as bad")


class Digest(StrictDocument):
    """A verdict, short."""

    case: str = Field(description="name of the case")
    verdict: Verdicts = Field(description="one of five")
    effects: dict[str, float] = Field(description="amplitudes of the answer, by name")
    set_90: list[list[str]] = Field(description="explanations of the 90 % set, best first")
    would_explain: bool = Field(
        False, description="the answer explains, and its chance is too small for it to be given"
    )
    shares: list[float] = Field(
        default_factory=list, description="their probabilities; empty in earlier records"
    )
    quoted: dict[str, dict[str, tuple[float, float]]] = Field(
        default_factory=dict,
        description="parameter -> level -> interval that is quoted; empty in earlier records",
    )
    beyond: dict[str, float] = Field(
        default_factory=dict,
        description="parameter -> of its standard deviation, for what no list holds; 0 before",
    )
    families: list[str] = Field(
        default_factory=list, description="of the answer, where its members look alike; else empty"
    )
    members: list[str] = Field(default_factory=list, description="of these families, best first")
    family_of: dict[str, str] = Field(
        default_factory=dict, description="effect of the answer -> its family"
    )
    base: StageDigest = Field(description="the base model")
    final: StageDigest = Field(description="the model of the answer")
    nearest: dict[str, float] = Field(description="candidate -> its largest |cosine| to a rival")
    scores: dict[str, float] = Field(description="candidate -> z, the best few")
    curve: CurveDigest | None = Field(description="where the effect is unknown")
    window: WindowDigest | None = Field(
        None, description="of the base model; null: no series, or an earlier record"
    )
    runs: int = Field(description="forward runs asked for")
    cut_short: list[str] = Field(description="what the allowance did not cover")
    seconds: float = Field(description="wall time")


def digest_of(verdict: Verdict) -> Digest:
    """The digest of a verdict."""
    names, cosine = verdict.confounding.names, verdict.confounding.cosine
    nearest = {
        name: max((abs(c) for k, c in enumerate(cosine[row]) if k != row), default=0.0)
        for row, name in enumerate(names)
    }
    scored = [c for c in verdict.candidates if c.z is not None]
    best = sorted(scored, key=lambda c: -(c.expected_drop or 0.0))[:6]
    curve = verdict.unknown_curve
    return Digest(
        case=verdict.case,
        verdict=verdict.verdict,
        effects={one.name: _short(one.amplitude) for one in verdict.answer.effects},
        set_90=[one.names for one in verdict.answer.set_90],
        would_explain=verdict.answer.would_explain,
        shares=[_short(one.probability) for one in verdict.answer.set_90],
        quoted={
            name: {level: (_short(a), _short(b)) for level, (a, b) in used.intervals.items()}
            for name, used in verdict.quoted.items()
        },
        beyond={name: used.beyond for name, used in verdict.quoted.items() if used.beyond},
        families=list(verdict.answer.families),
        members=verdict.answer.members,
        family_of={
            one.name: one.family
            for one in verdict.candidates
            if one.name in {effect.name for effect in verdict.answer.effects}
        },
        base=_stage(verdict.base),
        final=_stage(verdict.final),
        nearest={name: _short(value) for name, value in nearest.items()},
        scores={c.name: _short(c.z) for c in best if c.z is not None},
        curve=None
        if curve is None
        else CurveDigest(
            variable=curve.variable,
            knots=[_short(v) for v in curve.knots],
            multiplier=[_short(v) for v in curve.multiplier],
        ),
        window=_window(verdict.base),
        runs=verdict.runs.asked,
        cut_short=verdict.runs.cut_short,
        seconds=round(verdict.seconds or 0.0, 2),
    )


def load_digest(path: str | Path) -> Digest:
    """Read a digest.

    Raises:
        InputError: no such file, or not of this form; one line.
    """
    return validate_settings(Digest, read_json(path), origin=str(path))


def _stage(stage: FittedModelSummary) -> StageDigest:
    return StageDigest(
        values={name: _short(value) for name, value in stage.values.items()},
        std={name: _short(value) for name, value in stage.std.items()},
        chi2=_short(stage.chi2),
        dof=stage.dof,
        p=_short(stage.p_combined),
        held_out_chi2=_short(stage.held_out.chi2),
        held_out_n=stage.held_out.n,
    )


def _window(stage: FittedModelSummary) -> WindowDigest | None:
    found = stage.window
    if found is None or found.x_from is None or found.x_to is None:
        return None
    return WindowDigest(
        measurement=found.measurement, begin=found.x_from, end=found.x_to, p=_short(found.p)
    )


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
