"""The two dams that ship: their data agree with each other and with what their README says."""

from __future__ import annotations

from pathlib import Path

import pytest
from shapely.geometry import Polygon

from geometry.case import load_case
from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene, load_scene
from geometry.survey.measurements import load_measurements
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from inversion.back_analysis.case import InversionCase, inversion_case

CASES = Path(__file__).resolve().parents[2] / "case_histories"


def loaded(name: str, **options: object) -> InversionCase:
    """Loading builds every variant and sensitivity: a vertex that does not exist fails here."""
    return inversion_case(load_case(CASES / name), **options)


def test_the_question_of_lower_san_fernando():
    case = loaded("lower_san_fernando")
    sought = [(p.zones, p.start, p.low, p.high) for p in case.question.parameters]
    assert sought == [(["1"], 30, 5, 90), (["6"], 30, 27, 33), (["7"], 30, 27, 37)]
    targets = case.setup.targets
    roles = dict(zip(targets.names, targets.roles, strict=True))
    assert roles["upstream toe"] == "fitted" and roles["freeboard"] == "held out"
    assert targets.measured[targets.fitted].tolist() == [53.0]
    assert {v.water for v in case.question.variants} == {None, "none", "buoyant"}
    assert [v.targets for v in case.question.variants if v.targets] == [
        {"upstream toe": 42.0}, {"upstream toe": 65.0},
    ]  # fmt: skip
    top = next(s for s in case.question.sensitivities if s.name.startswith("top of"))
    up, down = case.sides(top)
    heights = [max(y for _, y in changed.setup.scene.zones[0].polygon) for changed in (up, down)]
    assert heights == pytest.approx([24.5, 12.5])


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
