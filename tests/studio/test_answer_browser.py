"""What an answer looks like in a real Chromium: its charts, its words, by mouse and by keys."""

from __future__ import annotations

import re
import time

import pytest
import yaml
from playwright.sync_api import expect

from diagnosis.verdict.verdict import save_document
from flowslide.studio.case_documents import read_documents
from flowslide.studio.jobs import RESULTS, Job, JobOptions
from flowslide.studio.workspace import revision_of
from pipeline.files import write_json
from report.diagnosis import write_report
from tests.diagnosis import verdict_case
from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, answered, picture

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


RANKED = [
    {"words": "fast shearing makes the soil stronger", "promised": 21.0, "refitted": 24.0},
    {"words": "the mass slides on a weak base", "promised": 9.0, "refitted": None},
]


def _diagnosed(workspace, tilt: str = "tried alone") -> None:
    """A diagnosis that is done, as its process would have left it."""
    folder = workspace.hidden("small", "jobs", "20260101-000000-abcdef")
    job = Job(
        id=folder.name,
        kind="diagnose",
        case="small",
        folder="x",
        revision=revision_of(read_documents(workspace.folder / "small")),
        options=JobOptions(spacing_m=1.0),
    )
    write_json(folder / "job.json", job.model_dump(mode="json"))
    save_document(verdict_case.identified(), folder / RESULTS["diagnose"] / "verdict.json")
    write_report(folder / RESULTS["diagnose"])
    common = {"unit": "", "words": "what it is"}
    each = [
        {"name": "rate_strengthening", "amplitude": 0.40004567891, "told": "0.4", "how": "named",
         "values": {"strength": 6.0}, **common},
        {"name": "strain_softening", "amplitude": 0.5, "told": "0.5", "how": "tried alone",
         "values": {"strength": 9.0}, **common},
        {"name": "base_tilt", "amplitude": 0.7, "told": "0.7 m", "how": tilt,
         "values": {"strength": 8.5}, **common},
    ]  # fmt: skip
    write_json(
        folder / "state.json",
        {"state": "done", "message": "", "answer": ["Identified. Rate strengthening."],
         "ranking": RANKED, "looked_at": 40, "values": [], "strengths": [],
         "effects": {"base": {"strength": 12.0}, "final": {"strength": 6.0}, "each": each,
                     "is_result": True}},
    )  # fmt: skip


