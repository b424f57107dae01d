"""The command table: every command has help, none of it loads anything heavy."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from flowslide.command_line import (
    COMMANDS,
    Group,
    build_parser,
    leaves,
    main,
)
from flowslide.commands import options
from flowslide.commands.schema import DOCUMENTS
from pipeline.cli import InputError

LEAVES = dict(leaves())
HEAVY = ("numpy", "scipy", "taichi", "torch", "matplotlib", "pydantic", "shapely", "h5py")


@pytest.mark.parametrize("words", LEAVES)
def test_every_command_has_its_help(words, capsys):
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--help"])
    said = capsys.readouterr().out
    assert end.value.code == 0
    assert said.startswith(f"usage: flowslide {words} ")
    module = import_module(f"flowslide.commands.{LEAVES[words].module}")
    assert " ".join(module.DESCRIPTION.split())[:40] in " ".join(said.split())
    assert LEAVES[words].help[0].islower() or LEAVES[words].help.startswith("S_r")


def test_every_option_and_argument_is_explained():
    for words, command in LEAVES.items():
        parser = argparse.ArgumentParser()
        import_module(f"flowslide.commands.{command.module}").add_arguments(parser)
        for action in parser._actions:
            assert action.help or action.choices, f"{words}: {action.dest}"


def test_help_lists_every_command(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    said = capsys.readouterr().out
    for part in COMMANDS.values():
        for name, one in part.items():
            assert f"\n  {name} " in said
            if isinstance(one, Group):
                assert f"({', '.join(one.commands)})" in said


def test_no_help_loads_anything_heavy():
    script = f"""
import sys
from flowslide.command_line import leaves, main
for words in ["", *[words for words, _ in leaves()]]:
    try:
        main([*words.split(), "--help"])
    except SystemExit:
        pass
    loaded = [name for name in {HEAVY!r} if name in sys.modules]
    assert not loaded, (words, loaded)
"""
    subprocess.run([sys.executable, "-c", script], check=True, stdout=subprocess.DEVNULL)


def test_every_module_of_commands_is_in_the_table():
    folder = Path(options.__file__).parent
    shared = {"options", "diagnosis.session_options"}
    found = {
        ".".join(path.relative_to(folder).with_suffix("").parts)
        for path in folder.rglob("*.py")
        if path.name != "__init__.py"
    }
    assert found - shared == {command.module for command in LEAVES.values()}


def test_choices_are_those_of_the_library():
    from flowslide.commands import classical, predict, simulate
    from flowslide.commands.gns import evaluate
    from flowslide.commands.runs import show
    from geometry.scenes.drawings import UNITS
    from gns.data.shard import SPLITS
    from inversion.classical.judgement import Judgement
    from inversion.prediction.known_strength import KINDS, OPTIONS
    from mpm_taichi.comparison import FILMS
    from report.pictures.colouring import COLOURS

    assert simulate.FILMS == FILMS
    assert show.COLOURS == COLOURS
    assert evaluate.SPLITS == SPLITS[1:]
    assert (predict.OPTION, predict.RATIO_OPTION) == tuple(OPTIONS.values())
    assert predict.KINDS == KINDS
    assert {name for _, name, _ in classical.CALLS} <= set(Judgement.model_fields)
    parser = argparse.ArgumentParser()
    options.add_drawing(parser)
    (unit,) = [action for action in parser._actions if action.dest == "unit"]
    assert unit.choices == tuple(UNITS)


def test_a_bare_diagnose_runs_the_loop(monkeypatch):
    asked = []
    monkeypatch.setattr("flowslide.commands.diagnosis.diagnose.run", asked.append)
    monkeypatch.setattr("flowslide.commands.diagnosis.compare.run", asked.append)
    main(["diagnose", "--threads", "2", "dam"])
    main(["diagnose", "run", "dam"])
    main(["diagnose", "compare", "dam"])
    assert [(one.case, one.threads) for one in asked] == [
        ("dam", 2), ("dam", None), ("dam", None)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["invert", "dam", "--threads", "0"], "--threads 0: at least 1"),
        (["predict", "dam", "--residual-strength", "9+-1", "--spacing", "0"], "--spacing 0: must"),
        (["import", "x.csv", "--out", "x.yaml", "--snap", "-1"], "--snap -1: must be at least 0"),
    ],
)
def test_shared_numbers_are_checked_in_one_place(line, message):
    with pytest.raises(InputError, match=message):
        main(line)


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_commands_and_options(shell, capsys):
    assert main(["completion", shell]) == 0
    said = capsys.readouterr().out
    for word in ("invert", "residual-strength", "baselines", "set-of-measurements"):
        assert word in said


def test_bash_completes(tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "flowslide.bash"
    script.write_text(capsys.readouterr().out)
    asked = (
        f"source {script}; COMP_WORDS=(flowslide diagnose e); COMP_CWORD=2; "
        "_shtab_flowslide flowslide e diagnose; echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["explain", "extend"]


def test_schemas_are_schemas(tmp_path, capsys, monkeypatch):
    import jsonschema

    monkeypatch.chdir(tmp_path)
    for document, (file, _) in DOCUMENTS.items():
        assert main(["schema", document]) == 0
        told = capsys.readouterr().out
        jsonschema.Draft202012Validator.check_schema(json.loads(told))
        assert main(["schema", document, "--write"]) == 0
        assert (tmp_path / file).read_text() == told
        capsys.readouterr()


def test_version(capsys):
    import pipeline

    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"flowslide {pipeline.__version__}\n"


def test_an_abbreviated_option_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        build_parser().parse_args(["invert", "dam", "--thr", "2"])
    assert end.value.code == 2
    assert "--thr" in capsys.readouterr().err
