"""The page while its disk is full, its files change under it, or its server is away."""

from __future__ import annotations

import resource
import shutil
import time

import pytest
from playwright.sync_api import Page, expect

from benchmarks.studio import started
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, stored, tab, watched

pytestmark = NEEDS_CHROMIUM
IDLE = "() => document.querySelector('#status').textContent.includes('answered in')"


def opened(page: Page, address: str) -> None:
    page.goto(address)
    expect(page.locator('body[data-answered="1"]')).to_have_count(1, timeout=WAIT_MS)


def friction(page: Page, value: str) -> None:
    """Type another friction angle of the crest."""
    page.get_by_label("friction of firm [deg]").click(click_count=3)
    page.keyboard.type(value)
    page.keyboard.press("Tab")


def section(page: Page) -> None:
    page.keyboard.press("1")
    page.locator("summary", has_text="firm").click()


def test_files_that_are_half_written_or_gone_are_told_until_they_are_back(page, workspace):
    """By the page's own look: nobody has to edit anything first."""
    told, status = page.locator("#apart"), page.locator("#status")
    scene = workspace.place("small") / "scene.yaml"
    whole = scene.read_text()
    scene.write_text(whole[:300])
    expect(told).to_contain_text("scene.yaml: line 7: not valid YAML", timeout=WAIT_MS)
    expect(told).to_contain_text("The page shows what was there before")
    scene.write_text(whole)
    expect(told).to_be_hidden(timeout=WAIT_MS)

    scene.write_text(whole.replace("cohesion_kpa: 8.0", "cohesion_kpa: -8.0"))
    expect(status).to_contain_text("S_r must be at least 0 (is -8)", timeout=WAIT_MS)
    expect(status).to_have_class("bad")
    scene.write_text(whole.replace("cohesion_kpa: 8.0", "cohesion_kpa: 9.0"))
    expect(page.get_by_label("S_r, loose [kPa]")).to_have_value("9", timeout=WAIT_MS)

    # The folder has another name: it is in the list without a reload.
    workspace.place("small").rename(workspace.folder / "other")
    expect(told).to_contain_text("case 'small': there is none", timeout=WAIT_MS)
    expect(page.locator("#case option").first).to_have_text("other")
    page.locator("#case").focus()
    page.keyboard.type("other")
    page.keyboard.press("Enter")
    expect(page.locator('body[data-case="other"]')).to_have_count(1, timeout=WAIT_MS)
    expect(told).to_be_hidden()


def test_who_edits_while_a_file_is_half_written_chooses_once_it_is_whole(page, workspace):
    section(page)
    scene = workspace.place("small") / "scene.yaml"
    whole = scene.read_text()
    scene.write_text(whole[:300])
    expect(page.locator("#apart")).to_contain_text("not valid YAML", timeout=WAIT_MS)
    friction(page, "28")
    expect(page.locator("#status")).to_contain_text("not saved:")
    scene.write_text(whole.replace("cohesion_kpa: 8.0", "cohesion_kpa: 9.0"))
    page.get_by_role("button", name="Show what is there now").click(timeout=WAIT_MS)
    expect(page.locator("#status")).to_have_text("shown as it is now")
    assert stored(page, workspace)["scene"]["materials"]["firm"]["friction_deg"] == 34


@pytest.mark.parametrize("choice, angle", [("Show what is there now", 31), ("Keep mine", 34)])
def test_a_file_that_is_edited_beside_a_draft_is_not_written_over_unasked(
    page, workspace, choice, angle
):
    page.keyboard.press("1")
    page.locator("summary", has_text="loose").click()
    strength = page.get_by_label("S_r, first guess of loose [kPa]")
    strength.click(click_count=3)
    page.keyboard.type("-3")
    page.keyboard.press("Tab")
    expect(page.locator("#status")).to_contain_text("kept as a draft")
    scene = workspace.place("small") / "scene.yaml"
    scene.write_text(scene.read_text().replace("friction_deg: 34.0", "friction_deg: 31.0"))
    expect(page.locator("#apart")).to_contain_text("beside the draft", timeout=WAIT_MS)
    strength.click(click_count=3)  # nothing is written before somebody chooses
    page.keyboard.type("9")
    page.keyboard.press("Tab")
    page.wait_for_timeout(1000)
    assert "friction_deg: 31.0" in scene.read_text()
    page.get_by_role("button", name=choice).click()
    expect(page.locator("#apart")).to_be_hidden()
    expect(page.locator("#status")).to_have_text("saved", timeout=WAIT_MS)
    soils = stored(page, workspace)["scene"]["materials"]
    assert soils["firm"]["friction_deg"] == angle
    assert soils["loose"]["cohesion_kpa"] == (8 if angle == 31 else 9)


