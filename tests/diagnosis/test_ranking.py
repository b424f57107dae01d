"""The ranking that grows while a diagnosis runs, and changes nothing that is found."""

from __future__ import annotations

import pytest

from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from diagnosis.ranking import Ranking, Standing
from diagnosis.signatures import signatures
from diagnosis.verdict.verdict_builder import verdict_document
from tests.diagnosis.straight import straight

PLANTED = {"late": 2.5}


def verdict_of(ranking: Ranking):
    asked = Options(draws=400, replicates=3, seed=0)
    found = diagnose(straight(0, PLANTED), asked, ranking=ranking)
    return verdict_document(found, case="c", title="t"), found


@pytest.fixture(scope="module")
def watched():
    told: list[list[Standing]] = []
    patch = pytest.MonkeyPatch()
    patch.setattr(signatures, "AT_ONCE", 2)
    verdict, found = verdict_of(Ranking(lambda lines: told.append(list(lines))))
    patch.undo()
    return verdict, found, told


def test_it_grows_and_ends_with_what_was_planted(watched):
    _, _, told = watched
    assert len(told[0]) < len(told[-1])
    assert {name for line in told[-1] for name in line.names} >= {"late", "bend", "step"}
    first = told[-1][0]
    assert first.names == ("late",) and first.words == "late"
    falls = [line.fall for line in told[-1]]
    assert falls == sorted(falls, reverse=True)
    assert told[0][0].refitted is None, "scores come before refits"


def test_its_falls_are_those_of_the_verdict(watched):
    verdict, found, told = watched
    last = {line.names: line for line in told[-1]}
    for candidate in verdict.candidates:
        assert last[(candidate.name,)].promised == pytest.approx(candidate.expected_drop, abs=1e-9)
    base = found.tried_models.way[0].model.fit.total
    for names, model in found.tried_models.models.items():
        if names and not model.unread:
            assert last[names].refitted == pytest.approx(base - model.fit.total, rel=0.05, abs=0.5)


def test_what_is_found_does_not_depend_on_who_watches(watched):
    alone, found = verdict_of(Ranking())
    assert alone.model_dump() == watched[0].model_dump()
    assert found.model.runs == watched[1].model.runs


def test_several_together_are_told_in_words_and_nobody_is_told_twice_of_nothing():
    told = []
    ranking = Ranking(told.append)
    ranking.refit((), 3.0)
    assert told == []
    ranking.promise({"wet_side": -1.0})
    ranking.refit(("drag", "wet_side"), 12.0)
    assert [line.words for line in told[-1]] == ["drag and wet side", "wet side"]
    assert told[-1][1].fall == 0.0
