"""A walk of random actions through the studio, as somebody in a hurry would do them.

Each action is one of real keys, the mouse, a reload, another tab, or a server that is killed and
started again. `Walk.agree` then says what must hold after any of them.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, expect

from benchmarks.studio import pixel_of
from flowslide.studio.workspace import Workspace
from tests.studio.browsing import WAIT_MS, tab, watched

PARTS = ("scene", "measurements", "inversion", "diagnosis", "blow_counts", "tables")
PANELS = "#section-left, #section-right, #survey-left, #survey-right"
FIELDS = ":is(input[type=text], textarea):enabled:visible"
NUMBERS = ("28", "3", "12,5", "0", "-4", "8.0", "1e3", "60", "0.3", "6", "12 ft", "200 psf", "soft")
WORDS = ("silt", "sand 2", "fill_3", "Ümläut", "a")
DESCRIBE = """(them) => them.map((one) => {
  const { x, y, width, height } = one.getBoundingClientRect();
  return {
    label: one.ariaLabel, title: one.title, text: one.innerText, tag: one.tagName,
    is_number: "number" in one.dataset, x, y, width, height,
  };
})"""
#: Finds the page's documents: the page itself has no name for them.
FIND = """async () => {
  if (window.documents_) return;
  const { Documents } = await import("/documents.js");
  const { look } = Documents.prototype;
  await new Promise((found) => {
    Documents.prototype.look = function () {
      window.documents_ = this;
      found();
      return look.call(this);
    };
  });
}"""
IS_QUIET = """() => {
  const { dirty, saving, apart } = window.documents_;
  return Boolean(apart) || !(dirty || saving);
}"""


class Server:
    """A studio that can be killed and started again."""

    def __init__(self, case: Path) -> None:
        self.case = case
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> str:
        """Start it; its address."""
        words = [sys.executable, "-m", "flowslide", "studio", str(self.case), "--no-browser"]
        self.process = subprocess.Popen(
            [*words, "--threads", "1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        found = (line for line in self.process.stdout if line.startswith("http://"))
        return next(found).strip()

    def kill(self) -> str:
        """End it at once; what it said of errors."""
        self.process.send_signal(signal.SIGKILL)
        _, said = self.process.communicate()
        self.process = None
        return said


class Walk:
    """Two tabs on one case of a workspace, and the server behind them.

    Args:
        browser: that shows them.
        workspace: with the case `small`.
        seed: of the actions.
    """

    def __init__(self, browser: Browser, workspace: Workspace, seed: int) -> None:
        self.workspace, self.chance = workspace, random.Random(seed)
        self.server, self.said, self.log = Server(workspace.folder / "small"), "", []
        self.page = watched(browser, width=1380, height=860)
        self.tabs = [self.page]
        self._open(self.page, self.server.start())

    def close(self) -> None:
        """End the server."""
        if self.server.process is not None:
            self.said += self.server.kill()

    def step(self) -> None:
        """One action."""
        kinds = {
            self.type: 8, self.press_tab: 4, self.drag_vertex: 3, self.drag_slider: 3,
            self.press_button: 4, self.undo: 4, self.redo: 2, self.switch_panel: 4,
            self.draw_zone: 1, self.reload: 1, self.switch_tab: 2, self.kill: 1, self.wait: 1,
        }  # fmt: skip
        (action,) = self.chance.choices(list(kinds), list(kinds.values()))
        self.log.append(action.__name__)
        action()
        self.page.wait_for_timeout(self.chance.choice((0, 0, 30, 150, 400)))

    # --- what somebody does ---

    def type(self) -> None:
        """Into any field; left by a key, or not at all."""
        field, it = self._any(f":is({PANELS}, #sliders) {FIELDS}")
        if field is None:
            return
        text = self.chance.choice(NUMBERS if it["is_number"] else WORDS)
        if it["tag"] == "TEXTAREA":
            text = "notes"
        self._note(it["label"], text)
        if not self._click(field, click_count=3):
            return
        self.page.keyboard.type(text, delay=self.chance.choice((0, 60)))
        key = self.chance.choice(("Tab", "Tab", "Enter", ""))
        if key:
            self.page.keyboard.press(key)

    def press_tab(self) -> None:
        """Once or more, now and then backwards."""
        for _ in range(self.chance.randint(1, 4)):
            self.page.keyboard.press(self.chance.choice(("Tab", "Tab", "Shift+Tab")))

    def press_button(self) -> None:
        """Any of those in the panels that change the documents, and the folds."""
        button, it = self._any(f":is({PANELS}) :is(button:enabled, summary):visible")
        if button is None:
            return
        self._note(it["text"], it["title"])
        self._click(button)

    def drag_vertex(self) -> None:
        """By some metres."""
        if not self._is_section():
            return
        scene = self._read("scene")
        if not scene["zones"]:
            return
        place = self.chance.choice(self.chance.choice(scene["zones"])["polygon"])
        self._note(place)
        self._drag(*self._pixel(place), 60)

    def drag_slider(self) -> None:
        """Back and forth."""
        self._show("slide")
        slider, it = self._any("#sliders input[type=range]:visible")
        if slider is None:
            return
        self._drag(it["x"] + self.chance.random() * it["width"], it["y"] + it["height"] / 2, 40)

    def draw_zone(self) -> None:
        """A triangle somewhere."""
        if not self._is_section():
            return
        self.page.locator('[data-tool="zone"]').click()
        canvas = self.page.locator("#canvas").bounding_box()
        for _ in range(3):
            x, y = (0.1 + 0.8 * self.chance.random() for _ in range(2))
            self.page.mouse.click(
                canvas["x"] + x * canvas["width"], canvas["y"] + y * canvas["height"]
            )
        self.page.keyboard.press(self.chance.choice(("Enter", "Enter", "Escape")))

    def undo(self) -> None:
        """By key or button."""
        self._step_back("#undo", "Control+z")

    def redo(self) -> None:
        """By key or button."""
        self._step_back("#redo", "Control+Shift+z")

    def switch_panel(self) -> None:
        """Section, survey or slide."""
        self._show(self.chance.choice(("section", "survey", "slide")))

    def wait(self) -> None:
        """Longer than the page looks after changes elsewhere."""
        self.page.wait_for_timeout(3500)

    def reload(self) -> None:
        """What is typed and not saved yet goes along."""
        if self.server.process is not None:
            self.page.reload()
            self._shown(self.page)

    def switch_tab(self) -> None:
        """The other one, which is opened where there is none."""
        if self.server.process is None:
            return
        if len(self.tabs) == 1:
            self.tabs.append(tab(self.page.context))
            self._open(self.tabs[1], self.page.url)
        self.page = next(one for one in self.tabs if one is not self.page)
        self.page.bring_to_front()

    def kill(self) -> None:
        """Kill the server, or start the next one, whose address somebody opens."""
        if self.server.process is None:
            address = self.server.start()
            other = self.page.context.new_page()
            other.goto(address)
            other.close()
            self.page.bring_to_front()
        else:
            self.said += self.server.kill()

    # --- what must hold ---

    def settle(self) -> None:
        """The server runs, nobody types, and everything is saved or chosen."""
        if self.server.process is None:
            self.kill()
        for _ in range(4):
            for page in self.tabs:
                page.bring_to_front()
                page.evaluate(FIND)
                page.keyboard.press("Tab")
                page.wait_for_function(IS_QUIET, timeout=WAIT_MS)
                if page.locator("#apart").is_visible():
                    words = self.chance.choice(("Show what is there now", "Keep mine"))
                    page.locator("#apart").get_by_role("button", name=words).click()
                    self._note(words)
                    page.wait_for_function(IS_QUIET, timeout=WAIT_MS)
            there = self.workspace.revision("small")
            if all(page.evaluate("documents_.revision") == there for page in self.tabs):
                return
            self.page.wait_for_timeout(3500)
        raise AssertionError("the tabs do not settle on what is in the files")

    def agree(self) -> None:
        """Page, files and undo agree, and nothing has failed."""
        self.settle()
        for page in self.tabs:
            page.bring_to_front()
            self._same(page)
            self._fields(page)
        self._undo_and_back()
        self.settle()
        for page in self.tabs:
            self._same(page)
            assert not page.errors, page.errors
        assert "Traceback" not in self.said, self.said

    def _same(self, page: Page) -> None:
        case = self.workspace.read("small")
        now = page.evaluate("documents_.now")
        for part in PARTS:
            assert now[part] == case[part], part

    def _fields(self, page: Page) -> None:
        """Every field shows what its document has."""
        now = page.evaluate("documents_.now")
        shown = page.evaluate(
            "() => [...document.querySelectorAll('[data-field]')].map((one) => "
            "[one.dataset.field, one.type === 'checkbox' ? one.checked : one.value, "
            "one.ariaInvalid])"
        )
        for field, value, invalid in shown:
            node: Any = now
            for key in field.split("/"):
                if isinstance(node, list):
                    node = node[int(key)] if key.isdigit() else node
                elif isinstance(node, dict):
                    node = node.get(key, node if key == node.get("type") else None)
            if value in NUMBERS[-3:] and invalid:
                continue  # refused: it stays to be mended
            if isinstance(value, bool):
                assert value == bool(node), field
            elif isinstance(node, int | float):
                assert value != "" and float(value) == node, (field, value, node)
            elif node is None:
                assert value == "", (field, value)

    def _undo_and_back(self) -> None:
        """What is undone and done again is what was there, at every step."""
        page = self.page
        page.bring_to_front()
        states = [page.evaluate("documents_.now")]
        for _ in range(min(4, page.evaluate("documents_.past.length"))):
            page.evaluate("document.activeElement.blur()")
            page.keyboard.press("Control+z")
            states.append(page.evaluate("documents_.now"))
            assert states[-1] != states[-2], "an edit that changes nothing"
        self.settle()
        self._same(page)
        for known in reversed(states[:-1]):
            page.evaluate("document.activeElement.blur()")
            page.keyboard.press("Control+Shift+z")
            now = page.evaluate("documents_.now")
            assert {**now, "scene": None} == {**known, "scene": None}
            assert now["scene"]["zones"] == known["scene"]["zones"]
            assert now["scene"]["materials"] == known["scene"]["materials"]

    # --- parts ---

    def _note(self, *words: object) -> None:
        self.log[-1] += f" {words}"

    def _open(self, page: Page, address: str) -> None:
        page.on("dialog", lambda dialog: dialog.accept())
        page.goto(address)
        self._shown(page)

    def _shown(self, page: Page) -> None:
        expect(page.locator('body[data-case="small"]')).to_have_count(1, timeout=WAIT_MS)

    def _is_section(self) -> bool:
        self._show("section")
        return self.page.locator("#canvas").get_attribute("data-box") is not None

    def _show(self, mode: str) -> None:
        self._note(mode)
        self.page.locator(f'#modes [data-mode="{mode}"]').click()

    def _read(self, part: str) -> Any:
        return self.workspace.read("small")[part]

    def _pixel(self, place: list[float]) -> tuple[float, float]:
        return pixel_of(self.page, *place)

    def _any(self, selector: str) -> tuple[Any, dict[str, Any]]:
        """One of the elements, and what it is; none: `None`.

        What they are is read at once: between two questions an edit of the other tab, or an answer,
        may have taken the element away, and a question to what is not there waits.
        """
        found = self.page.locator(selector)
        them = found.evaluate_all(DESCRIBE)
        if not them:
            return None, {}
        number = self.chance.randrange(len(them))
        return found.nth(number), them[number]

    def _click(self, found: Any, **more: Any) -> bool:
        """With the mouse, where it can be seen; the page may have moved it meanwhile."""
        try:
            found.scroll_into_view_if_needed(timeout=2000)
            box = found.bounding_box(timeout=2000)
        except Exception:  # it has gone with an edit that the page shows now
            return False
        if box is None:
            return False
        self.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, **more)
        return True

    def _drag(self, x: float, y: float, far: int) -> None:
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for _ in range(self.chance.randint(1, 8)):
            by = (self.chance.randint(-far, far) for _ in range(2))
            self.page.mouse.move(*(at + one for at, one in zip((x, y), by, strict=True)))
            self.page.wait_for_timeout(self.chance.choice((0, 16, 40)))
        self.page.mouse.up()

    def _step_back(self, button: str, key: str) -> None:
        if self.chance.random() < 0.5:
            self.page.keyboard.press(key)
        elif self.page.locator(button).is_visible() and self.page.locator(button).is_enabled():
            self._click(self.page.locator(button))
