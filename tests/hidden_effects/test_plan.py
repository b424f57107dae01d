"""The row of cases: kinds, balance, and that any prefix is the same row."""

from collections import Counter

import pytest

from benchmarks.hidden_effects.__main__ import FOLDER, main
from benchmarks.hidden_effects.making.benchmark import coarser
from benchmarks.hidden_effects.making.laboratory import Laboratory, Request
from benchmarks.hidden_effects.making.plan import ROUND, plan, reaches
from benchmarks.hidden_effects.making.sections import load_section
from mpm_taichi.effects import effects_on
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.files import read_json

EFFECTS = ["softening", "rate", "pool"]
SECTIONS, SURVEYS = ["dam", "tailings"], ["profile", "markers"]
REACH = {
    **{(name, section, survey): 500.0 for name in ("softening", "lens") for section in SECTIONS
       for survey in SURVEYS},
    **{("rate", section, survey): 11.0 for section in SECTIONS for survey in SURVEYS},
    **{("pool", "dam", survey): 500.0 for survey in SURVEYS},
}  # fmt: skip


@pytest.mark.parametrize("factor", [50.0, 1e308, 1e-200])
def test_a_spacing_that_a_section_cannot_have_is_one_line(root, factor):
    section = load_section(root / "benchmarks/hidden_effects/sections/tailings_dam")
    with pytest.raises(InputError) as caught:
        coarser(section, factor, "benchmark.yaml")
    message = str(caught.value)
    assert message.startswith(f"benchmark.yaml: spacing_factor {factor:g}: {section.folder}: ")
    assert "spacing" in message and "\n" not in message


def test_what_a_section_says_of_effects_holds_where_none_is_hidden(root):
    section = load_section(root / "benchmarks/hidden_effects/sections/porous_dam")
    laboratory = Laboratory(SimulationSettings())
    values = tuple(spec.start for spec in section.question.parameters)
    base = laboratory.scene(section, Request(values))
    assert base.effects == {"pore_water": 0.0} and not effects_on(base)
    wet = laboratory.scene(section, Request(values, {"pore_water": 3.0}))
    assert [(one.effect.name, one.amplitude) for one in effects_on(wet)] == [("pore_water", 3.0)]


def row(number, seed=3):
    return plan(number, seed=seed, effects=EFFECTS, outside=["lens"], sections=SECTIONS,
                surveys=SURVEYS, reach=REACH)  # fmt: skip


def test_each_round_has_its_kinds():
    cases = row(48)
    for first in (0, 16, 32):
        assert Counter(c.kind for c in cases[first : first + 16]) == Counter(ROUND)


def test_a_full_benchmark():
    counts = Counter(case.kind for case in row(352))
    assert counts == {"null": 154, "single": 154, "pair": 22, "outside": 22}


@pytest.mark.parametrize("n", [7, 50, 101, 150])
def test_wherever_it_ends_the_kinds_have_their_shares(n):
    counts = Counter(case.kind for case in row(240)[:n])
    for kind, share in (("null", 7), ("single", 7), ("pair", 1), ("outside", 1)):
        assert abs(counts[kind] - n * share / 16) <= share / 2 + 0.5


@pytest.mark.parametrize("n", [64, 100, 160])
def test_wherever_it_ends_singles_are_balanced(n):
    singles = [case for case in row(240)[:n] if case.kind == "single"]
    bins = Counter(case.bin for case in singles)
    assert max(bins.values()) - min(bins[k] for k in range(4)) <= 1
    used = Counter(case.effects[0] for case in singles)
    assert min(used[name] for name in EFFECTS) >= len(singles) // 5


def test_a_longer_row_begins_as_a_shorter_one():
    assert row(60)[:24] == row(24)


def test_another_seed_is_another_row():
    assert row(24) != row(24, seed=4)


def test_effects_hide_where_they_can_be_seen():
    for case in row(240):
        for name in case.effects:
            assert reaches(REACH[name, case.section, case.survey], case.bin)
        assert len(case.effects) == {"single": 1, "null": 0, "pair": 2, "outside": 1}[case.kind]
        assert len(set(case.effects)) == len(case.effects)


def test_singles_are_balanced():
    singles = [case for case in row(320) if case.kind == "single"]  # 140
    assert set(Counter(case.bin for case in singles).values()) == {35}
    used = Counter(case.effects[0] for case in singles)
    assert used == {"rate": 35, "softening": 52, "pool": 53}  # the faint one has all low bins
    assert {case.bin for case in singles if case.effects == ("rate",)} == {0}


def test_nulls_are_everywhere():
    nulls = [case for case in row(320) if case.kind == "null"]  # 140
    assert set(Counter((case.section, case.survey) for case in nulls).values()) == {35}


def test_pairs_are_not_hidden_where_they_cannot_be_seen():
    pairs = [case for case in row(240) if case.kind == "pair"]
    assert {case.bin for case in pairs} == {1, 2, 3}
    assert {case.effects for case in pairs} == {("pool", "softening")}


def test_the_order_of_kinds_says_nothing():
    cases = row(160)
    places = [Counter(case.kind for case in cases[k::16])["null"] for k in range(16)]
    assert max(places) < 10  # no place of a round is always a null
    assert cases[0].name == "case_0001"


def test_nothing_to_hide_is_an_error():
    with pytest.raises(ValueError, match="nothing to hide|no two effects"):
        plan(12, seed=0, effects=[], outside=["lens"], sections=SECTIONS, surveys=SURVEYS,
             reach=REACH)  # fmt: skip


def test_files_of_another_plan_or_of_other_settings_are_not_mixed(tmp_path):
    (tmp_path / "truths").mkdir()
    (tmp_path / "truths" / "case_0001.json").write_text("{}")
    given = ["--benchmark", f"{FOLDER}/slice.yaml", "--out", str(tmp_path), "--quiet"]
    with pytest.raises(InputError, match="of an earlier version; give another folder"):
        main(["make", *given])
    other = tmp_path / "other"
    by_codes = ["plan", "--benchmark", f"{FOLDER}/foreign_sixth.yaml", "--out", str(other)]
    for _ in range(2):  # the second time it is the same plan
        main(by_codes)
        assert read_json(other / "reach.json") == []
    with pytest.raises(InputError, match="has files of another plan, of other settings"):
        main([*by_codes, "--set", "simulation.courant=0.1"])
