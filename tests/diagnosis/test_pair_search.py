"""The search of pairs: what the rounds pass over, on a model with known answers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnosis.adequacy.compare import compare
from diagnosis.hypotheses.model import switch_of
from diagnosis.options import Options
from diagnosis.selection.explain import explain
from diagnosis.selection.forward_selection import run_rounds
from diagnosis.selection.pair_search import overlooked, promises, search_pairs, starts
from diagnosis.selection.selection import Selection
from tests.diagnosis.straight import straight


def searched(seed: int, effects: dict[str, float], *, switches=(), **options) -> Selection:
    """The rounds done, one effect at most: what the search of pairs starts from."""
    model = straight(seed, effects)
    model.candidates = [
        switch_of(one.name, "water", one.words) if one.name in switches else one
        for one in model.candidates
    ]
    asked = Options(draws=400, replicates=3, seed=seed, rounds=1, **options)
    comparison = compare(model, asked)
    selection = Selection(comparison, explain(model, comparison, asked), asked)
    run_rounds(selection)
    return selection


@pytest.mark.parametrize("switches", [(), ("step",)])
def test_two_effects_are_found_where_one_is_not_enough(switches):
    size = 1.0 if switches else 2.5
    # The second is small next to the first: nothing is to be forgiven.
    selection = searched(0, {"late": 2.8, "step": size}, switches=switches, nearly_all=0.0)
    alone = selection.now.model
    assert len(alone.names) == 1
    search_pairs(selection)
    found = selection.now.model
    assert found.names == ("late", "step")
    assert found.fit.total < alone.fit.total - 6.0 and found.sloped
    amplitudes = found.fit.space.amplitudes(found.fit.x)
    assert abs(amplitudes["late"] - 2.8) < 1.0
    assert selection.tried.doubted is not None, "judged with the error of its own effects"


@pytest.mark.parametrize("effects", [{}, {"late": 2.0}])
def test_what_explains_needs_no_pairs(effects):
    selection = searched(1, effects)
    asked, found = selection.runs.asked, selection.now.model.names
    search_pairs(selection)
    assert selection.runs.asked == asked
    assert selection.now.model.names == found == tuple(effects)


def test_what_the_parameters_imitate_and_every_switch_is_refitted():
    selection = searched(0, {"late": 2.8, "step": 2.5}, switches=("bend",))
    tried = selection.tried.models
    tried.pop(("like_strength",), None), tried.pop(("bend",), None)
    assert overlooked(selection)[:2] == ["bend", "like_strength"], "0.4 of a strength, nothing else"
    chance = [replace(one, by_chance=True) for one in selection.explanation.candidates]
    selection.explanation = replace(selection.explanation, candidates=chance)
    assert "like_strength" not in overlooked(selection)


def test_of_a_family_that_is_screened_one_is_refitted():
    selection = searched(0, {"late": 2.8, "step": 2.5})
    selection.tried.models = {
        key: model for key, model in selection.tried.models.items() if not key
    }
    screened = [
        replace(one, family="soil", screened=True) for one in selection.explanation.candidates
    ]
    selection.explanation = replace(selection.explanation, candidates=screened)
    assert len(overlooked(selection)) == 1


def test_a_single_effect_that_mends_nothing_is_not_built_on():
    selection = searched(0, {"late": 2.8, "step": 2.5})
    (late,) = [key for key in starts(selection) if key == ("late",)]
    assert starts(selection)[0] == late, "the best first"
    worse = selection.base.fit.total - 1.0
    for key, model in selection.tried.models.items():
        if key:
            selection.tried.models[key] = replace(model, fit=replace(model.fit, total=worse))
    assert starts(selection) == []


def test_a_promise_is_what_a_refit_keeps():
    selection = searched(0, {"late": 2.8, "step": 2.5})
    start = selection.give_own_derivative(("late",))
    before = selection.runs.asked
    promised = {one.names: one for one in promises(selection, start)}
    others = [one.name for one in selection.explanation.candidates if one.name != "late"]
    assert selection.runs.asked - before <= len(others) + 1, "one run each"
    pair = promised["late", "step"]
    refitted = selection.refit_on(pair.start, pair.names)
    assert refitted.fit.total == pytest.approx(pair.total, abs=2.0)


def test_the_pair_search_keeps_to_its_allowance():
    selection = searched(0, {"late": 2.8, "step": 2.5}, allowance=120)
    search_pairs(selection)
    assert selection.runs.asked <= 120 and selection.runs.cut_short