def test_a_case_that_cannot_be_read_is_not_named_as_the_one_that_is_open(page, workspace):
    shutil.copytree(workspace.place("small"), workspace.folder / "torn")
    (workspace.folder / "torn" / "scene.yaml").write_text("zones: [\n")
    page.reload()
    page.wait_for_function(IDLE, timeout=WAIT_MS)
    page.locator("#case").focus()
    page.keyboard.type("torn")
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_contain_text("torn/scene.yaml: line 2: not valid YAML")
    expect(page.locator("#case")).to_have_value("small")


def test_an_edit_waits_for_room_on_the_disk_and_its_case_stays_open(lone_workspace, browser):
    with started(lone_workspace.folder, "--threads", "1") as (server, address):
        page, asked = watched(browser), []
        opened(page, address)
        section(page)
        page.on("request", lambda one: asked.append(one.url) if one.method == "PUT" else None)
        before = resource.prlimit(server.pid, resource.RLIMIT_FSIZE, (600, -1))
        friction(page, "28")
        expect(page.locator("#status")).to_have_text("not saved: File too large")
        page.wait_for_timeout(3000)
        assert len(asked) <= 4, "it is asked less and less often"
        page.locator("#case").focus()
        page.keyboard.type("lower")
        page.keyboard.press("Enter")
        expect(page.locator("#case")).to_have_value("small")
        expect(page.locator("#status")).to_have_text("not saved: File too large")
        resource.prlimit(server.pid, resource.RLIMIT_FSIZE, before)
        expect(page.locator("#status")).to_have_text("saved", timeout=WAIT_MS)
        expect(page.locator("#apart")).to_be_hidden()
        found = stored(page, lone_workspace)
        assert found["scene"]["materials"]["firm"]["friction_deg"] == 28 and not found["draft"]
        first = lone_workspace.hidden("small", "first", "scene.yaml").read_text()
        assert "friction_deg: 34" in first
        page.errors.clear()  # the console has the requests that were refused
        page.context.close()


def test_a_server_that_comes_back_is_found_without_much_noise(lone_workspace, browser):
    tries = []
    with started(lone_workspace.folder, "--threads", "1") as (_, address):
        page = watched(browser)
        opened(page, address)
        page.on("websocket", lambda _: tries.append(time.monotonic()))
    page.wait_for_timeout(9000)
    assert 2 <= len(tries) <= 4, tries  # after 1, 2 and 4 s
    expect(page.locator("#status")).to_contain_text("the server is gone")
    page.locator("#sliders input[type=range]").first.focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#status")).to_contain_text("the server is gone")  # not "simulating ..."
    with started(lone_workspace.folder, "--threads", "1") as (_, address):
        other = tab(page.context)
        other.goto(address)
        page.wait_for_function(IDLE, timeout=WAIT_MS)
        expect(page.get_by_label("S_r, loose [kPa]")).to_have_value("8.1")
        assert not page.errors
        page.context.close()


@pytest.mark.parametrize("width", [820, 1380])
def test_buttons_of_the_tools_do_not_touch(address, browser, width):
    page = watched(browser, width=width)
    opened(page, address)
    page.keyboard.press("1")
    boxes = [one.bounding_box() for one in page.locator("#tools button").all()]
    for one in boxes:
        for other in boxes:
            if one is not other and abs(one["y"] - other["y"]) < 5 and other["x"] > one["x"]:
                assert other["x"] - one["x"] - one["width"] >= 3


def test_numbers_stand_in_one_column_whatever_their_unit(page):
    section(page)
    fields = page.locator("#section-left .field:not(.switch) .value > :first-child")
    boxes = [one.bounding_box() for one in fields.all() if one.is_visible()]
    numbers = [one for one in boxes if one["width"] < 100]
    assert len(numbers) >= 3
    assert len({round(one["x"]) for one in numbers}) == 1
    assert len({round(one["width"]) for one in numbers}) == 1


def test_a_slide_that_is_refused_leaves_what_is_shown_as_that_of_before(page):
    strength = page.get_by_label("S_r, loose [kPa]")
    strength.click(click_count=3)
    page.keyboard.type("-1")
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_contain_text("what is shown is of the values before")
    expect(page.locator("#readings")).to_have_class("before")
    strength.click(click_count=3)
    page.keyboard.type("9")
    page.keyboard.press("Enter")
    page.wait_for_function(IDLE, timeout=WAIT_MS)
    expect(page.locator("#readings")).not_to_have_class("before")
