"""Work that is killed at any moment: no process is left, no file half written, the result the same.

`KILLS=30 python -m pytest -m slow tests/flowslide/test_kills.py` tries thirty. When a command is
hit is counted in finished simulations and not in seconds, so that slow machines are hit as well.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import pytest

from flowslide.studio.jobs import Jobs
from flowslide.studio.workspace import Workspace
from tests.dams import dam_with_pool
from tests.inversion.conftest import QUESTION

pytestmark = [pytest.mark.slow, pytest.mark.long]
KILLS, SEED = int(os.environ.get("KILLS", 4)), 40
PATIENCE_S = 180.0


@dataclass(frozen=True)
class Work:
    """A command that simulates in processes of its own.

    Attributes:
        words: of the command line.
        document: that it leaves.
        runs: simulations of which it keeps files; 0: none.
    """

    words: Sequence[str]
    document: str
    runs: int


FEW = {"coarse_runs": 32, "refined_runs": 4, "fine_runs": 4, "live_points": 50, "draws": 200}
BRIEF = {"max_runs": 70, "replicates": 3, "draws": 300, "starts": 1, "rounds": 1, "refitted": 1}
WORKS = {
    "invert": Work(["invert", "--quick", "--report", "none"], "result.json", 12),
    "predict": Work(["predict", "--residual-strength", "18+-5"], "prediction.json", 24),
    "simulate": Work(["simulate", "--film", "none"], "observables.csv", 0),
    "posterior": Work(
        ["posterior", *(f"--set=posterior.{key}={value}" for key, value in FEW.items())],
        "posterior.json",
        36,
    ),
    "diagnose": Work(
        ["diagnose", "run", "--page", "no",
         *(f"--set=diagnosis.{key}={value}" for key, value in BRIEF.items())],
        "verdict.json",
        60,
    ),
}  # fmt: skip
#: Who is hit by what: the command itself, one of its processes, or all of a terminal.
BLOWS = [
    ("command", signal.SIGKILL), ("command", signal.SIGTERM), ("command", signal.SIGHUP),
    ("group", signal.SIGINT), ("group", signal.SIGKILL), ("process", signal.SIGKILL),
]  # fmt: skip
#: What tells of the work and not of its result.
OF_THE_WORK = {"manifest", "timings", "seconds", "simulated_now", "wall_time_s", "runs", "timing"}


@pytest.fixture(scope="module")
def dam(tmp_path_factory) -> Path:
    folder = dam_with_pool(tmp_path_factory.mktemp("kills") / "small_dam")
    (folder / "inversion.yaml").write_text(QUESTION)
    return folder


@pytest.fixture(scope="module")
def whole(dam) -> dict[str, object]:
    """Documents of commands that nobody has hit, made when they are first asked for."""
    return {}


def start(work: Work, dam: Path, out: Path, threads: int = 2) -> subprocess.Popen[str]:
    words = [*work.words, str(dam), "--out", str(out), "--threads", str(threads), "--quiet",
             "--set=simulation.duration_s=6"]  # fmt: skip
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "flowslide", *words],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def result(work: Work, out: Path) -> object:
    path = out / work.document
    return answer(json.loads(path.read_text())) if path.suffix == ".json" else path.read_text()


def answer(document: object) -> object:
    """Without what tells of the work."""
    if isinstance(document, dict):
        return {k: answer(v) for k, v in document.items() if k not in OF_THE_WORK}
    return [answer(one) for one in document] if isinstance(document, list) else document


def finished(work: Work, dam: Path, out: Path, threads: int = 2) -> object:
    process = start(work, dam, out, threads)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    return result(work, out)


def hit(process: subprocess.Popen[str], family: list[psutil.Process], blow) -> None:
    """Hit a command, with what it has started; it has ended by itself where that was too late."""
    whom, what = blow
    workers = [one for one in family if one.is_running() and "LokyProcess" in " ".join(_words(one))]
    if whom == "group":
        os.killpg(process.pid, what)
    elif whom == "process" and workers:
        workers[0].send_signal(what)
    else:
        process.send_signal(what)


def _words(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def until(true, what: str) -> None:
    end = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < end, f"not after {PATIENCE_S:.0f} s: {what}"
        time.sleep(0.02)


def lives(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


def check_whole(folder: Path) -> None:
    """Every file can be read, but for parts under a name that says so."""
    for path in folder.rglob("*"):
        begun = path.name.startswith(".") and ".tmp" in path.suffixes  # `pipeline.files`
        if not path.is_file() or begun or path.name.endswith(".part"):
            continue
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".npz":
            with zipfile.ZipFile(path) as archive:
                assert archive.testzip() is None
            with np.load(path, allow_pickle=False) as arrays:
                assert arrays.files


@pytest.mark.parametrize("number", range(KILLS))
def test_what_is_killed_leaves_nothing_and_goes_on_to_the_same(number, dam, whole, tmp_path):
    drawn = random.Random(f"{SEED} {number}")
    name = list(WORKS)[number % len(WORKS)]
    work, blow = WORKS[name], drawn.choice(BLOWS)
    if name not in whole:
        whole[name] = finished(work, dam, tmp_path / "whole", threads=1)  # which changes nothing
    out, after = tmp_path / "out", drawn.randrange(work.runs) if work.runs else 0

    process = start(work, dam, out)
    own = psutil.Process(process.pid)
    family: list[psutil.Process] = []

    def reached() -> bool:
        try:
            family[:] = own.children(recursive=True)
        except psutil.Error:
            return True
        kept = len(list((out / "runs").glob("*.npz")))
        return process.poll() is not None or (out.exists() and kept >= after)

    until(reached, f"{after} simulations of {name}")
    hit(process, family, blow)
    _, said = process.communicate(timeout=PATIENCE_S)
    until(lambda: not any(map(lives, family)), f"{name}: the processes of {blow} have ended")
    assert "Traceback" not in said, said
    check_whole(tmp_path)
    if process.returncode == 0:  # it was too late to be hit
        assert result(work, out) == whole[name]
    assert finished(work, dam, out) == whole[name], (name, blow, after)
    assert not [path for path in out.rglob("*") if path.name == ".lock"]


def test_a_job_of_the_studio_that_is_killed_goes_on_to_the_same(dam, tmp_path):
    """Its result is that of a job that nobody has hit."""
    shutil.copytree(dam, tmp_path / "cases" / "small_dam")
    jobs = Jobs(Workspace(tmp_path / "cases"), threads=2)
    drawn, found = random.Random(SEED), []
    for kill in (False, True):
        number = jobs.start("back_analyse", "small_dam", {"quick": True})["id"]
        folder = next((tmp_path / "cases").glob(f".studio/*/jobs/{number}"))
        if kill:
            shutil.rmtree(folder.parent.parent / "runs")
            after = drawn.randrange(6)
            runs = folder.parent.parent / "runs"
            until(lambda: len(list(runs.glob("*.npz"))) >= after, f"{after} simulations")  # noqa: B023
            job = psutil.Process(json.loads((folder / "state.json").read_text())["process"])
            family = job.children(recursive=True)
            job.kill()
            until(lambda: not any(map(lives, family)), "its processes have ended")  # noqa: B023
            check_whole(folder)
            until(lambda: jobs.state(number)["state"] == "interrupted", "it is noticed")  # noqa: B023
            jobs.again(number)
        until(lambda: jobs.state(number)["state"] not in ("running",), "the job ends")  # noqa: B023
        assert jobs.state(number)["state"] == "done", jobs.state(number)
        found.append(answer(json.loads((folder / "inversion" / "result.json").read_text())))
    assert found[0] == found[1]
