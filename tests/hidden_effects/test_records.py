"""Files of a benchmark that are not what was written: one line, before anything is written."""

from __future__ import annotations

import copy
import json
import re

import pytest

from benchmarks.hidden_effects import strangers
from benchmarks.hidden_effects.__main__ import main
from benchmarks.hidden_effects.baselines import run as baselines
from benchmarks.hidden_effects.making.benchmark import Places, load_benchmark
from benchmarks.hidden_effects.making.make import reach_of, sealed_cases
from benchmarks.hidden_effects.making.reopen import reopen
from benchmarks.hidden_effects.making.seal import is_sealed, seal
from benchmarks.hidden_effects.scoring import sets
from benchmarks.hidden_effects.scoring.opened import judged, load_rows, open_truths
from benchmarks.hidden_effects.scoring.records import read_sealed, read_truth
from diagnosis.case import diagnosis_case
from geometry.case import load_case
from pipeline.cli import InputError


@pytest.fixture(scope="module")
def shipped(root):
    """The first rows of the record that is shipped: two nulls and a few with effects."""
    return json.loads((root / "benchmarks" / "hidden_effects" / "results.json").read_text())[:20]


@pytest.fixture
def rows(shipped):
    return copy.deepcopy(shipped)


def kept(rows, tmp_path):
    path = tmp_path / "results.json"
    path.write_text(json.dumps(rows))
    return path


def score(root, tmp_path, *options):
    return main(
        ["score", "--benchmark", str(root / "benchmarks" / "hidden_effects"),
         "--out", str(tmp_path / "out"), *options]
    )  # fmt: skip


def sealed_anew(row, **changes):
    truth = {**row["truth"], **changes}
    return {**row, "truth": truth, "sha256": seal(truth)}


def test_the_shipped_records_are_of_their_form(root):
    assert len(load_rows(root / "benchmarks" / "hidden_effects" / "results.json")) == 347


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        (lambda rows: {"rows": rows}, "should be a valid list"),
        (lambda rows: [1, 2], r"0: 1: input should be a valid dict"),
        (lambda rows: [{**rows[0], "truth": None}], "0.truth"),
        (lambda rows: [{"truth": rows[0]["truth"]}], "0.sha256: is missing"),
        (lambda rows: [{**rows[0], "verdicts": {}}], "verdicts: method is missing"),
        (lambda rows: [{**rows[0], "verdicts": {"method": {}}}], "verdicts.method.case: is miss"),
        (lambda rows: [sealed_anew(rows[0], kind="double")], "0.truth.kind: 'double'"),
        (lambda rows: [sealed_anew(rows[0], kind="single")], "a case of kind single has 1"),
        (lambda rows: [sealed_anew(rows[0], parameters={})], "0.truth.parameters"),
        (lambda rows: [sealed_anew(rows[0], parameters={"other": 1.0})], "other needs a value"),
        (lambda rows: [rows[0], rows[0]], "case_0001 is there 2 times"),
        (lambda rows: [{**rows[0], "sha256": "0" * 64}], "case_0001: is not what was sealed"),
    ],
)
def test_a_record_that_is_none_is_reported_before_the_score(
    root, rows, tmp_path, broken, complaint
):
    path = kept(broken(rows), tmp_path)
    with pytest.raises(InputError, match=complaint) as caught:
        score(root, tmp_path, "--record", str(path))
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_score_leaves_its_page_and_its_pictures(root, rows, tmp_path):
    assert score(root, tmp_path, "--record", str(kept(rows, tmp_path))) == 0
    page = (tmp_path / "out" / "score.md").read_text()
    shown = re.findall(r"!\[[^]]+\]\((score/[^)]+)\)", page)
    assert shown and all((tmp_path / "out" / one).is_file() for one in shown)
    assert "### Every miss" in page


def test_the_table_of_all_sets_is_that_of_the_records():
    page = sets.PAGE.read_text("utf-8")
    assert sets.sets_table() in page, "python -m benchmarks.generated_pages"
    assert strangers.strangers_page() in page, "python -m benchmarks.generated_pages"
    answers = baselines.load_answers(baselines.RECORD)
    assert baselines.page(answers) in page, "python -m benchmarks.generated_pages"


def test_a_section_of_another_benchmark(root, rows):
    benchmark = load_benchmark(root / "benchmarks" / "hidden_effects")
    row = next(row for row in rows if row["truth"]["kind"] == "outside")
    law = next(iter(benchmark.plan.laws))
    row["truth"] |= {"section": "mountain", "effects": {law: 1.0}}
    with pytest.raises(InputError, match="'mountain' is not in this benchmark; it has reservoir"):
        judged([row], benchmark, "method")


@pytest.mark.parametrize(
    ("document", "complaint"),
    [
        ("{}", "should be a valid list"),
        ('[{"name": "case_0001"}]', "0.sha256: is missing"),
        ('[{"name": "case_0001", "sha256": "abc"}]', "0.sha256: 'abc': string should match"),
    ],
)
def test_hashes_that_are_none(tmp_path, document, complaint):
    places = Places(tmp_path)
    places.sealed.write_text(document)
    with pytest.raises(InputError, match=complaint) as caught:
        sealed_cases(places)
    assert str(caught.value).startswith(f"{places.sealed}: ")


def test_a_truth_that_is_none(rows, tmp_path):
    places, row = Places(tmp_path), rows[0]
    places.sealed.write_text(json.dumps([{"name": "case_0001", "sha256": row["sha256"]}]))
    verdict, truth = places.verdict("case_0001", "method"), places.truth("case_0001")
    for path, document in ((verdict, row["verdicts"]["method"]), (truth, row["truth"])):
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(document))
    assert open_truths(places, ["method"])[0]["truth"] == row["truth"]
    truth.write_text("[]")
    with pytest.raises(InputError, match="case_0001.json: the whole: "):
        open_truths(places, ["method"])


def test_a_reach_that_is_none(root, tmp_path):
    places = Places(tmp_path)
    places.reach.write_text('[{"of": ["shaking"]}]')
    with pytest.raises(InputError, match="reach.json: 0.lambda: is missing"):
        reach_of(load_benchmark(root / "benchmarks" / "hidden_effects"), places, None)


def test_an_opened_set_is_written_again_from_its_record(root, tmp_path):
    folder = root / "benchmarks" / "hidden_effects"
    rows = load_rows(folder / "foreign_sixth_results.json")
    benchmark, places = load_benchmark(folder / "foreign_sixth.yaml"), Places(tmp_path)
    count = reopen(rows, benchmark, places, ["identified", "case_0003"])
    assert count == len(read_sealed(places.sealed)) == 7
    (row,) = [row for row in rows if row["truth"]["name"] == "case_0005"]
    truth = read_truth(places.truth("case_0005"))
    assert is_sealed(truth, row["sha256"]), "the seal is that of the record"
    case = diagnosis_case(load_case(places.case("case_0005")))
    targets, n = case.setup.targets, len(truth["places"])
    assert sorted(targets.measured) == pytest.approx(sorted(truth["measured"]), abs=1e-3)
    assert case.question.source_strength == 0.03 and n == 20
    with pytest.raises(InputError, match="none of case_9999"):
        reopen(rows, benchmark, places, ["case_9999"])
