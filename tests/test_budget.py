"""The budget of the fast tests: what is over it is named, slow processors have more."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests import budget

SPINS = """
import time
import pytest
def spin(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
once = []
def test_cheap():
    pass
def test_dear():
    spin(1.2)
def test_somewhat_dear():
    spin(0.24)
def test_that_prepares_for_others():
    if not once:
        spin(0.6)
    once.append(1)
@pytest.mark.slow
def test_slow():
    spin(0.6)
"""


def test_what_is_over_the_budget_is_named_the_dearest_first():
    lines = budget.over({"a": 3.1, "b": 9.0, "c": 2.0}, 3.0, 1.0)
    assert [line.split(":")[0] for line in lines] == ["b", "a"]
    assert "9.0 s of CPU, at most 3.0 s" in lines[0]
    assert budget.over({"b": 9.0}, 3.0, 3.1) == []


def test_a_slow_processor_has_more():
    ticks = iter([0.0, 10.0 * budget.UNIT_S] * 5)
    assert budget.slowness(lambda: None, clock=lambda: next(ticks)) == pytest.approx(10.0)
    assert budget.slowness(lambda: None, clock=lambda: 0.0) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "workers, chosen, rc", [([], "test", 1), (["-n", "1"], "test", 1), ([], "not test_dear", 0)]
)
def test_what_is_far_over_its_budget_fails_the_run(tmp_path, root, workers, chosen, rc):
    (tmp_path / "conftest.py").write_text((root / "tests" / "conftest.py").read_text())
    (tmp_path / "test_spins.py").write_text(SPINS)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-c", "/dev/null", "-p", "no:cacheprovider", *workers,
         "--rootdir", ".", "-q", "-k", chosen, "test_spins.py"],
        cwd=tmp_path,
        env={"PATH": "", "PYTHONPATH": str(Path(root)), "CPU_BUDGET_S": "0.1"},
        capture_output=True,
        text=True,
    )  # fmt: skip
    over = [line for line in done.stdout.splitlines() if line.startswith("over the budget")]
    assert done.returncode == rc, done.stdout + done.stderr
    names = ["test_dear", "test_somewhat_dear"] if rc else ["test_somewhat_dear"]
    assert [line.split("::")[1].split(":")[0] for line in over] == names
    assert f"{3 + len(names)} passed" in done.stdout
