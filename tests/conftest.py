"""What all tests share."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings

from tests import budget

# Pictures are drawn without a screen; must be set before matplotlib is first imported.
os.environ["MPLBACKEND"] = "Agg"
# What a shell starts in the background ignores SIGINT, and so would the processes of the tests.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent

settings.load_profile("large" if budget.LARGE else "small")

Command = Callable[..., subprocess.CompletedProcess[str]]


def pytest_configure() -> None:
    """Give each worker of `-n` its share of the processor cores, and each of several runs its own.

    What uses all cores by default then uses that share, and kernels, which Taichi compiles for a
    number of threads, are compiled for one number.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    share = os.environ.get("CORES_SHARE", "0/1")  # of a run beside others: `tests.processors`
    if worker := os.environ.get("PYTEST_XDIST_WORKER"):  # which inherits what its run has
        share = f"{worker.removeprefix('gw')}/{os.environ['PYTEST_XDIST_WORKER_COUNT']}"
    number, of = map(int, share.split("/"))
    if of > 1:
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, cores[number % len(cores) :: of])


LONGEST = (
    "test_tutorial.py", "test_invert_body.py", "test_gpu_benchmark.py", "test_kills.py",
    "test_workflow.py", "test_processors.py", "test_wheel.py", "test_posterior.py",
    "test_invert.py", "test_commands.py", "test_train.py",
)  # fmt: skip
"""Files with the longest tests, begun first by `make test-all`: at its end no worker waits for the
other. xdist by itself would begin them last, as some have one test only."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the property tests, which `make test-all` runs again with more examples."""
    for item in items:
        if getattr(getattr(item, "function", None), "is_hypothesis_test", False):
            item.add_marker("property")
    if not config.getoption("loadscopereorder", True):
        order = {name: place for place, name in enumerate(LONGEST)}
        items.sort(key=lambda item: order.get(item.path.name, len(order)))


SPENT: dict[str, float] = {}
"""CPU seconds of each fast test; in the process that prints the summary those of all workers."""
LIMIT = {"factor": 1.0}


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Count what a fast test takes.

    The first to use a kernel, a module or a shared fixture pays for all: a test over its budget is
    run once more, and counts by that.
    """
    before = budget.cpu_s()
    yield
    if item.get_closest_marker("slow") is not None:
        return
    SPENT[item.nodeid] = budget.cpu_s() - before
    if SPENT[item.nodeid] > budget.CPU_S:
        before = budget.cpu_s()
        item._initrequest()
        runtestprotocol(item, nextitem=nextitem, log=False)
        SPENT[item.nodeid] = min(SPENT[item.nodeid], budget.cpu_s() - before)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node) -> None:
    """Take over what a worker has counted."""
    told = getattr(node, "workeroutput", {})
    SPENT.update(told.get("spent", {}))
    LIMIT["factor"] = max(LIMIT["factor"], told.get("factor", 1.0))


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """A test far over its budget fails the run, where there is one."""
    if math.isinf(budget.CPU_S):
        return
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput.update(spent=SPENT, factor=budget.slowness())
    elif (
        budget.over(SPENT, budget.FAILS * budget.CPU_S, LIMIT["factor"]) and not session.exitstatus
    ):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter) -> None:
    """The dearest fast tests, and those that are over the budget."""
    if math.isinf(budget.CPU_S) or not SPENT:
        return
    terminalreporter.section(f"CPU: {sum(SPENT.values()):.0f} s in {len(SPENT)} tests")
    for name, seconds in sorted(SPENT.items(), key=lambda one: -one[1])[:10]:
        terminalreporter.line(f"{seconds:5.1f} s  {name}")
    for line in budget.over(SPENT, budget.CPU_S, LIMIT["factor"]):
        terminalreporter.line(f"over the budget: {line}", red=True)


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
