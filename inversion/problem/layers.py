"""Strengths that published relations give the layers of a section, from their blow counts.

In: a section and blow counts by zone. Out: one `Estimate` for a relation and some zones, at the
vertical effective stress of each (`geometry.scenes.overburden`); several layers that share a
strength count by their area.

A question may take its priors from a relation as well: `prior: {relation: weber_2015, n1_60: 12.9}`
of a residual strength is the relation's lognormal at the stress of the zones before failure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.case import Case
from geometry.scenes.fill import fill
from geometry.scenes.overburden import mean_and_deviation, stress_in_kpa
from geometry.scenes.polygon_checks import area
from geometry.scenes.scene import Scene
from geometry.survey.blow_counts import FILE_NAME, BlowCount
from inversion.catalogue.correlations import RELATIONS, Relation
from inversion.problem.question import ParameterSpec, Question
from pipeline.cli import InputError


@dataclass(frozen=True)
class Layer:
    """A zone of known blow count and stress.

    Attributes:
        zone: its name.
        area_m2: of its section.
        sigma_v0_kpa: its mean vertical effective stress before failure.
        count: its blow count.
    """

    zone: str
    area_m2: float
    sigma_v0_kpa: float
    count: BlowCount


@dataclass(frozen=True)
class Estimate:
    """A strength by a relation.

    Attributes:
        strength_kpa: median S_r; the mean over the layers, by area.
        weakest_kpa: of the layers.
        strongest_kpa: of the layers.
        log_std: standard deviation of its logarithm; the layers' scatter is one and the same.
        n1_60: mean blow count of the layers, by area, of the kind used.
        sigma_v0_kpa: mean stress of the layers, by area.
        beyond: some blow count lies beyond the data of the relation, and counts as their largest.
        other_kind: some layer has only the other kind of blow count (N1,60 for N1,60cs).
    """

    strength_kpa: float
    weakest_kpa: float
    strongest_kpa: float
    log_std: float
    n1_60: float
    sigma_v0_kpa: float
    beyond: bool
    other_kind: bool


def layers_of(
    scene: Scene, counts: Mapping[str, BlowCount], zones: Sequence[str], gravity: float
) -> list[Layer]:
    """The zones among `zones` that have a blow count, in their order; gravity [m/s2]."""
    if not any(zone in counts for zone in zones):
        return []
    counted = [zone for zone in zones if zone in counts]
    means = mean_stresses_kpa(scene, [[zone] for zone in counted], gravity)
    outlines = {zone.name: zone.polygon for zone in scene.zones}
    return [
        Layer(zone, area(outlines[zone]), mean, counts[zone])
        for zone, mean in zip(counted, means, strict=True)
    ]


def mean_stresses_kpa(scene: Scene, groups: Sequence[Sequence[str]], gravity: float) -> list[float]:
    """Mean vertical effective stress before failure of groups of zones, by the weight above [kPa].

    Args:
        scene: the section.
        groups: names of zones.
        gravity: [m/s2].
    """
    points = fill(scene)
    stress = stress_in_kpa(scene, points.position, points.volume, points.zone, gravity)
    means = []
    for group in groups:
        numbers = [number for number, zone in enumerate(scene.zones) if zone.name in group]
        own = np.isin(points.zone, numbers)
        means.append(mean_and_deviation(stress[own], points.volume[own])[0])
    return means


def estimate(relation: Relation, layers: Sequence[Layer]) -> Estimate:
    """The strength of one or more layers by a relation."""
    kind = relation.clean_sand
    counts = [layer.count.of_kind(kind) for layer in layers]
    weights = np.array([layer.area_m2 for layer in layers])
    pairs = [(n, layer.sigma_v0_kpa) for n, layer in zip(counts, layers, strict=True)]
    strengths = np.array([relation.strength(*pair) for pair in pairs])
    spread = strengths * [relation.log_std(*pair) for pair in pairs]
    strength = float(np.average(strengths, weights=weights))
    return Estimate(
        strength_kpa=strength,
        weakest_kpa=float(strengths.min()),
        strongest_kpa=float(strengths.max()),
        log_std=float(np.average(spread, weights=weights)) / strength,
        n1_60=float(np.average(counts, weights=weights)),
        sigma_v0_kpa=float(np.average([stress for _, stress in pairs], weights=weights)),
        beyond=any(relation.beyond(n) for n in counts),
        other_kind=any(layer.count.is_other_kind(kind) for layer in layers),
    )


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
    prior = spec.prior
    assert prior is not None and prior.relation is not None
    relation = RELATIONS[prior.relation]
    if prior.n1_60 is not None:
        stated = BlowCount(
            zones=spec.zones,
            n1_60=prior.n1_60,
            n1_60cs=prior.n1_60,
            confidence="assumed",
            source=source,
        )
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
