"""Strangers for nothing: what the library is to lack, both verdicts, and what is counted."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from benchmarks.hidden_effects import strangers
from benchmarks.hidden_effects.__main__ import main
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.strangers import (
    Twice,
    explained,
    judge_twice,
    load_twice,
    rows_of,
    run_twice,
    save_twice,
    stands_for,
)
from pipeline.cli import InputError
from tests.hidden_effects.judges import digest

CANDIDATES = [
    SimpleNamespace(name=name, family=family)
    for name, family in (
        ("shaking", "physics"), ("bingham", "physics"), ("pool", "water"),
        ("pool_on_the_left", "water"), ("density_of_zone_3", "soil"), ("datum_shift", "survey"),
    )
]  # fmt: skip


def truth(hidden="pool", *, name="case_0001", source="smoothed_particles"):
    own = {} if source is None else {"source": source}
    return {"name": name, "kind": "single", "effects": {hidden: {"amplitude": 1.0}}, "lambda": 30.0,
            "section": "embankment", "survey": "profile",
            "parameters": {"strength": 20.0}, **own}  # fmt: skip


@pytest.mark.parametrize(
    ("hidden", "source", "names"),
    [
        ("pool", "smoothed_particles", {"pool", "pool_on_the_left"}),  # a family will do
        ("shaking", "smoothed_particles", {"shaking"}),  # of physics the name alone
        ("viscosity", "smoothed_particles", {"bingham"}),
        ("datum", "own", {"datum_shift"}),
        ("bingham", None, {"bingham"}),  # of the library's own slides
        ("wave", "smoothed_particles", set()),
    ],
)
def test_what_stands_for_a_hidden_thing(hidden, source, names):
    assert stands_for(truth(hidden, source=source), CANDIDATES) == names


@dataclass
class Judge:
    """Stands in for the diagnosis: it names `first`, and where that is forbidden `second`."""

    first: str
    second: str
    alike: tuple[str, ...] = ()
    asked: list = field(default_factory=list)

    def diagnose(self, model, options):
        self.asked.append(options.forbidden)
        named = self.first if self.first not in options.forbidden else self.second
        explanation = SimpleNamespace(
            names=["density_of_zone_3", "pool_on_the_left", "pool"],
            alike=lambda name, least: list(self.alike) if name == "pool_on_the_left" else [],
        )
        return SimpleNamespace(named=named, explanation=explanation)


@pytest.fixture
def judged_by(monkeypatch):
    """What judges in place of the diagnosis."""

    @dataclass(frozen=True)
    class Options:
        forbidden: tuple[str, ...] = ("bingham",)

    model = SimpleNamespace(candidates=CANDIDATES)
    case = SimpleNamespace(
        name="x", title="x", model=lambda store: model, options=lambda model: Options()
    )

    def use(judge: Judge, hidden: dict) -> None:
        monkeypatch.setattr(strangers, "load_case", lambda folder, config: None)
        monkeypatch.setattr(strangers, "diagnosis_case", lambda loaded: case)
        monkeypatch.setattr("diagnosis.diagnose.diagnose", judge.diagnose)
        monkeypatch.setattr(
            "diagnosis.verdict.verdict_builder.verdict_document", lambda found, **words: found
        )

        def digested(found):
            verdict = "identified" if found.named else "adequate"
            return digest(hidden, verdict, [found.named] if found.named else [])

        monkeypatch.setattr(strangers, "digest_of", digested)

    return use


def test_what_is_hidden_and_all_that_looks_like_it_is_off_the_list(judged_by, tmp_path):
    hidden = truth("pool")
    judge = Judge("pool", "shaking", alike=("datum_shift",))
    judged_by(judge, hidden)
    found = judge_twice(tmp_path, hidden, "a set", None, None)
    # What looks like any that stands for it goes with it.
    assert found.forbidden == ["datum_shift", "pool", "pool_on_the_left"]
    assert judge.asked == [("bingham",), ("bingham", *found.forbidden)]
    assert list(found.whole.effects) == ["pool"]
    assert list(found.without.effects) == ["shaking"]


@pytest.mark.parametrize(("hidden", "first"), [("pool", ""), ("wave", "shaking")])
def test_where_nothing_is_to_be_explained_or_missing_one_verdict_is_enough(
    hidden, first, judged_by, tmp_path
):
    judge = Judge(first, first)
    judged_by(judge, truth(hidden))
    found = judge_twice(tmp_path, truth(hidden), "a set", None, None)
    assert found.without is None and len(judge.asked) == 1


def twice(number, whole, without, *, of="a set", error=0.02):
    told = truth("datum", name=f"case_{number:04}")
    verdicts = [
        None if one is None
        else digest(told, "identified" if one else "unknown_effect", one, error=(0.2, error))
        for one in (whole, without)
    ]  # fmt: skip
    return Twice(
        of=of, truth=told, forbidden=["datum_shift"], whole=verdicts[0], without=verdicts[1]
    )


def test_names_are_counted_with_and_without(tmp_path):
    found = [
        twice(1, ["datum_shift"], []),
        twice(2, ["datum_shift"], ["pool"]),
        twice(3, ["pool"], ["pool"], error=0.5),
        twice(4, [], None),  # was adequate
    ]
    assert [row[1:] for row in rows_of(found)] == [
        ["3", "3", "2", "0", "0", "2"],
        ["3", "2", "0", "0", "1", "2"],
    ]
    assert explained(found) == [
        ["a set", "datum", "pool", "+22 %", "+2 %"], ["a set", "datum", "pool", "+22 %", "+65 %"],
    ]  # fmt: skip
    path = tmp_path / "record.json"
    save_twice(found[:2], path)
    save_twice([twice(2, ["datum_shift"], []), *found[2:]], path)
    again = load_twice(path)
    assert [one.truth["name"] for one in again] == [f"case_{k:04}" for k in (1, 2, 3, 4)]
    assert list(again[1].without.effects) == [], "the newer verdict stays"
    assert again[3].without is None


def test_a_record_that_is_none_is_refused_in_one_line(tmp_path):
    path = tmp_path / "record.json"
    path.write_text('[{"of": "a set", "truth": {}}]')
    with pytest.raises(InputError, match=r"record\.json: .*is missing") as error:
        load_twice(path)
    assert "\n" not in str(error.value)


def test_a_part_that_was_stopped_goes_on(root, judged_by, tmp_path):
    folder = root / "benchmarks" / "hidden_effects"
    out = tmp_path / "out"
    options = ["--benchmark", str(folder / "foreign_sixth.yaml"), "--out", str(out), "--quiet"]
    record = str(folder / "foreign_sixth_results.json")
    main(["reopen", *options, "--record", record, "--cases", "case_0005,case_0009,case_0001"])
    judged_by(Judge("datum_shift", ""), truth("datum"))
    said = []
    found = run_twice(Places(out), None, "sixth", on_case=lambda *words: said.append(words[-1]))
    assert len(found) == 2, "the third has nothing hidden"
    again = run_twice(Places(out), None, "sixth", on_case=lambda *words: said.append(words[-1]))
    assert said[2:] == ["case_0005: was there", "case_0009: was there"]
    assert again == found
    Places(out).truth("case_0009").unlink()
    with pytest.raises(InputError, match="is sealed: only an opened set"):
        run_twice(Places(out), None, "sixth")