def test_a_diagnosis_shows_its_ranking_and_switches_its_effects(workspace, page):
    _diagnosed(workspace)
    job = page.locator("#jobs > li").first
    expect(job).to_contain_text("Which hypothesis explains most? 40 looked at", timeout=WAIT_MS)
    hypotheses = job.get_by_role("list", name="hypotheses, the best first").get_by_role("listitem")
    expect(hypotheses).to_have_text(
        ["fast shearing makes the soil stronger: 24.0 found",
         "the mass slides on a weak base: 9.0 promised"]
    )  # fmt: skip
    overview = job.get_by_role("button", name="The diagnosis in one picture")
    expect(overview.locator("img")).not_to_have_js_property("naturalWidth", 0)
    box = overview.bounding_box()
    assert box["width"] > 250 and box["height"] > 200, "it is seen"
    picture(page, "diagnosis-in-one-picture")
    overview.click()
    report = page.frame_locator("#frame")
    expect(report.get_by_role("img", name="The diagnosis in one picture")).to_be_visible()
    picture(page, "diagnosis-in-its-report")
    page.locator("#close").click()

    seen = job.locator(".seen")
    expect(seen).to_have_text("Seen now: without any effect.")
    strength, toe = page.get_by_label("S_r, loose [kPa]"), page.locator("#readings tbody tr").first

    def shown(effects: str, value: str, number: int) -> str:
        answered(page, number)
        expect(seen).to_have_text(f"Seen now: {effects}, strength {value} kPa.")
        expect(strength).to_have_value(value)
        return toe.locator("td").nth(2).inner_text()

    rate = job.get_by_role("switch", name="rate strengthening")
    rate.click()
    expect(rate).to_have_attribute("aria-checked", "true")
    with_it = shown("with rate strengthening 0.4", "6", 2)
    expect(page.get_by_label("Spacing of points")).to_have_value("1")
    expect(page.locator("#effects [data-number]")).to_have_value("0.4")  # not with all its digits
    picture(page, "effect-switches")
    # Off by a key, without the film of the short cut of that key.
    rate.focus()
    page.keyboard.press("Space")
    expect(rate).to_have_attribute("aria-checked", "false")
    assert shown("without any effect", "12", 3) != with_it
    expect(page.locator("#play")).to_have_text("Play")

    # What was tried alone is shown alone, and what no slider has is not shown.
    softening = job.get_by_role("switch", name="strain softening")
    rate.click()
    shown("with rate strengthening 0.4", "6", 4)
    softening.click()
    expect(rate).to_have_attribute("aria-checked", "false")
    shown("with strain softening 0.5", "9", 5)
    expect(job.get_by_role("switch", name="base tilt")).to_be_disabled()
    expect(job).to_contain_text("base tilt 0.7 m, tried alone: not in the picture")
    # The slider of the effect says the same, and so does its removal.
    page.locator("#effects").get_by_role("button", name="remove").click()
    expect(softening).to_have_attribute("aria-checked", "false")

    job.get_by_role("button", name="Show it").click()
    expect(rate).to_have_attribute("aria-checked", "true")
    job.get_by_role("button", name="Keep it").click()
    expect(page.locator("#status")).to_contain_text("answered in", timeout=WAIT_MS)
    scene = workspace.folder / "small" / "scene.yaml"
    until(lambda: (yaml.safe_load(scene.read_text()).get("effects") or {}) == {
        "rate_strengthening": 0.4})  # fmt: skip
    kept = yaml.safe_load(scene.read_text())
    assert kept["materials"]["loose"]["cohesion_kpa"] == 6.0
    # The switch says what the picture has: the effect is the case's own until it is undone.
    expect(seen).to_have_text("Seen now: with rate strengthening 0.4.")
    expect(rate).to_have_attribute("aria-checked", "true")
    expect(rate).to_be_disabled()
    page.locator("#canvas").click()
    page.keyboard.press("Control+z")
    expect(seen).to_have_text("Seen now: without any effect.", timeout=WAIT_MS)
    expect(rate).to_have_attribute("aria-checked", "false")
    expect(rate).to_be_enabled()

    # Answers of a case are there with it, not seconds later.
    for name in ("sheffield", "small"):
        page.wait_for_timeout(1500)  # by then the list has forgotten what was typed before
        page.locator("#case").focus()
        page.keyboard.type(name)
        page.keyboard.press("Enter")
        expect(page.locator(f'body[data-case="{name}"]')).to_have_count(1, timeout=WAIT_MS)
        expect(page.locator("#jobs > li")).to_have_count(int(name == "small"), timeout=1500)


@pytest.fixture
def with_shaking(workspace):
    """The case has an effect of its own, with a parameter."""
    path = workspace.folder / "small" / "scene.yaml"
    path.write_text(path.read_text() + "effects: {shaking: {amplitude: 0.5, frequency_hz: 1.0}}\n")


def test_a_part_of_what_was_found_together_is_seen_as_a_part(workspace, with_shaking, page):
    _diagnosed(workspace, tilt="named")
    job = page.locator("#jobs > li").first
    rate = job.get_by_role("switch", name="rate strengthening")
    rate.click(timeout=WAIT_MS)
    seen = job.locator(".seen")
    expect(seen).to_contain_text("with shaking 0.5 and rate strengthening 0.4, strength 6 kPa")
    expect(seen).to_contain_text("and without base tilt, found together with it.")
    expect(job.get_by_role("button", name="Show it")).to_have_count(0)
    expect(job.get_by_role("button", name="Keep it")).to_have_count(0)


@pytest.fixture
def with_softening(workspace):
    """The case has what the diagnosis tried alone."""
    path = workspace.folder / "small" / "scene.yaml"
    path.write_text(path.read_text() + "effects: {strain_softening: 0.5}\n")


def test_an_effect_of_the_case_is_not_said_to_be_tried_alone(workspace, with_softening, page):
    _diagnosed(workspace)
    effects = page.get_by_role("list", name="effects").get_by_role("listitem")
    row = effects.filter(has_text="strain softening")
    expect(row).to_have_text("strain softening 0.5, in the case", timeout=WAIT_MS)
    expect(row.get_by_role("switch")).to_have_attribute("aria-checked", "true")
    expect(effects.filter(has_text="base tilt")).to_contain_text("tried alone")


def until(holds) -> None:
    """Wait for what the server does on its own."""
    for _ in range(200):
        if holds():
            return
        time.sleep(0.1)
    assert holds()
