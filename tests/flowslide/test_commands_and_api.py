"""Commands ask through `flowslide.api` alone, and its options are options of each function."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import flowslide
from flowslide import api
from flowslide.run import Call, SectionOptions

COMMANDS = Path(__file__).resolve().parents[2] / "flowslide" / "commands"
#: Of what works on a question: names, and the documents that an answer leaves.
NAMES = {
    "inversion.engines.registry", "inversion.back_analysis.result", "inversion.posterior.document",
    "inversion.classical.document", "diagnosis.session", "diagnosis.verdict.verdict",
    "diagnosis.verdict.verdict_builder", "diagnosis.verdict.fitted_models",
    "diagnosis.hypotheses.hypothesis_file",
}  # fmt: skip
#: Commands that ask no question about a case: `new` writes one, `catalogue` prints a table.
OTHERS = {"new.py", "catalogue.py"}


def asked(path: Path) -> list[str]:
    """Modules of `inversion` and `diagnosis` that a command imports."""
    found = [node.module or "" for node in ast.walk(ast.parse(path.read_text()))
             if isinstance(node, ast.ImportFrom)]  # fmt: skip
    return [name for name in found if name.partition(".")[0] in ("inversion", "diagnosis")]


@pytest.mark.parametrize("path", sorted(COMMANDS.rglob("*.py")), ids=lambda path: path.stem)
def test_a_command_asks_through_the_interface(path):
    if path.name not in OTHERS:
        assert set(asked(path)) <= NAMES


def test_names_are_listed_once():
    assert flowslide.__all__ is api.__all__ and set(dir(flowslide)) == set(api.__all__)
    for name in api.__all__:
        assert getattr(flowslide, name) is getattr(api, name)
    with pytest.raises(AttributeError, match="back_analyze"):
        _ = flowslide.back_analyze


def test_an_option_is_one_of_its_function_or_refused():
    assert set(SectionOptions.__annotations__) < set(Call.__annotations__)
    lacking = {
        "diagnose": "device",
        "simulate_3d": "device",
        "classical": "threads",
        "simulate": "x",
    }
    for name, option in lacking.items():
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{option}'"):
            getattr(flowslide, name)("lower_san_fernando", **{option: 1})
