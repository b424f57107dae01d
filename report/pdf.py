"""A page as PDF, printed by a browser that is on the machine.

In: a self-contained page. Out: a PDF next to it, with page numbers, in which no short table and no
picture is cut. The page itself says how it is printed (`report.page`). Only Chromium and what is
made of it print without a window.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from pipeline.cli import InputError, WorkFailed
from pipeline.files import atomic_path

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)
NEEDS = (
    "a PDF is printed by Chromium or Chrome, and none is installed; open the page in any browser "
    "and print it from there"
)
LONGEST_S = 180.0
OPTIONS = [
    "--headless",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--disable-sync",
    # A page needs no network, and shall have none.
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--no-pdf-header-footer",
]


def browser() -> str | None:
    """The first browser of the list that is installed; None: there is none."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


def write_pdf(page: str | os.PathLike[str]) -> Path:
    """Print a page into a PDF of the same name.

    Raises:
        InputError: there is no such page, or no browser.
        WorkFailed: the browser prints nothing.
    """
    page = Path(page).resolve()
    if not page.is_file():
        raise InputError(f"{page}: no such page")
    program = browser()
    if program is None:
        raise InputError(f"{page.with_suffix('.pdf')}: {NEEDS}")
    # Chromium's sandbox refuses to work for root.
    alone = ["--no-sandbox"] if os.geteuid() == 0 else []
    with (
        TemporaryDirectory(prefix="flowslide_pdf_") as folder,
        atomic_path(page.with_suffix(".pdf")) as path,
    ):
        # A profile of its own: a browser that is open would take the page into its window.
        printed = Path(folder) / "page.pdf"
        command = [
            program,
            *OPTIONS,
            *alone,
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={printed}",
            page.as_uri(),
        ]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise WorkFailed(f"{page}: {program} did not print it: {error}") from None
        if not printed.is_file():
            said = (done.stderr.strip().splitlines() or ["nothing was said"])[-1]
            raise WorkFailed(f"{page}: {program} did not print it: {said}")
        shutil.move(printed, path)
    return page.with_suffix(".pdf")
