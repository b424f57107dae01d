"""The way from another reading to the question, change by change."""

from __future__ import annotations

import pytest
import yaml

from geometry.case import load_case
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import inversion_case
from inversion.engines.run_store import RunStore
from inversion.problem.changes import Changes, OtherProperty, WaterfallStep, on_top
from pipeline.cli import InputError
from pipeline.config import load_config
from report.charts.waterfall import rows_of
from report.data.back_analysis import BackAnalysisData
from report.sentences.back_analysis import waterfall_sentence
from report.tables.back_analysis import waterfall_table
from tests.dams import dam_with_pool
from tests.inversion.report_case import full

STEPS = [
    {"name": "dry and bonded", "case": "../other", "contact": "no_slip", "water": "none"},
    {"name": "rough", "contact": "rough"},
    {"name": "this dam, light", "case": ".", "water": "buoyant",
     "properties": [{"property": "density", "value": 1600}]},
    {"name": "heavy", "properties": [{"property": "density", "value": None}]},
    {"name": "thrust", "water": "pore_pressure"},
]  # fmt: skip


@pytest.fixture
def asking(lsfd):
    """A case whose waterfall begins in another folder, and what writes its steps."""
    dam_with_pool(lsfd.parent / "other")

    def write(steps, **more):
        path = lsfd / "inversion.yaml"
        document = yaml.safe_load(path.read_text())
        document["waterfall"] = {"steps": steps, **more}
        path.write_text(yaml.safe_dump(document))
        return lsfd

    return write


def test_steps_stand_on_those_before_them_and_another_case_ends_the_soil():
    light = OtherProperty(zones=["a"], property="density", value=1600.0)
    before = Changes(water="buoyant", contact="no_slip", simulation={"transfer": "flip"},
                     properties=[light], zones={"s": ["a"]})  # fmt: skip
    more = on_top(before, WaterfallStep(name="x", contact="rough", simulation={"courant": 0.2}))
    assert (more.water, more.contact) == ("buoyant", "rough")
    assert more.simulation == {"transfer": "flip", "courant": 0.2}
    assert more.properties == [light] and more.zones == {"s": ["a"]}
    back = light.model_copy(update={"value": None})
    assert on_top(before, WaterfallStep(name="x", properties=[back])).properties == [back]
    heavy = OtherProperty(property="density", value=1800.0)
    part = OtherProperty(zones=["a"], property="density", value=1900.0)
    steps = [WaterfallStep(name="x", properties=[one]) for one in (heavy, part, heavy)]
    assert on_top(before, steps[0]).properties == [heavy]
    assert on_top(on_top(before, steps[0]), steps[1]).properties == [heavy, part]
    assert on_top(on_top(before, steps[1]), steps[2]).properties == [heavy]
    two = Changes(properties=[part.model_copy(update={"zones": ["a", "b"]})])
    assert [one.zones for one in on_top(two, steps[1]).properties] == [["b"], ["a"]]
    moved = on_top(before, WaterfallStep(name="x", case="."))
    assert moved.properties == [] and moved.zones == {} and moved.simulation == before.simulation


def test_the_last_that_is_said_of_a_zone_holds(asking):
    def core(value, zones=("5",)):
        return [{"property": "density", "value": value, "zones": list(zones)}]

    steps = [
        {"name": "core", "properties": core(1700.0)},
        {"name": "all", "properties": core(1800.0, ())},
        {"name": "core again", "properties": core(1900.0)},
        {"name": "as drawn", "properties": core(None)},
    ]
    case = inversion_case(load_case(asking(steps)))
    zones = {zone.name: zone.material for zone in case.scene.zones}
    drawn = case.scene.materials[zones["5"]].density
    other = next(name for name in zones if name != "5")
    found = []
    for reading in case.waterfall:
        scene = reading.setup.scene
        soil = {zone.name: scene.materials[zone.material].density for zone in scene.zones}
        found.append((soil["5"], soil[other]))
    assert [pair[0] for pair in found] == [1700.0, 1800.0, 1900.0, drawn]
    assert [pair[1] for pair in found][1:] == [1800.0] * 3


def test_each_step_is_a_setup_with_one_unknown(asking):
    case = inversion_case(load_case(asking(STEPS)))
    dry, rough, light, heavy, thrust = case.waterfall
    assert dry.case.name == "other" and thrust.case is case
    assert not dry.setup.scene.has_water and dry.setup.scene.ground.contact == "no_slip"
    assert rough.setup.scene.ground.contact == "rough" and not rough.setup.scene.has_water
    assert {soil.density for soil in light.setup.scene.materials.values()} == {1600.0}
    assert light.setup.settings.water == heavy.setup.settings.water == "buoyant"
    assert heavy.setup.scene == thrust.setup.scene == case.scene
    assert thrust.setup.settings == case.simulation
    targets = dry.setup.targets
    assert targets.named(targets.measured, targets.fitted) == {"upstream toe": 53.0}
    alone = thrust.alone([20.0, 35.0])
    assert alone.parameters.names == ["residual_strength_1"]
    rolled = next(zone for zone in alone.scene.zones if zone.name == "7")
    assert alone.scene.materials[rolled.material].friction_deg == 35.0


