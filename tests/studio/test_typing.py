"""Numbers as engineers type and paste them: other units, decimal commas, spreadsheet blocks."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from benchmarks.studio import pixel_of
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, stored, watched

pytestmark = NEEDS_CHROMIUM
SAVED = re.compile("^(saved|kept as a draft|not pasted|“|$)|answered in")


@pytest.fixture
def page(address, browser):
    found = watched(browser, width=1380, height=860)
    found.goto(address)
    found.context.grant_permissions(["clipboard-read", "clipboard-write"])
    expect(found.locator('body[data-case="small"]')).to_have_count(1, timeout=WAIT_MS)
    found.locator('[data-mode="section"]').first.click()
    yield found
    assert not found.errors


def typed(page: Page, label: str, text: str, key: str = "Tab") -> None:
    """Type over a field, and leave it by a key."""
    page.get_by_label(label, exact=True).locator("visible=true").click(click_count=3)
    page.keyboard.type(text)
    page.keyboard.press(key)


def paste(page: Page, label: str, text: str) -> None:
    """Paste into a field as Ctrl+V does."""
    page.evaluate("text => navigator.clipboard.writeText(text)", text)
    page.get_by_label(label, exact=True).locator("visible=true").click()
    page.keyboard.press("Control+v")


def saved(page: Page, workspace, *keys: object):
    """What is in the files once all is saved."""
    expect(page.locator("#status")).to_have_text(SAVED, timeout=WAIT_MS)
    node = stored(page, workspace)
    for key in keys:
        node = node[key]
    return node


def focused(page: Page) -> str:
    return page.evaluate("document.activeElement.getAttribute('aria-label') ?? ''")


def test_a_number_in_another_unit_is_converted_and_shown(page, workspace):
    page.locator("summary", has_text="firm").click()
    typed(page, "density of firm [kg/m³]", "120 pcf")
    typed(page, "cohesion of firm [kPa]", "250 psf")
    typed(page, "friction of firm [deg]", "33,5")
    soil = saved(page, workspace, "scene", "materials", "firm")
    assert soil["density"] == pytest.approx(120 * 16.01846, rel=1e-5)
    assert soil["cohesion_kpa"] == pytest.approx(250 * 0.04788026, rel=1e-5)
    assert soil["friction_deg"] == 33.5
    told = page.locator(".converted:visible")
    assert told.all_inner_texts() == ["250 psf = 11.9701 kPa", "120 pcf = 1922.22 kg/m³"]
    typed(page, "cohesion of firm [kPa]", "3")
    expect(told).to_have_text(["120 pcf = 1922.22 kg/m³"])
    page.keyboard.press("3")  # no short cut where somebody has just typed
    assert page.evaluate("document.body.dataset.mode") == "section"


def test_what_is_not_understood_stays_in_its_field_and_changes_nothing(page, workspace):
    page.locator("summary", has_text="firm").click()
    label = "cohesion of firm [kPa]"
    field = page.get_by_label(label, exact=True)
    for text, said in (
        ("12 ft", "“ft” is not understood here"),
        ("1,900", "may be 1900 or 1.900"),
        ("soft", "is no number"),
    ):
        typed(page, label, text)
        typed(page, "friction of firm [deg]", "31" if text == "soft" else "30")
        expect(field).to_have_value(text)
        expect(field).to_have_attribute("aria-invalid", "true")
        expect(page.locator("#section-left .wrong")).to_contain_text(said)
        soil = saved(page, workspace, "scene", "materials", "firm")
        assert soil["cohesion_kpa"] == 1.0
    typed(page, label, "2")
    expect(page.locator("#section-left .wrong")).to_have_count(0)
    assert saved(page, workspace, "scene", "materials", "firm")["cohesion_kpa"] == 2


def test_enter_goes_down_and_arrows_step(page, workspace):
    page.locator("#section-left .zone input").first.click()
    typed(page, "x of vertex 2 [m]", "71", "Enter")
    assert focused(page) == "x of vertex 3 [m]"
    page.keyboard.type("71")  # it was chosen as a whole
    page.keyboard.press("Shift+Enter")
    assert focused(page) == "x of vertex 2 [m]"
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowDown")
    assert focused(page) == "x of vertex 2 [m]"
    typed(page, "x of vertex 2 [m]", "=6+1", "Enter")
    told = page.locator("#section-right .wrong")
    expect(told).to_have_text("vertex 2, x: “=6+1” is no number")
    page.keyboard.press("Shift+Enter")
    page.keyboard.press("Escape")
    expect(told).to_have_text("")
    ring = saved(page, workspace, "scene", "zones", 0, "polygon")
    assert ring[1][0] == 63 and ring[2][0] == 71
    page.locator("summary", has_text="firm").click()
    typed(page, "friction of firm [deg]", "35", "Enter")
    assert focused(page) == "cohesion of firm [kPa]"


def test_tab_goes_from_number_to_number_and_rows_come_and_go_by_keys(page, workspace):
    page.locator("#section-left .zone input").first.click()
    typed(page, "x of vertex 2 [m]", "71")
    page.keyboard.type("0.5")
    page.keyboard.press("Tab")
    assert focused(page) == "x of vertex 3 [m]"
    page.keyboard.type("72")  # counts, though the next key is none that leaves the field
    page.keyboard.press("Insert")
    assert focused(page) == "x of vertex 4 [m]"
    ring = saved(page, workspace, "scene", "zones", 0, "polygon")
    assert ring == [[40, 0], [71, 0.5], [72, 6], [62, 6], [52, 6]]
    page.keyboard.press("Control+Delete")
    assert focused(page) == "x of vertex 3 [m]"
    page.keyboard.press("Control+Delete")
    ring = saved(page, workspace, "scene", "zones", 0, "polygon")
    assert ring == [[40, 0], [71, 0.5], [52, 6]]


def test_a_block_goes_over_the_vertices_and_beyond(page, workspace):
    """Borders that zones share move together, and one step takes it back."""
    page.locator("#section-left .zone input").nth(2).click()
    before = saved(page, workspace, "scene", "zones")
    paste(page, "x of vertex 2 [m]", "x [ft]\ty [ft]\n300\t0\n230\t32,5\n230\t26,5")
    expect(page.locator("#status")).to_have_text("saved: 3 vertices pasted, 2 moved, 1 added")
    zones = saved(page, workspace, "scene", "zones")
    assert zones[2]["polygon"] == [[70, 0], [91.44, 0], [70.104, 9.906], [70.104, 8.077]]
    assert zones[1]["polygon"][2] == [70.104, 9.906]
    page.keyboard.press("Control+z")  # nothing has been typed in the cell: it takes the paste back
    assert saved(page, workspace, "scene", "zones") == before
    expect(page.get_by_label("x of vertex 2 [m]")).to_have_value("90")
    page.get_by_label("x of vertex 2 [m]").click(click_count=3)
    page.keyboard.type("12")
    page.keyboard.press("Control+z")  # what is typed has an undo of its own
    page.keyboard.press("Control+z")
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    assert saved(page, workspace, "scene", "zones") == before

    paste(page, "x of vertex 1 [m]", "No\tChainage (m)\tElevation (m)\n1\t71\t0\n2\t91\t0,5")
    assert saved(page, workspace, "scene", "zones")[2]["polygon"][:2] == [[71, 0], [91, 0.5]]
    page.keyboard.press("Control+z")
    assert saved(page, workspace, "scene", "zones") == before

    for block, said in (
        ("1\t2\n3\tx", "not pasted: “x” is no number"),
        ("1\t2\t3\n1\t2\t3", "not pasted: 3 columns, where 2 fit"),
        ("1\t2\n3", "not pasted: row 2 (3) has 1 number, the first one 2"),
        ("1\n2\n3\n4", "not pasted: 4 rows, where 3 vertices are from here on"),
    ):
        paste(page, "x of vertex 1 [m]", block)
        expect(page.locator("#status")).to_have_text(said)
    assert saved(page, workspace, "scene", "zones") == before


def test_a_zone_is_drawn_by_a_block(page, workspace):
    page.mouse.click(*pixel_of(page, 110.0, 15.0))
    page.keyboard.press("z")
    paste(page, "next vertex as x, y [m]", "90;0\n100;0\n100;2,5\n90;0")
    zones = saved(page, workspace, "scene", "zones")
    assert zones[3]["polygon"] == [[90, 0], [100, 0], [100, 2.5]]


def test_a_column_fills_the_fields_of_a_soil(page, workspace):
    page.locator("summary", has_text="firm").click()
    before = saved(page, workspace, "scene", "materials", "firm")
    paste(page, "friction of firm [deg]", "31,5\n50 psf\n1 950")
    expect(page.locator("#status")).to_contain_text("not pasted: “950” is not understood here")
    assert saved(page, workspace, "scene", "materials", "firm") == before
    paste(page, "friction of firm [deg]", "31,5\n50 psf\n1950")
    expect(page.locator("#status")).to_have_text("saved: 3 numbers pasted", timeout=WAIT_MS)
    soil = saved(page, workspace, "scene", "materials", "firm")
    assert (soil["friction_deg"], soil["density"]) == (31.5, 1950)
    assert soil["cohesion_kpa"] == pytest.approx(2.39401)
    page.locator("#undo").click()
    expect(page.locator("#status")).to_have_text("saved", timeout=WAIT_MS)
    assert saved(page, workspace, "scene", "materials", "firm") == before


def test_a_column_of_blow_counts_is_pasted(page, workspace):
    page.locator('[data-mode="survey"]').first.click()
    page.locator("summary", has_text="Blow counts").click()
    paste(page, "blow count of loose", "N1,60cs\n12,5")
    expect(page.locator("#survey-left .wrong")).to_have_text("say where the number is from")
    typed(page, "source of the blow counts", "boring 3")
    expect(page.locator("#status")).to_contain_text("answered in", timeout=WAIT_MS)
    expect(page.locator("#survey-left .wrong")).to_have_count(0)
    layer = {"zones": ["loose"], "n1_60cs": 12.5, "confidence": "assumed", "source": "boring 3"}
    assert stored(page, workspace)["blow_counts"] == {"layers": [layer]}
    assert (workspace.folder / "small" / "blow_counts.yaml").is_file()
    paste(page, "blow count of loose", "12\n13")
    expect(page.locator("#status")).to_have_text("not pasted: 2 numbers, where 1 fit from here on")
    typed(page, "blow count of loose", "90")
    expect(page.locator("#survey-left .wrong")).to_contain_text("must be at most 60 (is 90)")
    page.get_by_label("blow count of loose").click(click_count=3)
    page.keyboard.press("Delete")
    page.keyboard.press("Tab")
    expect(page.locator("#survey-left .wrong")).to_have_count(0, timeout=WAIT_MS)
    expect(page.locator("#status")).to_contain_text(SAVED, timeout=WAIT_MS)
    assert stored(page, workspace)["blow_counts"] is None
