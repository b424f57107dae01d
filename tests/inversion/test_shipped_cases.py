"""The dams that ship: their data agree with each other and with what their README says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import Polygon

from geometry.case import load_case
from geometry.scenes.fill import fill
from geometry.scenes.overburden import mean_and_deviation, stress_in_kpa
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import Scene, load_scene
from geometry.survey.measurements import load_measurements
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.back_analysis.variants import sides
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

CASES = Path(__file__).resolve().parents[2] / "case_histories"


def loaded(name: str, **options: object) -> InversionCase:
    """Loading builds every variant and sensitivity: a vertex that does not exist fails here."""
    return inversion_case(load_case(CASES / name), **options)


LOWER_FILL = [f"upstream_fill_{layer}" for layer in (1, 2, 3, 4)]


def test_the_question_of_lower_san_fernando():
    case = loaded("lower_san_fernando")
    (sought,) = case.question.parameters
    assert (sought.zones, sought.start, sought.low, sought.high) == (LOWER_FILL, 30, 5, 90)
    targets = case.setup.targets
    roles = dict(zip(targets.names, targets.roles, strict=True))
    assert roles["upstream toe"] == "fitted" and roles["freeboard"] == "held out"
    assert targets.measured[targets.fitted].tolist() == [53.0]
    assert {v.water for v in case.question.variants} == {None, "none", "buoyant"}
    assert [v.targets for v in case.question.variants if v.targets] == [
        {"upstream toe": 42.0}, {"upstream toe": 65.0},
    ]  # fmt: skip
    top = next(s for s in case.question.sensitivities if s.name.startswith("top of"))
    heights = [
        max(y for zone in changed.setup.scene.zones if zone.name in LOWER_FILL
            for _, y in zone.polygon)
        for changed in sides(case.setup, top, case.source)
    ]  # fmt: skip
    assert heights == pytest.approx([21.5, 15.5])


def test_the_section_of_lower_san_fernando():
    scene = load_scene(CASES / "lower_san_fernando" / "scene.yaml")
    assert gaps({zone.name: zone.polygon for zone in scene.zones}, scene.spacing) == []
    # The published area is 5,525 m2; above y = 5, where the base is drawn, it is 100 m2 less.
    assert sum(Polygon(zone.polygon).area for zone in scene.zones) == pytest.approx(5422.8, abs=0.1)
    assert (scene.foot("left"), scene.foot("right"), scene.water_level) == (88.3, 366.4, 35.9)
    survey = load_measurements(CASES / "lower_san_fernando", scene)
    assert survey.foot("left") == scene.foot("left") and survey.initial.crest_y_m == 47.0
    # Undrained strengths: 0.8 x the published ratio x the mean of the weight above, less water.
    points, d = fill(scene), scene.spacing
    density = np.array([soil.density for soil in scene.materials.values()])[points.material]
    column = np.floor(points.position[:, 0] / d).astype(int)
    height = points.position[:, 1]
    above = np.array([
        density[(column == own) & (height > y)].sum() * d + 0.5 * d * rho
        for own, y, rho in zip(column, height, density, strict=True)
    ])  # fmt: skip
    top = np.array([height[column == own].max() + 0.5 * d for own in column])
    level = scene.phreatic_level(points.position[:, 0])
    pool, pore = np.maximum(level - top, 0), np.maximum(level - height, 0)
    stress = 9.81e-3 * (above + 1000.0 * (pool - pore))
    for zone, ratio in (("core", 0.153), ("rolled_fill", 0.5), ("ground_shale", 0.5)):
        (place,) = [n for n, one in enumerate(scene.zones) if one.name == zone]
        strength = scene.materials[scene.zones[place].material].cohesion_kpa
        assert strength == pytest.approx(0.8 * ratio * stress[points.zone == place].mean(), abs=1)


def test_upper_san_fernando_asks_for_a_bound():
    case = loaded("upper_san_fernando")
    targets = case.setup.targets
    roles = dict(zip(targets.names, targets.roles, strict=True))
    assert roles == {"downstream toe": "fitted", "upstream toe": "fitted", "crest": "held out"}
    assert targets.censored[targets.fitted].all() and case.objective().limit
    scene = case.scene
    assert gaps({zone.name: zone.polygon for zone in scene.zones}, scene.spacing) == []
    liquefied = {z.name for z in scene.zones if scene.materials[z.material].liquefied}
    assert set(case.parameters.specs[0].zones) == liquefied <= set(case.blow_counts)
    # Undrained strengths: 0.8 x the published ratio x the mean overburden.
    points = fill(scene)
    stress = stress_in_kpa(scene, points.position, points.volume, points.zone, 9.81)
    names = [zone.name for zone in scene.zones]
    for zone, ratio in (("core", 0.153), ("rolled_fill", 0.5)):
        own = points.zone == names.index(zone)
        mean, _ = mean_and_deviation(stress[own], points.volume[own])
        assert scene.materials[zone].cohesion_kpa == pytest.approx(0.8 * ratio * mean, abs=0.1)


def test_the_constructed_profile_of_lower_san_fernando_reads_as_measured():
    folder = CASES / "lower_san_fernando"
    scene = load_scene(folder / "scene.yaml")
    (profile,) = load_measurements(folder, scene).profiles
    outline = list(zip(profile.whole.x.tolist(), profile.whole.y.tolist(), strict=True))
    assert Polygon(outline).area == pytest.approx(5422.8, rel=0.003)
    assert profile.whole.x[0] == pytest.approx(scene.foot("left") - 53.0)
    assert 47.0 - np.interp(190.0, profile.whole.x, profile.whole.y) == pytest.approx(20, abs=0.5)
    assert profile.whole.y[profile.whole.x >= 190.0].max() - 35.9 == pytest.approx(1.5, abs=0.1)


def test_the_question_of_the_paper():
    case = loaded("lower_san_fernando_paper")
    sought = [(p.zones, p.start, p.low, p.high) for p in case.question.parameters]
    assert sought == [(["1"], 30, 5, 90), (["6"], 30, 27, 33), (["7"], 30, 27, 37)]
    assert not case.scene.has_water and case.setup.targets.fitted.sum() == 1
    assert {s.name for s in case.question.sensitivities} >= {"cell size", "transfer"}


@pytest.mark.parametrize(
    ("measurement_set", "runouts"), [("field", [11.0, 6.5]), ("paper", [2.5, 10.0])]
)
def test_the_question_of_la_marquesa(measurement_set, runouts):
    case = loaded("la_marquesa", measurement_set=measurement_set)
    sought = [(p.zones, p.start) for p in case.question.parameters]
    assert sought == [(["1"], 11.0), (["2"], 12.0), (["6"], 10.5)]
    targets = case.setup.targets
    assert targets.measured[targets.fitted].tolist() == runouts
    assert dict(zip(targets.names, targets.roles, strict=True))["crest"] == "held out"
    assert case.scene.materials["sandy_clay_core"].cohesion_kpa == 24.0
    (variant,) = [v for v in case.question.variants if v.measurements]
    other = case.variant(variant).setup.targets
    assert other.measured[other.fitted].tolist() == [2.5, 10.0]


def test_the_section_of_la_marquesa():
    scene = load_scene(CASES / "la_marquesa" / "scene.yaml")
    assert sum(Polygon(zone.polygon).area for zone in scene.zones) == pytest.approx(116.0)
    assert len(fill(scene)) == 1856
    assert (scene.foot("left"), scene.foot("right"), scene.water_level) == (0.0, 26.0, 5.5)


def test_the_constructed_profile_of_la_marquesa_reads_as_measured():
    folder = CASES / "la_marquesa"
    scene = load_scene(folder / "scene.yaml")
    measurements = load_measurements(folder, scene)
    (profile,) = measurements.profiles
    assert profile.constructed and set(profile.whole.part) == {"constructed"}
    outline = list(zip(profile.whole.x.tolist(), profile.whole.y.tolist(), strict=True))
    assert Polygon(outline).area == pytest.approx(116.0, abs=0.1)
    soil = {"name": "all", "polygon": outline, "material": "sandy_clay_core"}
    core = scene.materials["sandy_clay_core"].model_dump()
    moved = Scene.model_validate(
        {**scene.model_dump(), "zones": [soil], "materials": {"sandy_clay_core": core}}
    )
    points = fill(moved)
    for side, measured in (("left", 11.0), ("right", 6.5)):
        runout = toe_runout(points.position, points.volume, spacing=0.25, side=side,
                            initial_toe=scene.foot(side))  # fmt: skip
        assert runout == pytest.approx(measured, abs=1.2)  # fronts 0.57 m thin
    before = fill(scene)
    sunk = [
        surface_profile(soil.position, soil.volume, 13.5, spacing=0.25) for soil in (before, points)
    ]
    assert sunk[0] - sunk[1] == pytest.approx(2.0, abs=0.4)


def test_weaker_soil_runs_farther_where_it_comes_off():
    """What liquefied below Sheffield dam leaves it and lies in a sheet thinner than the points."""
    scene = load_scene(CASES / "sheffield" / "scene.yaml").changed(spacing=0.6)
    soil, toes = scene.materials["liquefied_soil"], []
    weak = [
        scene.changed(
            materials={
                **scene.materials, "liquefied_soil": soil.model_copy(update={"cohesion_kpa": s_r}),
            }
        )
        for s_r in (0.3, 0.6, 1.2, 1.8, 2.4, 4.8)
    ]  # fmt: skip
    for run in simulate(weak, SimulationSettings(duration_s=60.0)):
        toes.append(
            toe_runout(run.positions[-1], run.volume, spacing=0.6, side="left", initial_toe=0.0,
                       ground=0.0)
        )  # fmt: skip
    assert np.all(np.diff(toes) < 0.0) and toes[0] > 2.0 * toes[2] > 4.0 * toes[5]
