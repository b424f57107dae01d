"""How fast the studio answers, in a real browser, and the picture of its page in the docs.

    python -m benchmarks.studio [--picture docs/images/studio.png]

Lower San Fernando is opened; its S_r is moved 200 times, each time to a value that was not there
before. Printed: first paint; from the slider to the band of the learned model and to the new
deposit, and the part of it that the solver takes (p50 and p95); how many deposits a second are
shown while the slider is dragged; what page and server hold in memory afterwards. The limit is the
solver's own time. Then a vertex of a copy (16 zones) is dragged about: the time from frame to
frame, whose limit is the screen's 60 a second, and the part of it that the page works. Needs
Chromium.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.generated_pages import table
from pipeline.cli import InputError
from pipeline.places import CASES, shipped

if TYPE_CHECKING:
    from playwright.sync_api import Page

CASE, DRAWN, MOVES = "lower_san_fernando", "drawn", 200
HELD = [f"memory of the {what} after {MOVES} runs" for what in ("page", "server")]
ASKED = {
    "first paint": 0.3,
    "slider to first response, p50": 0.06,
    "deposits a second while dragged": 3.0,
    "slider to deposit, p50": 0.35,
    "slider to deposit, p95": 0.6,
    **dict.fromkeys(HELD, 500.0),
    "frame while drawing, p50": 1 / 60,
    "frame while drawing, p95": 1 / 60,
}
#: How long a slider is dragged [s].
DRAG_S = 8.0
#: Steps of the mouse while a vertex is dragged.
STEPS = 240
#: Keeps the time of every frame and of the page's work in it.
WATCH_FRAMES = """() => {
  window.frames_ = []; window.work_ = [];
  const loop = (now) => { window.frames_.push(now); requestAnimationFrame(loop); };
  requestAnimationFrame(loop);
  const paint = View_.prototype.paint;
  View_.prototype.paint = function () {
    const began = performance.now(); paint.call(this); window.work_.push(performance.now() - began);
  };
}"""
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: Options of a browser without a screen that asks nothing of the network.
QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
STATUS = re.compile(r"answered in ([\d.]+) s, ([\d.]+) s of it")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print; with `--picture` draw the page as well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path, help="PNG of the page")
    arguments = parser.parse_args(argv)
    if CHROMIUM is None:
        raise InputError("the studio is measured in Chromium, which is not installed")
    with TemporaryDirectory() as folder:
        shutil.copytree(shipped(CASES) / CASE, Path(folder) / DRAWN)
        with started(CASE, cwd=folder) as (server, address):
            measure(server.pid, address, arguments.picture)
        with serving(Path(folder) / DRAWN) as address:
            measure_drawing(address)
    return 0


@contextmanager
def serving(case: str | Path, *options: str, cwd: str | Path | None = None) -> Iterator[str]:
    """A studio in a process of its own; its address with the token."""
    with started(case, *options, cwd=cwd) as (_, address):
        yield address


@contextmanager
def started(
    case: str | Path, *options: str, cwd: str | Path | None = None
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The same; its process as well."""
    server = subprocess.Popen(
        [sys.executable, "-m", "flowslide", "studio", str(case), "--no-browser", *options],
        cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        yield server, next(line for line in server.stdout if line.startswith("http://")).strip()
    finally:
        server.terminate()
        server.communicate(timeout=30)


def resident(process: int) -> float:
    """Memory of a process and of those that it has started [MB], shared pages once; of Linux."""
    folder = Path(f"/proc/{process}")
    lines = (folder / "smaps_rollup").read_text().splitlines()
    own = next(1e-3 * float(line.split()[1]) for line in lines if line.startswith("Pss:"))
    started = (path.read_text().split() for path in folder.glob("task/*/children"))
    below = sum(resident(int(child)) for some in started for child in some)
    return own + below


def measure(server: int, address: str, picture: Path | None) -> None:
    """Move the slider in a browser, and print what came of it."""
    from playwright.sync_api import expect, sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=[*QUIET, "--enable-precise-memory-info"]
        )
        page = browser.new_page(viewport={"width": 1380, "height": 820})
        page.goto(address)

        def answered(number: int) -> tuple[float, float]:
            there = page.locator(f'body[data-answered="{number}"]')
            expect(there).to_have_count(1, timeout=120_000)
            found = STATUS.search(page.locator("#status").inner_text())
            return float(found.group(1)), float(found.group(2))

        answered(1)
        paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
        strength = page.get_by_label("S_r, liquefied fill [kPa]")
        seconds, first = [], []
        for move in range(MOVES):
            strength.fill(f"{18.13 + 0.1 * move:.2f}")
            strength.press("Enter")
            seconds.append(answered(2 + move))
            first.append(float(page.locator("body").get_attribute("data-first") or "nan") / 1e3)
        dragged = deposits_a_second(page)
        held = page.evaluate("performance.memory.usedJSHeapSize") / 1e6, resident(server)
        if picture is not None:
            strength.fill("20.4")
            strength.press("Enter")
            page.get_by_label("Colour").select_option("displacement")
            page.wait_for_timeout(3000)
            page.screenshot(path=str(picture))
        browser.close()
    whole, solver = np.array(seconds).T
    rows = [
        ("first paint", paint / 1e3, "s"),
        ("slider to first response, p50", float(np.nanmedian(first)), "s"),
        ("deposits a second while dragged", dragged, "1/s"),
    ]
    for share, words in ((50, "p50"), (95, "p95")):
        rows.append((f"slider to deposit, {words}", float(np.percentile(whole, share)), "s"))
        rows.append((f"of it the solver, {words}", float(np.percentile(solver, share)), "s"))
    rows += [(name, value, "MB") for name, value in zip(HELD, held, strict=True)]
    show(rows, ASKED)


