"""The whole back-analysis of a small, coarse dam: files, numbers, kill and resume, bad input."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from inversion.back_analysis.result import Result, load_result, schema_text
from pipeline.cli import InputError
from tests.dams import dam_with_pool
from tests.inversion.conftest import QUESTION

pytestmark = pytest.mark.slow

SMALL = ("--set", "inversion.noise_seeds=2", "--set", "inversion.starts=2",
         "--set", "inversion.step_seeds=2", "--report", "none")  # fmt: skip


def arguments(case: Path, out: Path) -> list[str]:
    return ["flowslide", "invert", str(case), "--out", str(out), *SMALL]


@pytest.fixture(scope="module")
def solved(root, tmp_path_factory):
    """The case solved once, without interruption: its folder, what was said, the files' folder."""
    folder = tmp_path_factory.mktemp("solved")
    case = dam_with_pool(folder / "small_dam")
    (case / "inversion.yaml").write_text(QUESTION)
    done = subprocess.run(
        [sys.executable, "-m", *arguments(case, folder / "out")],
        cwd=root, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return case, done, folder / "out"


def test_the_runout_is_fitted_and_the_answer_makes_sense(solved):
    _, done, out = solved
    result = load_result(out)
    answer = result.answer
    strength, friction = answer.parameters
    assert answer.reached and answer.loss < 0.1 and answer.loss_unit == "m2"
    assert result.runs_to_answer <= 30
    assert 15 < strength.value < 40
    assert 0.5 < strength.std_data < 5
    assert strength.std_total >= strength.std_data
    assert strength.interval_95[0] < strength.value < strength.interval_95[1]
    assert strength.determined and not friction.determined
    assert friction.std_data == pytest.approx(friction.prior_std, rel=0.05)
    assert any("zone" in line.words for line in answer.undetermined)
    # 14.5 m of fill under up to 26 m more, half of its weight carried by water: some 150 kPa.
    assert 100 < strength.sigma_v0_kpa < 200
    assert strength.ratio == pytest.approx(strength.value / strength.sigma_v0_kpa)
    assert friction.ratio is None
    assert "S_r of the fill" in done.stdout and "not determined" in done.stdout


def test_assumptions_move_the_answer_the_way_they_must(solved):
    result = load_result(solved[2])
    here = result.answer.parameters[0].value
    (dry,) = result.variants
    assert dry.reached and dry.values["residual_strength_1"] > 1.3 * here
    by_name = {entry.name: entry for entry in result.sensitivities}
    assert set(by_name) == {"top of the liquefied zone", "pool level", "time step"}
    assert len(by_name["pool level"].sides) == 2
    strength = result.answer.parameters[0]
    assert set(by_name) < set(strength.std_by_source)
    squares = sum(value**2 for value in strength.std_by_source.values())
    assert strength.std_total == pytest.approx(np.hypot(strength.std_data, np.sqrt(squares)))
    assert result.noise.seeds == [1, 2]
    (first, second) = result.starts
    assert first.start != second.start
    names = {line.name: line.role for line in result.measurements}
    assert names["upstream toe"] == "fitted" and names["crest"] == "compared"


def test_the_files_agree_with_each_other(solved):
    _, _, out = solved
    result = load_result(out)
    with (out / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(result.iterations)
    last = [row for row in rows if row["accepted"] == "true"][-1]
    assert float(last["loss_m2"]) == pytest.approx(result.answer.loss, rel=1e-4)
    # The history is of the runs as they were; the answer is told in small cells.
    strength = result.answer.parameters[0]
    assert float(last["residual_strength_1"]) == pytest.approx(strength.as_run, rel=1e-4)
    assert strength.value != strength.as_run
    with np.load(out / "sections.npz", allow_pickle=False) as file:
        assert file["final"].shape == (len(rows), *file["initial"].shape)
        toe = file["final"][int(file["answer"]), :, 0].min()
        assert 76.02 - 53 - 8 < toe < 76.02 - 53 + 8
        assert float(file["spacing"]) == 4 and len(file["zone"]) == len(file["initial"])


def test_the_trajectory_is_that_of_the_answer(solved):
    from mpm_taichi.trajectory import read_run

    _, _, out = solved
    run = read_run(out / "run.h5", 0, ["positions"])
    with np.load(out / "sections.npz", allow_pickle=False) as file:
        np.testing.assert_array_equal(run.positions[-1], file["final"][int(file["answer"])])


def test_result_fits_its_schema(solved):
    result = json.loads((solved[2] / "result.json").read_text())
    jsonschema.validate(result, json.loads(schema_text()))


def test_every_key_of_a_result_is_described():
    for name, part in json.loads(schema_text())["$defs"].items():
        for key, field in part["properties"].items():
            assert field.get("description") or "const" in field, f"{name}.{key}"


def timeless(path: Path) -> dict:
    """A result without what depends on the clock and the machine."""
    document = json.loads(path.read_text())
    for name in ("manifest", "timings"):
        del document[name]
    for line in document["iterations"]:
        del line["seconds"]
    return document


@pytest.mark.parametrize("threads", ["1", "2"], ids=["one process", "two processes"])
def test_killed_and_continued_leaves_the_same_bytes(solved, root, tmp_path, threads):
    case, _, whole = solved
    out = tmp_path / "out"
    command = [sys.executable, "-m", *arguments(case, out), "--threads", threads]
    process = subprocess.Popen(
        command,
        cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + 300  # on a busy machine
    while len(list(out.glob("runs/[!.]*.npz"))) < 7 and time.monotonic() < deadline:
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = {path.name: path.stat().st_mtime_ns for path in out.glob("runs/[!.]*.npz")}
    assert len(kept) >= 7 and not (out / "result.json").exists()

    done = subprocess.run(command, cwd=root, capture_output=True, check=False)
    assert done.returncode == 0
    for name, made in kept.items():
        assert (out / "runs" / name).stat().st_mtime_ns == made, "computed once"
    for name in ("history.csv", "sections.npz"):
        assert (out / name).read_bytes() == (whole / name).read_bytes(), name
    assert timeless(out / "result.json") == timeless(whole / "result.json")


def test_a_question_asked_again_costs_no_simulation(solved, root):
    case, _, out = solved
    before = {path: path.stat().st_mtime_ns for path in out.glob("runs/*.npz")}
    shutil.copy(out / "result.json", out / "before.json")
    done = subprocess.run(
        [sys.executable, "-m", *arguments(case, out)], cwd=root, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Taichi" not in done.stderr, "the solver need not even start"
    assert {path: path.stat().st_mtime_ns for path in out.glob("runs/*.npz")} == before
    assert timeless(out / "result.json") == timeless(out / "before.json")


def test_a_damaged_run_is_computed_again(solved, tmp_path):
    from inversion.engines.content_store import read_arrays
    from inversion.engines.run_store import run_of_arrays

    path = next(solved[2].glob("runs/*.npz"))
    assert read_arrays(path, run_of_arrays).status == "finished"
    broken = tmp_path / path.name
    broken.write_bytes(path.read_bytes()[:-200])
    assert read_arrays(broken, run_of_arrays) is None
    assert read_arrays(tmp_path / "none.npz", run_of_arrays) is None


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--threads", "0"], "--threads 0: at least 1"),
        (["--spacing", "-1"], "--spacing -1: must be greater than 0"),
        (["--set-of-measurements", "other"], "no set of measurements 'other'; there are field"),
        (["--set", "inversion.method=newton"], "inversion.method"),
        (["--method", "newton"], "invalid choice: 'newton'"),
        (["--set", "inversion.tolerance=1"], "did you mean"),
    ],
)
def test_bad_input_is_a_line_and_exit_2(lsfd, run_module, more, message):
    done = run_module("flowslide", "invert", lsfd, *more)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_no_such_case(run_module, tmp_path):
    done = run_module("flowslide", "invert", tmp_path / "nothing")
    assert done.returncode == 2 and "no such folder; a case has scene.yaml" in done.stderr


def test_work_that_fails_is_exit_1(lsfd, run_module):
    """Bounds so high that nothing can move."""
    path = lsfd / "inversion.yaml"
    path.write_text(path.read_text().replace("start: 30, low: 5, high: 90",
                                             "start: 900, low: 700, high: 990"))  # fmt: skip
    done = run_module("flowslide", "invert", lsfd, "--quick", "--quiet", "--out", lsfd / "out")
    assert done.returncode == 1, done.stderr
    assert (
        "nothing moves by 8 m in what is fitted, not even at residual_strength_1 700" in done.stderr
    )
    assert "Traceback" not in done.stderr


def test_a_damaged_result_is_refused(solved, tmp_path):
    document = json.loads((solved[2] / "result.json").read_text())
    Result.model_validate(document)
    del document["answer"]["loss"]
    (tmp_path / "result.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="answer.loss: is missing"):
        load_result(tmp_path)
