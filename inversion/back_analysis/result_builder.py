"""Build `result.json` from a finished back-analysis, published relations beside its answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from geometry.scenes.doubts import thin_layers
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.case import InversionCase, WaterfallReading, of_waterfall
from inversion.back_analysis.perturbed_answers import EquivalentAnswer, Problem
from inversion.back_analysis.result import (
    Answer,
    Correlation,
    EquallyGood,
    Iteration,
    MeasurementAnswer,
    ParameterAnswer,
    RelationAnswer,
    SensitivityAnswer,
    Start,
    Undetermined,
    WaterfallBar,
    fitted_to,
)
from inversion.catalogue.correlations import RELATIONS
from inversion.estimation.forward import Prediction, SectionSetup, Setup
from inversion.estimation.misfit import (
    Objective,
    Posterior,
    direction_in_words,
    interval,
    lower_bound,
)
from inversion.estimation.search import Evaluation, SearchResult
from inversion.estimation.unknowns import Parameters
from inversion.problem.layers import estimate, layers_of
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO
from mpm_taichi.effects import effects_on
from pipeline.config import SimulationSettings

#: Source of the scatter over jitter seeds among the sources of uncertainty.
NOISE_SOURCE = "place of the material points"
#: The survey's own errors, and what the user grants the model, in a covariance.
SURVEY_ERRORS = "the survey's errors"


def ratios(prediction: Prediction, values: np.ndarray, parameters: Parameters) -> dict[str, float]:
    """Strength / sigma'_v0 by name, for the parameters that are strengths or such ratios."""
    if not len(prediction.sigma_v0_kpa):
        return {}
    with np.errstate(invalid="ignore", divide="ignore"):
        found = values / parameters.per_ratio(prediction.sigma_v0_kpa)
    return {
        name: float(ratio)
        for name, ratio in zip(parameters.names, found, strict=True)
        if np.isfinite(ratio)
    }


def iterations(evaluations: Sequence[Evaluation], objective: Objective) -> list[Iteration]:
    """The history."""
    return [
        Iteration(
            iteration=evaluation.iteration,
            kind=evaluation.kind,
            spacing_m=evaluation.prediction.spacing_m,
            accepted=evaluation.accepted,
            values=objective.parameters.as_mapping(evaluation.values),
            loss=evaluation.loss if np.isfinite(evaluation.loss) else None,
            predicted=objective.targets.named(evaluation.prediction.values),
            runs_so_far=evaluation.runs,
            seconds=round(evaluation.seconds, 3),
        )
        for evaluation in evaluations
    ]


def start_of(found: SearchResult, objective: Objective) -> Start:
    """One of several starts."""
    parameters = objective.parameters
    return Start(
        start=parameters.as_mapping(found.evaluations[0].values),
        answer=parameters.as_mapping(found.values),
        loss=found.best.loss,
        reached=found.reached,
        iterations=found.iterations,
        runs=found.runs,
        words=found.words,
        spacing_m=found.best.prediction.spacing_m,
    )


def measurements(objective: Objective, prediction: Prediction) -> list[MeasurementAnswer]:
    """Measured against predicted, one line for each number."""
    targets = objective.targets
    lines, counted = [], targets.counted(prediction.values)
    for place, group in enumerate(targets.groups):
        entry, value = targets.entries[group], prediction.values[place]
        if not np.isfinite(value):
            continue
        ends = entry.stated_range or (None, None)
        lines.append(
            MeasurementAnswer(
                name=targets.names[place],
                group=entry.name,
                type=entry.type,
                unit=entry.unit,
                measured=float(targets.measured[place]),
                censored=entry.censored,
                low=ends[0],
                high=ends[1],
                std=float(np.sqrt(targets.covariance[place, place])),
                predicted=float(value),
                predicted_at_start=float(np.nan_to_num(prediction.at_start[place])),
                difference_in_std=float(
                    (counted[place] - targets.measured[place])
                    / np.sqrt(targets.covariance[place, place])
                ),
                role=targets.roles[place],
                confidence=entry.confidence,
                source=entry.source,
                by_eye=prediction.by_eye.get(entry.name),
            )
        )
    return lines


def few_points(setup: Setup) -> list[str]:
    """Lines on liquefied layers of few rows of points; of a section alone."""
    return [*thin_layers(setup.scene)] if isinstance(setup, SectionSetup) else []


def simulated_with(setup: Setup) -> list[str]:
    """Lines on the effects that the scene has on; of a section alone."""
    active = effects_on(setup.scene) if isinstance(setup, SectionSetup) else ()
    return [f"simulated with {one.label}: {one.effect.words}" for one in active]


def doubts(prediction: Prediction, settings: SimulationSettings) -> list[str]:
    """Remarks on the answer's run: that it was cut off, what could not be read."""
    lines = []
    if not prediction.at_rest:
        lines.append(
            f"the slide still moved after {settings.duration_s:g} s, where the simulation ends; "
            "give the question a longer duration_s"
        )
    if prediction.status != "failed" and prediction.reason:
        lines.append(f"not read on the answer, and left out of the comparison: {prediction.reason}")
    return lines


