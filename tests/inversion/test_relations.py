"""Relations with blow count as priors of a question, and next to its answer."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from diagnosis.case import diagnosis_case
from flowslide import api
from geometry.case import load_case
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.blow_counts import BlowCount
from inversion.back_analysis.case import inversion_case
from inversion.catalogue.correlations import RELATIONS
from inversion.problem.layers import estimate, layers_of
from inversion.problem.question import Prior
from pipeline.cli import InputError
from tests.inversion.report_case import full

DRY = 1800.0 * 9.81e-3
"""Unit weight, kPa/m."""
SCENE = {
    "name": "block",
    "domain": {
        "x_min": -60.0,
        "x_max": 90.0,
        "y_max": 20.0,
        "walls": "open",
        "left": "free",
        "right": "free",
    },
    "ground": {"points": [[-60.0, 0.0], [90.0, 0.0]]},
    "zones": [
        {"name": "deep", "polygon": [[0, 0], [40, 0], [40, 4], [0, 4]], "material": "sand"},
        {"name": "high", "polygon": [[0, 4], [40, 4], [40, 6], [0, 6]], "material": "sand"},
    ],
    "materials": {"sand": {"friction_deg": 0.0, "cohesion_kpa": 30.0, "liquefied": True}},
    "spacing": 1.0,
}
SURVEY = {
    "case": "block",
    "upstream": "left",
    "initial": {},
    "default_set": "field",
    "sets": {
        "field": [
            {"name": "toe", "type": "toe_runout", "side": "left", "value_m": 4.0, "std_m": 0.5,
             "confidence": "assumed", "source": "a test"},
        ]
    },
}  # fmt: skip


def count(zones: list[str], **kinds: float) -> BlowCount:
    return BlowCount(zones=zones, confidence="published", source="a boring", **kinds)


def write_case(folder, prior: dict | None = None, layers: list[dict] | None = None, **more):
    folder.mkdir()
    asked = {
        "name": "S_r", "zones": ["deep", "high"], "property": "residual_strength_kpa",
        "start": 12.0, "low": 2.0, "high": 60.0, "prior": prior, **more,
    }  # fmt: skip
    (folder / "scene.yaml").write_text(yaml.safe_dump(SCENE))
    (folder / "measurements.yaml").write_text(yaml.safe_dump(SURVEY))
    (folder / "inversion.yaml").write_text(
        yaml.safe_dump({"parameters": [asked], "duration_s": 8.0})
    )
    if layers:
        given = {"confidence": "published", "source": "a boring"}
        (folder / "blow_counts.yaml").write_text(
            yaml.safe_dump({"layers": [{**given, **layer} for layer in layers]})
        )
    return folder


# --- layers ---


def test_layers_count_by_their_area_at_their_own_stress():
    scene, deep, high = scene_from_mapping(SCENE, "test"), "deep", "high"
    counts = {deep: count([deep], n1_60=8.0), high: count([high], n1_60=4.0, n1_60cs=5.0)}
    layers = layers_of(scene, counts, [deep, high, "unknown"], 9.81)
    assert [(layer.zone, layer.area_m2) for layer in layers] == [(deep, 160.0), (high, 80.0)]
    stress = [4.0 * DRY, 1.0 * DRY]
    assert [layer.sigma_v0_kpa for layer in layers] == pytest.approx(stress)
    found = estimate(RELATIONS["olson_stark_2002"], layers)
    # sigma' (0.03 + 0.06) on two thirds of the area, sigma' (0.03 + 0.03) on one; +- 0.03 sigma'
    strength = (2 * 0.09 * stress[0] + 0.06 * stress[1]) / 3
    assert found.strength_kpa == pytest.approx(strength)
    assert (found.weakest_kpa, found.strongest_kpa) == pytest.approx(
        (0.06 * stress[1], 0.09 * stress[0])
    )
    mean = (2 * stress[0] + stress[1]) / 3
    assert found.log_std == pytest.approx(0.03 * mean / strength)
    assert found.n1_60 == pytest.approx(20.0 / 3.0)
    assert found.sigma_v0_kpa == pytest.approx(mean)
    assert not found.other_kind and not found.beyond
    assert estimate(RELATIONS["weber_2015"], layers).other_kind
    assert layers_of(scene, {}, [deep], 9.81) == []


# --- priors ---


@pytest.mark.parametrize(
    ("prior", "complaint"),
    [
        ({"mean": 20.0}, "give mean and std, or a relation"),
        ({"mean": 20.0, "std": 4.0, "n1_60": 8.0}, "n1_60: belongs to a relation"),
        ({"relation": "weber_2015", "mean": 20.0}, "mean, std: follow from the relation"),
        ({"relation": "seed_1987"}, "relation"),
    ],
)
def test_a_prior_is_one_or_the_other(prior, complaint):
    with pytest.raises(ValueError, match=complaint):
        Prior(**prior)


def test_a_relation_is_of_a_residual_strength(tmp_path):
    folder = write_case(
        tmp_path / "block", {"relation": "weber_2015", "n1_60": 8.0}, property="cohesion_kpa",
        zones=["high"],
    )  # fmt: skip
    scene = {**SCENE, "materials": {"sand": {"friction_deg": 0.0, "cohesion_kpa": 30.0}}}
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene))
    with pytest.raises(InputError, match=r"prior.relation: is of residual_strength_kpa"):
        inversion_case(load_case(folder))


@pytest.mark.parametrize("own", [True, False], ids=["stated", "of the borings"])
def test_the_prior_is_the_relation_at_the_stress_of_its_zones(tmp_path, own):
    prior = {"relation": "olson_stark_2002", **({"n1_60": 8.0} if own else {})}
    layers = None if own else [{"zones": ["deep", "high"], "n1_60": 8.0}]
    case = inversion_case(load_case(write_case(tmp_path / "block", prior, layers)))
    (spec,) = case.parameters.specs
    assert case.question.parameters == case.parameters.specs
    # A block 6 m high: 4 m of soil at 4 m below its top on average, and 2 m at 1 m.
    assert spec.prior.sigma_v0_kpa == pytest.approx(DRY * (2 * 4.0 + 1 * 1.0) / 3.0)
    assert spec.prior.mean == pytest.approx(0.09 * spec.prior.sigma_v0_kpa)
    assert spec.prior.std == pytest.approx(0.03 * spec.prior.sigma_v0_kpa)
    # As the fit sees it: the logarithm, with the relation's scatter.
    assert case.parameters.prior_mean == pytest.approx([spec.prior.mean])
    assert case.parameters.prior_std == pytest.approx([1.0 / 3.0])
    rows, constants = case.parameters.prior
    assert constants == pytest.approx([np.log(spec.prior.mean) * 3.0]) and rows == [[1.0]]
    # As a result has it, it is known and stays what it is.
    again = Prior.model_validate(json.loads(spec.prior.model_dump_json()))
    assert again.known and again == spec.prior


def test_a_diagnosis_has_the_same_prior(tmp_path):
    prior = {"relation": "olson_stark_2002", "n1_60": 8.0}
    folder = write_case(tmp_path / "block", prior)
    asked = diagnosis_case(load_case(folder)).setup.parameters.specs
    assert asked == inversion_case(load_case(folder)).parameters.specs


@pytest.mark.parametrize(
    ("prior", "layers", "more", "complaint"),
    [
        ({"relation": "weber_2015"}, None, {}, "no blow count of zone deep, high; give n1_60 here"),
        ({"relation": "weber_2015"}, [{"zones": ["deep"], "n1_60": 8.0}], {},
         "no blow count of zone high"),
        ({"relation": "olson_stark_2002", "n1_60": 8.0}, None, {"low": 9.0},
         r"Olson and Stark \(2002\) gives .* outside low 9 to high 60"),
    ],
)  # fmt: skip
def test_a_prior_that_cannot_be_is_one_line(tmp_path, prior, layers, more, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        inversion_case(load_case(write_case(tmp_path / "block", prior, layers, **more)))
    assert "\n" not in str(caught.value) and "parameters: S_r: prior" in str(caught.value)


# --- the whole way ---


@pytest.mark.slow
def test_a_back_analysis_uses_the_prior_and_compares_with_every_relation(tmp_path):
    folder = write_case(
        tmp_path / "block", {"relation": "olson_stark_2002"},
        [{"zones": ["deep"], "n1_60": 14.0}, {"zones": ["high"], "n1_60": 6.0}],
    )  # fmt: skip
    result = api.back_analyse(folder, out=tmp_path / "out", quick=True, threads=1)
    (answer,) = result.answer.parameters
    prior = result.question.parameters[0].prior
    assert answer.has_prior and prior.relation == "olson_stark_2002" and prior.known
    assert answer.prior_std == pytest.approx(prior.std / prior.mean * answer.value)
    assert {row.relation for row in result.relations} == set(RELATIONS)
    for row in result.relations:
        assert row.low_kpa < row.value_kpa < row.high_kpa
        assert row.sigma_v0_kpa == pytest.approx(answer.sigma_v0_kpa, rel=0.02)
        assert row.other_kind == row.clean_sand, "N1,60 alone was counted"
    beyond = {row.relation: row.beyond for row in result.relations}
    assert beyond["olson_stark_2002"] and not beyond["kramer_wang_2015"]


def test_tables_show_what_was_found_over_what_a_relation_says():
    from report.data.back_analysis import BackAnalysisData
    from report.tables.back_analysis import method_tables, relation_tables

    data = BackAnalysisData(folder=None, result=full())
    (table,) = relation_tables(data)
    assert "S_r of the fill, found 27.5 kPa" in table.text()
    (row,) = table.rows
    assert row[:5] == ["Weber of the fill", "N1,60 12.9", "145", "22.8", "15.3 to 34.0"]
    assert row[5] is None and row[6] == "1.21", "one layer"
    assert row[8] == ("beyond its data, taken at their end; asks for N1,60cs; blow count recalled")
    assert any("from blow counts" in one.text() for one in method_tables(data))
    # A lower bound is compared as what it is.
    result = full()
    own = result.answer.parameters[0].model_copy(update={"lower_bound_95": 22.8})
    answer = result.answer.model_copy(update={"parameters": [own, *result.answer.parameters[1:]]})
    stood = BackAnalysisData(folder=None, result=result.model_copy(update={"answer": answer}))
    (table,) = relation_tables(stood)
    assert table.rows[0][6] == "≥ 1.00" and "found ≥ 22.8 kPa" in table.text()
