"""What a learned model says before the solver has an answer, and where it says nothing."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from benchmarks.studio import serving
from flowslide.studio.forecast import Forecaster
from flowslide.studio.live import Asked, question
from geometry.case import load_case
from pipeline.places import CASES, shipped
from tests.studio.browsing import WAIT_MS, answered, needs_chromium, watched
from tests.studio.messages import unpack

pytestmark = pytest.mark.slow
CASE = "lower_san_fernando"


@pytest.fixture(scope="module")
def forecaster():
    return Forecaster()


@pytest.fixture(scope="module")
def case():
    return load_case(shipped(CASES) / CASE)


def asked(case, value, number=1, **more):
    changes = {"strengths_kpa": {"liquefied_fill": value}}
    return question(Asked(type="run", id=number, spacing_m=2.0, changes=changes, **more), case)


def test_a_weaker_soil_is_expected_to_run_farther(forecaster, case):
    found = [unpack(forecaster.ask(asked(case, value)).result(120)) for value in (30.0, 20.0)]
    (strong, _), (weak, arrays) = found
    assert weak["toes"][0] < strong["toes"][0] - 5.0 and weak["type"] == "forecast"
    assert (arrays["low"] <= arrays["middle"]).all() and (arrays["middle"] <= arrays["high"]).all()
    assert arrays["x"].shape == arrays["high"].shape


def test_it_says_nothing_where_it_does_not_apply(forecaster, case):
    effect = [{"name": "rate_strengthening", "amplitude": 0.1}]
    assert forecaster.ask(asked(case, 20.0, effects=effect)).result(120) is None
    scene = case.scene.model_dump()
    (left, low), (right, _) = (scene["ground"]["points"][k] for k in (0, -1))
    scene["ground"]["points"] = [[left, low], [0.5 * (left + right), low - 3.0], [right, low]]
    bent = type(case.scene).model_validate(scene)
    whole = asked(case, 20.0)
    whole = type(whole)(1, type(case)(**{**vars(whole.case), "scene": bent}), False)
    assert forecaster.ask(whole).result(120) is None


def test_the_newest_question_of_a_page_alone_is_answered(forecaster, case):
    page = object()
    questions = [asked(case, 20.0 + k, k) for k in range(6)]
    answers = [forecaster.ask(one, page) for one in questions]
    found = [one.result(120) is not None for one in answers]
    assert found[-1] and not any(found[1:-1])


@needs_chromium
def test_its_band_is_shown_while_a_slider_is_dragged_until_the_deposit_is_there(tmp_path, browser):
    with serving(CASE, "--threads", "1", cwd=tmp_path) as address:
        page = watched(browser, width=1380, height=860)
        page.goto(address)
        answered(page, 1)
        box = page.locator("#sliders input[type=range]").first.bounding_box()
        status = page.locator("#status")
        page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + box["height"] / 2)
        page.mouse.down()
        for step in range(400):  # its libraries take some seconds to load
            x = box["x"] + (0.3 + 0.0005 * step) * box["width"]
            page.mouse.move(x, box["y"] + box["height"] / 2)
            page.wait_for_timeout(40)
            if "the learned model" in status.inner_text():
                break
        expect(page.locator("#readings")).to_have_class("before")
        assert "left toe at" in status.inner_text()
        page.mouse.up()
        expect(status).to_contain_text("answered in", timeout=WAIT_MS)
        expect(page.locator("#readings")).not_to_have_class("before")
        # An effect is nothing that it knows.
        page.get_by_label("add an effect").select_option("rate_strengthening")
        page.evaluate("delete document.body.dataset.first")
        page.locator("#effects [data-number]").click(click_count=3)
        page.keyboard.type("0.2")
        page.keyboard.press("Enter")
        page.wait_for_timeout(200)
        expect(status).to_contain_text("answered in", timeout=WAIT_MS)
        assert page.locator("body").get_attribute("data-first") is None
        assert not page.errors
