"""The page of a score: every figure is in it, in words and in a picture."""

from dataclasses import replace

import pytest

from benchmarks.generated_pages import renew
from benchmarks.hidden_effects.run import METHOD, VARIANTS
from benchmarks.hidden_effects.scoring.asked import ASKED, MISSED, Asked
from benchmarks.hidden_effects.scoring.draw import draw_all
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.opened import shared
from benchmarks.hidden_effects.scoring.page import generated
from benchmarks.hidden_effects.scoring.score import Judged, score
from pipeline.cli import InputError
from tests.hidden_effects.judges import digest, perfect, truths


def accuse(truth):
    return digest(truth, "identified", ["effect_0"], nearest=0.98)


def judged_by(judge, number=160):
    return [
        Judged({**t, "name": f"case_{k:04d}", "section": "dam", "survey": "markers"}, judge(t),
               False if t["kind"] == "outside" else None)
        for k, t in enumerate(truths(number), start=1)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def method():
    """Right three times of four; else effect_0 is accused, and every rival looks alike."""
    right, wrong = judged_by(perfect), judged_by(accuse)
    return [wrong[k] if k % 16 >= 12 else right[k] for k in range(len(right))]


def test_every_figure_that_is_asked_for_is_computed(method):
    shares = score(method).shares
    assert {one.name for one in ASKED} == set(shares)


def test_met_and_missed():
    asked = Asked("precision", "right", 0.9)
    assert asked.verdict(Share(9, 10)) == "met"
    assert asked.verdict(Share(8, 10)) == MISSED
    assert asked.verdict(Share(0, 0)) == ""
    alarms = Asked("false_alarm", "alarms", 0.08, least=False)
    assert (alarms.verdict(Share(8, 100)), alarms.verdict(Share(9, 100))) == ("met", MISSED)
    assert alarms.bound == "at most 8 %"


def test_a_page_tells_everything(method):
    scores = {name: score(method) for name in VARIANTS}
    text = generated(scores[METHOD], scores, method, "images/x")
    found = score(method)
    for one in ASKED:
        assert f"| {one.words} | {found.shares[one.name].words} |" in text, one.name
    for words in ("median error of ln S_r before and after, where the name is right",
                  "the same in all singles", "look-alikes: set of at most three holds the truth",
                  "without the model's own error (C_num)", "images/x/asked.png"):  # fmt: skip
        assert words in text
    # A null that was accused is among the misses, one that was not is not.
    accused = [one.truth["name"] for one in method if one.truth["kind"] == "null" and one.alarmed]
    quiet = [one.truth["name"] for one in method if one.truth["kind"] == "null" and not one.alarmed]
    assert accused and all(f"| {name} |" in text for name in accused)
    assert quiet and not any(f"| {name} |" in text for name in quiet)


def test_ablations_are_compared_on_the_same_cases(method):
    by_variant = {METHOD: method, "no_projection": method[5:30], "tangent_only": method[:20]}
    found = shared(by_variant)
    assert list(found) == [METHOD, "no_projection", "tangent_only"]
    names = [one.truth["name"] for one in method[5:20]]
    assert all([one.truth["name"] for one in cases] == names for cases in found.values())
    scores = {name: score(cases) for name, cases in found.items()}
    assert "All on the same 15 cases." in generated(score(method), scores, method, "x")
    assert shared({METHOD: method, "no_projection": []}) == {}


def test_calibration_is_shown_with_probabilities_where_they_are_stated(method):
    text = generated(score(method), {}, method, "x")
    assert "### Calibration" in text and "| probability |" not in text
    sure = [replace(one, digest=one.digest.model_copy(update={"shares": [0.97]})) for one in method]
    told = generated(score(sure), {}, sure, "x")
    assert "| 0.95-1 | 0.97 |" in told and "| 0.2-0.5 | - | none |" in told


def test_effects_are_reported_by_bins(method):
    text = generated(score(method), {}, method, "x")
    own = [one for one in method if one.truth["kind"] == "single" and one.hidden == {"effect_3"}]
    cells = []
    for number in range(4):
        here = [one for one in own if one.bin == number]
        cells.append(f"{sum(one.right for one in here)} of {len(here)}" if here else "-")
    assert f"| effect_3 | {' | '.join(cells)} |" in text


def test_pictures_are_drawn(tmp_path, method):
    paths = draw_all(tmp_path, score(method), method)
    assert {path.name for path in paths} == {
        "asked.png", "detectability.png", "confusion.png", "strength.png",
            "calibration.png"}  # fmt: skip
    assert all(path.stat().st_size > 5000 for path in paths)


def test_pictures_of_few_cases_are_drawn(tmp_path, method):
    """A slice may have no pair, no stranger, and no right name."""
    nulls = [one for one in method if one.truth["kind"] == "null"][:2]
    assert all(path.is_file() for path in draw_all(tmp_path, score(nulls), nulls))


def test_a_page_keeps_what_is_written_by_hand(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- score: begin -->\nold\n<!-- score: end -->\nafter\n")
    renew(page, score="new\n")
    assert page.read_text() == "before\n<!-- score: begin -->\nnew\n<!-- score: end -->\nafter\n"
    with pytest.raises(InputError, match="other"):
        renew(page, other="new")
