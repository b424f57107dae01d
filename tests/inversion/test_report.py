"""The report: whole, alone, true to the result, and without the parts that have nothing to show."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from flowslide.command_line import main
from flowslide.commands.report import folders
from inversion.back_analysis.result import Result, save_result
from pipeline.cli import InputError
from report.back_analysis import PAGE, summary, write_report
from report.charts.iterations import MOST, shown_looks
from report.charts.uncertainty import bars
from report.data.back_analysis import BackAnalysisData, _case, load_back_analysis
from report.data.methods import reference, slides, undecided
from report.numbers import signed
from report.sentences.back_analysis import (
    answer_sentence,
    doubted,
    meaning_sentences,
    misfit_sentence,
    undetermined_sentences,
    variant_sentences,
)
from report.tables.back_analysis import answer_table, left_out_notes, measured_table
from tests.inversion.report_case import NASTY, document, full, least, measurement, parameter
from tests.pipeline.test_page import Outline

PICTURES = {"methods.svg", "measured.svg", "implied_strengths.svg", "before_after.svg",
            "history.svg", "catalogue.svg"}  # fmt: skip


def page_of(result: Result, folder: Path) -> str:
    """The page of a result that has nothing but its result.json, checked for being whole."""
    save_result(result, folder)
    text = write_report(load_back_analysis(folder), film=False).read_text("utf-8")
    outline = Outline()
    outline.feed(text)
    assert outline.open == []
    assert outline.links and all(link.startswith("data:") for link in outline.links)
    assert "url(" not in text and "@import" not in text
    return text.replace("\N{NO-BREAK SPACE}", " ")


def headings(text: str) -> list[str]:
    return re.findall(r"<h2>(.*?)</h2>", text)


@pytest.fixture(scope="module")
def full_page(tmp_path_factory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("full")
    return page_of(full(), folder), folder


# --- the page ---


def test_every_part_is_there_in_order(full_page):
    text, folder = full_page
    assert headings(text) == [
        "Answer",
        "The strength by every method",
        "Measured against predicted",
        "Which measurement asks for which strength",
        "What the data do not determine",
        "What moves the answer",
        "Variants of the question",
        "From another reading to this answer",
        "How it was found",
        "Among other flow slides",
        "Reviewer&#x27;s checklist",
        "How this was made",
    ]
    wanted = PICTURES | {"sensitivities.svg", "equally_good.svg", "waterfall.svg"}
    assert {path.name for path in folder.glob("*.svg")} == wanted
    assert text.count('src="data:image/svg+xml') == len(wanted)
    assert "27.5 ± 1.6 kPa" in text and "No cell size for the fill." in text
    assert "31.3" in text and "24.6 to 45.4" in text  # Kinetics with its range
    assert "level of the fill" in text and "not added" in text  # a target is reported, not added


def test_what_an_error_includes_is_what_was_varied(full_page, tmp_path):
    text, _ = full_page
    assert "includes the survey and every assumption that was varied" in text
    quick = page_of(least(), tmp_path)
    assert "is that of the survey alone: no assumption was varied" in quick
    assert "every assumption that was varied" not in quick


def test_a_poor_result_gives_a_page_without_empty_parts(tmp_path):
    text = page_of(least(), tmp_path)
    found = headings(text)
    assert "Variants of the question" not in found and "What moves the answer" not in found
    assert "The section before and after" not in found and "The slide as a film" not in found
    assert {path.name for path in tmp_path.glob("*.svg")} == PICTURES
    assert not re.search(r"<h2>[^<]*</h2>\s*</section>", text)


def test_names_are_text_and_not_markup(tmp_path):
    text = page_of(full(NASTY), tmp_path)
    assert "<script" not in text
    assert "&lt;script&gt;alert" in text


def test_without_any_strength(tmp_path):
    angle = parameter("phi", property="friction_deg", unit="deg", high=45.0, sigma_v0_kpa=None,
                      sigma_v0_std_kpa=None, ratio=None, ratio_std=None)  # fmt: skip
    text = page_of(Result.model_validate(document([angle])), tmp_path)
    assert "27.5 ± 1.6°" in text
    assert "The strength by every method" not in headings(text)
    assert "Among other flow slides" not in headings(text)


def test_the_same_result_gives_the_same_bytes(full_page, tmp_path):
    _, folder = full_page
    page_of(full(), tmp_path)
    assert (tmp_path / PAGE).read_bytes() == (folder / PAGE).read_bytes()
    for name in PICTURES:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


# --- what it says ---


def test_the_answer_is_one_sentence():
    sentence = answer_sentence(BackAnalysisData(Path(), full()))
    assert sentence == (
        "S_r of the fill: 27.5 ± 1.6 kPa (S_r/σ'_v0 = 0.183 ± 0.011); by the material point method "
        "at 2 m spacing."
    )
    made = document([parameter("s", equally_good_range=[20.0, 33.0])])
    told = answer_sentence(BackAnalysisData(Path(), Result.model_validate(made)))
    assert "equally good from 20.0 to 33.0; by" in told
    made = document([parameter("s", equally_good_range=[27.0, 28.0])])
    assert "equally good" not in answer_sentence(
        BackAnalysisData(Path(), Result.model_validate(made))
    )
    made["answer"]["reached"] = False
    data = BackAnalysisData(Path(), Result.model_validate(made))
    assert "NOT FITTED" in answer_sentence(data)
    said = "\n".join([summary(data), *meaning_sentences(data)])
    assert "No 95 % range is given" in said and "95 % range:" not in said
    assert "What the data determine is not known" in said and "every unknown" not in said
    assert answer_table(data).rows[0][answer_table(data).header.index("95 %")] is None


def test_a_measurement_has_the_digits_of_its_deviation():
    for std, measured in ((5.0, "1.2 m"), (0.5, "1.2 m"), (0.02, "1.23 m"), (0.002, "1.234 m")):
        line = measurement("toe", measured=1.2341, std=std)
        made = Result.model_validate(document([parameter("s")], measurements=[line]))
        (row,) = measured_table(BackAnalysisData(Path(), made), made.measurements).rows
        assert row[2] == measured


def test_what_a_hand_check_doubts_stands_in_the_first_line():
    check = {"name": "stability", "value": 1.3, "low": None, "high": 1.05, "words": "it stands"}
    for agrees in (True, False):
        made = document([parameter("s")])
        made["hand_checks"] = [{**check, "agrees": agrees}]
        data = BackAnalysisData(Path(), Result.model_validate(made))
        said = summary(data)
        assert said.startswith("DOUBTED BY HAND CHECKS: it stands.") is not agrees
        assert "Checked by hand: it stands." in said
        assert doubted(data) in ("", said.splitlines()[0])


def test_misfits_are_not_hidden(full_page):
    sentence = misfit_sentence(BackAnalysisData(Path(), full()))
    assert sentence.startswith("Not reproduced: freeboard measured 1.5 ± 0.5 m, predicted −3.9 m")
    assert "held out" in sentence and "crest" not in sentence
    lead = re.search(r'<p class="lead">(.*?)</p>', full_page[0])[1]
    assert "Not reproduced: freeboard" in lead
    told = (
        "Not reproduced by variants: without the fill: freeboard measured 1.5 ± 0.5 m, "
        "predicted −2.2 m."
    )
    assert told in full_page[0]


def test_a_reading_that_meets_what_the_answer_misses_is_named():
    result = full()
    met = result.variants[0].model_copy(update={"predicted": {"freeboard": 1.9}})
    result = result.model_copy(update={"variants": [met]})
    (sentence,) = variant_sentences(BackAnalysisData(Path(), result))
    assert sentence == (
        "Reproduced by variants: without the fill: freeboard measured 1.5 ± 0.5 m, predicted 1.9 m."
    )


def test_constructed_data_are_called_so_and_no_misfit():
    result = full()
    far = [m.model_copy(update={"difference_in_std": 9.0}) if m.role == "constructed" else m
           for m in result.measurements]  # fmt: skip
    result = result.model_copy(update={"measurements": far})
    assert "profile" not in misfit_sentence(BackAnalysisData(Path(), result))


def test_a_profile_is_judged_as_a_whole():
    made = document([parameter("s")])
    heights = [2.0] * 18 + [9.0] * 2
    made["measurements"] += [
        measurement(f"profile at x {x} m", group="profile", type="surface_profile", measured=2.0,
                    std=0.5, predicted=y, difference_in_std=(y - 2.0) / 0.5, role="compared")
        for x, y in enumerate(heights)
    ]  # fmt: skip
    sentence = misfit_sentence(BackAnalysisData(Path(), Result.model_validate(made)))
    assert sentence.startswith("Measurements that were not fitted agree")  # 2 of 20: a tenth
    for line in made["measurements"][1:4]:
        line.update(predicted=0.0, difference_in_std=-4.0)
    sentence = misfit_sentence(BackAnalysisData(Path(), Result.model_validate(made)))
    assert sentence == (
        "Not reproduced: profile, 5 of 20 values off by more than 2 standard deviations, root mean "
        "square 2.3 m, worst at x 18 m (+14.0 standard deviations, compared)."
    )


def test_what_was_held_out_of_a_profile_is_judged_by_itself():
    def said(off: float, held: float) -> str:
        made = document([parameter("s")])
        made["measurements"] += [
            measurement(f"profile at x {x} m", group="profile", measured=2.0, std=1.0,
                        predicted=2.0 + one, difference_in_std=one, role=role)
            for x, (one, role) in enumerate([(off, "fitted")] * 10 + [(held, "held out")] * 2)
        ]  # fmt: skip
        return misfit_sentence(BackAnalysisData(Path(), Result.model_validate(made)))

    agree = said(0.1, 0.5)
    assert agree.startswith("Measurements that were not fitted agree") and "0 of 2" in agree
    assert said(3.0, 0.5).startswith("Not reproduced: profile, 10 of 10 values")
    off = said(0.1, 5.0)
    assert off.startswith("Not reproduced: profile, 2 of 2 values") and "held out" in off


def test_a_case_that_is_given_must_be_there():
    with pytest.raises(InputError, match=r"has no measurements.yaml"):
        _case("no/such/case", "lower_san_fernando_paper")
    assert _case("lower_san_fernando_paper", "").name == "lower_san_fernando_paper"
    assert _case(None, "nobody's") is None


def test_what_is_not_identifiable_is_reported():
    told = " ".join(undetermined_sentences(BackAnalysisData(Path(), full())))
    assert "Friction angle of the rolled fill is not identifiable" in told
    assert "± 2.9° after the fit, ± 2.9° before (its bounds, 27 to 37)" in told


def test_published_values_of_other_zones_are_left_out():
    (panel,) = slides(BackAnalysisData(Path(), full()))
    rows = {row.label: row for row in panel.rows}
    assert rows["Olson and Stark (2002)"].low == 15.8
    assert rows["Weber (2015), IMM (recalled)"].hollow
    assert "ZIF" not in rows  # it has no answer
    assert not any(row.value == 77.7 for row in panel.rows)
    assert reference("paper") == "the paper" and reference("paper_zone_1") == "the paper, zone 1"


def test_a_method_that_does_not_say_what_the_strength_is_is_left_out():
    method = {"title": "IMM", "value_kpa": 7.4, "low_kpa": 1.2, "high_kpa": 38.1}
    assert undecided(method) == "1.2 to 38.1 kPa by its judgement calls"
    assert undecided({**method, "low_kpa": 17.1}) == "" == undecided({**method, "low_kpa": None})
    none = {**method, "value_kpa": None, "reason": "no solution"}
    assert undecided(none) == "no solution"
    (note,) = left_out_notes(BackAnalysisData(Path(), full()))
    assert "ZIF (no answer)" in note and note in summary(BackAnalysisData(Path(), full()))


def test_the_first_line_is_the_strength_with_its_range_and_ratio():
    data = BackAnalysisData(Path(), full())
    (strength, *_) = data.answers
    low, high = strength.interval_95
    line = summary(data).splitlines()[0]
    assert f"{strength.value:.1f} ({low:.1f} to {high:.1f}) kPa" in line
    assert f"S_r/sigma'_v0 {strength.ratio:.3f}" in line and line.endswith("not diagnosed.")


def test_the_strongest_assumption_is_on_top():
    data = BackAnalysisData(Path(), full())
    found = bars(data, data.result.answer.parameters[0])
    assert found[0].label == "survey" and found[0].std == 1.5
    sizes = [max(map(abs, bar.changes)) for bar in found]
    assert sizes == sorted(sizes, reverse=True)
    assert [bar.std for bar in found if bar.label == "upper toe"] == [None]


@pytest.mark.parametrize(("number", "text"), [(-3.94, "−3.9"), (0.04, "0.0"), (-0.04, "0.0"),
                                              (10.7, "+10.7")])  # fmt: skip
def test_numbers_have_their_sign(number, text):
    assert signed(number) == text


def test_a_long_search_is_thinned_and_keeps_its_ends():
    whole, accepted = np.ones(30, dtype=bool), np.ones(30, dtype=bool)
    whole[3], accepted[5] = False, False
    looks = shown_looks(whole, accepted, answer=28)
    assert len(looks) <= MOST and looks[0] == 0 and looks[-1] == 28
    assert looks == sorted(set(looks)) and 3 not in looks and 5 not in looks
    assert shown_looks(whole, accepted, answer=2) == [0, 1, 2]


# --- the command ---


def test_show_prints_the_table_and_writes_the_page(tmp_path, capsys):
    folder = tmp_path / "results" / "dam" / "inversion"
    save_result(least(), folder)
    assert main(["report", "dam", "--set", f"results_folder={tmp_path / 'results'}"]) == 0
    told = capsys.readouterr().out
    assert "27.5 kPa" in told and PAGE in told
    assert (folder / PAGE).is_file()
    (folder / PAGE).unlink()
    assert main(["report", str(folder), "--report", "none"]) == 0
    assert not (folder / PAGE).exists()


def test_show_refuses_what_was_not_asked(tmp_path):
    with pytest.raises(InputError, match=r"neither a folder with a result\.json nor a case"):
        folders(str(tmp_path / "nothing"), tmp_path)


def test_show_refuses_the_folder_of_another_case(tmp_path, capsys):
    folder = tmp_path / "inversion"
    save_result(least(), folder)
    for name, words in (
        ("other_dam", "the result answers 'no_such_case'"),
        ("x", "no such folder"),
    ):
        if name != "x":
            (tmp_path / name).mkdir()
        with pytest.raises(InputError, match=rf"--case .*{name}: {words}"):
            main(["report", str(folder), "--case", str(tmp_path / name)])
    assert capsys.readouterr().out == "" and not (folder / PAGE).exists()
    (tmp_path / "no_such_case").mkdir()
    assert main(["report", str(folder), "--case", str(tmp_path / "no_such_case")]) == 0


def test_damaged_sections_are_named(tmp_path):
    save_result(least(), tmp_path)
    (tmp_path / "sections.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"sections\.npz: cannot be read"):
        load_back_analysis(tmp_path)


def test_another_set_than_the_case_has_is_named(tmp_path, root):
    made = json.loads(least().model_dump_json()) | {"measurement_set": "lunar"}
    save_result(Result.model_validate(made), tmp_path)
    page = write_report(load_back_analysis(tmp_path), film=False)  # no run, so no case is needed
    text = page.read_text("utf-8")
    assert "lunar" in text


@pytest.mark.slow
def test_a_real_case(lsfd, tmp_path):
    """At 4 m spacing: section, iterations, toes, and the known misfit of this dam."""
    out = tmp_path / "out"
    quiet = ["--quick", "--quiet", "--set", "inversion.step_seeds=2", "--report", "page"]
    assert main(["invert", str(lsfd), "--out", str(out), *quiet]) == 0
    text = (out / PAGE).read_text("utf-8")
    assert "with the reservoir as pressure in and on the soil" in text
    assert re.search(r"Not reproduced: [^<]*freeboard measured", text)
    assert "Constructed, not surveyed: profile" in text
    for name in ("section.png", "iterations.png"):
        assert (out / name).stat().st_size > 20_000
    data = load_back_analysis(out, lsfd)
    toe = data.toes[0]
    assert data.toe_place(toe.side, toe.value_m) == pytest.approx(76.02 - 53.0)
    assert data.side(data.strengths[0]) == "left"
    assert len(data.sections.final) == len(data.result.iterations)
