"""What an answer looks like in a real Chromium: its charts, its words, by mouse and by keys."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, picture

pytestmark = NEEDS_CHROMIUM
CREST = """
    - {name: crest, type: crest_settlement, at: initial_crest_x, x_m: 70.0, value_m: 1.0,
       std_m: 0.1, std_is: assumed, confidence: published, source: test}
"""


@pytest.fixture
def workspace(workspace):
    """The toe asks for less than the crest, which has settled little."""
    with (workspace.folder / "small" / "measurements.yaml").open("a") as file:
        file.write(CREST)
    path = workspace.folder / "small" / "inversion.yaml"
    path.write_text(path.read_text() + "fit: [toe]\n")
    return workspace


def test_which_measurement_asks_for_which_strength(page):
    page.get_by_label("Spacing of points").select_option("1 m")
    page.get_by_role("button", name="Quick").click()
    job = page.locator("#jobs > li").first
    expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
    rows = job.get_by_role("listitem")
    expect(rows).to_have_count(2)
    toe, crest = rows.all()
    expect(toe).to_contain_text("toe (fitted): ")
    expect(toe).to_contain_text(" kPa (")
    expect(crest).to_contain_text("crest (compared): ")
    assert toe.get_attribute("data-status") == "met"
    told = float(re.search(r": ([\d.]+) kPa \(", toe.inner_text()).group(1))
    answered = float(page.locator("#strengths tbody td").nth(1).inner_text())
    assert told == pytest.approx(answered, rel=0.1), "it is the one that was fitted"
    # The mark of the toe lies on the line of the answer, within its band.
    mark, line, band = (
        toe.locator(one).bounding_box() for one in (".mark", "line.answer", "rect.band")
    )
    assert mark["x"] + mark["width"] / 2 == pytest.approx(line["x"], abs=14)
    assert band["x"] < mark["x"] < band["x"] + band["width"]
    picture(page, "asked-strengths")

    # It is folded and unfolded by keys, and stays as it was left.
    summary = job.locator("summary", has_text="Which measurement asks for which strength?")
    summary.focus()
    page.keyboard.press("Enter")
    expect(toe).to_be_hidden()
    page.wait_for_timeout(1200)
    expect(toe).to_be_hidden()
    page.keyboard.press("Enter")
    expect(toe).to_be_visible()

    # Show it, by the mouse, with what the run takes.
    job.get_by_role("button", name="Show it").click()
    expect(page.locator("#status")).to_contain_text("answered in", timeout=WAIT_MS)
    first = page.locator("#readings tbody tr").first
    assert abs(float(first.locator("td").nth(3).inner_text())) < 0.5
    job.get_by_role("button", name="Open the report").click()
    frame = page.frame_locator("#frame")
    expect(frame.get_by_role("heading", name="Which measurement asks for which")).to_be_visible()
