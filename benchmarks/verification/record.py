"""What has been verified: one record per case, kept in `results.json`.

A record is written as soon as its case is done, so an interrupted run keeps what it had, and a run
of one case leaves the others as they were. `document` makes the tables and the page of them.
"""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.generated_pages import Measured
from benchmarks.verification.rows import Row
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version, machine, package_versions

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
RESULTS = HERE / "results.json"

ORDER = ("material_paths", "elastic_column", "block_on_incline", "free_motion")
"""Cases that come first in the table, from the single point to the moving mass; others follow."""

PACKAGES = ("mpm_taichi", "geometry", "benchmarks")
"""Packages whose modules can change a figure; the rest reads settings and writes files."""

EFFECTS = ROOT / "mpm_taichi" / "effects"
"""Its modules are imported by name while a scene is prepared, which no reading of imports sees."""

Record = dict[str, Any]


def case_names(folder: Path = HERE) -> list[str]:
    """Modules of `folder` that are cases: those with a `TITLE` and a `run`."""
    names = []
    for path in sorted(folder.glob("*.py")):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        functions = {node.name for node in body if isinstance(node, ast.FunctionDef)}
        values = {ast.unparse(t) for node in body if isinstance(node, ast.Assign)
                  for t in node.targets}  # fmt: skip
        values |= {ast.unparse(node.target) for node in body if isinstance(node, ast.AnnAssign)}
        if "TITLE" in values and "run" in functions:
            names.append(path.stem)
    return in_order(names)


def in_order(names: Sequence[str]) -> list[str]:
    """Names in the order of the table."""
    return sorted(names, key=lambda n: (ORDER.index(n) if n in ORDER else len(ORDER), n))


def sources_hash(case: str) -> str:
    """Hash of the source text that a case's figures depend on; tells a stale record."""
    digest = hashlib.sha256()
    for path in sources(HERE / f"{case}.py"):
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
        if path not in found and path.is_file():
            found.add(path)
            waiting += imported_files(path)
    return sorted(found)


def imported_files(path: Path) -> list[Path]:
    """Files of `PACKAGES` that a file imports by name."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    stems = [ROOT.joinpath(*name.split(".")) for name in names if name.split(".")[0] in PACKAGES]
    files = [file for stem in stems for file in (stem.with_suffix(".py"), stem / "__init__.py")]
    return [file for file in files if file.is_file()]


def make_record(case: str, measured: Measured) -> Record:
    """The record of one case; `error` is empty where it ran to its end."""
    packages = package_versions()
    return {
        "title": measured.title,
        "made": datetime.now(UTC).date().isoformat(),
        "seconds": round(measured.seconds, 1),
        "code_version": code_version(),
        "sources": sources_hash(case),
        "packages": {name: packages[name] for name in ("python", "numpy", "taichi")},
        "processor": machine()["processor"],
        "error": measured.error,
        "rows": [_plain(row) for row in measured.rows],
    }


def rows_of(record: Record) -> list[Row]:
    """The rows of a record."""
    known = {field.name for field in fields(Row)}
    return [
        Row(**{key: math.nan if value is None else value
               for key, value in row.items() if key in known})
        for row in record["rows"]
    ]  # fmt: skip


def passed(record: Record) -> bool:
    """True where the case ran to its end and every row is within its tolerance."""
    return not record["error"] and all(row.passed for row in rows_of(record))


def read_records(path: Path | None = None) -> dict[str, Record]:
    """All records, by case, in the order of the table; none where there is no file."""
    path = path or RESULTS
    if not path.exists():
        return {}
    stored = read_json(path)["cases"]
    return {name: stored[name] for name in in_order(stored)}


def write_records(records: Mapping[str, Record], path: Path | None = None) -> None:
    """Write all records, whole or not at all."""
    ordered = {name: records[name] for name in in_order(list(records))}
    write_json(path or RESULTS, {"cases": ordered})


def _plain(row: Row) -> dict[str, Any]:
    values = asdict(row)
    for key, value in values.items():
        if hasattr(value, "item"):
            value = value.item()
        if isinstance(value, float) and not math.isfinite(value):
            value = None  # JSON knows no NaN; read back as NaN, which passes nothing
        values[key] = value
    return values
