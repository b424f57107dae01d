"""The page `docs/records/verification.md`, made from the records and the docstring of each case.

The docstring of a case gives formula, source and what limits the accuracy. The page shows that
text, the picture and the rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from benchmarks.generated_pages import between, explanation
from benchmarks.verification.record import HERE, ROOT, Record, passed, rows_of
from benchmarks.verification.rows import Row
from pipeline.files import write_text

PAGE = ROOT / "docs" / "records" / "verification.md"
PICTURES = ROOT / "docs" / "images" / "verification"
SUMMARY, SECTIONS = "summary", "cases"
"""Generated parts of the page."""

HEADINGS = (
    "| quantity | measured | reference | error | tolerance | |\n|---|---:|---:|---:|---:|---|\n"
)


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


def write_documents(records: Mapping[str, Record]) -> None:
    """Write the generated parts of the page."""
    write_text(PAGE, page_text(records, PAGE.read_text(encoding="utf-8")))


def page_text(records: Mapping[str, Record], text: str) -> str:
    """The page with its generated parts made anew."""
    text = between(text, SUMMARY, summary(records))
    sections = "\n".join(section(name, record) for name, record in records.items())
    return between(text, SECTIONS, sections)


def summary(records: Mapping[str, Record]) -> str:
    """One line a case: how many rows, how many within tolerance, which are not."""
    lines = ["| case | rows | within tolerance | outside |", "|---|---:|---:|---|"]
    total = good = 0
    for name, record in records.items():
        rows = rows_of(record)
        missed = [row.quantity for row in rows if not row.passed]
        if record["error"]:
            missed.append(f"did not run to its end: {record['error']}")
        right = sum(row.passed for row in rows)
        total, good = total + len(rows), good + right
        link = f"[{record['title']}](#{name})"
        lines.append(f"| {link} | {len(rows)} | {right} | {'; '.join(missed)} |")
    dates = sorted({record["made"] for record in records.values()})
    span = " to ".join(dict.fromkeys([dates[0], dates[-1]])) if dates else "never"
    lines += [
        "",
        f"{good} of {total} rows are within their tolerance. Run {span}; every digit, date and "
        "version is in `benchmarks/verification/results.json`.",
    ]
    return "\n".join(lines) + "\n"


def section(name: str, record: Record) -> str:
    """Heading, explanation, picture and rows of one case."""
    parts = [f'<a id="{name}"></a>', f"## {record['title']}", explanation(HERE / f"{name}.py")]
    if (PICTURES / f"{name}.png").exists():
        parts.append(f"![{record['title']}](../images/verification/{name}.png)")
    parts.append(HEADINGS + "\n".join(row_lines(record)))
    state = "all rows within tolerance" if passed(record) else "not all rows within tolerance"
    parts.append(
        f"`python -m benchmarks.verification {name}`, {record['seconds']:.0f} s, "
        f"{record['made']}: {state}."
    )
    return "\n\n".join(parts) + "\n"


def row_lines(record: Record) -> list[str]:
    """The rows of a record as lines of a markdown table."""
    lines = []
    if record["error"]:
        lines.append(f"| did not run to its end: {record['error']} | | | | | **FAIL** |")
    for row in rows_of(record):
        *texts, verdict = cells(row)
        verdict = verdict if row.passed else f"**{verdict}**"
        quantity = row.quantity + (f" ({row.note})" if row.note else "")
        lines.append(f"| {quantity} | {' | '.join(texts)} | {verdict} |")
    return lines
