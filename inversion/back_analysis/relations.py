"""The strengths found next to those that published relations give for the case's blow counts."""

from __future__ import annotations

import numpy as np

from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.result import RelationAnswer
from inversion.catalogue.correlations import RELATIONS
from inversion.problem.layers import estimate, layers_of
from inversion.problem.question import RESIDUAL_STRENGTH


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
