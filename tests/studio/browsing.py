"""What the tests in a browser share."""

from __future__ import annotations

import os
import re
import warnings

import pytest

from benchmarks.studio import CHROMIUM
from pipeline.files import read_json

WAIT_MS = 120_000
WALK = int(os.environ.get("STUDIO_WALK", 0))
"""Actions of a long walk, see test_walk.py; 0: short ones."""
PICTURES = os.environ.get("STUDIO_PICTURES")
"""Folder for pictures of the page, such as docs/images/studio; none: no pictures."""
NEEDS_CHROMIUM = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None and not os.environ.get("CI"), reason="there is no chromium on this machine"
    ),
    pytest.mark.flaky(reruns=1),  # a browser on a busy machine; the summary names who had to
]


def needs_chromium(test):
    """A test of a browser, in a file with others."""
    for mark in NEEDS_CHROMIUM:
        test = mark(test)
    return test


def watched(browser, *, width: int = 1280, height: int = 800):
    """A page in a window of its own; its `errors` are those of its scripts and its console."""
    context = browser.new_context(viewport={"width": width, "height": height})
    context.writing = set()
    context.on("request", lambda one: one.method != "GET" and context.writing.add(one))
    for ended in ("requestfinished", "requestfailed"):
        context.on(ended, lambda one: context.writing.discard(one))
    return tab(context)


def close_pages(browser) -> None:
    """Close all pages, once nothing of theirs is being written or is still to be written."""
    for context in browser.contexts:
        for page in context.pages:
            page.wait_for_selector("body:not([data-saving])", state="attached", timeout=20_000)
        for page in context.pages[:1]:
            for _ in range(100):  # what has outlived its page may never be said to have ended
                if not getattr(context, "writing", None):
                    break
                page.wait_for_timeout(50)
        context.close()


def tab(context):
    """Another page in a window."""
    page = context.new_page()
    page.set_default_timeout(20_000)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.on("console", lambda told: page.errors.extend(_faults(told)))
    return page


def _faults(told) -> list[str]:
    """What the console of the browser has to say, but for requests that are refused with a word."""
    gone = re.search(r"net::ERR_|status of (400|403|409)|WebSocket connection to", told.text)
    return [] if gone or told.type != "error" else [f"{told.text} {told.location}"]


def answered(page, number: int) -> None:
    """Wait for the answer to a question; where none comes, the page's own words say why."""
    from playwright.sync_api import expect

    there = page.locator(f'body[data-answered="{number}"]')
    try:
        expect(there).to_have_count(1, timeout=WAIT_MS)
    except AssertionError:
        told = page.locator("#status").inner_text(), page.evaluate("({ ...document.body.dataset })")
        words = f"no answer {number}: {told}, errors {page.errors}"
        warnings.warn(words, stacklevel=2)  # in the summary, also where the second try passes
        raise AssertionError(words) from None


def stored(page, workspace, name: str = "small"):
    """A case as it is in the files, once all that was done in the page is saved.

    The words of the status are no sign of it: those of an earlier edit stay meanwhile.
    """
    page.wait_for_selector("body:not([data-saving])", state="attached", timeout=WAIT_MS)
    return workspace.read(name)


def value_of_run(workspace) -> float:
    """The first parameter that the only job has found, as the cells of the picture have it."""
    (result,) = workspace.hidden("small", "jobs").glob("**/result.json")
    found = read_json(result)["answer"]["parameters"][0]
    return found.get("value_of_run") or found["value"]


def picture(page, name: str) -> None:
    """Take a picture of the page, where pictures are wanted."""
    if PICTURES:
        page.mouse.move(5, 5)
        page.wait_for_timeout(400)
        page.screenshot(path=f"{PICTURES}/{name}.png")
