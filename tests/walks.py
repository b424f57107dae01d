"""How many files a reader opens to follow a quantity through the product: `python -m tests.walks`.

A walk is written down in `walks.txt` as the tree of calls that the quantity takes: a line is a file
and a function (or a class) of it, a deeper line is called by the one above it. A function belongs
to it where the quantity is handed to it, changed by it or handed back by it; what only checks,
reports progress or names files does not. Counted are

- files: each once, however often the walk comes back to it;
- stays: lines in a row in one file are one stay;
- crossings: two lines in a row in different packages are one, so a call into another package and
  the way back are two.

The tree is checked against the code: every function exists, and the one above it names it. Where it
is called under another name (a field of a material law, a method of a protocol, a hook), that name
follows in brackets. So a layer that is put between two lines has to be added here, and counts.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Step:
    """One line of a walk."""

    depth: int
    file: str
    function: str
    called: str  # the name under which the line above calls it

    @property
    def package(self) -> str:
        """The package of its file."""
        return self.file.partition("/")[0]


def walks() -> dict[str, list[Step]]:
    """What is followed -> the lines of its walk, in their order."""
    found: dict[str, list[Step]] = {}
    for line in (ROOT / "tests" / "walks.txt").read_text().splitlines():
        if line.startswith("#"):
            found[line.removeprefix("# ").partition(",")[0]] = own = []
        elif line:
            file, function, *called = line.split()
            name = called[0].strip("()") if called else function.rpartition(".")[2]
            own.append(Step((len(line) - len(line.lstrip())) // 2, file, function, name))
    return found


@dataclass(frozen=True)
class Length:
    """How long a walk is; see the top of the file."""

    files: int
    stays: int
    crossings: int


def length(steps: list[Step]) -> Length:
    """Count a walk."""
    stays = [file for file, _ in groupby(step.file for step in steps)]
    crossings = sum(one.package != other.package for one, other in pairwise(steps))
    return Length(len(set(stays)), len(stays), crossings)


@cache
def _definitions(file: str) -> dict[str, ast.AST]:
    """Qualified name -> definition of what a file defines at its top level or in its classes."""
    found: dict[str, ast.AST] = {}

    def add(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found[f"{prefix}{node.name}"] = node
                if isinstance(node, ast.ClassDef):
                    add(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.Assign):
                names = [to.id for to in node.targets if isinstance(to, ast.Name)]
                found.update({f"{prefix}{name}": node for name in names})

    add(ast.parse((ROOT / file).read_text()).body, "")
    return found


def _names(node: ast.AST) -> set[str]:
    """All that a definition names: variables, attributes, hooks and functions by a text."""
    found = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            found.add(part.id)
        elif isinstance(part, ast.Attribute):
            found.add(part.attr)
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            found.add(part.value)
    return found


def faults(steps: list[Step]) -> Iterator[str]:
    """Lines of a walk that the code does not bear out."""
    above: list[Step] = []
    for step in steps:
        del above[step.depth :]
        if not (ROOT / step.file).is_file():
            yield f"{step.file}: no such file"
        elif step.function not in _definitions(step.file):
            yield f"{step.file}: has no {step.function}"
        elif len(above) != step.depth:
            yield f"{step.file} {step.function}: is two levels below the line above it"
        elif above and step.called not in _names(_definitions(above[-1].file)[above[-1].function]):
            yield f"{above[-1].file}: {above[-1].function} does not name {step.called}"
        above.append(step)


if __name__ == "__main__":
    for title, steps in walks().items():
        print(title, length(steps), *faults(steps), sep="\n  ")
