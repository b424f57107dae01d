"""The verification as a study: its cases, its records, and its pages.

The docstring of a case gives formula, source and what limits the accuracy. The page shows that
text (where all rows pass: its first paragraph), the picture, the rows outside their tolerance and
the one that comes closest to it.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from benchmarks.generated_pages import RECORDS, ROOT, Record, Study, renew, table
from benchmarks.verification.rows import Row
from benchmarks.verification.sources import sources_hash
from pipeline.manifest import package_versions

ORDER = ("material_paths", "elastic_column", "block_on_incline", "free_motion")
"""Cases that come first in the table, from the single point to the moving mass; others follow."""

ALIGN = "lrrrrl"
CLOSEST = 1
"""Rows of a case that the page shows next to those outside their tolerance."""


class Verification(Study):
    """Closed forms, experiments and convergence."""

    package = "benchmarks.verification"
    about = "Closed forms, experiments and convergence: measured figures and what they must be."
    noun, rows = "case", "rows"
    page = RECORDS / "verification.md"
    pictures = ROOT / "docs" / "images" / "verification"
    columns = ("measured", "reference", "error", "tolerance")

    def names(self) -> list[str]:
        """Modules that are cases: those with a `TITLE` and a `run`."""
        found = [path.stem for path in self.folder.glob("*.py") if _is_case(path)]
        return sorted(found, key=lambda n: (ORDER.index(n) if n in ORDER else len(ORDER), n))

    def state(self, name: str) -> dict[str, Any]:
        """Hash of the source text that the figures of a case depend on."""
        return {"sources": sources_hash(self.folder / f"{name}.py")}

    def record(
        self, name: str, title: str, rows: Sequence[Row], seconds: float, error: str
    ) -> Record:
        """The record of a case, with the versions of what computed it."""
        packages = package_versions()
        used = {package: packages[package] for package in ("python", "numpy", "taichi")}
        return {**super().record(name, title, rows, seconds, error), "packages": used}

    def plain(self, row: Row) -> dict[str, Any]:
        """A row for JSON, which has neither NaN nor the numbers of numpy."""
        values = {
            key: value.item() if hasattr(value, "item") else value
            for key, value in asdict(row).items()
        }
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in values.items()
        }

    def row(self, values: Mapping[str, Any]) -> Row:
        """A row; values that were not numbers become NaN again, which fails every bound."""
        known = {field.name for field in fields(Row)}
        return Row(**{k: math.nan if v is None else v for k, v in values.items() if k in known})

    def met(self, row: Row) -> bool:
        """The row is within its tolerance."""
        return bool(row.passed)

    def cells(self, row: Row) -> tuple[str, ...]:
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
        return measured, reference, error, tolerance, verdict

    def write_pages(self, records: Mapping[str, Record]) -> None:
        """Write the generated parts of the page."""
        renew(self.page, summary=self.summary(records), cases=self.sections(records))

    def summary(self, records: Mapping[str, Record]) -> str:
        """One line a case: how many rows, how many within tolerance, which are not."""
        lines, total, good = [], 0, 0
        for name, record in records.items():
            rows = self.rows_of(record)
            right = sum(row.passed for row in rows)
            total, good = total + len(rows), good + right
            link = f"[{record['title']}](#{name})"
            lines.append((link, str(len(rows)), str(right), "; ".join(self.missed(record))))
        dates = sorted({record["made"] for record in records.values()})
        span = " to ".join(dict.fromkeys([dates[0], dates[-1]])) if dates else "never"
        return (
            table(("case", "rows", "within tolerance", "outside"), lines, "lrrl")
            + f"\n\n{good} of {total} rows are within their tolerance. Run {span}; every digit, "
            "date and version is in `benchmarks/verification/results.json`.\n"
        )

    def sections(self, records: Mapping[str, Record]) -> str:
        """Every case: explanation, picture, rows."""
        made = []
        for name, record in records.items():
            rows = table(("quantity", *self.columns, ""), self.table_rows(record), ALIGN)
            made.append(self.section(name, record, rows, ""))
        return "\n".join(made)

    def shown(self, name: str, record: Record) -> str:
        """All of the explanation where a row fails, else its first paragraph."""
        whole = self.explanation(name)
        return whole if self.missed(record) else whole.partition("\n\n")[0]

    def table_rows(self, record: Record) -> list[tuple[str, ...]]:
        """The rows of a record that the page shows, as cells."""
        rows = self.rows_of(record)
        passed = sorted(
            (number for number, row in enumerate(rows) if row.passed),
            key=lambda number: -_share_used(rows[number]),
        )
        hidden = set(passed[CLOSEST:])
        return [
            (row.quantity + (f" ({row.note})" if row.note else ""), *self.cells(row)[:-1],
             self.verdict(row))
            for number, row in enumerate(rows) if number not in hidden
        ]  # fmt: skip


def _share_used(row: Row) -> float:
    """Share of its tolerance, or of its upper limit, that a figure uses."""
    used, allowed = (row.measured, row.reference) if row.bound else (abs(row.error), row.tolerance)
    return used / allowed if allowed else 0.0


def _is_case(path: Path) -> bool:
    body = ast.parse(path.read_text(encoding="utf-8")).body
    functions = {node.name for node in body if isinstance(node, ast.FunctionDef)}
    values = {ast.unparse(t) for node in body if isinstance(node, ast.Assign)
              for t in node.targets}  # fmt: skip
    values |= {ast.unparse(node.target) for node in body if isinstance(node, ast.AnnAssign)}
    return "TITLE" in values and "run" in functions


def number(value: float) -> str:
    """A number as people write it: four figures, powers of ten only where they help."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.4g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.1e}"