def unknown_derivatives(parameters: Parameters, derivative: np.ndarray) -> list[str]:
    """Of each parameter without which no run came through that the data do not count for it."""
    return [
        f"{spec.words}: simulations near the answer failed, so what the data say of it is not "
        "known; its standard deviation is the one before the data"
        for spec, column in zip(parameters.specs, derivative.T, strict=True)
        if np.isnan(column).all()
    ]


def answer(
    case: Asked,
    objective: Objective,
    found: SearchResult,
    spread: Posterior,
    stops: Sequence[EquivalentAnswer],
    resolved: np.ndarray,
    sensitivities: Sequence[SensitivityAnswer],
    ratio_changes: Mapping[str, Mapping[str, float]],
    noise_std: Mapping[str, float],
    more_sources: Mapping[str, Mapping[str, float]] | None = None,
) -> Answer:
    """Put the answer together.

    Args:
        case: the case.
        objective: of the question.
        found: the search.
        spread: covariance from the survey's errors.
        stops: equally good answers.
        resolved: (p,) bool, the finite differences stood out of the noise.
        sensitivities: what else moves the answer.
        ratio_changes: source -> parameter -> change of strength / sigma'_v0 for one standard
            deviation.
        noise_std: parameter -> scatter over jitter seeds; empty: not measured.
        more_sources: source -> parameter -> standard deviation from it.
    """
    parameters, targets = objective.parameters, objective.targets
    sources = {
        name: {
            **{entry.name: entry.std[name] for entry in sensitivities if entry.kind != "target"},
            **({NOISE_SOURCE: noise_std[name]} if noise_std else {}),
            **{source: std[name] for source, std in (more_sources or {}).items()},
        }
        for name in parameters.names
    }
    total = np.array(
        [
            np.sqrt(std**2 + sum(value**2 for value in sources[name].values()))
            for name, std in zip(parameters.names, spread.std, strict=True)
        ]
    )
    evaluation = found.best
    errors = [] if objective.loss == "runout" else [SURVEY_ERRORS, *(more_sources or {})]
    return Answer(
        fitted_to=fitted_to(targets, targets.fitted, errors),
        parameters=_parameters(
            case,
            found,
            spread,
            total,
            sources,
            interval(parameters, found.values, total),
            ratio_changes,
            stops,
            objective.limit,
        ),
        loss=evaluation.loss,
        loss_unit=objective.unit,
        tolerance=objective.tolerance,
        reached=found.reached,
        method=case.config.inversion.method,
        words=found.words,
        correlation=Correlation(
            names=parameters.names, matrix=np.round(spread.correlation, 6).tolist()
        ),
        undetermined=[
            Undetermined(
                direction=parameters.as_mapping(direction),
                words=direction_in_words(parameters, direction),
                remaining=float(remaining),
            )
            for direction, remaining in zip(spread.flat, spread.remaining, strict=True)
        ],
        equally_good=[
            EquallyGood(
                along=stop.along,
                spacing_m=stop.prediction.spacing_m,
                values=parameters.as_mapping(stop.values),
                predicted=targets.named(stop.prediction.values, targets.fitted),
                loss=stop.loss,
                at_bound=bounded(parameters.names, parameters.at_bound(stop.values)),
            )
            for stop in stops
        ],
        derivative={
            name: parameters.as_mapping(np.nan_to_num(row))
            for name, row, wanted in zip(
                targets.names, evaluation.derivative, targets.shown, strict=True
            )
            if wanted and not np.all(np.isnan(row))
        },
        derivative_resolved=dict(zip(parameters.names, map(bool, resolved), strict=True)),
        steps=parameters.as_mapping(evaluation.steps),
    )


def waterfall_bar(reading: WaterfallReading, setup: Setup, solved: Problem) -> WaterfallBar:
    """A solved reading; `setup` with its one unknown."""
    return WaterfallBar(
        name=reading.name,
        words=reading.words,
        case=reading.case.name,
        spacing_m=setup.scene.spacing,
        value=float(solved.refined[0]),
        predicted=setup.targets.named(solved.prediction.values),
        loss=solved.loss,
        reached=solved.reached,
        at_bound=setup.parameters.at_bound(solved.values)[0],
    )


def last_bar(case: InversionCase, found: SearchResult, last: WaterfallReading) -> WaterfallBar:
    """The answer, after the last of the readings."""
    spacing, targets, place = case.scene.spacing, case.setup.targets, of_waterfall(case)
    other = last.setup.scene.changed(spacing=spacing) != case.scene
    other = other or last.setup.settings != case.simulation
    return WaterfallBar(
        name="all else" if other else f"points {spacing:g} m apart",
        words="as asked",
        case=case.name,
        spacing_m=spacing,
        value=float(found.values[place]),
        predicted=targets.named(found.best.prediction.values),
        loss=found.best.loss,
        reached=found.reached,
        at_bound=case.parameters.at_bound(found.values)[place],
    )


