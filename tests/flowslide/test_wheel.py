"""The distributions: what they hold, and the wheel at work in environments of its own.

Far from the clone, in an empty folder: once with all that is installed here, once with nothing but
what flowslide requires.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
from email import message_from_string
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

import pytest

import pipeline

pytestmark = pytest.mark.slow
FILES = (
    "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "CHANGELOG.md",
    "CITATION.cff",
)  # fmt: skip
DATA = ("case_histories", "config", "models")
CASE = "lower_san_fernando_paper"
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]


@pytest.fixture(scope="module")
def packages(root) -> list[str]:
    """Names of the packages that are distributed."""
    settings = tomllib.loads((root / "pyproject.toml").read_text())
    patterns = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    return [pattern.rstrip("*") for pattern in patterns]


@pytest.fixture(scope="module")
def source(root, packages, tmp_path_factory) -> Path:
    """What a clone holds, with files beside it that no distribution may have."""
    folder = tmp_path_factory.mktemp("source")
    ignore = shutil.ignore_patterns("__pycache__")
    for name in (*packages, *DATA):
        shutil.copytree(root / name, folder / name, ignore=ignore)
    for name in FILES:
        shutil.copy(root / name, folder)
    for stray in ("tests/test_x.py", "benchmarks/x.py", "docs/x.md", "models/direct/.notes"):
        (folder / stray).parent.mkdir(exist_ok=True)
        (folder / stray).write_text("x = 1\n")
    return folder


@pytest.fixture(scope="module")
def wheel(source, tmp_path_factory) -> Path:
    """The wheel, made of the clone itself."""
    place, copy = tmp_path_factory.mktemp("wheel"), tmp_path_factory.mktemp("copy") / "source"
    shutil.copytree(source, copy)
    offline = ["--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*PIP, "wheel", *offline, "-w", str(place), str(copy)], check=True)
    (made,) = place.glob("flowslide-*.whl")
    return made


@pytest.fixture(scope="module")
def program(wheel, tmp_path_factory) -> Path:
    """The folder `bin` of an environment with the wheel; all else is taken from here."""
    environment = tmp_path_factory.mktemp("elsewhere") / "environment"
    venv.create(environment, with_pip=False)
    purelib = Path(
        sysconfig.get_path("purelib", "venv", {"base": environment, "platbase": environment})
    )
    # flowslide itself is not taken from here, since a path file within a path that a path file
    # adds is not read.
    (purelib / "requirements.pth").write_text(sysconfig.get_path("purelib") + "\n")
    _install(environment, "--no-deps", "--no-index", "--force-reinstall", wheel)
    return environment / "bin"


@pytest.fixture(scope="module")
def package_index(tmp_path_factory) -> None:
    """Skip where packages cannot be downloaded; `.ci/run` does not."""
    place = str(tmp_path_factory.mktemp("tried"))
    small = f"shtab=={metadata.version('shtab')}"
    download = [*PIP, "download", "--no-deps", "--no-cache-dir", "-d", place, small]
    tried = subprocess.run(download, capture_output=True, text=True)
    if tried.returncode and not os.environ.get("CI"):
        pytest.skip(f"no package index can be reached: {tried.stderr.strip().splitlines()[-1]}")


@pytest.fixture(scope="module")
def distributed(root, source, package_index, tmp_path_factory) -> Path:
    """Folder of the source distribution and of the wheel made of it, which twine has checked."""
    environment = tmp_path_factory.mktemp("release") / "environment"
    venv.create(environment, with_pip=False)
    _install(environment, "-c", root / "constraints.txt", "build", "setuptools", "twine")
    folder = tmp_path_factory.mktemp("dist")
    build = ["-m", "build", "--no-isolation", "--outdir", folder, source]
    subprocess.run([environment / "bin" / "python", *build], check=True)
    twine = [environment / "bin" / "python", "-m", "twine", "check", "--strict"]
    subprocess.run([*twine, *folder.iterdir()], check=True)
    return folder


@pytest.fixture(scope="module")
def bare(root, wheel, package_index, tmp_path_factory) -> Path:
    """The folder `bin` of an environment with the wheel and what it requires, no extra."""
    environment = tmp_path_factory.mktemp("bare") / "environment"
    venv.create(environment, with_pip=False)
    _install(environment, "-c", root / "constraints.txt", wheel)
    return environment / "bin"


def _install(environment: Path, *arguments: object) -> None:
    python = str(environment / "bin" / "python")
    words = [*PIP, "--python", python, "install", "--no-compile", *map(str, arguments)]
    subprocess.run(words, check=True)


def tried(place: Path, name: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess:
    """Run a program of an environment in a folder."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        [place / name, *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )


@pytest.fixture
def run(program, tmp_path):
    """Run a program of the environment with everything; its standard output."""

    def call(name: str, *arguments: str) -> str:
        done = tried(program, name, *arguments, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return call


def contents(wheel: Path) -> dict[str, int]:
    """Checksums of its files by name."""
    with ZipFile(wheel) as opened:
        return {info.filename: info.CRC for info in opened.infolist()}


def test_wheel_holds_the_packages_their_data_and_the_licence(wheel, packages, source):
    held = contents(wheel).keys()
    facts = f"flowslide-{pipeline.__version__}.dist-info"
    assert {name.partition("/")[0] for name in held} == {*packages, "flowslide_data", facts}
    assert f"{facts}/licenses/LICENSE" in held
    assert {
        "flowslide/studio/page/index.html",
        "diagnosis/names.yaml",
        "diagnosis/track_record.yaml",
    } <= held
    for name in (*packages, *DATA):
        start = f"flowslide_data/{name}/" if name in DATA else f"{name}/"
        files = {path.relative_to(source / name).as_posix()
                 for path in (source / name).rglob("*")
                 if path.is_file() and path.name != ".notes"}  # fmt: skip
        assert {one.removeprefix(start) for one in held if one.startswith(start)} == files


def test_metadata_of_the_wheel(wheel):
    with ZipFile(wheel) as opened:
        (name,) = (one for one in opened.namelist() if one.endswith("/METADATA"))
        facts = message_from_string(opened.read(name).decode())
    assert facts["Version"] == pipeline.__version__ and facts["License-Expression"] == "MIT"
    text = facts.get_payload()
    assert text.startswith("# flowslide\n") and "flowslide invert my_dam" in text
    # An index page has no file beside it.
    assert re.findall(r"\]\((?!https?://)", text) == []


def test_wheel_made_of_the_source_distribution_is_the_same(distributed, wheel):
    assert len(list(distributed.iterdir())) == 2
    assert contents(distributed / wheel.name) == contents(wheel)


def test_source_distribution_holds_what_builds_the_wheel(distributed, packages):
    (path,) = distributed.glob("flowslide-*.tar.gz")
    with tarfile.open(path) as opened:
        held = [Path(*Path(one.name).parts[1:]) for one in opened.getmembers() if one.isfile()]
    made = {"PKG-INFO", "setup.cfg", "flowslide.egg-info"}
    assert {one.parts[0] for one in held} == {*packages, *DATA, *FILES, *made}
    assert not [one for one in held if one.name == ".notes"]


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


def test_the_shipped_model_is_found(run):
    script = (
        "import flowslide; from inversion.back_analysis.by_engine import chosen_engine; "
        "from inversion.back_analysis.case import inversion_case; "
        "case = inversion_case(flowslide.load_case('lower_san_fernando')); "
        "print(chosen_engine(case, 'gns', 'thrust').model / 'model.pt')"
    )
    assert Path(run("python", "-c", script).strip()).is_file()


def test_requirements_alone_are_enough_for_a_back_analysis(bare, tmp_path):
    def run(*words: str) -> str:
        done = tried(bare, "flowslide", *words, "--threads", "2", folder=tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    said = run("invert", CASE, "--spacing", "4", "--quick", "--report", "page")
    assert "\nLower San Fernando Paper: back-analysis" in f"\n{said}"
    folder = tmp_path / "results" / CASE / "inversion"
    (strength, *_) = json.loads((folder / "result.json").read_text())["answer"]["parameters"]
    assert strength["name"] == "residual_strength_1" and 30.0 < strength["value"] < 75.0
    assert (folder / "report.html").is_file()
    run("simulate", CASE, "--spacing", "4")
    assert (tmp_path / "results" / CASE / "simulation" / "runout.gif").is_file()
    said = run("predict", CASE, "--spacing", "4", "--residual-strength", "40+-4", "--seeds", "0")
    assert "toe" in said


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["posterior", CASE], "flowslide posterior needs dynesty and h5netcdf and xarray"),
        (["studio"], "flowslide studio needs ruamel and starlette and uvicorn and websockets"),
        (["gns", "train"], "flowslide gns train needs torch"),
        (["invert", CASE, "--engine", "direct"], "the engine direct needs torch"),
    ],
)
def test_requirements_alone_say_what_to_install(bare, tmp_path, words, line):
    done = tried(bare, "flowslide", *words, folder=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"error: {line}: pip install 'flowslide[")
    assert done.stderr.count("\n") == 1 and not list(tmp_path.iterdir())
