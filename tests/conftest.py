"""What all tests share."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests import budget

# Pictures are drawn without a screen; must be set before matplotlib is first imported.
os.environ["MPLBACKEND"] = "Agg"

ROOT = Path(__file__).resolve().parent.parent

settings.load_profile("large" if budget.LARGE else "small")

Command = Callable[..., subprocess.CompletedProcess[str]]


def pytest_configure() -> None:
    """Give each worker of `-n` its share of the processor cores.

    What uses all cores by default then uses that share, and kernels, which Taichi compiles for a
    number of threads, are compiled for one number.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
    if workers > 1 and hasattr(os, "sched_setaffinity"):
        number = int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw"))
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, cores[number % len(cores) :: workers])


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the property tests, which `make test-all` runs again with more examples."""
    for item in items:
        if getattr(getattr(item, "function", None), "is_hypothesis_test", False):
            item.add_marker("property")


@pytest.fixture(scope="session")
def root() -> Path:
    """The top folder of the checkout."""
    return ROOT


@pytest.fixture(autouse=True, scope="module")
def _users_code_ends_with_its_file() -> Iterator[None]:
    """Effects, laws and measurements of users that a file of tests has loaded end with it."""
    before = {name: dict(_of_users(name)) for name in REGISTRIES}
    yield
    for name, known in before.items():
        after = _of_users(name)
        after.clear()
        after.update(known)


REGISTRIES = (
    ("mpm_taichi.effects.framework.registry", "_users"),
    ("mpm_taichi.materials.registry", "users"),
    ("geometry.survey.registry", "_users"),
)


def _of_users(name: tuple[str, str]) -> dict:
    registry = sys.modules.get(name[0])
    return getattr(registry, name[1]) if registry else {}


@pytest.fixture
def run_module() -> Command:
    """Run `python -m <arguments>` as a user would; returns exit code, output and errors."""

    def run(*arguments: object, cwd: Path = ROOT, timeout: float = 120.0):
        return subprocess.run(
            [sys.executable, "-m", *map(str, arguments)],
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    return run
