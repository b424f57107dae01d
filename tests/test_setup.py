"""Setting up: pinned versions, and what `make` says when it cannot go on."""

from __future__ import annotations

import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests import budget

ROOT = Path(__file__).resolve().parent.parent
PINS = {
    canonicalize_name(line.split("==")[0]): line.split("==")[1].strip()
    for line in (ROOT / "constraints.txt").read_text().splitlines()
    if line and not line.startswith("#")
}

#: Extras that `make` leaves out: what needs them skips without.
BY_HAND = ("foreign",)


def installed_extras() -> list[str]:
    """Extras that `make` installs, as pyproject.toml lists them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return [name for name in project["optional-dependencies"] if name not in BY_HAND]


def required(name: str, extras: tuple[str, ...] = (), seen: set | None = None) -> set[str]:
    """All distributions that `name` needs, directly or not, on this Python."""
    seen = set() if seen is None else seen
    if (name, extras) in seen:
        return set()
    seen.add((name, extras))
    found = {canonicalize_name(name)}
    for text in metadata.requires(name) or []:
        need = Requirement(text)
        chosen = [{"extra": extra} for extra in extras] or [{"extra": ""}]
        if need.marker is None or any(need.marker.evaluate(extra) for extra in chosen):
            found |= required(need.name, tuple(sorted(need.extras)), seen)
    return found


def test_everything_that_is_installed_is_pinned():
    needed = required("flowslide", tuple(installed_extras())) - {"flowslide"}
    # What torch brings with it for NVIDIA's GPUs follows from torch itself.
    needed = {name for name in needed if not name.startswith(("nvidia-", "cuda-", "triton"))}
    assert needed | {"setuptools"} <= set(PINS)


def test_pins_serve_the_oldest_python():
    """A pin may ask for a later patch of Python: then `make` fails where that is not to be had."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    oldest = f"{re.search(r'>=([0-9.]+)', project['requires-python'])[1]}.0"
    for name in sorted(required("flowslide", tuple(installed_extras())) & PINS.keys()):
        asked = metadata.metadata(name)["Requires-Python"]
        assert SpecifierSet(asked or "").contains(oldest), f"{name} needs Python {asked}"


def test_make_installs_every_extra():
    listed = re.search(r"^EXTRAS := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert listed[1].split(",") == installed_extras()


def test_extras_that_are_installed_by_hand_are_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for name in BY_HAND:
        needs = [Requirement(text) for text in project["optional-dependencies"][name]]
        for need in needs:
            assert str(need.specifier) == f"=={PINS[canonicalize_name(need.name)]}"


def recipe(target):
    """The commands of a target of the Makefile."""
    makefile = (ROOT / "Makefile").read_text()
    (found,) = re.findall(rf"^{target}:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    return found.splitlines()


def test_make_test_is_the_fast_tests_and_test_all_the_rest():
    options = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert "-m 'not slow'" in options["addopts"]
    (fast,) = recipe("test")
    slow, large = recipe("test-all")
    assert slow == f"{fast.replace(' CPU_BUDGET_S=3', '')} -m slow", "what the fast tests leave out"
    assert "CPU_BUDGET_S=3" in fast
    assert "HYPOTHESIS_PROFILE=large" in large and large.endswith("-m property")


def test_continuous_integration_runs_every_test_before_the_rest():
    commands = re.findall(r"^make (.*)$", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    assert commands[:2] == ["test", "test-all"]


def test_the_head_of_the_makefile_lists_its_targets():
    makefile = (ROOT / "Makefile").read_text()
    listed = re.findall(r"^# make ([a-z-]+) ", makefile, re.MULTILINE)
    targets = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split()
    assert set(targets) - {"format", "install"} == set(listed)


def test_property_tests_have_a_small_and_a_large_budget(monkeypatch):
    monkeypatch.setattr(budget, "LARGE", False)
    small = [budget.examples(number) for number in (5, 30, 100, 300)]
    monkeypatch.setattr(budget, "LARGE", True)
    large = [budget.examples(number) for number in (5, 30, 100, 300)]
    assert small == [10, 10, 33, 100] and large == [20, 120, 400, 1200]


def test_files_name_no_package_index():
    for name in ("constraints.txt", "Makefile", "pyproject.toml", ".ci/run"):
        text = (ROOT / name).read_text()
        assert "://" not in text and "index-url" not in text, name


@pytest.mark.parametrize(
    ("python", "message"),
    [("", "no Python found"), ("/bin/false", "Python 3.11, 3.12 or 3.13 is needed")],
)
def test_make_says_which_python_it_needs(tmp_path, python, message):
    done = subprocess.run(
        ["make", "install", f"VENV={tmp_path / 'venv'}", f"PYTHON={python}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2 and message in done.stdout
    assert not (tmp_path / "venv").exists()
