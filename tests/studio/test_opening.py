"""How a browser is given the address: by no word that other users of the machine can see."""

from __future__ import annotations

import os
import re
import signal
import stat
import subprocess
import sys
from urllib.parse import urlsplit
from urllib.request import url2pathname

from flowslide.studio.security import write_opening
from pipeline.processes import python_command, python_environment

BROWSER = """#!{python}
import os, sys
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname
path = Path(url2pathname(urlsplit(sys.argv[1]).path))
Path({told!r}).write_text("\\n".join([*sys.argv[1:], oct(path.stat().st_mode), path.read_text()]))
os.kill(os.getppid(), {signal})
"""


def test_a_page_that_leads_to_an_address_is_its_owners_alone(tmp_path):
    before = os.umask(0)
    try:
        page = write_opening(tmp_path, "http://127.0.0.1:1/?token=a&b")
    finally:
        os.umask(before)
    assert stat.S_IMODE(page.stat().st_mode) == 0o600
    assert 'url=http://127.0.0.1:1/?token=a&amp;b"' in page.read_text()


def test_a_browser_is_started_without_the_token(workspace, tmp_path):
    """It writes down what it was started with, and ends the studio as Ctrl-C does."""
    told, browser = tmp_path / "told.txt", tmp_path / "browser"
    browser.write_text(
        BROWSER.format(python=sys.executable, told=str(told), signal=int(signal.SIGINT))
    )
    browser.chmod(0o755)
    done = subprocess.run(
        python_command("-m", "flowslide", "studio", workspace.folder, "--threads", "1"),
        env=python_environment({"BROWSER": browser}), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (token,) = re.findall(r"token=(\S+)", done.stdout)
    page, mode, text = told.read_text().split("\n", 2)
    assert page.startswith("file://") and token not in page
    assert mode == "0o100600" and f"token={token}" in text
    assert not os.path.exists(url2pathname(urlsplit(page).path)), "it goes with the studio"
