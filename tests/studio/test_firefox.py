"""The studio in Firefox, by real keys and a real mouse: drawn, surveyed, run, watched, taken away.

Needs a Firefox that speaks WebDriver BiDi (`firefox-esr` of Debian); without one it is skipped.
"""

from __future__ import annotations

import json
import time
from xml.etree import ElementTree

import pytest

from benchmarks.studio import serving
from tests.studio.bodies import write_bank
from tests.studio.browsing import value_of_run
from tests.studio.firefox import FIREFOX, Firefox

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(FIREFOX is None, reason="there is no Firefox on this machine"),
]
ANSWERED = "document.querySelector('#status').textContent.includes('answered in')"
SAVED = "!document.body.hasAttribute('data-saving')"


@pytest.fixture
def firefox(tmp_path):
    with Firefox(tmp_path / "firefox") as found:
        yield found
        assert not found.errors


def pixel_of(firefox: Firefox, x: float, y: float) -> tuple[float, float]:
    """Where a place of the section [m] is in the window [px]."""
    left, bottom, scale, rise = map(
        float, firefox.evaluate("document.querySelector('#canvas').dataset.box").split(" ")
    )
    at_x, at_y, _, height = firefox.box("#canvas")
    return at_x + (x - left) / scale, at_y + height - (y - bottom) * rise / scale


def ink(firefox: Firefox, canvas: str) -> int:
    """Pixels of a canvas that something is painted on."""
    return firefox.evaluate(
        f"""(() => {{
          const one = document.querySelector("{canvas}");
          const {{ data }} = one.getContext("2d").getImageData(0, 0, one.width, one.height);
          let count = 0;
          for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
          return count;
        }})()"""
    )


def typed(firefox: Firefox, label: str, text: str, key: str = "Tab") -> None:
    """Type over a field, and go on."""
    firefox.click(f'[aria-label="{label}"]', times=3)
    firefox.type(text)
    firefox.press(key)


def saved(firefox: Firefox, kind: str) -> bytes:
    """What the menu saves."""
    before = set(firefox.downloads.iterdir())
    firefox.click("#save summary")
    firefox.click(f'#save [data-kind="{kind}"]')
    end = time.monotonic() + 30
    while time.monotonic() < end:
        new = [one for one in firefox.downloads.iterdir() if one not in before]
        if new and all(one.suffix == f".{kind}" and one.stat().st_size for one in new):
            return new[0].read_bytes()
        time.sleep(0.1)
    raise AssertionError(f"no {kind}")


def chosen(firefox: Firefox, selector: str, value: str) -> None:
    """Choose in a list by the arrow keys."""
    firefox.evaluate(f"document.querySelector('{selector}').focus()")
    firefox.press("Home")
    for _ in range(20):
        if firefox.value(selector) == value:
            return
        firefox.press("ArrowDown")
    raise AssertionError(f"{selector} has no {value}")


def test_a_section_is_drawn_and_its_numbers_are_typed(firefox, address, workspace):
    firefox.goto(address)
    firefox.wait_for("document.body.dataset.answered === '1'")
    assert "token" not in firefox.evaluate("location.href")
    firefox.click('[data-mode="section"]')

    # A zone by the mouse, whose vertices snap to the grid and to those that are there.
    chosen(firefox, "#grid", "1")
    firefox.click('[data-tool="zone"]')
    for place in ((60, 12), (70, 12), (66, 15)):
        firefox.click_at(*pixel_of(firefox, place[0] + 0.1, place[1] + 0.1))
    firefox.press("Enter")
    firefox.wait_for("document.querySelectorAll('#section-left .zone').length === 4")
    status = "document.querySelector('#status').textContent"
    firefox.wait_for(f"{status}.startsWith('kept as a draft')")  # its soil has no strength yet
    assert workspace.read("small")["scene"]["zones"][3]["polygon"] == [[60, 12], [70, 12], [66, 15]]

    # Undone, and a vertex of what was there is dragged instead.
    firefox.press("Control+z")
    firefox.wait_for("document.querySelectorAll('#section-left .zone').length === 3")
    firefox.wait_for(SAVED)
    firefox.click('[data-tool="select"]')
    firefox.drag(pixel_of(firefox, 90, 0), pixel_of(firefox, 94, 0))
    firefox.wait_for(SAVED)
    assert workspace.read("small")["scene"]["zones"][2]["polygon"][1] == [94, 0]

    # Fields: other units, a decimal comma, Tab to the next one.
    firefox.click('[data-key="material-firm"] > summary')
    firefox.click('[aria-label="cohesion of firm [kPa]"]', times=3)
    firefox.type("250 psf")
    firefox.press("Tab")
    firefox.type("1850,5")
    firefox.press("Tab")
    firefox.wait_for(SAVED)
    soil = workspace.read("small")["scene"]["materials"]["firm"]
    assert soil["cohesion_kpa"] == pytest.approx(11.97, abs=0.01) and soil["density"] == 1850.5
    firefox.press("Control+z")
    firefox.wait_for(SAVED)

    # A reload goes on in the section, and what was done before can be undone.
    firefox.reload()
    firefox.wait_for("document.body.dataset.case === 'small'")
    assert firefox.evaluate("document.body.dataset.mode") == "section"
    firefox.click("#undo")
    firefox.wait_for(SAVED)
    assert workspace.read("small")["scene"]["materials"]["firm"]["cohesion_kpa"] == 1


