"""A case in three dimensions in a real Chromium: opened, turned, cut, run, and watched."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from benchmarks.studio import serving
from tests.studio.bodies import write_bank, write_gully
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, picture, watched

pytestmark = NEEDS_CHROMIUM


@pytest.fixture
def folder(tmp_path):
    """A workspace with a bank; its run takes seconds."""
    write_bank(tmp_path / "cases" / "bank")
    return tmp_path / "cases"


def _shows(page, what):
    expect(page.locator(f'body[data-shown="{what}"]')).to_have_count(1, timeout=WAIT_MS)


def _place(page, x, y):
    """Pixels of a place in the plan [m]."""
    frame = page.locator("#plan").bounding_box()
    left, top, scale = map(float, page.locator("#plan").get_attribute("data-box").split())
    return frame["x"] + (x - left) / scale, frame["y"] + (top - y) / scale


def _numbers(page, *labels):
    return [float(page.get_by_label(label).input_value()) for label in labels]


def _middle(page, name):
    frame = page.locator(f"#{name}").bounding_box()
    return frame["x"] + frame["width"] / 2, frame["y"] + frame["height"] / 2


NOTE_WORDS = """() => {
  window.words_ = { "body-play": [], "body-time": [] };
  for (const id of Object.keys(window.words_)) {
    const element = document.getElementById(id);
    new MutationObserver(() => {
      const { textContent } = element;
      if (window.words_[id].at(-1) !== textContent) window.words_[id].push(textContent);
    }).observe(element, { childList: true, characterData: true, subtree: true });
  }
}"""


def test_somebody_turns_a_bank_cuts_it_runs_it_and_watches(folder, browser):
    with serving(folder / "bank", "--threads", "1") as address:
        page = watched(browser, width=1380, height=900)
        page.goto(address)
        _shows(page, "ground")
        assert page.url.endswith("#3d/bank")
        expect(page.locator("#body-told")).to_contain_text("Before the slide")
        expect(page.locator("#body-editing")).to_contain_text("cannot be edited here")
        expect(page.get_by_role("button", name="Back-analyse")).to_be_disabled()
        expect(page.locator("#ask")).to_contain_text("It needs what was measured")
        expect(page.locator("#modes")).to_be_hidden()

        # Turned by the mouse and by keys; nearer by the wheel.
        seen = {page.locator("#relief").get_attribute("data-turn")}
        x, y = _middle(page, "relief")
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 80, y + 30, steps=4)
        page.mouse.up()
        page.wait_for_timeout(60)
        seen.add(page.locator("#relief").get_attribute("data-turn"))
        page.mouse.wheel(0, -200)
        page.wait_for_timeout(60)
        seen.add(page.locator("#relief").get_attribute("data-turn"))
        page.locator("#relief").focus()
        page.keyboard.press("ArrowLeft")
        page.wait_for_timeout(60)
        seen.add(page.locator("#relief").get_attribute("data-turn"))
        assert len(seen) == 4, seen
        expect(page.locator('#relief[data-fine="true"]')).to_have_count(1)

        # The section: an end is dragged in the plan, then typed, then the whole is moved by a key.
        ends = _numbers(page, "x of B", "y of B")
        page.mouse.move(*_place(page, *ends))
        page.mouse.down()
        page.mouse.move(*_place(page, 40.0, 14.0), steps=4)
        page.mouse.up()
        assert _numbers(page, "x of B", "y of B") == pytest.approx([40.0, 14.0], abs=0.5)
        page.mouse.move(*_place(page, 40.0, 14.0))
        page.mouse.down()
        page.mouse.move(*_place(page, 30.0, 8.0), steps=4)
        page.keyboard.press("Escape")
        page.mouse.up()
        assert _numbers(page, "x of B", "y of B") == pytest.approx([40.0, 14.0], abs=0.5)
        field = page.get_by_label("x of B")
        field.fill("=6+1")
        field.press("Tab")
        expect(page.locator("#body-left .wrong")).to_have_text("x of B: “=6+1” is no number")
        field.fill("35")
        field.press("Tab")
        assert _numbers(page, "x of B") == [35.0]
        page.locator("#plan").focus()
        page.keyboard.press("ArrowLeft")
        expect(page.get_by_label("x of B")).to_have_value("31")

        # A weaker clay is run as a job, and its film is there by itself.
        strength = page.get_by_label("S_r, soil")
        strength.fill("8")
        strength.press("Tab")
        page.get_by_role("button", name="Simulate").click()
        job = page.locator("#jobs li").first
        expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
        expect(job).to_contain_text("three dimensions at 2 m, soil 8 kPa")
        expect(job.locator(".found")).to_contain_text("toe runout: ")
        _shows(page, job.get_attribute("data-job"))
        expect(page.locator("#body-told")).to_contain_text("soil 8 kPa")
        expect(page.locator("#body-told")).to_contain_text("points 2 m apart")
        rows = page.locator("#readings tbody tr")
        expect(rows.filter(has_text="toe runout")).to_contain_text(" m")
        end = page.locator("#body-time").inner_text()

        # The film by the keyboard, from its beginning to its end, four times as fast.
        page.get_by_label("Speed of the slide's film").select_option("2")
        page.wait_for_timeout(1100)  # a key right after a field is meant for it
        page.locator("#relief").focus()
        page.evaluate(NOTE_WORDS)  # less than a second, which a look from here can miss
        page.keyboard.press(" ")
        expect(page.locator("#body-play")).to_have_text("Play", timeout=WAIT_MS)
        words = page.evaluate("window.words_")
        assert words["body-play"] == ["Pause", "Play"]
        times = [float(one.split()[0]) for one in words["body-time"]]
        assert times == sorted(times) and times[0] < float(end.split()[0])
        assert page.locator("#body-time").inner_text() == end
        for colour, words in (("change", "change of the surface"), ("speed", "largest speed"),
                              ("thickness", "at least 2 m"), ("zone", "soil")):  # fmt: skip
            page.get_by_label("What the map shows").select_option(colour)
            expect(page.locator("#body-legend")).to_contain_text(words)

        # Its pictures one by one; the last one stays.
        for key in "123":
            page.keyboard.press(key)
        assert page.locator(".pane:visible").count() == 1
        page.keyboard.press("1")
        page.keyboard.press("2")

        with page.expect_download() as downloading:
            page.locator("#save summary").click()
            page.get_by_role("button", name="Numbers (CSV)").click()
        assert downloading.value.suggested_filename == "bank-slide-section.csv"
        header, first, *_ = downloading.value.path().read_text().splitlines()
        assert header.startswith("way_m,x_m,y_m,ground_m") and float(first.split(",")[3]) == 0.0

        # A reload begins with the ground; another case and back again.
        page.reload()
        _shows(page, "ground")
        page.locator("#case").select_option("upper_san_fernando")
        expect(page.locator('body[data-case="upper_san_fernando"]')).to_have_count(1)
        expect(page.locator("#modes")).to_be_visible()
        expect(page.locator("#body-view")).to_be_hidden()
        page.locator("#case").select_option("3d/bank")
        _shows(page, "ground")
        job = page.locator("#jobs li").first
        job.get_by_role("button", name="Show it").click()
        _shows(page, job.get_attribute("data-job"))
        assert not page.errors


def test_what_was_surveyed_is_seen_and_a_file_that_changes_is_shown_again(tmp_path, browser):
    gully = write_gully(tmp_path / "cases" / "gully")
    with serving(gully, "--threads", "1") as address:
        page = watched(browser, width=820, height=900)
        page.goto(address)
        _shows(page, "ground")
        expect(page.locator("#body-legend")).to_contain_text("where it was surveyed")
        page.get_by_label("What the map shows").select_option("measured")
        expect(page.locator("#body-legend")).to_contain_text("as it was surveyed")
        page.mouse.move(*_place(page, 12.0, 8.0))
        expect(page.locator("#body-over")).to_contain_text("on top")
        assert page.locator("body").evaluate("one => one.scrollWidth <= innerWidth")
        picture(page, "body-narrow")

        page.get_by_role("button", name="Simulate").click()
        job = page.locator("#jobs li").first
        job.get_by_role("button", name="Cancel").click()
        expect(job).to_have_attribute("data-state", "cancelled", timeout=WAIT_MS)

        scene = gully / "scene3d.yaml"
        scene.write_text(scene.read_text().replace("spacing: 1.0", "spacing: 2.0"))
        expect(page.locator("#body-told")).to_contain_text("points 2 m apart", timeout=WAIT_MS)
        scene.write_text(scene.read_text().replace("surface: surface.tif", "surface: none.tif"))
        expect(page.locator(".faults")).to_contain_text("none.tif: no such file", timeout=WAIT_MS)
        expect(page.locator("#body-told")).to_contain_text("cannot be shown")
        assert not page.errors
