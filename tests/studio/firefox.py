"""Firefox of the system, driven by its own WebDriver BiDi: nothing is downloaded for it.

Playwright drives a Firefox of its own build alone, so this has the few commands that a walk needs:
real keys, a real mouse, and questions about what is seen.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import time
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
WAIT_S = 120.0
LISTENS = re.compile(r"WebDriver BiDi listening on (ws://\S+)")
#: Keys of WebDriver by the names that a browser gives them.
KEYS = {
    "Shift": "\ue008", "Control": "\ue009", "Alt": "\ue00a", "Tab": "\ue004", "Enter": "\ue007",
    "Escape": "\ue00c", "ArrowLeft": "\ue012", "ArrowUp": "\ue013", "ArrowRight": "\ue014",
    "ArrowDown": "\ue015", "Home": "\ue011", "End": "\ue010", "Delete": "\ue017",
    "Backspace": "\ue003",
}  # fmt: skip
#: Nothing is asked of the network, and downloads need no hand.
PREFERENCES = {
    "browser.download.folderList": 2,
    "browser.download.alwaysOpenPanel": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.reportingpolicy.firstRun": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "app.normandy.enabled": False,
    "browser.safebrowsing.downloads.enabled": False,
}


class Firefox:
    """A window of Firefox.

    Args:
        folder: of its profile and its downloads.
        width: of the page [px].
        height: likewise.
        ratio: pixels of the screen for one of the page.
        dark: the system prefers dark.

    Attributes:
        errors: of the scripts of its pages, and what they write to the console as errors.
    """

    def __init__(
        self,
        folder: Path,
        *,
        width: int = 1380,
        height: int = 860,
        ratio: float = 1.0,
        dark: bool = False,
    ) -> None:
        self.downloads, profile = folder / "downloads", folder / "profile"
        self.errors: list[str] = []
        self._numbers = count(1)
        self._open = ExitStack()
        self.downloads.mkdir(parents=True)
        profile.mkdir()
        chosen = {
            **PREFERENCES,
            "browser.download.dir": str(self.downloads),
            "ui.systemUsesDarkTheme": int(dark),
            "layout.css.prefers-color-scheme.content-override": 0 if dark else 1,
        }
        lines = [f'user_pref("{name}", {json.dumps(value)});' for name, value in chosen.items()]
        (profile / "user.js").write_text("\n".join(lines))
        self._process = subprocess.Popen(
            [FIREFOX, "--headless", "--no-remote", "--profile", str(profile),
             "--remote-debugging-port", "0", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            self._begin(width, height, ratio)
        except BaseException:
            self.close()
            raise

    def _begin(self, width: int, height: int, ratio: float) -> None:
        found = (LISTENS.search(line) for line in self._process.stderr)
        address = next(one.group(1) for one in found if one)
        line = connect(f"{address}/session", max_size=None, compression=None, proxy=None)
        self._socket = self._open.enter_context(line)
        self._ask("session.new", capabilities={})
        # In the tab that is there already the cursor is in the bar of addresses: a page without the
        # focus hears of no change of a field.
        made = self._ask("browsingContext.create", type="tab", background=False)
        self.context = made["context"]
        self._ask("session.subscribe", events=["log.entryAdded"])
        self.window(width, height, ratio)

    def close(self) -> None:
        """End it."""
        self._open.close()
        self._process.terminate()
        try:
            self._process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    def __enter__(self) -> Firefox:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- what is seen ---

    def window(self, width: int, height: int, ratio: float) -> None:
        """A page of this size [px], with `ratio` pixels of the screen for one of its own."""
        self._ask(
            "browsingContext.setViewport",
            context=self.context,
            viewport={"width": width, "height": height},
            devicePixelRatio=ratio,
        )

    def goto(self, address: str) -> None:
        """Open an address."""
        self._ask("browsingContext.navigate", context=self.context, url=address, wait="complete")

    def reload(self) -> None:
        """Load the page again."""
        self._ask("browsingContext.reload", context=self.context, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript in the page.

        Raises:
            AssertionError: it fails there.
        """
        found = self._ask(
            "script.evaluate",
            expression=f"(async () => JSON.stringify({expression}))()",
            target={"context": self.context},
            awaitPromise=True,
        )
        assert found["type"] == "success", (expression, found["exceptionDetails"]["text"])
        text = found["result"].get("value")
        return None if text is None else json.loads(text)

    def wait_for(self, expression: str, seconds: float = WAIT_S) -> Any:
        """The value of an expression as soon as it is true; a page that is not there yet has none.

        Raises:
            AssertionError: it is not in time.
        """
        end = time.monotonic() + seconds
        while True:
            found = self.evaluate(f"document.body && ({expression})")
            if found:
                return found
            status = "document.querySelector('#status')?.textContent"
            assert time.monotonic() < end, (expression, self.evaluate(status), self.errors)
            time.sleep(0.05)

    def text(self, selector: str) -> str:
        """What is written in an element."""
        return self.evaluate(f"document.querySelector({json.dumps(selector)}).innerText")

    def value(self, selector: str) -> str:
        """What a field holds."""
        return self.evaluate(f"document.querySelector({json.dumps(selector)}).value")

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Left, top, width and height of an element [px], scrolled into sight.

        Raises:
            AssertionError: there is none.
        """
        found = self.evaluate(
            f"""(() => {{
              const one = document.querySelector({json.dumps(selector)});
              one?.scrollIntoView({{ block: "nearest" }});
              const box = one?.getBoundingClientRect();
              return box ? [box.x, box.y, box.width, box.height] : null;
            }})()"""
        )
        assert found is not None, f"no {selector}"
        return tuple(found)

    def picture(self, path: Path) -> None:
        """A PNG of what is seen."""
        found = self._ask("browsingContext.captureScreenshot", context=self.context)
        path.write_bytes(base64.b64decode(found["data"]))

    # --- hands ---

    def move(self, x: float, y: float) -> None:
        """The mouse goes to a place [px]."""
        self._mouse({"type": "pointerMove", "x": x, "y": y, "origin": "viewport"})

    def down(self) -> None:
        """Press the button of the mouse."""
        self._mouse({"type": "pointerDown", "button": 0})

    def up(self) -> None:
        """Let it go."""
        self._mouse({"type": "pointerUp", "button": 0})

    def click_at(self, x: float, y: float, times: int = 1) -> None:
        """Click at a place [px]."""
        there = {"type": "pointerMove", "x": x, "y": y, "origin": "viewport"}
        click = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._mouse(there, *times * click)

    def click(self, selector: str, times: int = 1) -> None:
        """Click in the middle of an element."""
        left, top, width, height = self.box(selector)
        self.click_at(left + width / 2, top + height / 2, times)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 5) -> None:
        """Press, move and let go."""
        self.move(*start)
        self.down()
        for k in range(1, steps + 1):
            share = k / steps
            self.move(*(a + share * (b - a) for a, b in zip(start, end, strict=True)))
        self.up()

    def wheel(self, x: float, y: float, by: int) -> None:
        """Turn the wheel at a place [px]; more than 0: towards somebody."""
        scroll = {"type": "scroll", "x": round(x), "y": round(y), "deltaX": 0, "deltaY": by}
        self._act({"type": "wheel", "id": "wheel", "actions": [scroll]})

    def press(self, keys: str) -> None:
        """A key, or several at once such as Control+z."""
        values = [KEYS.get(key, key) for key in (keys.split("+") if len(keys) > 1 else [keys])]
        down = [{"type": "keyDown", "value": value} for value in values]
        up = [{"type": "keyUp", "value": value} for value in reversed(values)]
        self._act({"type": "key", "id": "keys", "actions": [*down, *up]})

    def type(self, text: str) -> None:
        """Type a text."""
        for letter in text:
            self.press(letter)

    # --- the wire ---

    def _mouse(self, *actions: dict[str, Any]) -> None:
        self._act(
            {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"},
             "actions": list(actions)}
        )  # fmt: skip

    def _act(self, source: dict[str, Any]) -> None:
        self._ask("input.performActions", context=self.context, actions=[source])

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            found = json.loads(self._socket.recv(timeout=WAIT_S))
            if found.get("method") == "log.entryAdded":
                entry = found["params"]
                if entry["level"] == "error":
                    self.errors.append(entry["text"])
            if found.get("id") == number:
                assert found["type"] == "success", (method, found)
                return found["result"]
