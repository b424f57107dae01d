"""The same documents on every processor: two or three kinds are stood in for by their kernels.

OpenBLAS and numpy choose their kernels by the processor, and so round otherwise on each. Here one
computer takes the kernels of others; what each simulates is the same to the bit and is kept.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.inversion.small_slide import write_case
from tests.processors import PROCESSORS

pytestmark = [pytest.mark.slow, pytest.mark.long]

TOLERANCE = 1e-6
#: What tells of the work and not of the answer.
OF_THE_WORK = {"manifest", "timings", "simulated_now", "seconds"}

FEW = [f"--set=posterior.{name}={number}" for name, number in {
    "coarse_runs": 32, "refined_runs": 8, "fine_runs": 4, "live_points": 50, "draws": 200,
}.items()]  # fmt: skip


@pytest.fixture(scope="module")
def commands(root: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """What is run, by the document that it leaves."""
    density = {"name": "density", "kind": "property", "property": "density", "zones": ["soil"],
               "std": 100.0}  # fmt: skip
    block = write_case(
        tmp_path_factory.mktemp("cases") / "block", loss="misfit", sensitivities=[density]
    )
    embankment = root / "docs" / "examples" / "hidden_effect"
    return {
        "result.json": ["invert", embankment, "--spacing", "3", "--quick", "--report", "none"],
        "posterior.json": ["posterior", block, *FEW],
        "verdict.json": ["diagnose", embankment, "--config", root / "config/test.yaml",
                         "--set", "diagnosis.spacing_factor=3", "--page", "no"],
    }  # fmt: skip


@pytest.fixture
def answers(commands, tmp_path, run_module, monkeypatch):
    """A document of each processor, in turn; runs of the first are known to the others."""

    def answer(name: str) -> dict[str, dict]:
        found, before = {}, None
        for kernel, environment in PROCESSORS.items():
            out = tmp_path / kernel
            if before is not None:
                shutil.copytree(before / "runs", out / "runs")
            with monkeypatch.context() as here:
                here.delenv("OPENBLAS_NUM_THREADS", raising=False)  # it would win
                for key, value in {"OPENBLAS_CORETYPE": kernel, **environment}.items():
                    here.setenv(key, value)
                threads = environment["OMP_NUM_THREADS"]
                done = run_module(
                    "flowslide", *commands[name], "--quiet", "--threads", threads, "--out", out
                )
            assert done.returncode == 0, done.stderr
            found[kernel] = json.loads((out / name).read_text())
            before = out
        return found

    return answer


@pytest.mark.skipif(len(PROCESSORS) < 2, reason="this processor has no second kind of kernel")
@pytest.mark.parametrize("name", ["result.json", "posterior.json", "verdict.json"])
def test_documents_agree_in_numbers_and_words(answers, name):
    (first, expected), *others = answers(name).items()
    for kernel, found in others:
        apart = list(differences(expected, found))
        assert not apart, f"{first} and {kernel}: " + "; ".join(apart[:5])


def differences(expected, found, place: str = "") -> Iterator[str]:
    """Where two documents differ by more than the tolerance, or in a word."""
    if isinstance(expected, dict) and isinstance(found, dict):
        assert expected.keys() == found.keys(), place
        for key in expected.keys() - OF_THE_WORK:
            yield from differences(expected[key], found[key], f"{place}.{key}")
    elif isinstance(expected, list) and isinstance(found, list):
        assert len(expected) == len(found), place
        for number, pair in enumerate(zip(expected, found, strict=True)):
            yield from differences(*pair, f"{place}[{number}]")
    elif isinstance(expected, float) and isinstance(found, float):
        if not math.isclose(expected, found, rel_tol=TOLERANCE, abs_tol=TOLERANCE):
            yield f"{place}: {expected} and {found}"
    elif expected != found:
        yield f"{place}: {expected!r} and {found!r}"


@pytest.mark.skipif(len(PROCESSORS) < 2, reason="this processor has no second kind of kernel")
def test_the_kernels_do_round_differently():
    """Else the test above compared a processor with itself."""
    script = (
        "import numpy as np; a = np.random.default_rng(0).normal(size=(50, 50));"
        "print((a @ a).tobytes().hex(), np.exp(a).tobytes().hex())"
    )
    printed = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, **environment},
            capture_output=True, check=True,
        ).stdout
        for kernel, environment in PROCESSORS.items()
    }  # fmt: skip
    assert len(printed) > 1


def test_a_difference_is_seen():
    one = {"a": [1.0, {"words": "the base"}], "manifest": {"made": "now"}}
    other = {"a": [1.00001, {"words": "the fill"}], "manifest": {"made": "then"}}
    assert list(differences(one, one | {"manifest": {}})) == []
    assert len(list(differences(one, other))) == 2