def bounded(names: Sequence[str], bounds: Sequence[str | None]) -> list[str]:
    """Names of the parameters that rest on a bound."""
    return [name for name, bound in zip(names, bounds, strict=True) if bound]


def _parameters(
    case: Asked,
    found: SearchResult,
    spread: Posterior,
    total: np.ndarray,
    sources: Mapping[str, Mapping[str, float]],
    intervals: list[tuple[float, float]],
    ratio_changes: Mapping[str, Mapping[str, float]],
    stops: Sequence[EquivalentAnswer],
    limit: bool,
) -> list[ParameterAnswer]:
    parameters = case.parameters
    prediction = found.best.prediction
    ratio = ratios(prediction, found.values, parameters)
    per = parameters.per_ratio(prediction.sigma_v0_kpa) if ratio else np.array([])
    before = parameters.prior_std * np.where(parameters.logarithmic, found.values, 1.0)
    good = np.array([found.values, *[stop.values for stop in stops]])
    lines = []
    for place, spec in enumerate(parameters.specs):
        sigma = sigma_std = ratio_std = bound = ratio_bound = None
        strength: dict[str, float] = {}
        if spec.name in ratio:
            sigma = float(prediction.sigma_v0_kpa[place])
            sigma_std = float(prediction.sigma_v0_std_kpa[place])
            own = spread.std[place] / per[place]
            changes = [change.get(spec.name, 0.0) for change in ratio_changes.values()]
            ratio_std = float(np.sqrt(own**2 + sum(c**2 for c in changes)))
            if spec.property == STRENGTH_RATIO:
                strength = meant_strength(float(found.values[place]), float(total[place]), sigma)
        if limit and parameters.strengths[place]:
            bound = lower_bound(float(found.values[place]), float(total[place]))
            intervals[place] = (max(bound, spec.low), spec.high)
            if bound and ratio_std is not None:
                ratio_bound = lower_bound(ratio[spec.name], ratio_std)
        lines.append(
            ParameterAnswer(
                name=spec.name,
                label=spec.words,
                zones=spec.zones,
                property=spec.property,
                unit=spec.unit,
                value=float(found.values[place]),
                start=spec.start,
                low=spec.low,
                high=spec.high,
                std_data=float(spread.std[place]),
                std_by_source=dict(sources[spec.name]),
                std_total=float(total[place]),
                interval_95=intervals[place],
                equally_good_range=(
                    (float(good[:, place].min()), float(good[:, place].max())) if stops else None
                ),
                at_bound=parameters.at_bound(found.values)[place],
                determined=bool(spread.determined[place]),
                prior_std=float(before[place]),
                has_prior=spec.prior is not None,
                sigma_v0_kpa=sigma,
                sigma_v0_std_kpa=sigma_std,
                ratio=ratio.get(spec.name),
                ratio_std=ratio_std,
                lower_bound_95=bound,
                ratio_lower_bound_95=ratio_bound,
                **strength,
            )
        )
    return lines


def meant_strength(ratio: float, std: float, sigma_v0_kpa: float) -> dict[str, float]:
    """The mean S_r that a strength ratio means, as the fields of a `ParameterAnswer`.

    Args:
        ratio: S_r / sigma'_v0.
        std: its standard deviation.
        sigma_v0_kpa: mean over the zones [kPa].
    """
    return {"strength_kpa": ratio * sigma_v0_kpa, "strength_std_kpa": std * sigma_v0_kpa}


def compared_relations(case: InversionCase) -> list[RelationAnswer]:
    """Every relation for each residual strength whose zones have a blow count; else empty."""
    found, gravity = [], case.simulation.gravity_m_per_s2
    for spec in case.parameters.specs:
        if spec.property != RESIDUAL_STRENGTH:
            continue
        layers = layers_of(case.scene, case.blow_counts, spec.zones, gravity)
        for relation in RELATIONS.values() if layers else ():
            one = estimate(relation, layers)
            low, high = one.strength_kpa * np.exp([-one.log_std, one.log_std])
            found.append(
                RelationAnswer(
                    parameter=spec.name,
                    relation=relation.name,
                    label=relation.label,
                    zones=[layer.zone for layer in layers],
                    n1_60=one.n1_60,
                    n1_60_of_zones={
                        layer.zone: layer.count.of_kind(relation.clean_sand) for layer in layers
                    },
                    clean_sand=relation.clean_sand,
                    other_kind=one.other_kind,
                    beyond=one.beyond,
                    confidence=sorted({layer.count.confidence for layer in layers}),
                    sigma_v0_kpa=one.sigma_v0_kpa,
                    value_kpa=one.strength_kpa,
                    weakest_kpa=one.weakest_kpa,
                    strongest_kpa=one.strongest_kpa,
                    low_kpa=float(low),
                    high_kpa=float(high),
                    scatter=relation.scatter_words,
                )
            )
    return found
