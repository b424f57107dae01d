"""The page in a real Chromium: what somebody sees who opens it and moves a slider."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from benchmarks.studio import serving
from flowslide.studio.security import write_opening
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, answered, picture, watched

pytestmark = NEEDS_CHROMIUM


def _answered(page, number):
    """Wait for the answer to a question; returns the simulated toe."""
    answered(page, number)
    return page.locator("#readings tbody tr").first.locator("td").nth(2).inner_text()


def test_somebody_moves_a_strength_and_watches_it_flow(address, browser, workspace):
    page = watched(browser)
    page.goto(address)
    before = _answered(page, 1)
    assert "token" not in page.url, "the address that is shown can be shared without harm"
    expect(page.locator("#readings tbody tr").first).to_contain_text("14.0 ± 2")
    strength = page.get_by_label("S_r, loose [kPa]")
    expect(strength).to_have_value("8")
    strength.fill("6")
    strength.press("Enter")
    weaker = _answered(page, 2)
    assert float(weaker.split()[0]) > float(before.split()[0])
    expect(page.locator("#status")).to_contain_text("at rest")

    # The film, by the keyboard.
    page.locator("#canvas").focus()
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_text("Play", timeout=WAIT_MS)
    page.get_by_label("Colour").select_option("displacement")
    expect(page.locator("#legend")).to_contain_text("displacement")

    # What may be missing: an effect by a switch.
    page.get_by_label("add an effect").select_option("rate_strengthening")
    expect(page.get_by_label("rate strengthening [", exact=False).first).to_be_visible()
    expect(page.locator("#status")).to_contain_text("answered in", timeout=WAIT_MS)

    # A reload begins with the files, which nothing has changed.
    page.reload()
    assert _answered(page, 1) == before
    assert not (workspace.folder / ".studio").exists()
    assert not page.errors

    stranger = browser.new_context().new_page()
    assert stranger.goto(address.split("?")[0]).status == 403
    expect(stranger.locator("body")).to_contain_text("refused")


def test_the_file_that_leads_to_the_studio(address, browser, tmp_path):
    """What `flowslide studio` gives a browser; a cookie that is strict comes along nevertheless."""
    page = watched(browser)
    page.goto(write_opening(tmp_path, address).as_uri())
    assert _answered(page, 1)
    assert "token" not in page.url and not page.errors


def test_a_job_is_started_survives_a_reload_and_is_cancelled(address, browser):
    page = watched(browser)
    page.goto(address)
    _answered(page, 1)
    page.get_by_role("button", name="Back-analyse").click()
    job = page.locator("#jobs li").first
    expect(job).to_have_attribute("data-state", "running", timeout=WAIT_MS)
    page.reload()
    job = page.locator("#jobs li").first
    expect(job).to_contain_text("back-analysis: small", timeout=WAIT_MS)
    job.get_by_role("button", name="Cancel").click()
    expect(job).to_have_attribute("data-state", "cancelled", timeout=WAIT_MS)
    expect(job.get_by_role("button", name="Go on")).to_be_visible()


def test_an_answer_shows_its_search_and_a_prediction_asks_for_its_strength(address, browser):
    page = watched(browser, height=860)
    page.goto(address)
    _answered(page, 1)
    page.get_by_label("Spacing of points").select_option("1 m")
    page.get_by_role("button", name="Quick").click()
    job = page.locator("#jobs li").first
    expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
    expect(job.locator(".found")).to_contain_text("S_r: ")
    expect(job.locator(".found")).to_contain_text("95 %")
    expect(job.locator("svg.history circle").nth(1)).to_be_visible()
    expect(page.locator("#strengths tbody tr")).to_contain_text("back-analysis")
    value = page.locator("#strengths tbody td").nth(1).inner_text()

    page.get_by_role("button", name="Predict ...").click()
    dialog = page.get_by_role("dialog", name="Predict")
    dialog.get_by_role("button", name="Predict").click()
    expect(dialog.get_by_role("alert")).to_contain_text("must be greater than 0")
    expect(dialog.get_by_label("standard deviation of S_r")).to_be_focused()
    dialog.get_by_role("button", name="As found for this case").click()
    mean = dialog.get_by_label("mean of S_r").input_value()
    assert f"{float(mean):.1f}" == value
    expect(dialog.locator("output")).to_contain_text(" to ")
    picture(page, "predict")
    dialog.get_by_role("button", name="Predict").click()
    job = page.locator("#jobs li").first
    expect(job).to_contain_text("prediction: small at 1 m", timeout=WAIT_MS)
    expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
    expect(job.locator(".found")).to_contain_text("toe: ")
    job.get_by_role("button", name="Open the report").click()
    expect(page.frame_locator("#frame").locator("h2").first).to_have_text("How far it would run")
    page.get_by_role("button", name="close").click()
    with page.expect_download(timeout=WAIT_MS) as downloading:
        job.get_by_role("button", name="PDF").click()
    assert downloading.value.suggested_filename == "small-predict.pdf"
    assert downloading.value.path().read_bytes().startswith(b"%PDF-")
    assert not page.errors


def test_lower_san_fernando_runs_farther_the_weaker_it_is(tmp_path, browser):
    with serving("lower_san_fernando", "--threads", "1", cwd=tmp_path) as address:
        page = watched(browser)
        page.goto(address)
        _answered(page, 1)
        strength = page.get_by_label("S_r, liquefied fill [kPa]")

        def numbers():
            rows = page.locator("#readings tbody tr")
            cells = {row.locator("td").first.inner_text(): row.locator("td").nth(2).inner_text()
                     for row in rows.all()}  # fmt: skip
            return [float(cells[name].split()[0])
                    for name in ("toe runout (upstream toe)", "freeboard (held out)")]  # fmt: skip

        found = []
        for number, value in enumerate((30, 20), start=2):
            strength.fill(str(value))
            strength.press("Enter")
            _answered(page, number)
            found.append(numbers())
        (strong_toe, strong_freeboard), (weak_toe, weak_freeboard) = found
        assert weak_toe > strong_toe + 10.0 and weak_freeboard < strong_freeboard - 0.5
        # At the published strength the toe is within two standard deviations of the survey.
        assert weak_toe == pytest.approx(53.0, abs=2 * 5.75)
