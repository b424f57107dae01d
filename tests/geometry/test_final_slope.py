"""How steep the slid soil lies: planted slopes, and those of a slide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.final_slope import FinalSlope, crest_edge
from geometry.survey.measured import Deposit
from geometry.survey.registry import measurement_of
from mpm_taichi.simulate import simulate
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.geometry.test_heave_and_slip import differences

ABOUT = {"confidence": "assumed", "source": "a test", "std_deg": 1.0}
HEIGHT, EDGE = 10.0, 30.0
SETTINGS = SimulationSettings(duration_s=10.0)


def slope_of(side="left", value=5.0) -> FinalSlope:
    return measurement_of(
        {"name": "slope", "type": "final_slope", "side": side, "value_deg": value, **ABOUT}
    )


def bank(side: str = "left", cohesion: float = 6.0, tilt: float = 0.0):
    """A bank with a face of 1 in 1 on one side, on a base that rises towards it."""
    mirror = 1.0 if side == "left" else -1.0
    foot = EDGE - HEIGHT
    outline = [(foot, tilt * foot), (80.0, tilt * 80.0), (80.0, HEIGHT), (EDGE, HEIGHT)]
    soil = {
        "friction_deg": 0.0, "cohesion_kpa": cohesion, "density": 1900.0, "youngs_modulus_mpa": 5.0,
        "liquefied": True,
    }  # fmt: skip
    base = [[mirror * x, tilt * x] for x in (-60.0, 80.0)]
    ends = sorted((mirror * -60.0, mirror * 80.0))
    return scene_from_mapping(
        {
            "name": "bank", "spacing": 0.5, "materials": {"silt": soil},
            "domain": {"x_min": ends[0], "x_max": ends[1], "y_max": 20.0},
            "ground": {"points": sorted(base), "contact": "rough"},
            "zones": [{"name": "bank", "material": "silt",
                       "polygon": [[mirror * x, y] for x, y in outline]}],
        },
        "bank",
    )  # fmt: skip


def deposit_of(scene, points, volume, side: str, moved=None) -> Deposit:
    mirror = 1.0 if side == "left" else -1.0
    foot = {"left": EDGE - HEIGHT, "right": 80.0}
    feet = foot if side == "left" else {"left": -80.0, "right": mirror * foot["left"]}
    return Deposit.on(scene, feet, points if moved is None else moved, points, volume)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("flat", [4.0, 8.0, 20.0])
def test_a_planted_slope_is_read(side, flat):
    """Soil that fills a triangle below a line through the crest's edge of before."""
    scene = bank(side)
    before = fill(scene)
    mirror = 1.0 if side == "left" else -1.0
    step, left = 0.5, 0.6 * HEIGHT
    x, y = np.meshgrid(np.arange(-120.0, 80.0, step), np.arange(0.0, HEIGHT, step))
    line = left + (x - EDGE) / flat
    inside = (y < np.minimum(line, left)) & (x < 80.0)
    after = np.stack([mirror * (x[inside] + 0.25), y[inside] + 0.25], axis=1)
    now = Deposit(
        position=after,
        initial_position=before.position,
        volume=np.full(len(after), step**2),
        spacing=step,
        foot={"left": EDGE - HEIGHT, "right": 10.0 - EDGE},
        ground=0.0,
        initial_volume=before.volume,
    )
    entry = slope_of(side)
    read = entry.observe(now)[0]
    edge = crest_edge(now.before, side)
    assert mirror * edge == pytest.approx(EDGE - 0.1 * HEIGHT, abs=0.5)
    assert 1.0 / math.tan(math.radians(read)) == pytest.approx(flat, rel=0.1)


@pytest.mark.slow
def test_weaker_soil_lies_flatter_and_the_derivative_is_that_of_differences():
    slopes = []
    for cohesion in (4.0, 8.0, 12.0):
        scene = bank(cohesion=cohesion, tilt=0.02)
        (run,) = simulate([scene], SETTINGS, threads=1)
        start, end = run.positions[[0, -1]].astype(float)
        moved = deposit_of(scene, start, run.initial_volume.astype(float), "left", end)
        slopes.append(slope_of().observe(moved)[0])
        told, found = differences(slope_of(), moved)
        assert told == pytest.approx(found, rel=1e-4)
    assert 0.0 < slopes[0] < slopes[1] < slopes[2]


def test_what_cannot_be_is_refused_in_one_line():
    scene = bank()
    with pytest.raises(InputError, match="value_deg 70: slid soil lies flatter"):
        slope_of(value=70.0).check_in(scene, {}, "slope")
    points = fill(scene)
    gone = deposit_of(scene, points.position, points.volume, "left", points.position + [300.0, 0.0])
    assert "no soil is left" in slope_of().reading(gone).trouble