def test_a_slide_follows_is_fitted_watched_and_taken_away(firefox, address, workspace):
    firefox.goto(address)
    firefox.wait_for("document.body.dataset.answered === '1'")
    toe = "document.querySelector('#readings tbody td:nth-child(3)').innerText"
    before = firefox.evaluate(toe)

    # The slider by the mouse: deposits on its way, and the answer where it was let go.
    slider = "#sliders input[type=range]"
    left, top, width, height = firefox.box(slider)
    middle = top + height / 2
    firefox.drag((left + 0.27 * width, middle), (left + 0.2 * width, middle), steps=20)
    firefox.wait_for(ANSWERED)
    strength = float(firefox.value(slider))
    assert strength < 7 and float(firefox.evaluate(toe).split()[0]) > float(before.split()[0])
    assert float(firefox.value('[aria-label="S_r, loose [kPa]"]')) == strength

    # The film.
    chosen(firefox, "#speed", "4")
    firefox.click("#play")
    firefox.wait_for("document.querySelector('#play').textContent === 'Pause'")
    firefox.wait_for("document.querySelector('#play').textContent === 'Play'")
    chosen(firefox, "#colour", "displacement")
    assert "displacement" in firefox.text("#legend") and ink(firefox, "#canvas") > 10_000

    # As files.
    assert saved(firefox, "png").startswith(b"\x89PNG")
    drawing = ElementTree.fromstring(saved(firefox, "svg"))
    assert len(drawing.findall(".//{http://www.w3.org/2000/svg}rect")) > 300
    assert saved(firefox, "csv").decode().splitlines()[0].startswith("x_m,y_m")

    # A survey of more, then the quick answer, which is shown.
    firefox.click('[data-mode="survey"]')
    firefox.click("#survey-left .entry summary")
    typed(firefox, "value of toe [m]", "12")
    firefox.wait_for("document.body.dataset.saved")
    (entry,) = workspace.read("small")["measurements"]["sets"]["field"]
    assert entry["value_m"] == 12
    firefox.click('[data-mode="slide"]')
    chosen(firefox, "#spacing", "2")
    firefox.wait_for(ANSWERED)
    firefox.click('#ask [data-quick="true"]')
    firefox.wait_for("document.querySelector('#jobs li')?.dataset.state === 'done'")
    firefox.evaluate(
        "[...document.querySelectorAll('#jobs button')]"
        ".find(({ textContent }) => textContent === 'Show it').id = 'show-it'"
    )
    firefox.click("#show-it")
    firefox.wait_for(ANSWERED)
    value = value_of_run(workspace)
    assert firefox.value('[aria-label="S_r, loose [kPa]"]') == f"{value:.4g}"


def test_a_window_that_goes_to_a_screen_with_finer_pixels_stays_sharp(firefox, address):
    firefox.goto(address)
    firefox.wait_for("document.body.dataset.answered === '1'")
    for ratio in (1.5, 2.0, 1.0):
        firefox.window(1380, 860, ratio)
        assert firefox.evaluate("devicePixelRatio") == ratio
        firefox.wait_for("Math.abs(canvas.width - canvas.clientWidth * devicePixelRatio) <= 1")


def test_a_bank_is_turned_cut_run_and_watched(firefox, tmp_path):
    write_bank(tmp_path / "cases" / "bank")
    with serving(tmp_path / "cases" / "bank", "--threads", "1") as address:
        firefox.goto(address)
        firefox.wait_for("document.body.dataset.shown === 'ground'")
        for canvas in ("#relief", "#plan", "#profile"):
            assert ink(firefox, canvas) > 1_000, canvas
        left, top, width, height = firefox.box("#relief")
        x, y = left + width / 2, top + height / 2
        turn = "document.querySelector('#relief').dataset.turn"
        seen = {firefox.evaluate(turn)}
        firefox.drag((x, y), (x + 80, y + 30))
        seen.add(firefox.wait_for(f"{turn} !== {json.dumps([*seen][0])} && {turn}"))
        firefox.wheel(x, y, -200)
        time.sleep(0.3)
        seen.add(firefox.evaluate(turn))
        firefox.press("ArrowLeft")
        time.sleep(0.3)
        seen.add(firefox.evaluate(turn))
        assert len(seen) == 4, seen

        # An end of the section is dragged in the plan, then typed.
        def place(x, y):
            at_x, at_y, _, _ = firefox.box("#plan")
            box = firefox.evaluate("document.querySelector('#plan').dataset.box")
            left, top, scale = map(float, box.split())
            return at_x + (x - left) / scale, at_y + (top - y) / scale

        ends = [float(firefox.value(f'[aria-label^="{one} of B"]')) for one in "xy"]
        firefox.drag(place(*ends), place(40, 14))
        ends = [float(firefox.value(f'[aria-label^="{one} of B"]')) for one in "xy"]
        assert ends == pytest.approx([40, 14], abs=0.5)
        firefox.click('[aria-label^="x of B"]', times=3)
        firefox.type("35")
        firefox.press("Tab")
        assert firefox.value('[aria-label^="x of B"]') == "35"

        firefox.click('[aria-label^="S_r, soil"]', times=3)
        firefox.type("8")
        firefox.press("Tab")
        firefox.evaluate(
            "[...document.querySelectorAll('#ask button')]"
            ".find(({ textContent }) => textContent === 'Simulate').id = 'simulate'"
        )
        firefox.click("#simulate")
        firefox.wait_for("document.querySelector('#jobs li')?.dataset.state === 'done'")
        firefox.wait_for("document.body.dataset.shown !== 'ground'")
        firefox.click("#body-play")  # three seconds, which a busy machine does not miss
        firefox.wait_for("document.querySelector('#body-play').textContent === 'Pause'")
        firefox.wait_for("document.querySelector('#body-play').textContent === 'Play'")
        assert saved(firefox, "png").startswith(b"\x89PNG")
        assert saved(firefox, "csv").startswith(b"way_m,x_m,y_m,ground_m")
