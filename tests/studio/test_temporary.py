"""What is temporary goes with the server; what one that was killed has left goes with the next."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from flowslide.studio.temporary import OLD_S, PREFIX, clear_left_behind, temporary_folder


def _left(folder, name, *, mode=0o700, age_s=OLD_S + 60.0):
    """A folder of a server that has ended."""
    made = folder / f"{PREFIX}{name}"
    made.mkdir()
    (made / "open.html").write_text("<!doctype html>")
    (made / "after.csv").symlink_to(folder / "kept.csv")
    made.chmod(mode)
    os.utime(made, (time.time() - age_s,) * 2)
    return made


def test_what_a_killed_server_has_left_is_removed_and_nothing_else(tmp_path, monkeypatch):
    kept = tmp_path / "kept.csv"
    kept.write_text("1,2\n")
    gone = _left(tmp_path, "abcdefgh")
    stay = [
        _left(tmp_path, "abcdefg1", age_s=5.0),  # may be in use
        _left(tmp_path, "abcdefg2", mode=0o755),  # no folder of ours
        _left(tmp_path, "backup_of_mine"),  # somebody has named it
        _left(tmp_path, "abcdefg3"),
    ]
    (stay[-1] / "case").mkdir()  # nothing of ours has folders
    os.utime(stay[-1], (0.0, 0.0))
    link = tmp_path / f"{PREFIX}abcdefg4"
    link.symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with temporary_folder() as used:
        os.utime(used, (0.0, 0.0))  # as that of a server that has run for days
        clear_left_behind()
        assert used.is_dir()
    assert not gone.exists() and not used.exists()
    assert all(one.is_dir() for one in stay)
    assert link.is_symlink() and kept.read_text() == "1,2\n"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_server_that_is_told_to_end_leaves_nothing(workspace, tmp_path, number):
    own = tmp_path / "temporary"
    own.mkdir()
    server = subprocess.Popen(
        [sys.executable, "-m", "flowslide", "studio", str(workspace.folder), "--no-browser"],
        env={**os.environ, "TMPDIR": str(own)}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert next(line for line in server.stdout if line.startswith("http://"))
    end = time.monotonic() + 60.0
    while not [*own.glob(f"{PREFIX}*")]:
        assert time.monotonic() < end
        time.sleep(0.05)
    time.sleep(0.5)  # until it serves
    server.send_signal(number)
    server.communicate(timeout=60)
    assert not [*own.iterdir()]
