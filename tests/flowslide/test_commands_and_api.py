"""Commands ask through `flowslide.api` alone, and its options are options of each function."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import flowslide
from flowslide import api
from flowslide.run import Call, SectionOptions

COMMANDS = Path(__file__).resolve().parents[2] / "flowslide" / "commands"
#: Of what works on a question: names of engines, which are options and folders; and the document
#: that a back-analysis leaves, which `report` holds against a case.
NAMES = {
    "inversion.engines.registry.MPM",
    "inversion.engines.registry.engine_named",
    "inversion.engines.registry.engines",
    "inversion.back_analysis.result.load_result",
}
#: Commands that ask no question about a case: `new` writes one, `catalogue` prints a table.
OTHERS = {"new.py", "catalogue.py"}


def asked(text: str) -> set[str]:
    """What a command imports of `inversion` and `diagnosis`, unless for types alone."""
    tree, found = ast.parse(text), set()
    tree.body = [node for node in tree.body if not _for_types(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.partition(".")[0] in ("inversion", "diagnosis")}


def _for_types(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


@pytest.mark.parametrize("path", sorted(COMMANDS.rglob("*.py")), ids=lambda path: path.stem)
def test_a_command_asks_through_the_interface(path):
    if path.name not in OTHERS:
        assert asked(path.read_text()) <= NAMES


def test_every_exception_is_one():
    used = {name for path in COMMANDS.rglob("*.py") for name in asked(path.read_text())}
    assert used >= NAMES


def test_what_is_asked():
    assert asked("import inversion.joint as j\nfrom report import joint") == {"inversion.joint"}
    assert asked("def run():\n    from diagnosis.case import a, b") == {
        "diagnosis.case.a",
        "diagnosis.case.b",
    }
    assert not asked("if TYPE_CHECKING:\n    from diagnosis.session import Session")


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
