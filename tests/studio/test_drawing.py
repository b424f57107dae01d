"""Somebody draws a dam in the page, in a real Chromium.

With STUDIO_PICTURES=docs/images/studio the walk of docs/start/studio.md leaves its pictures
there.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from benchmarks.studio import pixel_of, serving
from pipeline.files import read_yaml
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, answered, picture, stored, tab, watched

pytestmark = NEEDS_CHROMIUM
EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


def fill(page: Page, label: str, value: object) -> None:
    """Type into a field of the section or of the survey, and go on to the next."""
    entry = page.locator("#section-left, #survey-left").get_by_label(label, exact=True)
    entry.fill(str(value))
    entry.press("Tab")


def click(page: Page, x: float, y: float, **options) -> None:
    """Click a place of the section [m]."""
    page.mouse.click(*pixel_of(page, x, y), **options)


def saved(page: Page) -> None:
    """Wait until the last edit is in the files."""
    page.wait_for_selector("body:not([data-saving])", state="attached", timeout=WAIT_MS)
    expect(page.locator("#status")).to_have_text(re.compile("^saved|answered in"), timeout=WAIT_MS)


def opened(page: Page, case: str = "small") -> None:
    """Wait until the page shows a case."""
    expect(page.locator(f'body[data-case="{case}"]')).to_have_count(1, timeout=WAIT_MS)


def new_case(page: Page, name: str) -> None:
    page.get_by_role("button", name="New", exact=True).click()
    page.get_by_label("name of the case").fill(name)
    page.get_by_role("button", name="Make it").click()
    expect(page.locator("#faults, .faults").first).to_contain_text("no zone is drawn yet")


COUNT_CLICKS = """addEventListener("pointerdown", (event) => {
  if (event.isTrusted) sessionStorage.clicks = Number(sessionStorage.clicks ?? 0) + 1;
}, true)"""
MOST_CLICKS = 45


def typed(page: Page, label: str, text: object) -> None:
    """Type over a field, which is clicked if the last Tab did not lead there, and go on."""
    focused = "document.activeElement.getAttribute('aria-label')"
    if page.evaluate(focused) != label:
        page.locator("#section-left, #survey-left").get_by_label(label, exact=True).click()
    page.keyboard.press("Control+a")
    if "\n" in str(text):  # a block is pasted
        page.evaluate("text => navigator.clipboard.writeText(text)", str(text))
        page.keyboard.press("Control+v")
    else:
        page.keyboard.type(str(text))
    page.keyboard.press("Tab")


def chosen(page: Page, label: str, value: str) -> None:
    """Choose from a list, which takes two clicks that the page does not see."""
    page.get_by_label(label, exact=True).select_option(value)
    page.evaluate("sessionStorage.clicks = Number(sessionStorage.clicks) + 2")


def test_an_embankment_is_drawn_surveyed_and_answered(address, browser, workspace):
    """The walk of docs/start/studio.md by mouse and keys, its clicks counted."""
    page = watched(browser, width=1380, height=860)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.add_init_script(COUNT_CLICKS)
    page.goto(address)
    answered(page, 1)
    page.get_by_role("button", name="New", exact=True).click()
    page.keyboard.type("road embankment")
    page.keyboard.press("Enter")
    opened(page, "road_embankment")
    expect(page.locator("#faults, .faults").first).to_contain_text("no zone is drawn yet")
    picture(page, "empty")

    # The first zone by clicks on the grid of 1 m, the others typed vertex after vertex.
    chosen(page, "grid", "1")
    for x, y in ((0, 0), (21, 0), (21, 3), (6, 3), (0, 0)):
        click(page, x, y)
    expect(page.locator(".zone")).to_have_count(1)
    page.locator("#coordinate").click()
    for ring in ("21,0 42,0 36,3 21,3", "6,3 36,3 24,9 18,9"):
        for vertex in ring.split():
            page.keyboard.type(vertex)
            page.keyboard.press("Enter")
        page.keyboard.press("Enter")
    expect(page.locator(".zone")).to_have_count(3)
    page.keyboard.press("Escape")
    page.locator("#fit-section").click()
    picture(page, "drawn")

    for number, name in enumerate(("loose_sand", "dense_sand", "fill"), start=1):
        typed(page, f"name of zone {number}", name)
    expect(page.locator("#section-right .faults li")).to_have_count(6)
    page.locator("#section-left").get_by_label("loose sand liquefied").click()
    typed(page, "S_r, first guess of loose sand [kPa]", 10)
    for name, friction, cohesion in (("dense sand", 34, 1), ("fill", 33, 2)):
        typed(page, f"friction of {name} [deg]", friction)
        typed(page, f"cohesion of {name} [kPa]", cohesion)
        typed(page, f"density of {name} [kg/m³]", 1900)
    typed(page, "pool level [m]", 3)
    chosen(page, "pool on", "both")
    typed(page, "spacing [m]", 0.5)
    expect(page.locator("#section-right .faults")).to_contain_text("It holds together: 864 points")
    picture(page, "section")

    page.get_by_role("tab", name="Survey").click()
    chosen(page, "add a measurement", "toe_runout")
    typed(page, "value of toe runout [m]", 18.5)
    page.get_by_role("button", name="assume 1.85").click()
    typed(page, "source of toe runout", "left end of the surveyed profile")
    chosen(page, "add a measurement", "surface_profile")
    profile = (EXAMPLES / "road_embankment_after.csv").read_text()
    typed(page, "points of surface profile", profile)
    typed(page, "standard deviation of surface profile [m]", 0.3)
    typed(page, "source of surface profile", "the example's survey")
    expect(page.locator("#survey-right")).to_contain_text("S_r of the loose sand", timeout=WAIT_MS)
    expect(page.locator("#readings")).to_contain_text("18.5 ± 1.85", timeout=WAIT_MS)
    picture(page, "survey")

    page.get_by_role("tab", name="Slide").click()
    page.get_by_role("button", name="Quick").click()
    job = page.locator("#jobs li").first
    expect(job).to_have_attribute("data-state", "done", timeout=WAIT_MS)
    (result,) = workspace.hidden("road_embankment", "jobs").glob("**/result.json")
    (answer,) = json.loads(result.read_text())["answer"]["parameters"]
    assert answer["value"] == pytest.approx(6.3, abs=0.15)
    assert answer["std_total"] == pytest.approx(0.6, abs=0.2)
    job.get_by_role("button", name="Show it").click()
    expect(page.get_by_label("S_r, loose sand [kPa]")).to_have_value(
        f"{answer['value_of_run']:.4g}", timeout=WAIT_MS
    )
    expect(page.locator("#readings tbody tr").first.locator("td").nth(3)).to_have_class("near")
    picture(page, "answer")
    assert page.evaluate("Number(sessionStorage.clicks)") <= MOST_CLICKS

    # The same files as `flowslide new` writes, for the command line.
    folder = workspace.folder / "road_embankment"
    drawn = read_yaml(folder / "scene.yaml")
    assert [zone["name"] for zone in drawn["zones"]] == ["loose_sand", "dense_sand", "fill"]
    assert drawn["zones"][2]["polygon"][1] == [21.0, 3.0], "the border got its neighbours' vertex"
    assert (folder / "README.md").read_text().count("FILL IN") > 5
    assert not page.errors


def test_vertices_move_together_and_every_edit_is_undone(address, browser, workspace):
    page = watched(browser)
    page.goto(address)
    opened(page)
    page.get_by_role("tab", name="Section").click()
    scene = workspace.folder / "small" / "scene.yaml"
    before = read_yaml(scene)["zones"]

    def ring(number):
        return [[float(v) for v in place] for place in read_yaml(scene)["zones"][number]["polygon"]]

    # Drag the vertex (70, 10), which two zones share, to (71, 11).
    page.get_by_label("grid").select_option("1")
    page.mouse.move(*pixel_of(page, 70, 10))
    page.mouse.down()
    page.mouse.move(*pixel_of(page, 70.6, 10.4), steps=4)
    page.mouse.move(*pixel_of(page, 71, 11), steps=4)
    page.mouse.up()
    saved(page)
    assert [71.0, 11.0] in ring(1) and [71.0, 11.0] in ring(2)
    expect(page.locator("#section-right")).to_contain_text("It holds together")

    # A fault is shown where it is, in the words of check, and the files stay as they were.
    page.locator(".vertices input").first.fill("90")
    page.locator(".vertices input").first.press("Tab")
    expect(page.locator("#section-right .faults li").first).to_contain_text("not a simple polygon")
    assert [71.0, 11.0] in ring(1)
    page.reload()
    opened(page)
    page.get_by_role("tab", name="Section").click()
    expect(page.locator("#section-right .faults li").first).to_contain_text("not a simple polygon")
    page.get_by_role("button", name="not a simple polygon").first.click()
    expect(page.locator(".zone.chosen")).to_have_count(1)

    # Undo reaches back beyond the reload; then another program writes.
    page.locator(".zone input").first.click()
    page.locator("#canvas").focus()
    page.keyboard.press("Control+z")
    saved(page)
    expect(page.locator("#section-right")).to_contain_text("It holds together")
    case = stored(page, workspace)
    case["scene"]["zones"] = before
    assert workspace.save("small", case["revision"], case)
    expect(page.locator("#status")).to_contain_text("changed elsewhere", timeout=WAIT_MS)
    expect(page.locator("#section-right")).to_contain_text("It holds together")
    expect(page.locator(".zone.chosen")).to_have_count(1)

    # New vertex, removed zone, undo, redo.
    click(page, 65, 3)
    expect(page.locator(".zone.chosen input")).to_have_value("loose")
    click(page, 55, 0.0, click_count=2)
    saved(page)
    assert [55.0, 0.0] in ring(0)
    page.keyboard.press("Control+z")
    expect(page.locator("#undo")).to_be_disabled()
    saved(page)
    assert read_yaml(scene)["zones"] == before
    page.get_by_title("remove crest").click()
    expect(page.locator(".zone")).to_have_count(2)
    page.locator("#undo").click()
    expect(page.locator(".zone")).to_have_count(3)
    page.locator("#redo").click()
    expect(page.locator(".zone")).to_have_count(2)
    saved(page)
    assert len(read_yaml(scene)["zones"]) == 2
    assert not page.errors


def test_the_values_of_the_sliders_are_kept_in_the_case(address, browser, workspace):
    page = watched(browser)
    page.goto(address)
    opened(page)
    strength = page.get_by_label("S_r, loose [kPa]")
    strength.fill("6.5")
    strength.press("Enter")
    page.get_by_label("add an effect").select_option("rate_strengthening")
    page.get_by_role("button", name="Keep these values").click()
    saved(page)
    scene = read_yaml(workspace.folder / "small" / "scene.yaml")
    assert scene["materials"]["loose"]["cohesion_kpa"] == 6.5
    assert scene["effects"]["rate_strengthening"] > 0
    expect(strength).to_have_value("6.5")
    page.get_by_role("button", name="Keep these values").click()
    expect(page.locator("#status")).to_have_text("the case has these values already")
    page.keyboard.press("Control+z")
    saved(page)
    assert "effects" not in read_yaml(workspace.folder / "small" / "scene.yaml")
    assert not page.errors


def test_a_strength_is_asked_and_stated_as_a_ratio(address, browser, workspace):
    page = watched(browser)
    page.goto(address)
    opened(page)
    page.get_by_role("tab", name="Survey").click()
    reading = page.locator("#survey-right").get_by_label(re.compile("how the strength of .* asked"))
    reading.first.select_option("strength_ratio")
    saved(page)
    folder = workspace.folder / "small"
    asked = read_yaml(folder / "inversion.yaml")["parameters"][0]
    assert asked["property"] == "strength_ratio"
    assert (asked["low"], asked["start"], asked["high"]) == (0.02, 0.1, 0.5)
    page.get_by_role("tab", name="Section").click()
    page.locator("#section-left details.material").first.locator("summary").first.click()
    fill(page, "strength ratio of loose", 0.12)
    saved(page)
    assert read_yaml(folder / "scene.yaml")["materials"]["loose"]["strength_ratio"] == 0.12
    expect(page.locator("#section-left")).to_contain_text("S_r/σ′v0 0.12")
    page.get_by_role("tab", name="Slide").click()
    expect(page.get_by_label("S_r, loose [kPa]")).to_have_count(0)
    assert not page.errors


def test_two_tabs_on_one_case_are_told_and_nothing_is_lost(address, browser, workspace):
    first = watched(browser)
    first.goto(address)
    opened(first)
    first.get_by_role("tab", name="Section").click()
    second = tab(first.context)
    second.goto(address.split("?")[0])
    opened(second)
    second.get_by_role("tab", name="Section").click()
    expect(second.locator(".zone")).to_have_count(3)
    first.bring_to_front()  # what is in the background is drawn late
    fill(first, "spacing [m]", 1.5)
    second.bring_to_front()
    expect(second.get_by_label("spacing [m]", exact=True)).to_have_value("1.5", timeout=WAIT_MS)
    # Both edit at once: who comes second is asked.
    first.route("**/revision", lambda route: route.abort())
    fill(second, "spacing [m]", 2)
    saved(second)
    first.bring_to_front()
    fill(first, "spacing [m]", 3)
    expect(first.locator("#apart")).to_contain_text("changed elsewhere")
    expect(first.locator("#status")).to_contain_text("not saved")
    first.get_by_label("Case").first.select_option("la_marquesa")
    expect(first.locator("#status")).to_contain_text("choose which to keep first")
    expect(first.get_by_label("Case").first).to_have_value("small")
    first.get_by_role("button", name="Keep mine").click()
    saved(first)
    assert read_yaml(workspace.folder / "small" / "scene.yaml")["spacing"] == 3


def test_a_killed_server_loses_nothing_that_was_drawn(lone_workspace, browser):
    place = lone_workspace.folder / "small"
    with serving(place, "--threads", "1") as address:
        page = watched(browser)
        page.goto(address)
        opened(page)
        new_case(page, "drawn")
        for vertex in ("0,0", "20,0", "10,8", ""):
            page.locator("#coordinate").fill(vertex)
            page.locator("#coordinate").press("Enter")
        expect(page.locator("#status")).to_contain_text("kept as a draft")
    with serving(place, "--threads", "1") as address:
        page = watched(browser)
        page.goto(address)
        opened(page)
        page.get_by_label("Case").first.select_option("drawn")
        opened(page, "drawn")
        expect(page.locator(".zone input")).to_have_value("zone_1")
        expect(page.locator("#section-right .faults li")).to_have_count(2)


def test_an_open_page_saves_when_the_studio_is_started_again(lone_workspace, browser):
    """The folder keeps its port; the address that is printed has another token."""
    place = lone_workspace.folder / "small"
    with serving(place, "--threads", "1") as address:
        page = watched(browser)
        page.goto(address)
        opened(page)
        page.get_by_role("tab", name="Section").click()
    fill(page, "spacing [m]", 3)
    expect(page.locator("#status")).to_have_text(
        "not saved: the server does not answer", timeout=WAIT_MS
    )
    with page.expect_event("dialog") as leaving:  # who leaves now is asked
        page.on("dialog", lambda dialog: dialog.dismiss())
        page.evaluate("setTimeout(() => location.reload())")
    assert leaving.value.type == "beforeunload"
    with serving(place, "--threads", "1") as address:
        other = tab(page.context)
        other.goto(address)
        opened(other)
        page.bring_to_front()
        for _ in range(200):  # its status may speak of the connection by then
            if read_yaml(place / "scene.yaml")["spacing"] == 3:
                return
            page.wait_for_timeout(100)
    raise AssertionError(page.locator("#status").inner_text())


def test_a_shipped_case_is_copied_and_a_drawing_is_imported(address, browser, workspace):
    page = watched(browser)
    page.goto(address)
    opened(page)
    page.get_by_label("Case").first.select_option("upper_san_fernando")
    opened(page, "upper_san_fernando")
    page.get_by_role("tab", name="Section").click()
    expect(page.locator("#section-right")).to_contain_text("Copy it to edit it")
    page.get_by_role("button", name="Copy", exact=True).click()
    page.get_by_role("button", name="Make it").click()
    expect(page.locator("#origin")).to_have_text("")
    fill(page, "pool level [m]", 20)
    saved(page)
    copied = workspace.folder / "upper_san_fernando_mine" / "scene.yaml"
    assert read_yaml(copied)["water_level"] == 20 and "#" in copied.read_text()

    page.get_by_role("button", name="Import", exact=True).click()
    page.get_by_label("drawing", exact=True).set_input_files(EXAMPLES / "road_embankment_after.csv")
    page.get_by_role("button", name="Make it").click()
    expect(page.locator("#make-fault")).to_contain_text("no column 'zone'")
    page.get_by_label("drawing", exact=True).set_input_files(EXAMPLES / "road_embankment.csv")
    page.get_by_role("button", name="Make it").click()
    expect(page.locator(".zone")).to_have_count(3)
    expect(page.locator("#section-right")).to_contain_text("It holds together")
    assert not page.errors


@pytest.mark.parametrize(
    ("pasted", "kept"),
    [
        ("12,5\t3,2\n13,5\t3,0", "12.5,3.2\n13.5,3\n"),
        ("x; y\n12,5; 3\n14; 2,5", "12.5,3\n14,2.5\n"),
        ("12.5, 3.2\n13.5 3", "12.5,3.2\n13.5,3\n"),
        ("12,5 3,2\n13,5 3,0", "12.5,3.2\n13.5,3\n"),
        ("1\t12.5\t3.2", None),
        ("No\tStation (m)\tElevation (m)\n1\t30\t0,5\n2\t45\t2", "30,0.5\n45,2\n"),
        ("x_m,y_m\n30,0.5\n45\t2,5\n", "30,0.5\n45,2.5\n"),
        ("12,5 3\n13 3", None),
    ],
)
def test_pasted_columns_are_read_as_they_are_meant(address, browser, pasted, kept):
    page = watched(browser)
    page.goto(address)
    opened(page)
    got = page.evaluate(
        """async (text) => {
          const { tableOf } = await import("/survey_panel.js");
          try { return tableOf(text); } catch (error) { return `refused: ${error.message}`; }
        }""",
        pasted,
    )
    if kept is None:
        assert got.startswith("refused: ") and "a point is two numbers" in got
    else:
        assert got == f"x_m,y_m\n{kept}"


def test_a_picture_gets_its_scale_from_two_places(address, browser, workspace, tmp_path):
    import matplotlib.image
    import numpy as np

    scan = tmp_path / "scan.png"
    matplotlib.image.imsave(scan, np.random.default_rng(1).random((100, 200, 3)))
    page = watched(browser)
    page.goto(address)
    opened(page)
    page.get_by_role("tab", name="Section").click()
    page.get_by_label("picture to draw on").set_input_files(scan)
    view = workspace.hidden("small", "view.json")
    for number, (x, y, known) in enumerate(((45, 2, (0, 0)), (85, 12, (80, 10))), start=1):
        page.get_by_role("button", name=f"Click place {number}").click()
        page.keyboard.down("Alt")  # where it is, not on the grid
        click(page, x, y)
        page.keyboard.up("Alt")
        for key, value in zip("xy", known, strict=True):
            fill(page, f"{key} of place {number} [m]", value)
    before = json.loads(view.read_text())["underlay"]
    page.get_by_role("button", name="Set the scale").click()
    expect(page.locator("#status")).to_contain_text("has its scale")
    after = json.loads(view.read_text())["underlay"]
    # 40 m of the sheet are 80 m, 10 m are 10 m: pictures may exaggerate the height.
    assert after["sx"] == pytest.approx(2 * before["sx"], rel=0.02)
    assert after["sy"] == pytest.approx(before["sy"], rel=0.05)
    page.reload()
    opened(page)
    page.get_by_role("tab", name="Section").click()
    expect(page.get_by_role("button", name="Remove the picture")).to_be_visible()
    page.get_by_label("picture to draw on").wait_for(state="detached")
    page.get_by_role("button", name="Remove the picture").click()
    expect(page.get_by_label("picture to draw on")).to_be_visible()
    assert not page.errors


RANDOM_EDITS = """async ([scene, seed, count]) => {
  const s = await import('/section.js');
  let state = seed;
  const random = () => {
    state = (1103515245 * state + 12345) % 2147483648;
    return state / 2147483648;
  };
  const pick = (list) => list[Math.floor(random() * list.length)];
  const areas = () => scene.zones.map(({ polygon }) => s.area(polygon));
  const close = (a, b) => a.every((v, i) => Math.abs(v - b[i]) < 1e-6 * Math.max(1, v));
  const wrong = [];
  for (let n = 0; n < count; n += 1) {
    const before = JSON.stringify(scene);
    const was = areas();
    const zone = pick(scene.zones);
    const edge = pick(s.edges({ points: zone.polygon, closed: true }));
    const share = 0.1 + 0.8 * random();
    const place = [0, 1].map((k) => edge.start[k] + share * (edge.end[k] - edge.start[k]));
    s.insertVertex(scene, place);
    if (!close(areas(), was)) wrong.push(`${n}: a vertex on an edge changes an area`);
    const on = (ring) => ring.some((point) => s.same(point, place));
    const having = (test) => scene.zones.filter(({ polygon }) => test(polygon)).length;
    const bordering = having(on);
    const to = [place[0] + random(), place[1] + random()];
    s.moveVertex(scene, place, to);
    const moved = (ring) => ring.some((point) => s.same(point, to));
    if (having(moved) < bordering) wrong.push(`${n}: a border split`);
    s.moveVertex(scene, to, place);
    if (!s.removeVertex(scene, place)) wrong.push(`${n}: not removed`);
    if (JSON.stringify(scene) !== before) wrong.push(`${n}: there and back is elsewhere`);
    if (n % 5 === 0) s.insertVertex(scene, place);
  }
  return wrong;
}"""


@pytest.mark.parametrize("case", ["lower_san_fernando", "la_marquesa", "upper_san_fernando"])
def test_edits_of_borders_keep_zones_together(address, browser, case):
    page = watched(browser)
    page.goto(address)
    opened(page)
    scene = page.evaluate(f"fetch('/api/cases/{case}').then((answer) => answer.json())")["scene"]
    assert page.evaluate(RANDOM_EDITS, [scene, 7, 300]) == []


def test_a_zone_drawn_at_others_shares_their_vertices(address, browser):
    page = watched(browser)
    page.goto(address)
    opened(page)
    found = page.evaluate("""async () => {
      const s = await import('/section.js');
      const scene = { zones: [], materials: {} };
      s.addZone(scene, [[0, 0], [10, 0], [10, 4], [0, 4]]);
      s.addZone(scene, [[2, 4], [8, 4], [5, 9]]);
      s.addZone(scene, [[10, 1], [14, 1], [10, 3]]);
      return scene.zones.map(({ name, polygon }) => [name, polygon, s.area(polygon)]);
    }""")
    (_, base, area), (_, roof, _), (_, side, _) = found
    assert area == 40 and len(roof) == 3 and len(side) == 3
    assert [tuple(place) for place in base] == [(0, 0), (10, 0), (10, 1), (10, 3), (10, 4), (8, 4),
                                                (2, 4), (0, 4)]  # fmt: skip


def test_the_water_table_of_a_pool_on_one_side(address, browser):
    """A dam on its foundation; a side that it does not hold back has none."""
    page = watched(browser)
    page.goto(address)
    opened(page)
    found = page.evaluate("""async () => {
      const { tableOfPool, poolSide, setPool } = await import('/water.js');
      const ground = { name: 'a', polygon: [[0, 0], [100, 0], [100, 5], [70, 5], [30, 5], [0, 5]] };
      const dam = { name: 'b', polygon: [[30, 5], [70, 5], [52, 14], [48, 14]] };
      const scene = { zones: [ground, dam], materials: {}, water_level: null, phreatic_line: null };
      const tables = [[11, 'left'], [11, 'right'], [14.5, 'left'], [5, 'left'], [3, 'left']]
        .map(([level, side]) => tableOfPool(scene, level, side));
      const sides = ['left', 'right', 'both'].map((side) => {
        setPool(scene, 11, side);
        return poolSide(scene);
      });
      Object.assign(scene, { water_level: 11, phreatic_line: [[40, 11], [50, 8], [70, 5]] });
      sides.push(poolSide(scene));
      setPool(scene, 12, 'drawn');
      return [tables, sides, scene.phreatic_line];
    }""")
    tables, sides, moved = found
    assert tables == [[[42, 11], [70, 5]], [[30, 5], [58, 11]], None, None, None]
    assert sides == ["left", "right", "both", "drawn"]
    assert moved == [[40, 12], [50, 8], [70, 5]], "what stood at the pool goes with it"
