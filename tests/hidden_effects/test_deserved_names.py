"""How often an explanation is right: the law, what it was fitted to, and what a diagnosis does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.generated_pages import around
from benchmarks.hidden_effects.scoring.sets import PAGE
from benchmarks.studies.deserved_names import Given, fitted, given, shown, unseen
from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from diagnosis.track_record import Figures, NameRecord, name_record
from diagnosis.verdict.verdict_builder import verdict_document
from report.sentences.finding import headline
from tests.diagnosis.straight import straight

FIGURES = Figures(nearest=0.9, p_left=0.3, share=0.95)
LAW = NameRecord(given=1, right=1, intercept=3.0, apart=1.2, p_left=0.3, share=4.0)
OPTIONS = Options(draws=400, replicates=3, seed=2)


def test_the_law_rises_with_each_figure():
    law = name_record()
    chance = law.chance(FIGURES)
    better = ({"nearest": 0.7}, {"p_left": 0.9}, {"share": 1.0})
    assert all(law.chance(replace(FIGURES, **one)) > chance for one in better)
    alone = law.chance(Figures(nearest=0.0, p_left=1.0, share=1.0))
    assert 0.9 < alone < 1.0, "nothing looks like it"
    assert law.chance(Figures(nearest=1.0, p_left=0.0, share=0.4)) < 0.1


def test_a_law_that_was_planted_is_found():
    rng = np.random.default_rng(0)
    rows = []
    for number in range(3000):
        seen = Figures(*(float(one) for one in (rng.uniform(0.3, 1), rng.uniform(), rng.uniform())))
        right = bool(rng.uniform() < LAW.chance(seen))
        rows.append(Given("a set", f"thing {number % 9}", False, True, seen, right))
    found = fitted(rows)
    for name in ("intercept", "apart", "p_left", "share"):
        assert getattr(found, name) == pytest.approx(getattr(LAW, name), rel=0.25), name
    chance, right = unseen(rows, lambda one: one.hidden), np.array([one.right for one in rows])
    for low in (0.2, 0.4, 0.6, 0.8):
        inside = (chance >= low) & (chance < low + 0.2)
        assert right[inside].mean() == pytest.approx(chance[inside].mean(), abs=0.06)


def test_a_figure_that_says_the_opposite_counts_for_nothing():
    rows = [
        Given("a set", "one", False, True, replace(FIGURES, share=share), share < 0.5)
        for share in np.linspace(0.0, 1.0, 40)
    ]
    assert fitted(rows).share == 0.0


def test_law_and_page_are_those_of_the_records():
    known, strangers = given()
    assert fitted(known) == name_record(), "out of date: see benchmarks.studies.deserved_names"
    before, after = around(PAGE, "names")
    assert shown(known, strangers) in PAGE.read_text(encoding="utf-8")[len(before) : -len(after)]
    assert all(not one.right for one in known if one.stranger)


def test_a_name_of_too_small_a_chance_is_told_as_what_would_explain():
    found = diagnose(straight(2, {"late": 2.5}), OPTIONS)
    assert found.decision.verdict == "identified" and found.decision.chance > OPTIONS.deserved
    told = verdict_document(found, case="c", title="t")
    assert f"right in {100 * told.answer.chance:.0f} of 100" in headline(told)
    assert not told.answer.would_explain

    stricter = diagnose(straight(2, {"late": 2.5}), replace(OPTIONS, deserved=0.999))
    unsure = verdict_document(stricter, case="c", title="t")
    assert unsure.verdict == "unknown_effect" and unsure.answer.would_explain
    assert unsure.answer.chance == told.answer.chance
    assert headline(unsure).startswith("Late would explain the measurements, chi² falls")
    assert [one.name for one in unsure.answer.effects] == ["late"], "what it is, is shown"
    (name, *_) = told.quoted
    quoted, named = unsure.quoted[name], told.quoted[name]
    assert quoted.std > named.std and [] in [model.names for model in quoted.models]


def test_several_explanations_state_their_chance_and_stay_several():
    found = diagnose(straight(2, {"bend": 1.5}), OPTIONS)
    told = verdict_document(found, case="c", title="t")
    assert told.verdict == "ambiguous" and told.answer.chance < OPTIONS.deserved
    assert "it was among explanations like these in" in headline(told)
