"""Priors that a question takes from a published relation, as means and standard deviations.

`prior: {relation: weber_2015, n1_60: 12.9}` of a residual strength is the relation's lognormal at
the vertical effective stress of the zones before failure.
"""

from __future__ import annotations

from collections.abc import Mapping

from geometry.case import Case
from geometry.scenes.scene import Scene
from geometry.survey.blow_counts import FILE_NAME, BlowCount
from inversion.catalogue.correlations import RELATIONS
from inversion.problem.layers import estimate, layers_of
from inversion.problem.question import ParameterSpec, Question
from pipeline.cli import InputError


def with_relation_priors(question: Question, case: Case, source: str) -> Question:
    """The question with every prior known.

    Args:
        question: of the case.
        case: at the spacing in force, with its blow counts.
        source: file of the question, for messages.

    Raises:
        InputError: no blow count for a zone, or a prior outside the bounds; one line.
    """
    gravity = case.simulation.gravity_m_per_s2
    known = [
        spec
        if spec.prior is None or spec.prior.known
        else _known(spec, case.scene, case.blow_counts, gravity, source)
        for spec in question.parameters
    ]
    return question.model_copy(update={"parameters": known})


def _known(
    spec: ParameterSpec,
    scene: Scene,
    counts: Mapping[str, BlowCount],
    gravity: float,
    source: str,
) -> ParameterSpec:
    where = f"{source}: parameters: {spec.name}: prior"
    prior, relation = spec.prior, RELATIONS[spec.prior.relation]
    if prior.n1_60 is not None:
        stated = BlowCount(
            zones=spec.zones, n1_60=prior.n1_60, n1_60cs=prior.n1_60, confidence="assumed",
            source=source,
        )  # fmt: skip
        counts = dict.fromkeys(spec.zones, stated)
    layers = layers_of(scene, counts, spec.zones, gravity)
    missing = [zone for zone in spec.zones if zone not in [layer.zone for layer in layers]]
    if missing:
        raise InputError(
            f"{where}: no blow count of zone {', '.join(missing)}; give n1_60 here, or the zone in "
            f"{FILE_NAME}"
        )
    found = estimate(relation, layers)
    if not spec.low <= found.strength_kpa <= spec.high:
        raise InputError(
            f"{where}: {relation.label} gives {found.strength_kpa:.3g} kPa at N {found.n1_60:.3g} "
            f"and sigma'_v0 {found.sigma_v0_kpa:.3g} kPa, outside low {spec.low:g} to high "
            f"{spec.high:g}"
        )
    update = {
        "mean": found.strength_kpa,
        "std": found.strength_kpa * found.log_std,
        "n1_60": found.n1_60,
        "sigma_v0_kpa": found.sigma_v0_kpa,
    }
    return spec.model_copy(update={"prior": prior.model_copy(update=update)})
