"""Python processes of ours: nothing in the working directory runs in them."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from pipeline.processes import python_command, python_environment
from tests.planted import plant, planted
from tests.test_layout import FILES, relative

POOL = """
import os
from pipeline.processes import process_pool

pool = process_pool(2)
print(*pool.map(abs, [-1, -2]), "PYTHONSAFEPATH" in os.environ)
pool.shutdown()
"""


def call(command, folder, environment=None) -> str:
    done = subprocess.run(
        command, cwd=folder, env=environment or python_environment(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_what_is_planted_would_run(tmp_path):
    """Else the tests that nothing of it does could not fail."""
    plant(tmp_path)
    (tmp_path / "tool.py").write_text("import sys, json")
    call([sys.executable, "-m", "tool"], tmp_path, dict(os.environ))
    assert "json" in planted(tmp_path)
    subprocess.run(["git", "status"], cwd=tmp_path, capture_output=True)
    assert "program" in planted(tmp_path)


def test_a_command_finds_our_packages_and_nothing_here(tmp_path):
    plant(tmp_path)
    script = "import signal, flowslide, pipeline; print(signal.SIGINT, flowslide.__file__)"
    said = call(python_command("-c", script), tmp_path)
    assert "flowslide/__init__.py" in said and not planted(tmp_path)
    call(python_command("-m", "flowslide", "--version"), tmp_path)
    assert not planted(tmp_path)


def test_a_pool_and_its_trackers_run_nothing_here(tmp_path):
    """And what the user starts afterwards has the path that it always has."""
    case, programs = tmp_path / "case", tmp_path / "programs"
    case.mkdir(), programs.mkdir()
    plant(case)
    (programs / "flowslide").write_text(POOL)  # as the command is: its own folder is its path
    assert call([sys.executable, programs / "flowslide"], case) == "1 2 False\n"
    assert not planted(case)


def test_a_clone_that_is_not_installed_runs_its_own_code(root, tmp_path):
    """It is found as the working directory alone, which the command leaves out."""
    bare = [sys.executable, "-S", "-c"]  # without what is installed
    script = (
        "import subprocess; from pipeline.processes import *; command = python_command('-S', '-c', "
        "'import pipeline; print(pipeline.__file__)'); "
        "subprocess.run(command, env=python_environment(), cwd={!r}, check=True)"
    )
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    said = call([*bare, script.format(str(tmp_path))], root, environment)
    assert said.strip() == str(root / "pipeline" / "__init__.py")


@pytest.mark.parametrize("before", [None, "/some/where"])
def test_a_path_that_is_set_is_kept(root, monkeypatch, before):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    if before is not None:
        monkeypatch.setenv("PYTHONPATH", before)
    expected = [str(root), *([before] if before else [])]
    assert python_environment({"RANK": 1})["PYTHONPATH"].split(os.pathsep) == expected
    assert python_environment({"RANK": 1})["RANK"] == "1"


def test_python_is_started_in_one_place():
    texts = {relative(path): path.read_text() for path in FILES}
    found = [name for name, text in texts.items() if "sys.executable" in text or "loky" in text]
    assert found == ["pipeline/processes.py"]
