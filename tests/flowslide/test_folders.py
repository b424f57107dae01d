"""The folder of the results: had by one command at a time, and tried before the work."""

from __future__ import annotations

import fcntl
import sys

import pytest

from flowslide.command_line import main
from pipeline.cli import InputError, WorkFailed
from pipeline.files import only_one, working_in
from tests.dams import dam_with_pool
from tests.inversion.conftest import QUESTION

COMMANDS = {
    "invert": ["invert", "--quick"],
    "posterior": ["posterior"],
    "predict": ["predict", "--residual-strength", "18+-5"],
    "simulate": ["simulate", "--film", "none"],
    "compare": ["diagnose", "compare"],
    "diagnose": ["diagnose", "run"],
}


@pytest.fixture
def dam(tmp_path):
    folder = dam_with_pool(tmp_path / "small_dam")
    (folder / "inversion.yaml").write_text(QUESTION)
    return folder


def asked(name: str, dam, out) -> list[str]:
    return [*COMMANDS[name], str(dam), "--out", str(out), "--quiet", "--threads", "1"]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_folder_at_work_is_refused_before_any_simulation(name, dam, tmp_path):
    out = tmp_path / "out"
    with working_in(out):
        with pytest.raises(WorkFailed, match="out: another command works in this folder: wait"):
            main(asked(name, dam, out))
        assert [path.name for path in out.rglob("*")] == [".lock"]
    assert not out.exists()


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is of Linux")
def test_a_folder_that_cannot_be_written_is_refused_before_any_simulation(name, dam):
    with pytest.raises(InputError, match="/proc/none/out: cannot be written: "):
        main(asked(name, dam, "/proc/none/out"))


def test_a_refused_case_leaves_no_folder(dam, tmp_path):
    (dam / "scene.yaml").write_text("name: no\n")
    for name in COMMANDS:
        with pytest.raises(InputError):
            main(asked(name, dam, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_lock_ends_with_its_work(tmp_path):
    with working_in(tmp_path / "out"):
        (tmp_path / "out" / "result").touch()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result"]
    with working_in(tmp_path / "out"):
        with (tmp_path / "out" / ".lock").open() as other, pytest.raises(BlockingIOError):
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_a_folder_that_takes_no_file(tmp_path):
    (tmp_path / "lock").mkdir()
    with pytest.raises(InputError, match="cannot be written: Is a directory"):
        with only_one(tmp_path, "busy"):
            pass