@pytest.mark.parametrize(
    ("steps", "more", "words"),
    [
        ([{"name": "a"}, {"name": "a"}], {}, "names must be unique"),
        ([{"name": "a", "case": "nowhere"}], {}, "nowhere: no such folder"),
        ([{"name": "a", "contact": "glued"}], {}, "contact"),
        ([{"name": "a", "simulation": {"transfer": "pigeon"}}], {}, "pigeon"),
        ([{"name": "a", "zones": {"residual_strength_1": ["9"]}}], {}, "waterfall: a: zones"),
        ([{"name": "a", "properties": [{"property": "density", "value": 1, "zones": ["9"]}]}], {},
         "no zone '9' in the scene"),
        ([{"name": "a", "properties": [{"property": "cohesion_kpa", "value": 1, "zones": ["1"]}]}],
         {}, "cohesion_kpa of 1 is calibrated"),
        ([{"name": "a"}], {"parameter": "cheese"}, "no parameter 'cheese'"),
    ],
)  # fmt: skip
def test_what_cannot_be_made_is_said_in_a_line(asking, steps, more, words):
    with pytest.raises(InputError, match=words) as caught:
        inversion_case(load_case(asking(steps, **more)))
    assert "\n" not in str(caught.value)


def test_zones_and_soil_of_a_variant(lsfd):
    path = lsfd / "inversion.yaml"
    both = "  - {name: both, zones: {residual_strength_1: ['1', '2']}, pool_level_m: 35.0}\n"
    path.write_text(path.read_text().replace("variants:\n", "variants:\n" + both))
    case = inversion_case(load_case(lsfd))
    changed = case.variant(case.question.variants[0])
    scene = changed.setup.parameters.scene(changed.setup.scene, [22.0, 30.0])
    soil = {zone.name: scene.materials[zone.material] for zone in scene.zones}
    assert soil["1"] == soil["2"] and soil["2"].cohesion_kpa == 22.0 and soil["2"].liquefied
    assert soil["4"].friction_deg == 35.0, "another zone of the same soil keeps it"
    assert scene.water_level == 35.0 and scene.phreatic_line[0][1] == 35.0
    assert "residual_strength_1 of 1, 2" in changed.words and "pool at 35 m" in changed.words


@pytest.mark.slow
def test_the_last_bar_is_the_answer(asking):
    steps = [{"name": "dry", "water": "none"}, {"name": "wet", "water": "pore_pressure"}]
    stated = {"name": "somebody", "value": 10.0, "source": "a letter"}
    settings = ["inversion.starts=1", "inversion.noise_seeds=0", "inversion.variants=false",
                "inversion.sensitivities=false"]  # fmt: skip
    case = inversion_case(load_case(asking(steps, stated=stated), load_config(None, settings)))
    result = BackAnalysis(case, RunStore(None, threads=1)).run()
    dry, wet, last, *small = result.waterfall.bars
    (strength,) = [p for p in result.answer.parameters if p.name == result.waterfall.parameter]
    assert result.waterfall.stated.value == 10.0 and last.value == strength.as_run
    known = result.answer.small_cells.known
    assert [bar.value for bar in small] == ([strength.value] if known else [])
    assert dry.value > 1.2 * wet.value, "buoyancy and thrust help the slide"
    if case.coarse_spacing_m is None:
        assert wet.value == pytest.approx(last.value, rel=0.03)
    assert all(bar.predicted["upstream toe"] == pytest.approx(53.0, abs=0.4) for bar in (dry, wet))
    assert "freeboard" in wet.predicted


def test_the_table_and_the_sentence_have_every_bar(tmp_path):
    data = BackAnalysisData(folder=tmp_path, result=full("x"))
    names, values = rows_of(data.result.waterfall)
    assert values == [18.9, 51.0, 90.0, 27.5] and names[0] == "paper of x"
    text = waterfall_table(data).text()
    for words in ("+32.1", "-62.5", "not fitted; at its high bound", "as stated: x", "-2.0"):
        assert words in text
    sentence = waterfall_sentence(data)
    assert "from 18.9 kPa (paper of x) to 27.5 kPa" in sentence
    assert "answer of x (-62.5), water of x (+39.0), base of x (+32.1)" in sentence
