"""Reconsolidation: strength of a point in time, and a slump that stops early."""

import numpy as np
import pytest

from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear


@pytest.mark.parametrize(("time", "gained"), [(0.0, 0.0), (2.5, 0.5), (10.0, 1.0), (40.0, 2.0)])
def test_strength_is_regained_with_the_root_of_time(time, gained):
    for liquefied, reference in ((True, 10.0), (True, 2.5), (False, 10.0)):
        soil = Soil(cohesion=10e3, liquefied=liquefied)
        path = lead("reconsolidation", 0.6, soil, pure_shear(1.0, 1), 1e-6, start_time=time,
                    reference_s=reference)  # fmt: skip
        share = 0.6 * gained * np.sqrt(10.0 / reference) if liquefied else 0.0
        assert 0.5 * path.strength[-1, 1] == pytest.approx(10e3 * (1.0 + share), rel=1e-5)


def test_a_slump_that_regains_strength_stops_early_and_near():
    settings = SimulationSettings(duration_s=30.0)
    plain, stiffer = simulate([slump({}), slump({"reconsolidation": 1.0})], settings, threads=1)
    assert plain.status == stiffer.status == "finished"
    ways = [np.abs(run.positions - run.positions[0]).mean(axis=(1, 2)) for run in (plain, stiffer)]
    assert ways[1][-1] < 0.9 * ways[0][-1]
    ends = [
        float(run.time[np.argmax(way > 0.95 * way[-1])])
        for run, way in zip((plain, stiffer), ways, strict=True)
    ]
    assert ends[1] < ends[0]
    assert "no material is marked" in effect("reconsolidation").applies(
        slump({}).changed(
            materials={
                name: one.model_dump() | {"liquefied": False}
                for name, one in slump({}).materials.items()
            }
        )
    )
