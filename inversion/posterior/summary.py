"""A posterior that was found, as a document and as draws.

What moves a strength are shares of its posterior variance, after Sobol. With Y the logarithm of the
strength (of another parameter: its value) and X_i the other unknowns and the errors of the fitted
measurements, all of them posterior draws,

    first order  S_i = Var(E[Y | X_i]) / Var(Y),
    total        T_i = 1 - Var(E[Y | all but X_i]) / Var(Y):

the share of the variance that would go if X_i became known, and the share that would stay if
everything else did (Sobol 1993; for inputs that depend on each other Kucherenko et al. 2012). The
conditional means are polynomials fitted to the draws: cubic in one input, quadratic in all.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.dimensions.stated import SlideDimensions
from inversion import PHYSICS_VERSION
from inversion.back_analysis.asked import Asked
from inversion.engines.small_cells import NAME as CELLS
from inversion.estimation.forward import SectionSetup
from inversion.posterior.confirmation import confirmed
from inversion.posterior.document import (
    FILE_NAME,
    Evidence,
    PosteriorDocument,
    PredictedNumber,
    RunCounts,
    SobolShare,
    Spread,
    UnknownAnswer,
)
from inversion.posterior.draws import FILE_NAME as DRAWS
from inversion.posterior.draws import Draws, save_draws
from inversion.posterior.emulator import Emulated
from inversion.posterior.infer import Inferred
from inversion.posterior.runs import CaseModel, stress_name
from inversion.problem.question import STRENGTH_RATIO
from inversion.problem.unknown import Unknown
from mpm_taichi import PHYSICS_VERSION as SOLVER_VERSION
from pipeline.files import write_json
from pipeline.manifest import manifest
from pipeline.ties import ranked
from pipeline.units import with_signs

DIGITS = 5
#: Directions in which the errors of a map count: a surface moves as a whole.
COMPONENTS = 3
#: Standard deviations of the prior between the means of prior and posterior: three are chance
#: once in 370 parameters.
DISAGREE = 3.0


def save_all(
    found: Inferred[CaseModel], folder: Path, solver: CaseModel | None = None
) -> PosteriorDocument:
    """Write `posterior.json` and `posterior.nc`.

    Args:
        found: the posterior.
        folder: of the files.
        solver: the same case by the engine that judges the others, which runs at some draws; None:
            it has found the posterior itself.
    """
    document = document_of(found)
    if solver is not None and (runs := found.inference.settings.confirming_runs):
        numbers, lines = confirmed(found, solver, runs)
        remarks = [*document.remarks, *lines]
        document = document.model_copy(update={"confirmation": numbers, "remarks": remarks})
    write_json(folder / FILE_NAME, document.model_dump(mode="json"))
    save_draws(draws_of(found), folder / DRAWS)
    return document


def draws_of(found: Inferred[CaseModel]) -> Draws:
    """The draws of a posterior."""
    inference, targets = found.inference, found.inference.targets
    case = inference.model.varied.case
    return Draws(
        unknowns=[one.name for one in inference.unknowns],
        posterior=found.told,
        prior=found.prior,
        numbers=inference.names,
        posterior_predictive=found.replicated(),
        prior_predictive=found.replicated(prior=True),
        log_likelihood=found.likelihood(found.values),
        observed={
            name: float(value)
            for name, value in zip(targets.names, targets.measured, strict=True)
            if name in inference.names
        },
        facts={
            "case": case.name,
            "log_evidence": found.sampled.log_evidence,
            "log_evidence_std": found.sampled.log_evidence_std,
            "seed": inference.settings.seed,
        },
    )


def document_of(found: Inferred[CaseModel]) -> PosteriorDocument:
    """The summary of a posterior."""
    inference, sampled = found.inference, found.sampled
    model = inference.model
    case = model.varied.case
    return PosteriorDocument(
        case=case.name,
        title=case.title,
        measurement_set=case.measurement_set,
        engine=model.engine.name,
        spacing_m=case.spacing_m,
        coarse_spacing_m=case.coarse_spacing_m,
        physics={"mpm": SOLVER_VERSION, "inversion": PHYSICS_VERSION},
        settings=inference.settings.model_dump(),
        unknowns=[_unknown(found, place) for place in range(len(inference.unknowns))],
        numbers=_numbers(found),
        other_ways={
            name: {
                number: _round(value) for number, value in zip(inference.names, change, strict=True)
            }
            for name, change in inference.otherwise.items()
        },
        small_cells=inference.cells,
        section=_stated_section(case),
        correlation=[[_round(r) for r in row] for row in _correlation(found.told)],
        evidence=Evidence(
            log_evidence=_round(sampled.log_evidence),
            log_evidence_std=_round(sampled.log_evidence_std),
            information_nats=_round(sampled.information),
        ),
        runs=RunCounts(
            coarse=inference.settings.coarse_runs,
            refined=inference.settings.refined_runs,
            fine=int(np.isfinite(inference.fine).any(axis=1).sum()),
            other_ways=len(inference.otherwise),
            failed=model.unread,
            simulated_now=model.store.computed,
        ),
        remarks=[
            *model.varied.remarks,
            *model.remarks,
            *coarse_remarks(found),
            *prior_remarks(found),
            *inference.remarks,
            *(f"{name}: too few runs could be read; left out" for name in inference.unread),
        ],
        timings={name: round(time, 2) for name, time in inference.timings.items()},
        manifest=manifest(case.config, seeds={"posterior": inference.settings.seed}),
    )


def _stated_section(case: Asked) -> SlideDimensions | None:
    """What is stated of a section that nobody drew; None: it was drawn."""
    setup = case.setup
    family = setup.family if isinstance(setup, SectionSetup) else None
    return None if family is None else family.stated


def spread(draws: np.ndarray) -> Spread:
    """Of draws (s,)."""
    low, lower, median, upper, high = np.percentile(draws, (2.5, 25, 50, 75, 97.5))
    return Spread(
        mean=_round(draws.mean()),
        std=_round(draws.std()),
        median=_round(median),
        interval_50=(_round(lower), _round(upper)),
        interval_95=(_round(low), _round(high)),
    )


def coarse_remarks(found: Inferred[CaseModel]) -> list[str]:
    """Fitted numbers that the emulator knows less well than the survey does."""
    inference, targets = found.inference, found.inference.targets
    remarks = []
    more = "posterior.refined_runs"
    if inference.model.two_fidelities:
        more = "posterior.fine_runs, or inversion.coarse_factor: 1,"
    for number in np.flatnonzero(targets.fitted):
        name = targets.names[number]
        error = found.emulator_error[inference.names.index(name)]
        survey = float(np.sqrt(targets.covariance[number, number]))
        if error > survey:
            remarks.append(
                f"{name}: the emulator's error of {error:.2g} exceeds the survey's {survey:.2g} "
                f"and widens the posterior; more {more} may make it smaller, unless single runs "
                "scatter as much"
            )
    return remarks


def prior_remarks(found: Inferred[CaseModel]) -> list[str]:
    """Unknowns that the data move so far from their prior that one of the two must be wrong."""
    remarks = []
    for place, unknown in enumerate(found.inference.unknowns):
        before, after = found.prior[:, place], found.told[:, place]
        apart = abs(after.mean() - before.mean()) / max(before.std(), 1e-300)
        if apart > DISAGREE:
            remarks.append(
                f"{unknown.label}: the measurements and its prior disagree: "
                f"{after.mean():.4g} ± {after.std():.2g} {with_signs(unknown.unit)} with the "
                f"measurements, {before.mean():.4g} ± {before.std():.2g} without, "
                f"{apart:.1f} standard deviations of the prior apart; "
                "one of the two, or the section, is wrong"
            )
    return remarks


def _unknown(found: Inferred[CaseModel], place: int) -> UnknownAnswer:
    inference = found.inference
    unknown, model = inference.unknowns[place], inference.model
    before, after = found.prior[:, place], found.told[:, place]
    is_parameter = place < model.varied.parameters
    spec = model.varied.case.parameters.specs[place] if is_parameter else None
    ratio = strength = None
    if (stress := stress_name(unknown.name)) in inference.names:
        sigma = found.replicated()[:, inference.names.index(stress)]
        if spec is not None and spec.property == STRENGTH_RATIO:
            ratio, strength = spread(after), spread(after * sigma)
        else:
            ratio = spread(after / sigma)
    left = float(np.var(unknown.counts(after)) / max(np.var(unknown.counts(before)), 1e-300))
    return UnknownAnswer(
        name=unknown.name,
        label=unknown.label,
        kind="parameter" if is_parameter else "nuisance",
        property="" if spec is None else spec.property,
        zones=[] if spec is None else list(spec.zones),
        dimension="" if is_parameter else model.varied.dimension_of(place),
        unit=unknown.unit,
        prior=_prior_words(unknown),
        before=spread(before),
        after=spread(after),
        ratio=ratio,
        strength_kpa=strength,
        narrowed=_round(max(1.0 - left, 0.0)),
        sobol=_sobol(found, place) if is_parameter else [],
    )


def _sobol(found: Inferred[CaseModel], place: int) -> list[SobolShare]:
    """Shares of a parameter's variance, by the other unknowns and the errors of what was fitted."""
    inference, targets = found.inference, found.inference.targets
    unknowns, names = inference.unknowns, inference.names
    values = np.stack([one.counts(found.told[:, k]) for k, one in enumerate(unknowns)], axis=1)
    inputs = [np.delete(values, place, axis=1)]
    labels = [one.name for k, one in enumerate(unknowns) if k != place]
    if inference.cells is not None and unknowns[place].strength:
        ran = unknowns[place].counts(found.values[:, place])
        inputs.append((values[:, place] - ran)[:, None])
        labels.append(CELLS)
    known, groups = targets.fitted & ~targets.censored, np.array(targets.groups)
    for group, entry in enumerate(targets.entries):
        own = np.flatnonzero(known & (groups == group))
        columns = [names.index(targets.names[number]) for number in own]
        errors = targets.measured[own] - found.predicted[:, columns]
        if entry.as_one and len(own) > COMPONENTS:
            inputs.append(principal(errors, COMPONENTS))
            labels += [f"errors of {entry.name}"] * COMPONENTS
        else:
            inputs.append(errors)
            labels += [f"errors of {targets.names[number]}" for number in own]
    return [
        SobolShare(name=one.name, first=_round(one.first), total=_round(one.total))
        for one in shares(values[:, place], np.hstack(inputs), labels)
    ]


