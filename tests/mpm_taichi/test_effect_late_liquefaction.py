"""Liquefaction late or spreading: strength of a point in time, the front, and a slump."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects.spreading_liquefaction import distance, sources
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import prepare
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import SHORT, slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SOIL = Soil(cohesion=10e3, liquefied=True)
DEFAULT = {"from_x_m": 1e6, "front_length_m": 2.0, "peak_ratio": 3.0, "peak_friction_deg": 0.0}


def strength_at(name, amplitude, time, soil=SOIL, **numbers):
    """sin(phi) and undrained strength [Pa] of a point."""
    if name == "late_liquefaction":
        numbers = {"field": 1.0} | numbers  # of the zone that is late
    path = lead(name, amplitude, soil, pure_shear(1.0, 1), 1e-6, start_time=time, **numbers)
    return path.strength[-1, 0], 0.5 * path.strength[-1, 1]


# --- late ---


@pytest.mark.parametrize(
    ("time", "left"), [(0.0, 1.0), (2.0, 0.8), (5.0, 0.5), (9.0, 0.1), (10.0, 0.0), (50.0, 0.0)]
)
def test_strength_falls_from_the_peak_to_the_residual(time, left):
    _, found = strength_at("late_liquefaction", 10.0, time, peak_ratio=4.0)
    assert found == pytest.approx(10e3 * (1.0 + 3.0 * left), rel=1e-5)
    _, held = strength_at("late_liquefaction", 10.0, time, peak_ratio=4.0, hold=0.5)
    assert held == pytest.approx(10e3 * (1.0 + 3.0 * min(2.0 * left, 1.0)), rel=1e-5)


def test_drained_soil_has_friction_until_it_liquefies():
    numbers = {"peak_ratio": 0.0, "peak_friction_deg": 33.0}
    sine, cohesion = strength_at("late_liquefaction", 10.0, 0.0, **numbers)
    assert (sine, cohesion) == (pytest.approx(np.sin(np.radians(33.0))), pytest.approx(0, abs=1))
    sine, cohesion = strength_at("late_liquefaction", 10.0, 5.0, **numbers)
    tangent = 0.5 * np.tan(np.radians(33.0))
    assert sine == pytest.approx(np.sin(np.arctan(tangent)), rel=1e-5)
    assert cohesion == pytest.approx(5e3 * np.cos(np.arctan(tangent)), rel=1e-5)
    assert strength_at("late_liquefaction", 10.0, 11.0, **numbers) == (0.0, pytest.approx(10e3))


@pytest.mark.parametrize("name", ["late_liquefaction", "spreading_liquefaction"])
def test_other_soil_is_left_alone(name):
    firm = Soil(cohesion=10e3, friction=0.5)
    sine, cohesion = strength_at(name, 10.0, 0.0, soil=firm)
    assert sine == pytest.approx(np.sin(np.arctan(0.5)))
    assert cohesion == pytest.approx(10e3 * np.cos(np.arctan(0.5)))


def test_a_sliding_block_is_braked_by_the_strength_of_the_moment():
    """Acceleration g sin(b) - S(t) / (rho H), integrated twice; S falls from 8 to 5 kPa."""
    height, slope, density, fall = 2.0, 0.3, 2000.0, 4.0
    angle = np.arctan(slope)
    scene = scene_from_mapping(
        {
            "name": "block",
            "domain": {"x_min": 0, "x_max": 200, "y_max": 70},
            "ground": {"points": [[0, 60], [200, 60 - 200 * slope]]},
            "zones": [
                {"name": "soft", "material": "soft",
                 "polygon": [[10, 57], [50, 45], [50, 45 + 2 / np.cos(angle)],
                             [10, 57 + 2 / np.cos(angle)]]},
            ],
            "materials": {
                "soft": {"friction_deg": 0, "cohesion_kpa": 5, "density": density,
                         "youngs_modulus_mpa": 50, "liquefied": True}
            },
            "spacing": 0.5,
            "effects": {"late_liquefaction": {"amplitude": fall, "peak_ratio": 1.6}},
        }
    )  # fmt: skip
    (run,) = simulate([scene], SimulationSettings(duration_s=6.0, early_stop=False), threads=1)
    assert run.status == "finished", run.reason
    inner = np.abs(run.positions[0, :, 0] - 30.0) < 8.0
    way = (run.positions[:, inner] - run.positions[0, inner]).mean(axis=1)
    way = way @ np.array([np.cos(angle), -np.sin(angle)])
    t = run.time
    held = 5e3 * (1.0 + 0.6 * np.maximum(1.0 - t / fall, 0.0))
    pull = 9.81 * np.sin(angle) - held / (density * height)
    speed = np.concatenate([[0.0], np.cumsum(0.5 * (pull[1:] + pull[:-1]) * np.diff(t))])
    expected = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    assert way[-1] == pytest.approx(expected[-1], rel=0.05)


# --- spreading ---


@pytest.mark.parametrize("left", [0.0, 0.25, 1.0])
def test_strength_falls_behind_the_front(left):
    # Half a second a metre: at 6 m it arrives after 3 s, and 2 m behind it all is lost.
    _, found = strength_at("spreading_liquefaction", 0.5, 3.0 + (1.0 - left), field=6.0,
                           peak_ratio=4.0, front_length_m=2.0)  # fmt: skip
    assert found == pytest.approx(10e3 * (1.0 + 3.0 * left), rel=1e-4)
    _, before = strength_at("spreading_liquefaction", 0.5, 2.9, field=6.0, peak_ratio=4.0)
    assert before == pytest.approx(40e3, rel=1e-5)
    sine, _ = strength_at("spreading_liquefaction", 0.5, 2.9, field=6.0, peak_friction_deg=30.0)
    assert sine == pytest.approx(0.5)


def test_the_front_starts_at_the_toe_or_where_it_is_stated():
    assert sources(slump(), 1e6) == [20.0, 40.0], "a slump falls to both sides"
    shell = [{"name": "a", "material": "silt", "polygon": [[20, 0], [40, 0], [40, 6], [20, 6]]},
             {"name": "b", "material": "sand", "polygon": [[40, 0], [50, 0], [40, 6]]}]  # fmt: skip
    one_sided = slump(zones=shell)
    assert sources(one_sided, 1e6) == [20.0]
    assert sources(one_sided, 33.0) == [33.0]
    place = np.array([[20.0, 1.0], [25.0, 5.0], [38.0, 2.0]])
    assert distance(slump(), place, 0.5, DEFAULT) == pytest.approx([0.0, 5.0, 2.0])
    assert distance(one_sided, place, 0.5, DEFAULT) == pytest.approx([0.0, 5.0, 18.0])
    numbers = DEFAULT | {"from_x_m": 33.0}
    assert distance(one_sided, place, 0.5, numbers) == pytest.approx([13.0, 8.0, 5.0])


def test_a_run_is_not_ended_before_all_has_liquefied():
    late = slump({"late_liquefaction": 12.0})
    assert prepare(late, SHORT).busy_until == 12.0
    spreading = slump({"spreading_liquefaction": {"amplitude": 0.5, "front_length_m": 3.0}})
    assert prepare(spreading, SHORT).busy_until == pytest.approx(0.5 * (10.0 + 3.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    "entry", [{"late_liquefaction": 1e-3}, {"spreading_liquefaction": 1e-5}], ids=str
)
def test_at_once_is_the_base_model(entry):
    settings = SimulationSettings(duration_s=6.0)
    base, quick = simulate([slump(), slump(entry)], settings, threads=1)
    # Falling faces part from rounding on, by decimetres at single points.
    assert np.abs(quick.positions[-1] - base.positions[-1]).mean() < 0.1


@pytest.mark.slow
def test_what_holds_at_its_peak_waits_and_then_runs_less_far():
    strong = {"peak_ratio": 20.0}
    settings = SimulationSettings(duration_s=30.0)
    base, late, front = simulate(
        [
            slump(),
            slump({"late_liquefaction": {"amplitude": 10.0, "hold": 0.5, **strong}}),
            slump({"spreading_liquefaction": {"amplitude": 0.5, "from_x_m": 40.0, **strong}}),
        ],
        settings,
        threads=1,
    )
    assert all(run.status == "finished" for run in (base, late, front))
    way = [np.abs(run.positions - run.positions[0]).max(axis=2) for run in (base, late, front)]
    still = late.time < 5.0
    assert way[1][still].max() < 0.3 and way[1][-1].max() > 3.0
    spread = [np.ptp(run.positions[-1, :, 0]) for run in (base, late, front)]
    assert 21.0 < spread[1] < spread[0]
    # The right end goes first; at the left end the front is after 10 s.
    x = front.positions[0, :, 0]
    early = np.searchsorted(front.time, 4.0)
    assert way[2][early, x > 38.0].max() > 1.0
    assert way[2][early, x < 26.0].max() < 0.3 < way[2][-1, x < 22.0].max()


# --- one zone late ---


def test_soil_of_other_zones_has_its_residual_strength_from_the_start():
    _, found = strength_at("late_liquefaction", 10.0, 1.0, peak_ratio=4.0, field=0.0)
    assert found == pytest.approx(10e3, rel=1e-5)


def test_one_zone_may_be_late_alone():
    """Two blocks side by side, far apart: the late one stands until it has liquefied."""
    outlines = {"early": (10, 20), "late": (60, 70)}
    scene = scene_from_mapping(
        {
            "name": "two blocks",
            "domain": {"x_min": 0, "x_max": 100, "y_max": 20},
            "ground": {"points": [[0, 0], [100, 0]]},
            "zones": [
                {"name": name, "material": "soft", "polygon": [[a, 0], [b, 0], [b, 8], [a, 8]]}
                for name, (a, b) in outlines.items()
            ],
            "materials": {
                "soft": {"friction_deg": 0, "cohesion_kpa": 10, "density": 1800,
                         "youngs_modulus_mpa": 20, "liquefied": True}
            },
            "spacing": 1.0,
            "effects": {"late_liquefaction": {"amplitude": 4.0, "hold": 0.75, "peak_ratio": 8.0,
                                              "zone": 2.0}},
        }
    )  # fmt: skip
    settings = SimulationSettings(duration_s=8.0, early_stop=False)
    run, plain = simulate([scene, scene.changed(effects={})], settings, threads=1)
    assert run.status == plain.status == "finished"
    late = run.positions[0, :, 0] > 40.0
    then = np.searchsorted(run.time, 2.5)
    sunk = run.positions[0, :, 1] - run.positions[..., 1]
    assert sunk[then, late].max() < 0.1 < 1.0 < sunk[then, ~late].max()
    assert sunk[-1, late].max() > 1.0
    assert run.positions[:, ~late] == pytest.approx(plain.positions[:, ~late], abs=0.01)
