"""How a browser is given the address: by no word that other users of the machine can see."""

from __future__ import annotations

import os
import re
import signal
import stat
import subprocess
import sys
from contextlib import closing
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest

from flowslide.commands.studio import listen, usual_port
from flowslide.studio.security import write_opening
from pipeline.cli import InputError
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


def test_a_folder_keeps_its_port(tmp_path):
    """A page that was open when the server ended finds the next one at its address."""
    ports = []
    for _ in range(2):
        with closing(listen(None, tmp_path)) as listener:
            ports.append(listener.getsockname()[1])
            with closing(listen(None, tmp_path)) as second:
                assert second.getsockname()[1] != ports[-1], "two studios of one folder"
            with pytest.raises(InputError, match=f"--port {ports[-1]}: "):
                listen(ports[-1], tmp_path)
    assert ports == 2 * [usual_port(tmp_path)]
    assert usual_port(tmp_path / "other") != ports[0]
    with pytest.raises(InputError, match="--port 99999: "):
        listen(99_999, tmp_path)
