"""Setting up: pinned versions, and what `make` says when it cannot go on."""

from __future__ import annotations

import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

import pipeline
from flowslide.command_line import leaves
from inversion.engines.registry import engines
from pipeline.extras import MODULES
from tests import budget

ROOT = Path(__file__).resolve().parent.parent
PINS = {
    canonicalize_name(line.split("==")[0]): line.split("==")[1].strip()
    for line in (ROOT / "constraints.txt").read_text().splitlines()
    if line and not line.startswith("#")
}

#: Extras that `make` leaves out: what needs them skips without.
BY_HAND = ("foreign", "release")
#: Those of developers, which `all` leaves out.
OF_DEVELOPERS = ("dev", "docs", *BY_HAND)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = {
    name: [Requirement(text) for text in needs]
    for name, needs in PROJECT["optional-dependencies"].items()
}


def setting(name: str) -> str:
    """A variable of the Makefile, or one of a target of it."""
    makefile = (ROOT / "Makefile").read_text()
    return re.search(rf"^{re.escape(name)} := (.*)$", makefile, re.MULTILINE)[1]


def installed_extras() -> tuple[str, ...]:
    """Extras that `make` installs."""
    return tuple(setting("EXTRAS").split(","))


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
    needed = required("flowslide", installed_extras()) - {"flowslide"}
    # What torch brings with it for NVIDIA's GPUs follows from torch itself.
    needed = {name for name in needed if not name.startswith(("nvidia-", "cuda-", "triton"))}
    assert needed | {"pip", "setuptools"} <= set(PINS)


def test_pins_serve_the_oldest_python():
    """A pin may ask for a later patch of Python: then `make` fails where that is not to be had."""
    oldest = f"{re.search(r'>=([0-9.]+)', PROJECT['requires-python'])[1]}.0"
    for name in sorted(required("flowslide", installed_extras()) & PINS.keys()):
        asked = metadata.metadata(name).get("Requires-Python", "")
        assert SpecifierSet(asked).contains(oldest), f"{name} needs Python {asked}"


def test_make_installs_every_extra_and_all_is_all_of_users():
    (everything,) = EXTRAS["all"]
    assert everything.name == "flowslide"
    assert everything.extras == EXTRAS.keys() - {"all", *OF_DEVELOPERS}
    assert set(installed_extras()) == {"all", *OF_DEVELOPERS} - set(BY_HAND)


@pytest.mark.parametrize("stamp", ["READY", "LSFD_READY"])
def test_make_counts_the_packages_it_installs(stamp):
    names = installed_extras() if stamp == "READY" else tuple(setting("LSFD_EXTRAS").split(","))
    said = int(setting(f"$({stamp}): PACKAGES"))
    # torch brings NVIDIA's libraries, or none.
    needed = [name for name in required("flowslide", names) if name in PINS]
    assert said == pytest.approx(len(needed), rel=0.05)


def test_extras_that_are_installed_by_hand_are_pinned():
    for need in (need for name in BY_HAND for need in EXTRAS[name]):
        assert need.specifier.contains(PINS[canonicalize_name(need.name)])
    for need in EXTRAS["foreign"]:  # private parts of it are used
        assert str(need.specifier) == f"=={PINS[canonicalize_name(need.name)]}"


@pytest.mark.parametrize("extra", MODULES)
def test_modules_of_an_extra_are_those_of_its_distributions(extra):
    distributions = metadata.packages_distributions()
    found = {name for module in MODULES[extra] for name in distributions.get(module, ())}
    if not found:
        pytest.skip(f"the extra {extra} is not installed")
    assert {canonicalize_name(name) for name in found} == {
        canonicalize_name(need.name) for need in EXTRAS[extra]
    }


def test_every_extra_of_a_command_is_known():
    assert MODULES.keys() == EXTRAS.keys() - {"all", "workflow", *OF_DEVELOPERS}
    of_commands = {command.extra for _, command in leaves()} - {""}
    of_engines = {engine.extra for engine in engines().values()} - {""}
    assert of_commands | of_engines <= MODULES.keys()


