"""One dam has two strengths: both are shown together, as answers to two questions."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.adequacy.calibration import calibrate
from diagnosis.options import Options
from diagnosis.track_record import worth_of
from diagnosis.verdict.fitted_models import fitted_to_part
from diagnosis.verdict.verdict import Verdict, save_document
from inversion.back_analysis.result import FittedTo, Result, save_result
from report.back_analysis import write_report
from report.data.back_analysis import load_back_analysis
from report.numbers import plus_minus
from report.sentences.back_analysis import first_line
from report.table import plain
from report.two_strengths import two_strengths
from tests.diagnosis.straight import SIZE, Straight
from tests.diagnosis.verdict_case import adequate, compared, identified
from tests.inversion.report_case import document, parameter

TOE = FittedTo(measurements=["upstream toe"], covariance=[])
ALL = FittedTo(measurements=["upstream toe", "crest"], covariance=["the survey's errors"])


def back_analysis(folder, value: float, case: str) -> Result:
    made = document([parameter("residual_strength_1", value=value)], case=case)
    result = Result.model_validate(made)
    answer = result.answer.model_copy(update={"fitted_to": TOE})
    result = result.model_copy(update={"answer": answer})
    (folder / "inversion").mkdir()
    save_result(result, folder / "inversion")
    return result


def diagnosed(folder, verdict: Verdict) -> Verdict:
    (folder / "diagnosis").mkdir()
    verdict = verdict.model_copy(update={"fitted_to": ALL})
    save_document(verdict, folder / "diagnosis" / "verdict.json")
    return verdict


def test_both_are_shown_with_their_questions(tmp_path):
    verdict = diagnosed(tmp_path, identified())
    back_analysis(tmp_path, 40.0, verdict.case)
    both = two_strengths(tmp_path / "diagnosis")
    assert both == two_strengths(tmp_path / "inversion")
    (first, base, final) = both.table.rows
    assert first[:2] == ("back-analysis", "40.0 ± 1.6 kPa")
    assert first[2] == "fitted to upstream toe alone, unweighted"
    assert base[0] == "diagnosis, base model"
    name = "residual_strength_1"
    assert base[1] == plus_minus(verdict.base.values[name], verdict.base.std[name], "kPa")
    assert base[2] == (
        "fitted to upstream toe, crest, weighted by the covariance of the survey's errors"
    )
    assert final[0] == f"diagnosis, with {', '.join(verdict.final.effects)}"
    assert "standard deviations" in both.reason
    assert "compromise of a model that fails" in both.reason
    shown = both.text()  # its last column is folded
    assert plain(both.reason) in shown
    for cell in (*first, *base, *final):
        assert set(plain(cell).split()) <= set(shown.split())
    assert max(map(len, both.table.text(folded=True).splitlines())) <= 120


def test_where_they_agree_the_reason_says_so(tmp_path):
    verdict = diagnosed(tmp_path, adequate())
    back_analysis(tmp_path, verdict.base.values["residual_strength_1"] + 0.5, verdict.case)
    both = two_strengths(tmp_path / "diagnosis")
    assert len(both.table.rows) == 2 and "the two agree within 2 standard deviations" in both.reason


def test_a_comparison_is_enough(tmp_path):
    found = compared()
    (tmp_path / "diagnosis").mkdir()
    save_document(found, tmp_path / "diagnosis" / "compare.json")
    back_analysis(tmp_path, 12.0, found.case)
    both = two_strengths(tmp_path / "diagnosis")
    assert both.table.rows[1][2] == "not recorded by this version"


@pytest.mark.parametrize("missing", ["inversion", "diagnosis", "same case"])
def test_one_question_alone_shows_nothing(tmp_path, missing):
    verdict = identified()
    if missing != "diagnosis":
        diagnosed(tmp_path, verdict)
    if missing != "inversion":
        back_analysis(tmp_path, 12.0, "other" if missing == "same case" else verdict.case)
    assert two_strengths(tmp_path / "diagnosis").text() == ""
    assert two_strengths(tmp_path / "inversion").parts() == []


def test_a_damaged_neighbour_is_left_out(tmp_path):
    verdict = identified()
    back_analysis(tmp_path, 40.0, verdict.case)
    (tmp_path / "diagnosis").mkdir()
    (tmp_path / "diagnosis" / "verdict.json").write_text("{")
    assert two_strengths(tmp_path / "inversion").text() == ""


def test_the_page_of_the_back_analysis_names_the_diagnosis(tmp_path):
    verdict = diagnosed(tmp_path, identified())
    back_analysis(tmp_path, 40.0, verdict.case)
    text = write_report(load_back_analysis(tmp_path / "inversion"), film=False).read_text()
    assert "Two questions, two strengths" in text and "diagnosis, base model" in text


def test_the_covariance_is_named_by_its_parts():
    readings = Straight(np.ones(SIZE)).level
    base = calibrate(Straight(readings, noise=0.1), Options())
    found = fitted_to_part(base, Straight(readings).targets)
    assert found.measurements == ["toe", "profile", "history"]
    assert found.covariance[:2] == ["the survey's errors", "the place of the material points"]
    plain = calibrate(Straight(readings), Options(numerical_covariance=False))
    assert fitted_to_part(plain, Straight(readings).targets).covariance == ["the survey's errors"]


def test_the_first_line_has_the_range_that_the_verdict_has_been_worth(tmp_path):
    verdict = diagnosed(tmp_path, identified())
    back_analysis(tmp_path, 40.0, verdict.case)
    worth = worth_of("identified")
    low, high = worth.span(40.0)
    line = first_line(load_back_analysis(tmp_path / "inversion"))
    assert f"40.0 ({low:.1f} to {high:.1f}) kPa" in line
    assert (low, high) == pytest.approx(
        (40.0 / (1.0 + worth.most_off), 40.0 * (1.0 + worth.most_off))
    )
    assert f"with the verdict 'identified' (off by up to {100 * worth.most_off:.0f} %)" in line
