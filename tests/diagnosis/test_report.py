"""The page of a diagnosis: whole, alone, true to the verdict, and without empty parts."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from diagnosis.hypotheses import strength
from diagnosis.reason import Reason
from diagnosis.track_record import worth_of
from diagnosis.verdict.sections_file import FILE_NAME, load_sections
from diagnosis.verdict.verdict import SOLVER_ERRORS, ValidationCase, Verdict, save_document
from flowslide.studio import diagnosis_answers
from inversion.back_analysis.result import FittedTo
from pipeline.cli import InputError
from report.charts.confounding import MOST, most_alike, order
from report.charts.effects import ranked
from report.charts.fingerprints import blocks, fingerprints
from report.charts.hidden import hidden_bars
from report.charts.profile import heading
from report.charts.strength_curve import plain_knots
from report.data.diagnosis import DiagnosisData, Document, load_diagnosis
from report.diagnosis import (
    COMPARE_PAGE,
    EXPLAIN_PAGE,
    TRACK_PAGE,
    summary,
    write_compare,
    write_explain,
    write_report,
    write_track,
)
from report.numbers import LN_RATIO, chance, from_to, number, plus_minus, with_unit
from report.sentences.diagnosis import (
    alarm_sentence,
    answer_sentences,
    confounded,
    error_sentence,
    is_by_hand,
    refuted_sentence,
    role_sentence,
    shortened,
    spoken,
    step_words,
    validation_sentence,
    window_sentence,
    worth_sentence,
)
from report.sentences.finding import (
    REASONS,
    candidate_sentence,
    fall_words,
    headline,
    lead,
    reason_words,
)
from report.table import plain
from report.tables.diagnosis import key_numbers, outcomes_table
from tests.diagnosis.verdict_case import (
    NASTY,
    STRENGTH,
    adequate,
    ambiguous,
    compared,
    explained,
    identified,
    least,
    save_section,
    unknown,
)
from tests.pipeline.test_page import Outline

ALWAYS = {"confounding.svg", "effects.svg", "fingerprints.svg", "hidden.svg", "histories.svg",
          "overview.svg", "profile.svg", "residuals.svg"}  # fmt: skip


def checked(path: Path) -> str:
    """The text of a page that needs nothing else."""
    text = path.read_text("utf-8")
    outline = Outline()
    outline.feed(text)
    assert outline.open == []
    assert all(link.startswith("data:") for link in outline.links)
    assert "url(" not in text and "@import" not in text
    assert not re.search(r"<h2>[^<]*</h2>\s*</section>", text)
    return text


def page_of(verdict: Verdict, folder: Path) -> str:
    save_document(verdict, folder / "verdict.json")
    return checked(write_report(folder))


def told(text: str) -> str:
    """What a reader reads, with plain spaces."""
    bare = re.sub(r"<(style|title).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
    return " ".join(html.unescape(bare).split())


def headings(text: str) -> list[str]:
    return re.findall(r"<h2>(.*?)</h2>", text)


def pictures(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("*.svg")}


def data_of(verdict: Verdict) -> DiagnosisData:
    return DiagnosisData(Path(), verdict)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("whole")
    save_section(folder)
    return page_of(identified(), folder), folder


# --- the page ---


def test_every_part_is_there_in_order(whole):
    text, folder = whole
    assert headings(text) == [
        "In short",
        "Measured against modelled",
        "Where it fails",
        "How far the error falls",
        "Which effects would explain it",
        "Fingerprints",
        "What cannot be distinguished",
        "The strength before and after",
        "What could be hidden in it",
        "Reviewer&#x27;s checklist",
        "How this was made",
    ]
    assert pictures(folder) == ALWAYS | {"steps.svg"}
    assert text.count('src="data:image/svg+xml') == len(pictures(folder))
    read = told(text)
    assert "missing effect strain softening 15.6 ± 2.0 kPa" in read
    assert "misfit, fitted data 1.9 → 1.1 standard deviations" in read and "3.1 → 1.2 " in read
    assert "21.9 ± 1.5 kPa 14.68 ± 0.73 kPa before" in read
    assert "128 of 250 allowed" in read and "5f0c1a92d3e4" in read and "null 20260101" in read


def test_an_unknown_effect_shows_its_curve_and_no_result(tmp_path):
    text = page_of(unknown(), tmp_path)
    assert "curve.svg" in pictures(tmp_path) and "steps.svg" not in pictures(tmp_path)
    assert "What the unknown effect looks like" in headings(text)
    read = told(text)
    assert "of all models tried, widened: not a result" in read
    assert "Not a result, only a range:" in read
    assert "no residual strength is reported from it" in read


def test_an_ambiguous_verdict_names_no_single_effect(tmp_path):
    read = told(page_of(ambiguous(), tmp_path))
    assert "missing effect" not in read.replace("which effect", "")
    assert "most probable pore pressure" in read
    assert re.search(r"pore pressure 56 % 21\.9 kPa overburden strength 39 % 22\.2 kPa", read)
    assert "displacement of a point at x 62 m" in read
    assert "How this could be refuted" in read and "it would read" in read


def test_a_poor_verdict_gives_a_page_without_empty_parts(tmp_path):
    text = page_of(least(), tmp_path)
    made = ["In short", "The strength", "Reviewer&#x27;s checklist", "How this was made"]
    assert headings(text) == made
    assert pictures(tmp_path) == {"overview.svg"}


@pytest.mark.slow
def test_names_are_text_and_not_markup(tmp_path):
    made = identified(NASTY).model_dump(mode="json")
    made["parameters"][0]["words"] = NASTY
    made["candidates"][0]["words"] = NASTY
    for line in made["measurements"]:
        line["measurement"] = line["measurement"].replace("profile", NASTY)
    made["base"]["window"]["measurement"] = NASTY
    text = page_of(Verdict.model_validate(made), tmp_path)
    assert "<script" not in text and "&lt;script&gt;alert" in text


def test_the_same_verdict_gives_the_same_bytes(whole, tmp_path):
    text, folder = whole
    save_section(tmp_path)
    assert page_of(identified(), tmp_path) == text
    for name in pictures(folder):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_compare_has_a_smaller_page(tmp_path):
    save_document(compared(), tmp_path / "compare.json")
    path = write_compare(tmp_path)
    assert path.name == COMPARE_PAGE
    text = checked(path)
    assert headings(text) == [
        "In short", "Measured against modelled", "Where it fails", "How this was made"
    ]  # fmt: skip
    assert "base model alarm p < 0.001" in told(text)


def test_explain_has_a_smaller_page(tmp_path):
    save_document(explained(), tmp_path / "explain.json")
    path = write_explain(tmp_path)
    assert path.name == EXPLAIN_PAGE
    assert headings(checked(path)) == [
        "In short", "Which effects would explain it", "Fingerprints",
        "What cannot be distinguished", "What could be hidden in it", "How this was made",
    ]  # fmt: skip


def test_track_marks_the_steps_of_a_person(tmp_path):
    steps = identified().steps
    path = write_track(tmp_path, "A dam", steps, by_hand=["with_strain_softening"])
    assert path.name == TRACK_PAGE
    read = told(checked(path))
    assert "2 models so far" in read and "1.9 standard deviations with the first, 1.1" in read
    assert step_words(1, steps, ["with_strain_softening"]) == "+ strain softening (by hand)"
    beside = [*steps, steps[1].model_copy(update={"effects": {"weak_base": 0.3}})]
    assert step_words(2, beside) == "base + weak base"
    both = beside[2].model_copy(update={"effects": {**steps[1].effects, "weak_base": 0.3}})
    assert step_words(2, [*steps, both]) == "+ weak base"
    assert step_words(2, [steps[0], both, steps[1]]) == "\N{MINUS SIGN} weak base"
    noted = steps[1].model_copy(update={"note": "by hand: cores say so"})
    assert is_by_hand(noted) and not is_by_hand(steps[1])
    assert headings(checked(write_track(tmp_path / "none", "A dam", []))) == []


def test_the_section_is_read_back(tmp_path):
    save_section(tmp_path)
    sections = load_sections(tmp_path)
    assert sections.toes["upstream toe"].place(30.0) == pytest.approx(17.0)
    middle = np.argmin(np.abs(sections.x - 120.0))
    assert sections.initial[middle] == pytest.approx(22.0, abs=1.0)
    assert sections.base[middle] == pytest.approx(16.0, abs=1.0)
    assert np.isnan(sections.initial[0])
    assert load_sections(tmp_path / "nothing") is None


def test_sections_of_an_earlier_version_have_points_of_one_volume(tmp_path):
    path = save_section(tmp_path)
    now = load_sections(tmp_path).final
    with np.load(path) as file:
        kept = dict(file)
    for name in ("initial", "base", "final"):
        kept[name] = kept[name][:, :2]
    np.savez(path, **kept)
    np.testing.assert_allclose(load_sections(tmp_path).final, now)


def test_what_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"verdict\.json"):
        write_report(tmp_path)
    save_document(least(), tmp_path / "verdict.json")
    (tmp_path / FILE_NAME).write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"sections\.npz: cannot be read"):
        load_diagnosis(tmp_path)


# --- what it says ---


@pytest.mark.parametrize("made", [identified, ambiguous, unknown])
def test_a_finding_is_always_among_the_effects_tested(made):
    assert "tested" in lead(data_of(made()))


def finding(found: Document, **answer: object) -> str:
    """The headline of a document, its answer changed."""
    if answer:
        answer = found.answer.model_copy(update=answer)
        found = found.model_copy(update={"answer": answer})
    return headline(found)


def test_every_finding_is_a_sentence():
    fall = "chi² falls from 100 to 36 (noise 27), on held-out data from 94.3 to 14.0 (noise 10)"
    assert finding(identified()) == (
        f"The measurements ask for strain softening, among the 10 effects tested: {fall}. Where "
        "the truth is known, explanations like this one were right in 88 of 100."
    )
    said = finding(identified(), families=["soil"], members=["core", "fill"], chance=None)
    assert said.startswith("The measurements ask for another soil where it is not calibrated, am")
    assert said.endswith(f"cannot tell which: core or fill. With strain softening {fall}.")
    said = finding(ambiguous(), untried=[["bend"]])
    assert said.startswith(
        "The measurements ask for one of pore pressure; overburden strength; what could not be "
        "tried within the runs allowed, among"
    )
    assert said.endswith("it was among explanations like these in 38 of 100.")
    assert finding(adequate()).endswith("; nothing is missing among the 10 effects tested.")
    stood = {"S_r": identified().quoted[STRENGTH].model_copy(update={"at_least": 9.0})}
    assert finding(adequate().model_copy(update={"quoted": stood})).startswith("Nothing ran.")
    assert finding(least()).startswith("The base model is suspect (p = ")
    failing = "The base model does not explain the measurements (p < 0.001, by "
    assert finding(unknown()).startswith(failing)
    assert finding(unknown()).endswith("and no effect among the 10 effects tested does.")
    assert "fits late, one random pattern of many, which" in finding(unknown(), by_chance=["late"])
    worse = identified().model_copy(update={"verdict": "unknown_effect"})
    why = Reason(kind="misfit_left", numbers=[0.31])
    said = finding(worse, not_enough=why, chance=None)
    assert said.startswith(f"Strain softening improves the model, {fall}, and does not explain")
    assert ": 31 % of the misfit beyond noise is left, " in said
    said = finding(worse, not_enough=Reason(kind="too_often_wrong"), chance=0.4)
    assert said.startswith(f"Strain softening would explain the measurements, {fall}, and is not")
    assert "wrong too often. Where the truth is known, explanations like this one" in said


def test_the_finding_of_a_comparison_says_where_it_fails():
    found = compared()
    said = headline(found)
    assert said.startswith(
        "The base model does not explain the measurements (chi² 99.7 on 28 degrees of freedom, "
        "combined p < 0.001, by "
    )
    assert said.endswith("; it fails most along profile from x 85 to 105 m.")
    nowhere = found.base.model_copy(update={"window": None})
    suspect = found.model_copy(update={"base": nowhere, "alarm": "suspect"})
    assert "may not explain" in headline(suspect) and "; farthest off is " in headline(suspect)
    unseen = nowhere.tests[0].model_copy(update={"name": "held_out", "p": 0.0})
    elsewhere = nowhere.model_copy(update={"tests": [*nowhere.tests, unseen]})
    said = headline(found.model_copy(update={"base": elsewhere}))
    assert said.endswith("by the held-out data)."), "which no fitted measurement is to blame for"
    assert headline(found.model_copy(update={"alarm": "adequate"})) == (
        "The base model explains the measurements within their errors (chi² 99.7 on 28 degrees of "
        "freedom, combined p < 0.001)."
    )


def test_a_reason_has_its_words():
    assert set(REASONS) == set(get_args(Reason.model_fields["kind"].annotation))
    assert reason_words(None) == ""
    for said, kind, of, *numbers in (
        ("chi² falls by 5.0 only; 6 are asked for", "small_fall", "", 5.0, 6.0),
        ("S_r is at its bound, where the evidence means nothing", "at_bound", "S_r"),
        ("its tests still fail (p = 0.005, by the residuals of toe)", "tests_fail", "group toe",
         0.005),
        ("60 % of the excess misfit of the held-out data is left", "held_out_left", "", 0.6),
    ):  # fmt: skip
        assert reason_words(Reason(kind=kind, of=of, numbers=numbers)) == said


def test_files_of_earlier_versions_are_read():
    """They have the finding as a sentence, and reasons in words."""
    made = identified().model_dump(mode="json") | {"sentence": "It is strain softening."}
    made["answer"]["not_enough"] = ""
    made["candidates"][0]["refit"]["why_not"] = ""
    made["candidates"][1]["refit"]["why_not"] = "the evidence rises by 1.0 only"
    found = Verdict.model_validate(made)
    assert found.answer.not_enough is None and "sentence" not in found.model_dump()
    first, second = (one.refit.why_not for one in found.candidates[:2])
    assert first is None and reason_words(second) == "the evidence rises by 1.0 only"


def test_synthetic_measurements_are_called_constructed():
    made = identified()
    manifest = {**made.manifest, "settings": {"synthetic": True}}
    sentence = lead(data_of(made.model_copy(update={"manifest": manifest})))
    assert sentence.endswith("The measurements are synthetic, made by a simulation.")
    assert "synthetic" not in lead(data_of(made))


def test_held_out_and_constructed_data_are_reported():
    assert role_sentence(data_of(identified())) == (
        "Held out, not fitted: profile from x 80 to 95 m, toe history. Constructed, not surveyed: "
        "drawn crest; shown only, not part of a fit or score."
    )


def test_a_second_section_judges_the_answer():
    check = ValidationCase(case="second_dam", n=12, chi2_base=108.0, chi2_final=12.0)
    data = data_of(identified().model_copy(update={"validation_case": check}))
    assert "misfit, second dam 3.0 → 1.0 " in told(key_numbers(data).html())
    assert "On second dam, which was not fitted (12 numbers" in validation_sentence(data)
    assert validation_sentence(data_of(identified())) == ""


def test_where_and_how_it_fails_is_reported():
    verdict = identified()
    sentence = alarm_sentence(data_of(verdict)).replace("\N{NO-BREAK SPACE}", " ")
    assert "chi² 99.7 on 28 degrees of freedom" in sentence
    assert "all combined p < 0.001" in sentence
    sentence = window_sentence(verdict.base.window, "base model")
    assert sentence.startswith("Worst stretch of the base model: profile from x 85 to 105 m, 5 ")
    assert window_sentence(None, "base model") == ""


def test_what_such_a_verdict_has_been_worth_is_reported():
    """As a benchmark by other codes found it; nothing where no strength is quoted."""
    for verdict in (identified(), ambiguous()):
        found = worth_of(verdict.verdict)
        said = worth_sentence(data_of(verdict)).replace("\N{NO-BREAK SPACE}", " ")
        assert f"of {found.slides} slides made by other codes" in said
        assert f"by {100 * found.most_off:.0f} % or less in nine of ten, which here is " in said
        (quoted,) = verdict.quoted.values()
        middle = (quoted.intervals["95%"][0] * quoted.intervals["95%"][1]) ** 0.5
        for end in (middle / (1.0 + found.most_off), middle * (1.0 + found.most_off)):
            assert f"{end:.3g}" in said
        assert f"its 95 % interval held it in {found.held}." in said
        assert worth_sentence(data_of(verdict.model_copy(update={"quoted": {}}))) == ""
    assert worth_of("ambiguous").most_off > worth_of("identified").most_off


def test_rivals_are_reported():
    told_ = " ".join(answer_sentences(data_of(ambiguous())))
    assert "Measure what is proposed" in told_
    assert "Measure what is proposed" not in " ".join(answer_sentences(data_of(identified())))
    assert "Most probable: pore pressure" in told_
    assert "pore pressure (56 %); overburden strength (39 %)" in told_
    assert confounded(data_of(ambiguous()), 0.95)[0][:2] == ("overburden_strength", "pore_pressure")


def test_how_an_answer_could_be_refuted_is_reported():
    said = refuted_sentence(ambiguous())
    assert "With pore pressure it would read dx 21.04 ± 0.62 m, dy −3.20 ± 0.31 m." in said
    assert "more than two of these standard deviations away is against it" in said
    rows = outcomes_table(ambiguous().next_measurement).rows
    assert [row[1] for row in rows] == ["pore pressure", "overburden strength"]
    assert [row[0] for row in rows] == ["marker at x 62 m, y 4 m", ""], "named once"
    assert said in diagnosis_answers.verdict(ambiguous())["answer"], "the studio says so, too"
    assert refuted_sentence(unknown()) == "", "nothing is proposed"


def test_what_promises_most_is_reported():
    sentence = candidate_sentence(data_of(identified())).replace("\N{NO-BREAK SPACE}", " ")
    assert sentence.startswith("Of 10 effects tested strain softening promises most: the liquefied")
    assert "(chi² would fall by 64, family-wise p < 0.001)" in sentence
    assert headline(explained()) == sentence
    first, *others = explained().candidates
    faint = explained().model_copy(
        update={"candidates": [first.model_copy(update={"p_family": 0.3}), *others]}
    )
    assert headline(faint).startswith("No effect stands out among the 10 tested: the best score")
    assert headline(faint.model_copy(update={"candidates": []})) == "No effect was tested."
    alike = candidate_sentence(data_of(ambiguous()))
    assert alike.endswith(" These data cannot tell it from overburden strength.")


@pytest.mark.slow
def test_steps_left_out_are_counted_above_and_listed_below(tmp_path):
    runs = identified().runs.model_copy(update={"cut_short": ["refit of a", "refit of b"]})
    read = told(page_of(identified().model_copy(update={"runs": runs}), tmp_path))
    assert "2 steps of the search are listed at the foot of the page" in read
    assert read.rindex("refit of a, refit of b") > read.index("How this was made")


def test_boundaries_are_reported_by_what_they_bound():
    assert spoken("boundary_top_of_the_sand") == "top of the sand"
    assert shortened("boundary_top_of_the_liquefied_zone", 20) == "top of the…"
    assert shortened("weak_base", 20) == "weak base"


def test_several_effects_are_counted_where_there_is_no_room():
    verdict = identified()
    final = verdict.final.model_copy(
        update={"effects": {"spatial_variability": 1.0, "boundary_top_of_the_sand": 1.0}}
    )
    data = data_of(verdict.model_copy(update={"final": final}))
    assert heading(data, data.series[0], True) == "profile: after, with 2 effects"
    assert heading(data_of(verdict), data.series[0], True).endswith("with strain softening")


# --- what the pictures show ---


def test_the_best_score_is_on_top_and_refits_stay():
    shown = ranked(data_of(identified()))
    assert shown[0].name == "strain_softening"
    drops = [(c.expected_drop, c.z) for c in shown]
    assert drops == sorted(drops, reverse=True)
    assert "side_shear" not in {c.name for c in shown}


def test_a_fingerprint_is_that_of_the_amplitude_found():
    data = data_of(identified())
    chosen = {entry.name: entry for entry in fingerprints(data)}
    assert len(chosen) == 10 and fingerprints(data)[0].name == "strain_softening"
    assert chosen["strain_softening"].amplitude == pytest.approx(20.0)  # of 10, 20, 40; found 15.6
    assert chosen["datum_shift"].amplitude == pytest.approx(0.5)


def test_constructed_numbers_have_no_column():
    found = {block.name: block for block in blocks(data_of(identified()))}
    assert "drawn crest" not in found
    assert found["profile"].ends == ("20 m", "150 m") and len(found["profile"].columns) == 27
    assert found["marker A"].ends is None and len(found["marker A"].columns) == 2


def test_like_stands_next_to_like():
    found = identified().confounding
    names = [found.names[place] for place in order(np.array(found.cosine))]
    places = [names.index(name) for name in ("pore_pressure", "overburden_strength")]
    assert abs(places[0] - places[1]) == 1
    assert sorted(names) == sorted(found.names)


def test_effects_that_look_like_another_are_shown_where_there_is_no_room_for_all():
    cosine = np.eye(50)
    for one, other in ((3, 49), (10, 45)):
        cosine[one, other] = cosine[other, one] = 0.9
    kept = most_alike(cosine)
    assert kept == sorted(kept) and len(kept) == MOST and {3, 49, 10, 45} < set(kept)
    assert most_alike(np.eye(4)) == [0, 1, 2, 3]


def test_the_largest_hidden_shift_comes_first():
    bars = hidden_bars(data_of(identified()), "residual_strength_1")
    sizes = [abs(change) for _, change in bars]
    assert sizes == sorted(sizes, reverse=True) and sizes[-1] >= 0.5


def test_the_knots_of_a_logarithm_are_drawn_as_what_it_is_of():
    knots, unit = plain_knots(unknown().unknown_curve)
    assert knots == pytest.approx([0.01, 0.0562, 0.316, 1.778, 10.0], rel=1e-3) and unit == "1/s"


def test_a_misfit_without_degrees_of_freedom_is_no_root_mean_square():
    verdict = identified()
    stage = verdict.base.model_copy(update={"dof": 0})
    data = data_of(verdict.model_copy(update={"base": stage}))
    read = f"{told(key_numbers(data).html())} {fall_words(data.verdict)}"
    assert "misfit, fitted data chi² 99.7 → chi² 35.6 degrees of freedom: 0, 27" in read
    assert "as many parameters as data" in read and "nan" not in read


@pytest.mark.slow
def test_a_base_model_on_a_bound_says_what_that_means(tmp_path):
    verdict = identified()
    name, low, high = (getattr(verdict.parameters[0], key) for key in ("name", "low", "high"))
    assert low < verdict.base.values[name] < high
    assert "rests on" not in told(page_of(verdict, tmp_path / "inside"))
    for value, side in ((low, "lower"), (high, "upper")):
        update = {"values": {name: value}, "std": {name: 0.0}}
        changed = verdict.model_copy(update={"base": verdict.base.model_copy(update=update)})
        read = told(page_of(changed, tmp_path / side))
        assert f"The base model rests on the {side} bound of" in read
        assert f"its {side} bound" in read


@pytest.mark.parametrize(
    ("value", "text"), [(0.0123456, "0.0123"), (99.97, "100"), (-3.0, "−3"), (12345.6, "12346")]
)
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_a_logarithm_is_told_as_a_factor_also_where_it_could_be_any():
    assert with_unit(0.5, "ln ratio") == "× 1.65" and with_unit(1e5, "ln ratio") == "× over 10000"
    assert from_to(-1e5, 1e5, "ln ratio") == "0 to over 10000"


def test_chances_and_spreads_are_short():
    plain = [chance(p).replace("\N{NO-BREAK SPACE}", " ") for p in (0.0, 0.0042, 0.04, 0.5)]
    assert plain == ["p < 0.001", "p = 0.0042", "p = 0.04", "p = 0.50"]
    spread = plus_minus(21.913, 1.49, "kPa").replace("\N{NO-BREAK SPACE}", " ")
    assert spread == "21.9 ± 1.5 kPa"


def test_a_contrast_is_written_as_the_factor_that_it_is():
    assert with_unit(np.log(3.3), LN_RATIO) == "× 3.3"
    assert plus_minus(np.log(0.5), np.log(1.25), LN_RATIO) == "× 0.5 (0.4 to 0.625)"
    assert from_to(np.log(0.4), np.log(0.8), LN_RATIO) == "0.4 to 0.8"
    assert from_to(-0.4, 1.0, "m") == "−0.4 to 1"
    layer = strength.part_at("part_x_31_to_43").candidate
    assert layer.unit == LN_RATIO and layer.prior_std == pytest.approx(np.log(2.0))


def test_a_terminal_tells_the_range_that_the_page_tells(tmp_path):
    verdict = identified()
    said = worth_sentence(DiagnosisData(tmp_path, verdict))
    assert "nine of ten" in said and plain(said) in summary(verdict, tmp_path)


def test_what_the_uncertainty_is_made_of_is_said(tmp_path):
    """A solver whose own error is most of the variance is what to improve."""
    own = {SOLVER_ERRORS[0]: 0.2, SOLVER_ERRORS[2]: 0.45, "the survey's errors": 0.35}

    def said(shares: dict[str, float]) -> str:
        fitted = FittedTo(measurements=["toe"], covariance=list(shares), shares=shares)
        changed = identified().model_copy(update={"fitted_to": fitted})
        return error_sentence(DiagnosisData(tmp_path, changed))

    assert "the size of the cells 45 %, the survey's errors 35 %" in said(own)
    assert "a finer model (--spacing)" in said(own)
    assert "--spacing" not in said({SOLVER_ERRORS[0]: 0.1, "the survey's errors": 0.9})
    assert said({"the survey's errors": 1.0}) == ""
