"""Which files the figures of a program depend on, found by following its imports."""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

from benchmarks.generated_pages import ROOT

PACKAGES = ("inversion", "mpm_taichi", "geometry", "benchmarks")
"""Packages whose modules can change a figure; the rest reads settings and writes files."""

PRESENTATION = ROOT / "benchmarks" / "generated_pages.py"
"""Writes records and pages; changes no figure."""

EFFECTS = ROOT / "mpm_taichi" / "effects"
"""Its modules are imported by name while a scene is prepared, which no reading of imports sees."""


def sources_hash(program: Path) -> str:
    """Hash of the source text that a program's figures depend on; shows an out-of-date record."""
    digest = hashlib.sha256()
    for path in sources(program):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def sources(program: Path) -> list[Path]:
    """The files of `PACKAGES` that a program imports, directly or not, itself included; sorted.

    Imports inside functions and of names from packages are followed as well.
    """
    found: set[Path] = set()
    waiting = [program, *EFFECTS.glob("*.py")]
    while waiting:
        path = waiting.pop()
        if path not in found and path.is_file() and path != PRESENTATION:
            found.add(path)
            waiting += imported_files(path)
    return sorted(found)


@cache
def imported_files(path: Path) -> list[Path]:
    """Files of `PACKAGES` that a file imports by name; read once, though many programs share it."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    stems = [ROOT.joinpath(*name.split(".")) for name in names if name.split(".")[0] in PACKAGES]
    files = [file for stem in stems for file in (stem.with_suffix(".py"), stem / "__init__.py")]
    return [file for file in files if file.is_file()]
