"""What suites of measurements share: running their parts, and the generated parts of their pages.

In: modules with a `TITLE` and a `run(folder, quick=...)`, whose docstrings explain what they
measure. Out: their rows, and Markdown between `<!-- NAME: begin -->` and `<!-- NAME: end -->`.
"""

from __future__ import annotations

import ast
import importlib
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from pipeline.cli import InputError


@dataclass(frozen=True)
class Measured:
    """What a part of a suite returned; `error` is empty if it ran to its end."""

    title: str
    rows: list
    seconds: float
    error: str


def run_part(package: str, name: str, folder: Path | None, *, quick: bool) -> Measured:
    """Run one part of a suite. An error ends that part alone and is kept.

    Args:
        package: of the suite, such as `benchmarks.verification`.
        name: module of the part.
        folder: for its pictures; None: no pictures.
        quick: a small version.
    """
    print(f"{name} ...", flush=True)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    began, rows, error, title = time.perf_counter(), [], "", name
    try:
        module = importlib.import_module(f"{package}.{name}")
        title = module.TITLE
        rows = list(module.run(folder, quick=quick))
    except Exception as problem:
        traceback.print_exc()
        error = " ".join(f"{type(problem).__name__}: {problem}".split())
    seconds = time.perf_counter() - began
    print(f"{name}: {seconds:.1f} s", flush=True)
    return Measured(title, rows, seconds, error)


def explanation(program: Path) -> str:
    """The docstring of a part."""
    return ast.get_docstring(ast.parse(program.read_text(encoding="utf-8"))) or ""


def between(text: str, part: str, new: str, *, page: str | Path = "the page") -> str:
    """`text` with everything between the markers of a part replaced by `new`.

    Raises:
        InputError: `page` has no such markers.
    """
    begin, end = (f"<!-- {part}: {word} -->" for word in ("begin", "end"))
    before, found, rest = text.partition(begin)
    _, also_found, after = rest.partition(end)
    if not (found and also_found):
        raise InputError(f"{page}: the lines {begin} and {end} are missing")
    return f"{before}{begin}\n{new}{end}{after}"


def wide_console() -> Console:
    """A console for tables, wide where the output is a file."""
    console = Console()
    return console if console.is_terminal else Console(width=150)
