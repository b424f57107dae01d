"""The wheel works in an environment of its own, far from the clone, in an empty folder."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
FILES = ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE")
DATA = ("case_histories", "config", "models")


@pytest.fixture(scope="module")
def program(root, tmp_path_factory) -> Path:
    """The folder `bin` of an environment into which the wheel alone was installed."""
    source, place = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("elsewhere")
    settings = tomllib.loads((root / "pyproject.toml").read_text())
    patterns = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    ignore = shutil.ignore_patterns("__pycache__")
    for name in (*(pattern.rstrip("*") for pattern in patterns), *DATA):
        shutil.copytree(root / name, source / name, ignore=ignore)
    for name in FILES:
        shutil.copy(root / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    offline = ["--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*pip, "wheel", *offline, "-w", str(place), str(source)], check=True)
    (wheel,) = place.glob("flowslide-*.whl")
    shutil.rmtree(source)

    environment = place / "environment"
    venv.create(environment, with_pip=False)
    packages = Path(
        sysconfig.get_path("purelib", "venv", {"base": environment, "platbase": environment})
    )
    # What flowslide requires is taken from here; flowslide itself is not, since a path file within
    # a path that a path file adds is not read.
    (packages / "requirements.pth").write_text(sysconfig.get_path("purelib") + "\n")
    python = environment / "bin" / "python"
    install = ["--python", str(python), "install", "--no-deps", "--no-index", "--force-reinstall"]
    subprocess.run([*pip, *install, str(wheel)], check=True)
    return environment / "bin"


@pytest.fixture
def run(program, tmp_path, monkeypatch):
    """Run a program of that environment in an empty folder; its standard output."""
    monkeypatch.delenv("PYTHONPATH", raising=False)

    def call(name: str, *arguments: str) -> str:
        done = subprocess.run(
            [program / name, *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return call


def test_packages_and_data_are_those_of_the_wheel(run, program):
    script = (
        "import flowslide, inversion, pipeline; from pipeline.places import shipped; "
        "print(flowslide.__file__, inversion.__file__, pipeline.__file__, "
        "*(shipped(name) for name in ('case_histories', 'config', 'models')))"
    )
    for place in run("python", "-c", script).split():
        assert Path(place).is_relative_to(program.parent) and Path(place).exists(), place


def test_the_command_is_there(run):
    assert "\n  invert " in run("flowslide", "--help")
    assert "lower_san_fernando" in run("flowslide", "check", "lower_san_fernando")
    assert "Wachusett" in run("flowslide", "catalogue")
    assert '"$schema"' in run("flowslide", "schema", "result")


def test_a_small_back_analysis(run, tmp_path):
    said = run(
        "flowslide", "invert", "lower_san_fernando_paper", "--spacing", "4", "--quick",
        "--threads", "1", "--report", "page",
    )  # fmt: skip
    assert said.startswith("Lower San Fernando Paper: back-analysis")
    folder = tmp_path / "results/lower_san_fernando_paper/inversion"
    (strength, *_) = json.loads((folder / "result.json").read_text())["answer"]["parameters"]
    assert strength["name"] == "residual_strength_1" and 30.0 < strength["value"] < 75.0
    assert (folder / "report.html").is_file()


def test_the_shipped_model_is_found(run):
    script = (
        "import flowslide; from inversion.back_analysis.by_engine import chosen_engine; "
        "from inversion.back_analysis.case import inversion_case; "
        "case = inversion_case(flowslide.load_case('lower_san_fernando')); "
        "print(chosen_engine(case, 'gns', 'coarse').model / 'model.pt')"
    )
    assert Path(run("python", "-c", script).strip()).is_file()