def _numbers(found: Inferred[CaseModel]) -> list[PredictedNumber]:
    inference, targets = found.inference, found.inference.targets
    names, emulator = inference.names, found.likelihood.emulator
    before, after = found.replicated(prior=True), found.replicated()
    random = np.random.default_rng([inference.settings.seed, 9])
    made = []
    for place, name in enumerate(targets.names):
        if name not in names:
            continue
        column = names.index(name)
        std = float(np.sqrt(targets.covariance[place, place]))
        measured, number = float(targets.measured[place]), emulator.numbers[column]
        surveyed = after[:, column] + std * random.standard_normal(len(after))
        correction = _correction(inference.coarse[:, column], inference.fine[:, column])
        made.append(
            PredictedNumber(
                name=name,
                group=targets.entries[targets.groups[place]].name,
                unit=targets.entries[targets.groups[place]].unit,
                role=targets.roles[place],
                measured=measured,
                censored=bool(targets.censored[place]),
                std=_round(std),
                before=spread(before[:, column]),
                after=spread(after[:, column]),
                difference_in_std=_round(
                    (measured - after[:, column].mean()) / np.hypot(after[:, column].std(), std)
                ),
                share_below=_round(np.mean(surveyed < measured)),
                left_out_std=_round(_left_out(number, inference.settings.coarse_runs)),
                correction=None if correction is None else _round(correction[0]),
                correction_std=None if correction is None else _round(correction[1]),
            )
        )
    return made


