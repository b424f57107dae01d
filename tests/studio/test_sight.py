"""The page for other eyes and hands: enlarged, dark, and by the keyboard alone."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from benchmarks.studio import pixel_of, serving
from tests.studio.bodies import write_bank
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, answered, stored, tab

pytestmark = NEEDS_CHROMIUM
#: What is beyond the right edge of the window.
BEYOND = """() => [...document.querySelectorAll("body *")].filter((one) => {
  const { width, right } = one.getBoundingClientRect();
  return width && right > innerWidth + 1;
}).map((one) => one.outerHTML.slice(0, 80))"""
#: Texts whose contrast to what is behind them is less than WCAG 2 asks for (AA: 4.5).
FAINT = """() => {
  const linear = (part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);
  const parts = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = (colour) => [0.2126, 0.7152, 0.0722]
    .reduce((sum, share, k) => sum + share * linear(colour[k] / 255), 0);
  const behind = (one) => {
    for (let at = one; at; at = at.parentElement) {
      const [r, g, b, a = 1] = parts(getComputedStyle(at).backgroundColor);
      if (a > 0.99) return [r, g, b];
    }
    return parts(getComputedStyle(document.body).backgroundColor);
  };
  const found = [];
  for (const one of document.querySelectorAll("body *")) {
    const own = [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    if (!(own || one.matches("input[type=text]"))) continue;
    if (one.closest(":disabled") || !one.checkVisibility()) continue;
    const both = [light(parts(getComputedStyle(one).color)), light(behind(one))];
    const [a, b] = both.sort((x, y) => y - x);
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < 4.5) found.push([contrast.toFixed(2), one.outerHTML.slice(0, 90)]);
  }
  return found;
}"""


def opened(browser, address: str, shown: str = "small", **window) -> Page:
    page = tab(browser.new_context(**window))
    page.goto(address)
    expect(page.locator(f'body[data-case="{shown}"]')).to_have_count(1, timeout=WAIT_MS)
    return page


def canvases(page: Page, *names: str) -> None:
    """As many pixels as the screen has for them: not one is smeared over two."""
    for name in names:
        wide, tall, shown_wide, shown_tall = page.locator(f"#{name}").evaluate(
            "one => [one.width, one.height, one.clientWidth * devicePixelRatio,"
            " one.clientHeight * devicePixelRatio]"
        )
        assert abs(wide - shown_wide) <= 1 and abs(tall - shown_tall) <= 1, name


def test_at_150_percent_nothing_is_cut_off_and_clicks_land_where_the_mouse_is(
    address, browser, workspace
):
    page = opened(browser, address, viewport={"width": 853, "height": 600}, device_scale_factor=1.5)
    answered(page, 1)
    for mode in ("slide", "survey", "section"):
        page.locator(f'[data-mode="{mode}"]').first.click()
        assert page.evaluate(BEYOND) == []
        assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
        page.wait_for_timeout(100)
        canvases(page, "canvas")
    page.locator('[data-tool="zone"]').click()
    page.get_by_label("grid").select_option("1")
    for x, y in ((62, 12), (68, 12), (66, 14)):
        page.mouse.move(*pixel_of(page, x + 0.1, y + 0.1))
        expect(page.locator("#status")).to_contain_text(f"{x}, {y} m")
        page.mouse.click(*pixel_of(page, x + 0.1, y + 0.1))
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_contain_text("kept as a draft", timeout=WAIT_MS)
    assert stored(page, workspace)["scene"]["zones"][3]["polygon"] == [[62, 12], [68, 12], [66, 14]]
    page.locator("#undo").click()
    page.locator('[data-tool="select"]').click()
    page.mouse.move(*pixel_of(page, 90, 0))
    page.mouse.down()
    page.mouse.move(*pixel_of(page, 93, 0), steps=4)
    page.mouse.up()
    expect(page.locator("#status")).to_have_text("saved", timeout=WAIT_MS)
    assert stored(page, workspace)["scene"]["zones"][2]["polygon"][1] == [93, 0]
    assert not page.errors


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_texts_stand_out_on_either_paper(address, browser, workspace, scheme):
    write_bank(workspace.folder / "bank")
    window = {"viewport": {"width": 1380, "height": 860}, "color_scheme": scheme}
    page = opened(browser, address, **window)
    answered(page, 1)
    assert page.evaluate("document.documentElement.dataset.theme") == scheme
    for mode in ("slide", "survey", "section"):
        page.locator(f'[data-mode="{mode}"]').first.click()
        for fold in page.locator("main details:not([open]) > summary:visible").all():
            fold.click()
        assert page.evaluate(FAINT) == [], mode
    page.get_by_role("button", name="New", exact=True).click()
    assert page.evaluate(FAINT) == []
    page.keyboard.press("Escape")
    page.locator("#case").select_option("3d/bank")
    expect(page.locator('body[data-shown="ground"]')).to_have_count(1, timeout=WAIT_MS)
    assert page.evaluate(FAINT) == []


def name_of(page: Page) -> str:
    """What the element with the focus is called; who has it is seen.

    Raises:
        AssertionError: nothing shows where the focus is.
    """
    name, outline, tag = page.evaluate(
        """() => {
          const one = document.activeElement;
          const { outlineStyle, outlineWidth } = getComputedStyle(one);
          const words = one.getAttribute("aria-label") ?? (one.labels?.[0] ?? one).innerText;
          const wide = outlineStyle === "none" ? 0 : parseFloat(outlineWidth);
          return [words.trim(), wide, one.tagName];
        }"""
    )
    assert outline >= 2 or tag == "BODY", f"nobody sees that {name!r} has the focus"
    return "" if tag == "BODY" else name


def go_to(page: Page, name: str, most: int = 90) -> None:
    """Press Tab until an element that is called so has the focus."""
    passed = []
    for _ in range(most):
        page.keyboard.press("Tab")
        passed.append(name_of(page))
        if passed[-1] == name:
            return
    raise AssertionError(f"no {name!r} among {passed}")


def choose(page: Page, words: str) -> None:
    """Find something in the list that has the focus, by its arrow keys; nothing comes of it yet."""
    found = "document.activeElement.selectedOptions[0].text"
    page.keyboard.press("Home")
    for _ in range(40):
        if words in page.evaluate(found):
            return
        page.keyboard.press("ArrowDown")
    raise AssertionError(f"the list has no {words!r}")


def test_a_dam_is_drawn_surveyed_and_back_analysed_by_the_keyboard_alone(tmp_path, browser):
    keys = tmp_path / "cases"
    keys.mkdir()
    with serving(keys, "--threads", "1") as address:
        page = tab(browser.new_context(viewport={"width": 1380, "height": 860}))
        page.goto(address)
        expect(page.get_by_role("dialog", name="Welcome")).to_be_visible(timeout=WAIT_MS)
        press = page.keyboard.press
        assert name_of(page) == "Draw a section"
        press("Enter")
        page.keyboard.type("bank")
        press("Enter")
        expect(page.locator('body[data-case="bank"]')).to_have_count(1, timeout=WAIT_MS)
        assert name_of(page).startswith("Section before the slide"), "keys go on from the sheet"

        # A zone, typed; its soil; the spacing.
        go_to(page, "next vertex as x, y [m]")
        for place in ("0, 0", "30, 0", "30, 8", "12, 8", ""):
            page.keyboard.type(place)
            press("Enter")
        expect(page.locator("#section-left .zone")).to_have_count(1)
        go_to(page, "zone 1 liquefied")
        press(" ")
        go_to(page, "S_r, first guess of zone 1 [kPa]")
        page.keyboard.type("6")
        go_to(page, "spacing [m]")
        press("Control+a")
        page.keyboard.type("1")
        press("Tab")
        expect(page.locator("#status")).to_contain_text("saved", timeout=WAIT_MS)

        # What was measured; what is asked follows from it.
        page.wait_for_timeout(1100)  # a key right after a field is meant for what follows it
        go_to(page, "Survey")
        press("Enter")
        go_to(page, "add a measurement")
        choose(page, "toe ran")
        expect(page.locator("#survey-left .entry")).to_have_count(0)
        press("Enter")
        expect(page.locator("#survey-left .entry")).to_have_count(1)
        go_to(page, "value of toe runout [m]")
        page.keyboard.type("9")
        go_to(page, "assume 1")
        press("Enter")
        go_to(page, "source of toe runout")
        page.keyboard.type("test")
        press("Tab")
        expect(page.locator("#survey-right .parameter")).to_have_count(1, timeout=WAIT_MS)

        # The slide, its strength by an arrow key, the answer, which is shown.
        page.wait_for_timeout(1100)
        go_to(page, "Slide")
        press("Enter")
        there = page.locator("#status")
        expect(there).to_contain_text("answered in", timeout=WAIT_MS)
        before = page.locator("#sliders input[type=range]").first.input_value()
        go_to(page, "S_r, zone 1 [kPa]")
        press("Tab")
        press("ArrowLeft")
        assert page.locator("#sliders input[type=range]").first.input_value() != before
        go_to(page, "Quick")
        press("Enter")
        job = page.locator("#jobs li").first
        expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
        go_to(page, "Show it")
        press("Enter")
        expect(page.get_by_label("S_r, zone 1 [kPa]")).not_to_have_value(before)
        expect(there).to_contain_text("answered in", timeout=WAIT_MS)
        off = page.locator("#readings tbody tr").first.locator("td").nth(3)
        expect(off).not_to_have_class("far", timeout=WAIT_MS)
        assert not page.errors


def test_a_body_is_turned_cut_and_run_by_the_keyboard_alone(tmp_path, browser):
    write_bank(tmp_path / "cases" / "bank")
    with serving(tmp_path / "cases" / "bank", "--threads", "1") as address:
        page = opened(browser, address, "3d/bank", viewport={"width": 1380, "height": 860})
        expect(page.locator('body[data-shown="ground"]')).to_have_count(1, timeout=WAIT_MS)
        press = page.keyboard.press
        go_to(page, "S_r, soil [kPa]")
        press("Control+a")
        page.keyboard.type("8")
        press("Tab")
        page.wait_for_timeout(1100)
        go_to(page, page.locator("#relief").get_attribute("aria-label"))
        before = page.locator("#relief").get_attribute("data-turn")
        press("ArrowLeft")
        press("+")
        expect(page.locator("#relief")).not_to_have_attribute("data-turn", before)
        go_to(page, page.locator("#plan").get_attribute("aria-label"))
        before = page.get_by_label("x of B").input_value()
        press("ArrowLeft")
        expect(page.get_by_label("x of B")).not_to_have_value(before)
        go_to(page, "Simulate")
        press("Enter")
        job = page.locator("#jobs li").first
        expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
        expect(page.locator("#body-told")).to_contain_text("soil 8 kPa", timeout=WAIT_MS)
        go_to(page, "Play")
        press("Enter")
        expect(page.locator("#body-play")).to_have_text("Pause")
        expect(page.locator("#body-play")).to_have_text("Play", timeout=WAIT_MS)
        assert not page.errors
