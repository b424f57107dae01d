"""Predictions from blow counts: strengths of layers, closed forms, tables, the command."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import yaml
from scipy.special import ndtr

from flowslide.command_line import main
from geometry.case import load_case
from inversion.catalogue.correlations import RELATIONS
from inversion.prediction.from_blow_counts import (
    SCORES,
    document_of,
    layer_strengths,
    liquefied_with_counts,
    with_liquefied,
)
from inversion.prediction.prediction_case import prediction_case
from inversion.problem.layers import Layer
from pipeline.cli import InputError
from report.from_blow_counts import summary, write_report
from tests.inversion.analytic import Formula
from tests.inversion.test_relations import SURVEY, count, write_case

LAYERS = [
    Layer("deep", 160.0, 80.0, count(["deep"], n1_60=8.0, n1_60cs=10.0)),
    Layer("high", 80.0, 40.0, count(["high"], n1_60=14.0)),
]
COUNTED = [{"zones": ["deep"], "n1_60": 8.0, "n1_60cs": 10.0}, {"zones": ["high"], "n1_60": 14.0}]
STOOD = {"name": "no flow", "type": "no_flow", "side": "right", "limit_m": 1.5, "std_m": 0.5,
         "confidence": "assumed", "source": "a test"}  # fmt: skip


@pytest.fixture
def block(tmp_path):
    folder = write_case(tmp_path / "block", layers=COUNTED)
    survey = {**SURVEY, "sets": {"field": [*SURVEY["sets"]["field"], STOOD]}}
    (folder / "measurements.yaml").write_text(yaml.safe_dump(survey))
    return folder


def mean_law(values):
    """Toe 10 m at a mean of 5 kPa, falling with the logarithm; the right toe 8 m less."""
    toe = 10.0 - 6.0 * np.log(np.mean(values) / 5.0)
    return np.array([toe, toe - 8.0])


def test_each_layer_has_the_strength_of_its_own_count_and_stress():
    strengths = layer_strengths(RELATIONS["olson_stark_2002"], LAYERS)
    assert strengths.shape == (len(SCORES), 2)
    # 80 (0.03 + 0.0075 x 8) and, beyond the data, 40 (0.03 + 0.0075 x 12); scatter 0.03 of each.
    assert strengths[2] == pytest.approx([7.2, 4.8])
    assert strengths[4] / strengths[2] == pytest.approx(np.exp([2 * 0.03 / 0.09, 2 * 0.03 / 0.12]))
    weber = layer_strengths(RELATIONS["weber_2015"], LAYERS)[2]
    assert weber == pytest.approx(
        [RELATIONS["weber_2015"].strength(10.0, 80.0), RELATIONS["weber_2015"].strength(14.0, 40.0)]
    )


def test_quantiles_and_the_probability_of_a_flow_are_the_closed_form(block):
    case = prediction_case(load_case(block))
    assert liquefied_with_counts(case) == ["deep", "high"]
    assert [entry.name for entry in case.entries] == ["toe", "no flow"]
    engine = Formula(mean_law, [entry.name for entry in case.entries])
    relation = RELATIONS["kramer_wang_2015"]
    document = document_of(case, LAYERS, engine, engine, [relation])
    assert engine.runs == len(SCORES)
    (found,) = document["relations"]
    toe, stood = found["quantities"]
    # All layers by one factor exp(0.4 z): the toe is 10 - 6 (ln(m / 5) + 0.4 z).
    mean = np.mean(layer_strengths(relation, LAYERS)[2])
    middle = 10.0 - 6.0 * np.log(mean / 5.0)
    assert toe["at_median"] == pytest.approx(middle, abs=1e-3)
    for percent, score in (("5", 1.645), ("50", 0.0), ("95", -1.645)):
        assert toe["quantiles"][percent] == pytest.approx(middle - 2.4 * score, abs=0.02)
    assert toe["measured"] == 4.0 and not toe["censored"]
    assert toe["probability_beyond_measured"] == pytest.approx(ndtr((middle - 4.0) / 2.4), abs=2e-3)
    assert stood["censored"] and stood["measured"] == 1.5
    flows = ndtr((middle - 8.0 - 1.5) / 2.4)
    assert stood["probability_beyond_measured"] == pytest.approx(flows, abs=2e-3)
    assert found["strengths_kpa"]["deep"] == pytest.approx(relation.strength(8.0, 80.0), abs=1e-3)
    assert found["beyond"] == [] and found["other_kind"] == []


class Weak(Formula):
    """Fails where the deep layer is weak."""

    least = 0.0

    def _one(self, values):
        made = super()._one(values)
        return replace(made, status="failed", values=made.values * np.nan) if (
            values[0] < self.least
        ) else made  # fmt: skip


def test_runs_that_failed_are_left_out_and_reported(block):
    case = prediction_case(load_case(block))
    names = [entry.name for entry in case.entries]
    median = RELATIONS["kramer_wang_2015"].strength(8.0, 80.0)
    engine = Weak(mean_law, names)
    engine.least = 0.5 * median
    document = document_of(case, LAYERS, engine, engine, [RELATIONS["kramer_wang_2015"]])
    runs = document["relations"][0]["runs"]
    assert [run["predicted"] is None for run in runs] == [True, False, False, False, False]
    assert "1 simulations failed and are left out" in summary(document)


def test_table_and_page(block, tmp_path):
    case = prediction_case(load_case(block))
    engine = Formula(mean_law, [entry.name for entry in case.entries])
    document = document_of(case, LAYERS, engine, engine, list(RELATIONS.values()))
    text = summary(document)
    assert "< 1.5" in text and "4 +- 0.5" in text and "flows: " in text
    assert "a flow, which did not happen, is predicted with a probability of" in text
    assert "4.8*" in text and "*: blow count beyond the data" in text
    page = write_report(document, tmp_path).read_text()
    for one in RELATIONS.values():
        assert one.label in page
    assert "toe" in page and "<svg" not in page and "data:image/svg+xml" in page


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda d: d["layers"].pop(), "no blow count of liquefied zone high"),
        (None, "no blow count of liquefied zone deep, high"),
    ],
)
def test_a_liquefied_zone_without_a_count_is_refused(block, change, complaint):
    path = block / "blow_counts.yaml"
    document = yaml.safe_load(path.read_text())
    if change is None:
        path.unlink()
    else:
        change(document)
        path.write_text(yaml.safe_dump(document))
    with pytest.raises(InputError, match=complaint):
        liquefied_with_counts(prediction_case(load_case(block)))


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--seeds", "2"], "--seeds: is of strengths that are given"),
        (["--zones", "deep"], "--zones: zone 'high' is liquefied in the section"),
        (["--zones", "wide"], "--zones: no zone 'wide'; known are deep, high"),
        (["--samples", "500"], "--samples: is of strengths"),
    ],
)
def test_options_of_given_strengths_are_refused(block, more, complaint):
    with pytest.raises(InputError, match=complaint):
        main(["predict", str(block), "--from-blow-counts", *more])


def test_strengths_are_given_or_predicted(block, capsys):
    with pytest.raises(SystemExit):
        main(["predict", str(block), "--from-blow-counts", "--residual-strength", "9+-1"])
    assert "not allowed with argument" in capsys.readouterr().err


def test_another_zone_may_liquefy(block):
    text = yaml.safe_load((block / "scene.yaml").read_text())
    text["materials"]["clay"] = {"friction_deg": 30.0, "cohesion_kpa": 5.0}
    text["zones"][1]["material"] = "clay"
    (block / "scene.yaml").write_text(yaml.safe_dump(text))
    (block / "inversion.yaml").unlink()
    case = prediction_case(load_case(block))
    assert liquefied_with_counts(case) == ["deep"]
    both = with_liquefied(case, ["deep", "high"])
    assert liquefied_with_counts(both) == ["deep", "high"]
    soil = {zone.name: both.scene.materials[zone.material] for zone in both.scene.zones}["high"]
    assert soil.liquefied and soil.friction_deg == 0.0
    assert with_liquefied(case, []) is case


@pytest.mark.slow
def test_the_command_predicts_from_the_case_alone(block, tmp_path, capsys):
    (block / "inversion.yaml").unlink()
    out = tmp_path / "out"
    main(["predict", str(block), "--from-blow-counts", "--out", str(out), "--threads", "1",
          "--set", "simulation.duration_s=8"])  # fmt: skip
    document = json.loads((out / "from_blow_counts.json").read_text())
    assert [layer["zone"] for layer in document["layers"]] == ["deep", "high"]
    deep, high = (layer["sigma_v0_kpa"] for layer in document["layers"])
    unit = 1800.0 * 9.81e-3
    assert deep == pytest.approx(4.0 * unit, rel=0.06) and high == pytest.approx(unit, rel=0.06)
    assert len(document["relations"]) == len(RELATIONS)
    # The stronger the layers by a relation, the shorter the way; equal ones differ by the noise.
    ways = [(sum(one["strengths_kpa"].values()), one["quantities"][0]["at_median"])
            for one in document["relations"]]  # fmt: skip
    for (weak, far), (strong, near) in combinations(sorted(ways), 2):
        assert far > near - 0.3 or strong < 1.1 * weak
    assert (out / "from_blow_counts.html").stat().st_size > 10_000
    assert "measured" in capsys.readouterr().out
