"""What has been verified: one record per case in `results.json`, and the table made of it.

A record is written as soon as its case is done, so an interrupted run keeps what it had, and a run
of one case leaves the others as they were.
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

from benchmarks.verification.rows import Row
from pipeline.files import read_json, write_json, write_text
from pipeline.manifest import code_version, machine, package_versions

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
RESULTS = HERE / "results.json"
PAGE = ROOT / "docs" / "verification.md"
FRAGMENT = ROOT / "docs" / "verification-table.md"
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"

ORDER = ("material_paths", "elastic_column", "block_on_incline", "free_motion")
"""Cases that come first in the table, from the single point to the moving mass; others follow."""

SOLVER = (
    "mohr_coulomb", "transfer", "boundary", "layout", "point_functions", "scene_schedule",
    "solver", "runtime", "initial_state", "simulate",
)  # fmt: skip
"""Modules of `mpm_taichi` on which every figure depends."""

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
    paths = [ROOT / "mpm_taichi" / f"{name}.py" for name in SOLVER]
    paths += [ROOT / "geometry" / "scene.py", ROOT / "geometry" / "fill.py", HERE / f"{case}.py"]
    paths += [HERE / "lab.py"]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes() if path.exists() else b"")
    return digest.hexdigest()[:16]


def make_record(case: str, title: str, rows: Sequence[Row], seconds: float, error: str) -> Record:
    """The record of one case; `error` is empty where it ran to its end."""
    packages = package_versions()
    return {
        "title": title,
        "made": datetime.now(UTC).date().isoformat(),
        "seconds": round(seconds, 1),
        "code_version": code_version(),
        "sources": sources_hash(case),
        "packages": {name: packages[name] for name in ("python", "numpy", "taichi")},
        "processor": machine()["processor"],
        "error": error,
        "rows": [_plain(row) for row in rows],
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


def read_records(path: Path = RESULTS) -> dict[str, Record]:
    """All records, by case, in the order of the table; none where there is no file."""
    if not path.exists():
        return {}
    stored = read_json(path)["cases"]
    return {name: stored[name] for name in in_order(stored)}


def write_records(records: Mapping[str, Record], path: Path = RESULTS) -> None:
    """Write all records, whole or not at all."""
    ordered = {name: records[name] for name in in_order(list(records))}
    write_json(path, {"cases": ordered})


def cells(row: Row) -> tuple[str, str, str, str, str]:
    """Measured, reference, error, tolerance and verdict of a row as text."""
    unit = f" {row.unit}" if row.unit else ""
    verdict = "pass" if row.passed else "FAIL"
    measured, reference = f"{number(row.measured)}{unit}", f"{number(row.reference)}{unit}"
    if row.bound:
        return measured, "", "", f"≤ {reference}", verdict
    if row.absolute:
        error, tolerance = f"{row.error:+.2g}{unit}", f"± {number(row.tolerance)}{unit}"
    else:
        error, tolerance = f"{100 * row.error:+.2g} %", f"± {number(100 * row.tolerance)} %"
    return (
        f"{number(row.measured)}{unit}",
        f"{number(row.reference)}{unit}",
        error,
        tolerance,
        verdict,
    )


def number(value: float) -> str:
    """A number as people write it: four figures, powers of ten only where they help."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.4g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.1e}"


def markdown_table(records: Mapping[str, Record]) -> str:
    """The whole table as markdown, with a line on how much of it passes."""
    lines = [
        "| case | quantity | measured | reference | error | tolerance | |",
        "|---|---|---:|---:|---:|---:|---|",
    ]
    total = good = 0
    for name, record in records.items():
        link = f"[{name}](#{name})"
        if record["error"]:
            lines.append(
                f"| {link} | did not run to its end: {record['error']} | | | | | **FAIL** |"
            )
            total += 1
        for row in rows_of(record):
            *texts, verdict = cells(row)
            verdict = verdict if row.passed else f"**{verdict}**"
            quantity = row.quantity + (f" ({row.note})" if row.note else "")
            lines.append(f"| {link} | {quantity} | {' | '.join(texts)} | {verdict} |")
            total, good = total + 1, good + row.passed
    dates = sorted({record["made"] for record in records.values()})
    span = " to ".join(dict.fromkeys([dates[0], dates[-1]])) if dates else "never"
    lines.append("")
    lines.append(
        f"{good} of {total} rows within their tolerance; {len(records)} cases, run {span}. "
        "Dates, versions and every digit: `benchmarks/verification/results.json`."
    )
    return "\n".join(lines) + "\n"


def write_documents(
    records: Mapping[str, Record], page: Path = PAGE, fragment: Path = FRAGMENT
) -> None:
    """Write the table as a fragment, and between the markers of the page."""
    table = markdown_table(records)
    write_text(fragment, table)
    if page.exists():
        write_text(page, with_table(page.read_text(encoding="utf-8"), table))


def with_table(text: str, table: str) -> str:
    """The text of a page with everything between its markers replaced by `table`."""
    before, found, rest = text.partition(BEGIN)
    _, also_found, after = rest.partition(END)
    if not (found and also_found):
        raise ValueError(f"the page has no markers {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n{table}{END}{after}"


def _plain(row: Row) -> dict[str, Any]:
    values = asdict(row)
    for key, value in values.items():
        if hasattr(value, "item"):
            value = value.item()
        if isinstance(value, float) and not math.isfinite(value):
            value = None  # JSON knows no NaN; read back as NaN, which passes nothing
        values[key] = value
    return values