def _left_out(number: Emulated, first: int) -> float:
    """Root mean square of left-out errors, of the refined runs where there are any."""
    errors, late = number.left_out(), number.runs >= first
    return float(np.sqrt(np.mean(errors[late if late.any() else slice(None)] ** 2)))


def _correction(coarse: np.ndarray, fine: np.ndarray) -> tuple[float, float] | None:
    """Mean and standard deviation of fine less coarse numbers; None: no pairs."""
    difference = (fine - coarse)[np.isfinite(fine - coarse)]
    return (float(difference.mean()), float(difference.std())) if len(difference) else None


def _prior_words(unknown: Unknown) -> str:
    words = _distribution_words(unknown)
    return f"{words}; {unknown.source}" if unknown.source else words


def _distribution_words(unknown: Unknown) -> str:
    cut = f"{unknown.low:.3g} to {unknown.high:.3g}"
    if unknown.normal is None:
        return f"{'ln ' * unknown.logarithmic}uniform, {cut}"
    mean, std = unknown.normal
    if unknown.logarithmic:
        return f"lognormal, median {np.exp(mean):.3g}, ln std {std:.2g}, {cut}"
    return f"normal, {mean:.3g} ± {std:.3g}, {cut}"


def _correlation(values: np.ndarray) -> np.ndarray:
    deviation = values - values.mean(axis=0)
    scale = np.maximum(deviation.std(axis=0), 1e-12)
    return (deviation / scale).T @ (deviation / scale) / len(values)


