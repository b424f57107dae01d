"""The row of cases: kinds, balance, and that any prefix is the same row."""

from collections import Counter

import pytest

from diagnosis.blind.plan import ROUND, plan

EFFECTS = ["softening", "rate", "pool"]
WHERE = {"": ["dam", "tailings"], "softening": ["dam", "tailings"], "rate": ["dam", "tailings"],
         "pool": ["dam"], "lens": ["tailings"]}  # fmt: skip


def row(number, seed=3):
    return plan(number, seed=seed, effects=EFFECTS, outside=["lens"], where=WHERE,
                surveys=["profile", "markers"])  # fmt: skip


def test_each_round_has_its_kinds():
    cases = row(36)
    for first in (0, 12, 24):
        assert Counter(c.kind for c in cases[first : first + 12]) == Counter(ROUND)


def test_a_longer_row_begins_as_a_shorter_one():
    assert row(60)[:24] == row(24)


def test_another_seed_is_another_row():
    assert row(24) != row(24, seed=4)


def test_effects_hide_where_they_can_act():
    for case in row(240):
        assert all(case.section in WHERE[name] for name in case.effects)
        assert len(case.effects) == {"single": 1, "null": 0, "pair": 2, "outside": 1}[case.kind]
        assert len(set(case.effects)) == len(case.effects)


def test_singles_are_balanced():
    singles = [case for case in row(288) if case.kind == "single"]  # 120: 40 of each effect
    assert Counter(case.effects[0] for case in singles) == dict.fromkeys(EFFECTS, 40)
    for name in EFFECTS:
        own = [case for case in singles if case.effects == (name,)]
        assert set(Counter(case.bin for case in own).values()) == {10}
    assert set(
        Counter((c.section, c.survey) for c in singles if c.effects == ("rate",)).values()
    ) == {10}


def test_pairs_are_not_hidden_where_they_cannot_be_seen():
    assert {case.bin for case in row(240) if case.kind == "pair"} == {2, 3}


def test_names_say_nothing_of_the_kind():
    cases = row(120)
    places = [Counter(case.kind for case in cases[k::12])["null"] for k in range(12)]
    assert max(places) < 10  # no place of a round is always a null
    assert cases[0].name == "case_0001"


def test_nothing_to_hide_is_an_error():
    with pytest.raises(ValueError, match="empty range|randrange|deck"):
        plan(12, seed=0, effects=[], outside=["lens"], where=WHERE, surveys=["profile"])