def test_one_version_and_one_date_everywhere():
    """The newest of the changelog is that of the packages and of a citation."""
    changelog = (ROOT / "CHANGELOG.md").read_text()
    version, day = re.search(r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", changelog, re.MULTILINE).groups()
    assert version == pipeline.__version__
    cited = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {version}\ndate-released: {day}\n" in cited


def test_an_entry_of_the_changelog_has_at_most_two_lines():
    lines = (ROOT / "CHANGELOG.md").read_text().splitlines()
    for number, line in enumerate(lines, start=1):
        assert len(line) <= 120, number
    text = "\n".join(line for line in lines if line and not line.startswith("#"))
    entries = re.findall(r"^- .*(?:\n  .*)*", text, re.MULTILINE)
    assert len(entries) > 30 and all(entry.count("\n") < 2 for entry in entries)


def test_no_text_is_left_of_a_merge():
    folders = (".", "docs", "config", "rules", "benchmarks", ".github")
    texts = [
        path
        for folder in folders
        for path in (ROOT / folder).glob("*" if folder == "." else "**/*")
        if path.is_file() and path.suffix in (".md", ".yaml", ".toml", ".smk", "")
    ]
    assert len(texts) > 60
    for path in texts:
        text = path.read_text("utf-8")
        assert not re.search(r"^(<{7}|>{7}) ", text, re.MULTILINE), path


def recipe(target):
    """The commands of a target of the Makefile."""
    makefile = (ROOT / "Makefile").read_text()
    (found,) = re.findall(rf"^{target}:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    return found.splitlines()


def test_make_test_is_the_fast_tests_and_test_all_the_rest():
    options = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert "-m 'not slow'" in options["addopts"]
    (fast,), (rest,) = recipe("test"), recipe("test-all")
    assert "$(PYTEST)" in fast and "$(PYTEST)" in rest and " -m " not in fast
    assert "CPU_BUDGET_S=3" in fast
    # What the fast tests leave out, and the property tests with more examples.
    assert "HYPOTHESIS_PROFILE=large" in rest and rest.endswith('-m "$(SELECT)"')
    assert "\ntest-all: SELECT ?= slow or property\n" in (ROOT / "Makefile").read_text()


def test_continuous_integration_runs_every_test_before_the_rest():
    script = (ROOT / ".ci" / "run").read_text()
    commands = re.findall(r"^make (.*)$", script, re.MULTILINE)
    assert commands[:3] == ["test", "test-numerics", 'test-all SELECT="$select"']
    # All of them but on a slow machine.
    assert re.findall(r"^.*select=.*$", script, re.MULTILINE) == [
        'select="slow or property"',
        '[ "$SECONDS" -lt 900 ] || select="($select) and not long"',
    ]


def test_a_fork_runs_the_same_on_every_python_that_is_promised():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yaml").read_text())
    (job,) = workflow["jobs"].values()
    assert ".ci/run" in [step.get("run") for step in job["steps"]]
    promised = SpecifierSet(PROJECT["requires-python"])
    minors = [f"3.{minor}" for minor in range(8, 30) if promised.contains(f"3.{minor}.0")]
    assert job["strategy"]["matrix"]["python"] == minors


def test_commits_are_checked_by_the_linters_that_are_pinned():
    settings = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    (own,) = settings["repos"]
    used = [Requirement(text) for hook in own["hooks"] for text in hook["additional_dependencies"]]
    assert {need.name for need in used} == {"ruff", "snakefmt"}
    for need in used:
        assert str(need.specifier) == f"=={PINS[need.name]}"


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


def test_make_does_not_take_an_environment_for_one_of_another_python(tmp_path):
    for place, version in (("venv/bin/python", "3.11.7"), ("python3.12", "3.12.1")):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(f"#!/bin/sh\necho Python {version}\n")
        (tmp_path / place).chmod(0o755)
    stamp = tmp_path / "venv" / ".flowslide-installed"
    stamp.touch()
    words = ["make", "install", f"VENV={tmp_path / 'venv'}"]
    other = f"PYTHON={tmp_path / 'python3.12'}"
    done = subprocess.run([*words, other], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "venv has Python 3.11.7; remove it, or give" in done.stdout
    same = f"PYTHON={tmp_path / 'venv' / 'bin' / 'python'}"
    assert subprocess.run([*words, same], cwd=ROOT, capture_output=True).returncode == 0
