"""A case folder that somebody else has made: nothing in it runs, whatever is done in it."""

from __future__ import annotations

import os
import subprocess
import sys
from unittest.mock import Mock

import pytest

from flowslide.studio.jobs import Jobs
from flowslide.studio.workspace import Workspace
from gns.training.processes import in_processes
from pipeline.processes import python_command, python_environment
from tests.planted import plant, planted, the_command
from tests.studio.conftest import INVERSION, MEASUREMENTS, SCENE


@pytest.fixture
def case(tmp_path):
    """A case with files that must not run."""
    folder = tmp_path / "small"
    folder.mkdir()
    for name, text in (("scene", SCENE), ("measurements", MEASUREMENTS), ("inversion", INVERSION)):
        (folder / f"{name}.yaml").write_text(text)
    plant(folder)
    return folder


@pytest.fixture
def flowslide(case, root, tmp_path):
    """Run the command in that folder."""
    program = the_command(tmp_path)

    def run(*words: object) -> str:
        done = subprocess.run(
            [sys.executable, program, *map(str, words)], cwd=case, capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": str(root)}, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_a_look_runs_nothing(flowslide, case):
    assert "small" in flowslide("check", ".")
    assert not planted(case)


@pytest.mark.slow
def test_a_job_of_the_studio_runs_nothing(case, monkeypatch):
    """One that ends at once: its case has gone."""
    monkeypatch.chdir(case)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    jobs = Jobs(Workspace(case.parent), threads=1)
    with monkeypatch.context() as patch:
        patch.setattr(jobs.workspace, "snapshot", lambda name, folder: folder / "gone")
        patch.setattr("flowslide.studio.jobs.read_documents", lambda folder: {})
        number = jobs.start("predict", "small", {"strengths": ["loose=8+-2"]})["id"]
    jobs._running[number].wait()
    state = jobs.state(number)
    assert state["state"] == "failed" and "gone" in state["message"], state
    assert not planted(case)


def test_processes_that_train_together_run_nothing(case, tmp_path, monkeypatch):
    monkeypatch.chdir(case)
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "tool.py").write_text("import signal, random, gns; print(gns.__file__)")
    monkeypatch.setenv("PYTHONPATH", str(tools))
    assert in_processes(2, ["tool"]) == 0
    assert not planted(case)


WORK = {
    "invert": ["invert", ".", "--quick", "--spacing", 2, "--threads", 2],
    "predict": ["predict", ".", "--residual-strength", "loose=8+-2", "--spacing", 2,
                "--threads", 2],
    "diagnose": ["diagnose", ".", "--threads", 2, "--set", "diagnosis.replicates=2", "--set",
                 "diagnosis.draws=200", "--set", "diagnosis.max_runs=70", "--set",
                 "diagnosis.rounds=1", "--set", "diagnosis.starts=1"],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("words", WORK.values(), ids=WORK)
def test_work_runs_nothing(flowslide, case, words):
    """With processes, and with a page that is drawn."""
    flowslide(*words, "--set", "simulation.duration_s=4", "--quiet")
    assert list(case.glob("results/**/*.html"))
    assert not planted(case)


def test_how_pages_look_is_not_for_the_folder_to_say(case):
    """Else it might have LaTeX run what it likes."""
    (case / "matplotlibrc").write_text("text.usetex: True\nfont.size: 44\n")
    script = "import report.style, matplotlib; print(matplotlib.rcParams['text.usetex'])"
    done = subprocess.run(
        python_command("-c", script), cwd=case, env=python_environment(), capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.stdout == "False\n", done.stderr


def test_nobody_is_told_that_a_simulation_starts(monkeypatch):
    """Taichi would ask its makers' server for a newer version, with a number of the machine."""
    from taichi import _version_check

    import mpm_taichi.simulate  # noqa: F401 - Taichi as the program uses it

    started = Mock()
    monkeypatch.setattr(_version_check, "threading", started)
    _version_check.start_version_check_thread()
    assert not started.Thread.called
    monkeypatch.delenv("TI_SKIP_VERSION_CHECK")
    _version_check.start_version_check_thread()
    assert started.Thread.called
