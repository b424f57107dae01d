"""Extras of the installation: one line says what to install, before any work; all else goes on."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec

import pytest

import flowslide
from flowslide.command_line import leaves, main
from geometry.terrain.raster import read_raster
from inversion.engines.registry import engines
from pipeline import extras
from pipeline.cli import InputError
from pipeline.extras import MODULES, has, require

CASE = "lower_san_fernando_paper"
#: Command lines that need an extra, and the extra.
NEEDY = {
    "dxf": ["import dam.dxf --out scene.yaml", "new dam --section dam.dxf"],
    "learned": [
        "gns train --scale coarse",
        "gns evaluate --scale coarse",
        "gns rollout scene.yaml --model thrust --out out",
        "gns direct-train",
        f"invert {CASE} --engine gns --model thrust",
        f"invert {CASE} --engine direct",
        f"invert {CASE} --set inversion.engine=direct",
        f"posterior {CASE} --engine direct",
        f"predict {CASE} --residual-strength 20+-2 --engine direct",
        f"predict {CASE} --from-blow-counts --engine direct",
        f"diagnose {CASE} --engine direct",
        f"diagnose compare {CASE} --engine direct",
    ],
    "posterior": [
        f"posterior {CASE}",
        f"predict {CASE} --posterior results",
        f"joint {CASE} la_marquesa",
    ],
    "studio": ["studio", f"studio {CASE}"],
    "video": [f"simulate {CASE} --film mp4"],
}


@pytest.fixture
def without(monkeypatch):
    """Take the modules of an extra away."""

    def take(extra: str) -> None:
        names = MODULES[extra]
        monkeypatch.setattr(
            extras, "find_spec", lambda name: None if name in names else find_spec(name)
        )

    return take


@pytest.mark.parametrize(
    ("extra", "typed"), [(extra, typed) for extra, lines in NEEDY.items() for typed in lines]
)
def test_a_command_says_what_to_install_before_any_work(
    extra, typed, without, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dam.dxf").write_text("0\nEOF\n")
    without(extra)
    with pytest.raises(InputError) as said:
        main(typed.split())
    modules = " and ".join(MODULES[extra])
    assert str(said.value).endswith(f" needs {modules}: pip install 'flowslide[{extra}]'")
    assert [path.name for path in tmp_path.iterdir()] == ["dam.dxf"]


def test_the_line_names_the_command_as_it_was_typed(without):
    without("posterior")
    line = "dynesty and h5netcdf and xarray: pip install 'flowslide[posterior]'"
    with pytest.raises(InputError) as said:
        main(["posterior", CASE])
    assert str(said.value) == f"flowslide posterior needs {line}"
    with pytest.raises(InputError, match="^a posterior needs "):
        flowslide.posterior(CASE)


def test_a_raster_says_what_to_install(without, tmp_path):
    path = tmp_path / "ground.tif"
    path.write_bytes(b"")
    without("terrain")
    with pytest.raises(InputError) as said:
        read_raster(path)
    assert str(said.value) == "a raster needs pyproj and rasterio: pip install 'flowslide[terrain]'"


def test_what_is_missing_alone_is_named(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "xarray" else name)
    assert not has("posterior")
    with pytest.raises(InputError, match="^it needs xarray: pip install 'flowslide.posterior.'$"):
        require("posterior", "it")


def test_every_command_and_engine_with_an_extra_is_tried():
    for words, command in leaves():
        if command.extra:
            assert any(typed.startswith(words) for typed in NEEDY[command.extra]), words
    for name, engine in engines().items():
        if engine.extra:
            assert any(f"engine {name}" in typed or f"engine={name}" in typed
                       for typed in NEEDY[engine.extra]), name  # fmt: skip


SCRIPT = """
import sys
from importlib.machinery import PathFinder

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in sys.argv[1].split(",") else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Without
from flowslide.command_line import leaves, main
def said(*words):
    try:
        assert main(words) == 0, words
    except SystemExit as end:
        assert end.code == 0, words
"""
LOOKED_UP = """
for words, _ in leaves():
    said(*words.split(), "--help")
said("--help")
said("check", "lower_san_fernando", "upper_san_fernando")
said("catalogue")
said("effects")
said("settings", "check")
said("completion", "bash")
"""
SCHEMAS = """
for document in ("settings", "result", "posterior", "card", "verdict"):
    said("schema", document)
"""


@pytest.mark.parametrize("words", [LOOKED_UP, SCHEMAS], ids=["looked up", "schemas"])
def test_what_looks_up_needs_no_extra(words, tmp_path):
    missing = ",".join(name for names in MODULES.values() for name in names)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT + words, missing],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