def deposits_a_second(page: Page) -> float:
    """Drag the first slider for `DRAG_S`, and count the deposits that are shown meanwhile."""
    page.evaluate(
        """() => {
          window.shown_ = 0;
          new MutationObserver(() => { window.shown_ += 1; })
            .observe(document.querySelector("#misfit"), { childList: true });
        }"""
    )
    box = page.locator("#sliders input[type=range]").first.bounding_box()
    began, step = time.perf_counter(), 0
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    while time.perf_counter() - began < DRAG_S:
        step += 1
        share = 0.4 + 0.2 * np.sin(0.03 * step)
        page.mouse.move(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
        page.wait_for_timeout(16)
    shown = page.evaluate("window.shown_")
    page.mouse.up()
    return float(shown / (time.perf_counter() - began))


def pixel_of(page: Page, x: float, y: float) -> tuple[float, float]:
    """Where a place of the section [m] is in the window [pixels]."""
    canvas = page.locator("#canvas")
    shown = canvas.evaluate("canvas => canvas.dataset.box.split(' ')")
    left, bottom, scale, rise = map(float, shown)
    box = canvas.bounding_box()
    return box["x"] + (x - left) / scale, box["y"] + box["height"] - (y - bottom) * rise / scale


def measure_drawing(address: str) -> None:
    """Drag a vertex about, and print how smoothly it follows."""
    from playwright.sync_api import expect, sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        page = browser.new_page(viewport={"width": 1380, "height": 820})
        page.goto(address)
        expect(page.locator('body[data-answered="1"]')).to_have_count(1, timeout=120_000)
        page.get_by_role("tab", name="Section").click()
        x, y = pixel_of(page, 169.9, 5.0)  # a foot of the core, which three lines share
        page.evaluate(
            f"async () => {{ window.View_ = (await import('/view.js')).View; ({WATCH_FRAMES})(); }}"
        )
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(STEPS):
            angle = 2 * np.pi * step / 60
            page.mouse.move(x + 30 * np.sin(angle), y - 20 * (1 - np.cos(angle)))
        frames, work = page.evaluate("[window.frames_, window.work_]")
        browser.close()
    between = np.diff(frames) / 1e3
    work = np.array(work) / 1e3
    rows = []
    for share, words in ((50, "p50"), (95, "p95")):
        rows.append((f"frame while drawing, {words}", float(np.percentile(between, share)), "s"))
        rows.append((f"of it the page, {words}", float(np.percentile(work, share)), "s"))
    show(rows, ASKED)


def show(rows: list[tuple[str, float, str]], asked: dict[str, float]) -> None:
    """Print figures next to those asked for."""
    print(table(("figure", "measured", "asked"),
                [(name, f"{value:.3g} {unit}", f"{asked[name]:.3g} {unit}" if name in asked else "")
                 for name, value, unit in rows]))  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
