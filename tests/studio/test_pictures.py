"""What somebody takes away from the page: the film as it runs, and what is seen as a file."""

from __future__ import annotations

import csv
import re
import time
from xml.etree import ElementTree

import matplotlib.image
import pytest
from playwright.sync_api import expect

from benchmarks.studio import pixel_of
from geometry.scenes.drawings import read_section
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, stored

pytestmark = NEEDS_CHROMIUM


def saved(page, kind):
    """The file that the menu saves, chosen by the keyboard."""
    page.locator("#save summary").focus()
    page.keyboard.press("Enter")
    for _ in range(1 + ["png", "svg", "csv"].index(kind)):
        page.keyboard.press("Tab")
    with page.expect_download(timeout=20_000) as downloading:
        page.keyboard.press("Enter")
    expect(page.locator("#status")).to_contain_text("is with your downloads")
    return downloading.value


@pytest.mark.parametrize("speed", ["2", "8"])
def test_the_film_runs_as_fast_as_is_chosen(page, speed):
    def shown():
        return float(page.locator("#time").inner_text().split()[0])

    page.get_by_label("Speed of the film").select_option(speed)
    end = shown()
    page.locator("#play").click()
    page.wait_for_function(
        "() => { const now = parseFloat(document.querySelector('#time').value);"
        f" return now > 0 && now < {end}; }}",
        polling="raf",
        timeout=WAIT_MS,
    )
    began, first = time.perf_counter(), shown()
    page.wait_for_timeout(int(400 * (end - first) / float(speed)))
    moved, took = shown() - first, time.perf_counter() - began
    # The clock is read before and after the page's own.
    assert moved == pytest.approx(float(speed) * took, rel=0.25, abs=0.1 * float(speed))
    expect(page.locator("#play")).to_have_text("Play", timeout=WAIT_MS)
    assert shown() == end


def test_a_deposit_is_saved_as_it_is_seen(page, tmp_path):
    points = int(re.sub(r"\D.*", "", page.locator("#status").inner_text()))
    numbers = saved(page, "csv")
    assert numbers.suggested_filename == "small-slide.csv"
    rows = list(csv.DictReader(numbers.path().read_text().splitlines()))
    assert len(rows) == points and {row["zone"] for row in rows} == {"loose", "crest", "back"}
    toe = 40.0 - min(float(row["x_m"]) for row in rows)
    read = float(page.locator("#readings tbody td").nth(2).inner_text().split()[0])
    assert toe == pytest.approx(read, abs=2.5)
    drawing = ElementTree.parse(saved(page, "svg").path()).getroot()
    name = "{http://www.w3.org/2000/svg}"
    assert len(drawing.findall(f".//{name}rect")) > points
    words = [one.text for one in drawing.findall(f".//{name}text")]
    assert "loose" in words and "measured toe" in words
    # At the edge of the window the words leave the numbers of the heights alone.
    canvas = page.locator("#canvas").bounding_box()
    x, y = pixel_of(page, 26.0, 20.0)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(canvas["x"] + 4, y, steps=3)
    page.mouse.up()
    drawing = ElementTree.parse(saved(page, "svg").path()).getroot()
    toe = next(one for one in drawing.findall(f".//{name}text") if one.text == "measured toe")
    assert toe.get("text-anchor") == "middle"
    assert float(toe.get("x")) > 60
    saved(page, "png").save_as(tmp_path / "slide.png")
    canvas = page.locator("#canvas").bounding_box()
    high, wide, _ = matplotlib.image.imread(tmp_path / "slide.png").shape
    assert wide == 2 * canvas["width"] and high > 2 * canvas["height"]


def test_a_section_is_saved_as_it_can_be_imported(page, tmp_path, workspace):
    page.locator('[data-mode="section"]').first.click()
    saved(page, "csv").save_as(tmp_path / "section.csv")
    section = read_section(tmp_path / "section.csv")
    zones = stored(page, workspace)["scene"]["zones"]
    assert section.zones == {
        one["name"]: [tuple(place) for place in one["polygon"]] for one in zones
    }
    assert section.properties["crest"]["friction_deg"] == 34.0
    drawing = saved(page, "svg").path().read_text()
    assert drawing.count("<clipPath") == 4  # the sheet, and the hatch of each zone
