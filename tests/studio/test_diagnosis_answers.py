"""What the line of a diagnosis has: the ranking, effects to switch."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnosis.ranking import Standing
from flowslide.studio.diagnosis_answers import (
    comparison,
    effects,
    explanation,
    verdict,
)
from flowslide.studio.job_process import MOST_RANKED, Told
from pipeline.files import read_json
from tests.diagnosis import verdict_case


@pytest.fixture(scope="module")
def found():
    return verdict_case.identified()


def test_the_ranking_is_in_the_state_of_the_job_from_the_first_on(tmp_path):
    told = Told(tmp_path)
    told.ranked([Standing(("drag",), "drag", promised=3.0)])
    told.report(1, 10, "running")
    assert read_json(tmp_path / "state.json")["ranking"] == [
        {"words": "drag", "promised": 3.0, "refitted": None}
    ]
    many = [Standing((str(k),), str(k), promised=20.0 - k, refitted=1.0) for k in range(12)]
    told.ranked(many)
    told.end({"state": "done"})
    state = read_json(tmp_path / "state.json")
    assert state["looked_at"] == 12 and len(state["ranking"]) == MOST_RANKED
    assert state["ranking"][0] == {"words": "0", "promised": 20.0, "refitted": 1.0}
    # What was calibrated again stands first, whatever others promise.
    calibrated = Standing(("drag",), "drag", promised=0.5, refitted=0.2)
    told.ranked([*(replace(one, refitted=None) for one in many), calibrated])
    told.end({"state": "done"})
    words = [line["words"] for line in read_json(tmp_path / "state.json")["ranking"]]
    assert words == ["drag", *map(str, range(MOST_RANKED - 1))]


def test_effects_have_the_amplitudes_and_the_strengths_that_belong_together(found):
    shown = effects(found)
    named = [one for one in shown["each"] if one["how"] == "named"]
    assert [one["name"] for one in named] == [one.name for one in found.answer.effects]
    assert shown["base"] == found.base.values and shown["final"] == found.final.values
    assert shown["is_result"]
    for one in shown["each"]:
        if one["how"] == "named":
            assert one["values"] == found.final.values
        else:
            (refit,) = [c.refit for c in found.candidates if c.name == one["name"]]
            assert (one["amplitude"], one["values"]) == (refit.amplitude, refit.values)
    assert verdict(found)["effects"] == shown


def test_nothing_is_kept_of_a_verdict_that_explains_nothing():
    assert not effects(verdict_case.unknown())["is_result"]


def test_a_comparison_has_values_and_an_explanation_says_where_amplitudes_are_from():
    compared = verdict_case.compared()
    shown = comparison(compared)["effects"]
    assert shown["base"] == compared.base.values and not shown["each"]
    explained = explanation(verdict_case.explained())["effects"]["each"]
    assert explained and {one["how"] for one in explained} == {"by its score"}