def _round(value: float | np.floating[Any]) -> float:
    return round(float(value), DIGITS)


@dataclass(frozen=True)
class Share:
    """Shares of one input, S_i and T_i."""

    name: str
    first: float
    total: float


def shares(output: np.ndarray, inputs: np.ndarray, names: list[str]) -> list[Share]:
    """Shares of the variance of an output (s,) by inputs (s, i), the largest total first.

    Columns of the same name are one input.
    """
    spread = inputs.std(axis=0)
    moving = spread > 1e-12
    x = (inputs[:, moving] - inputs[:, moving].mean(axis=0)) / spread[moving]
    left = np.array(names)[moving]
    found, everything = [], explained(output, _quadratic(x))
    for name in dict.fromkeys(left):
        own = left == name
        powers = [x[:, own] ** power for power in range(1, 4)]
        alone = explained(output, np.hstack([np.ones((len(x), 1)), *powers]))
        others = explained(output, _quadratic(x[:, ~own]))
        # What no input explains is nobody's: the total is what this one adds to the others.
        found.append(Share(str(name), alone, max(everything - others, 0.0)))
    return ranked(found, lambda share: share.total)


def explained(output: np.ndarray, features: np.ndarray) -> float:
    """Share of the variance of an output (s,) that a linear function of features (s, f) has.

    Less what as many features without a meaning would explain by chance.
    """
    count, rank = features.shape[0], features.shape[1]
    coefficients, *_ = np.linalg.lstsq(features, output, rcond=None)
    left = np.var(output - features @ coefficients) / max(np.var(output), 1e-300)
    return float(np.clip(1.0 - left * (count - 1) / max(count - rank, 1), 0.0, 1.0))


def principal(errors: np.ndarray, count: int) -> np.ndarray:
    """Leading principal components (s, count) of errors (s, n) that hang together."""
    left, size, _ = np.linalg.svd(errors - errors.mean(axis=0), full_matrices=False)
    return left[:, :count] * size[:count]


def _quadratic(x: np.ndarray) -> np.ndarray:
    """1, x_i, x_i x_j of inputs (s, i)."""
    rows, columns = np.triu_indices(x.shape[1])
    return np.hstack([np.ones((len(x), 1)), x, x[:, rows] * x[:, columns]])
