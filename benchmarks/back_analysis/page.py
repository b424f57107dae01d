"""The generated part of `docs/records/validation.md`: a summary, then each figure and table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from benchmarks.back_analysis.lab import ROOT
from benchmarks.back_analysis.record import Record, figures_of, missed
from benchmarks.generated_pages import between, explanation
from pipeline.files import write_text

HERE = Path(__file__).parent
PAGE = ROOT / "docs" / "records" / "validation.md"
PICTURES = ROOT / "docs" / "images" / "validation"
SUMMARY, PARTS = "summary", "parts"
PICTURE_OF = {
    "lower_san_fernando": "history.png", "la_marquesa": "la_marquesa.png", "twins": "twins.png",
}  # fmt: skip


def write_page(records: Mapping[str, Record]) -> None:
    """Renew what stands between the markers."""
    text = between(PAGE.read_text(encoding="utf-8"), SUMMARY, summary(records))
    parts = "\n".join(section(name, record) for name, record in records.items())
    write_text(PAGE, between(text, PARTS, parts))


def summary(records: Mapping[str, Record]) -> str:
    """One line a part."""
    lines = ["| part | figures | asked and met | asked and missed |", "|---|---:|---:|---|"]
    for name, record in records.items():
        figures = figures_of(record)
        met = sum(figure.met is True for figure in figures)
        lines.append(
            f"| [{record['title']}](#{name}) | {len(figures)} | {met} | "
            f"{'; '.join(missed(record)) or 'none'} |"
        )
    return "\n".join(lines) + "\n"


def section(name: str, record: Record) -> str:
    """Heading, explanation, picture and table of one part."""
    parts = [
        f'<a id="{name}"></a>',
        f"## {record['title']}",
        explanation(HERE / f"{name}.py").partition("\n\n")[2],
    ]
    picture = PICTURE_OF.get(name)
    if picture and (PICTURES / picture).exists():
        parts.append(f"![{record['title']}](../images/validation/{picture})")
    lines = ["| quantity | measured | asked, or compared with | | note |", "|---|---:|---|---|---|"]
    for figure in figures_of(record):
        verdict = f"**{figure.verdict}**" if figure.met is False else figure.verdict
        cells = (figure.quantity, figure.measured, figure.asked, verdict, figure.note)
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    parts.append("\n".join(lines))
    if record["error"]:
        parts.append(f"Did not run to its end: {record['error']}")
    version = record["physics"]["mpm"]
    parts.append(
        f"`python -m benchmarks.back_analysis {name}`, {record['seconds']:.0f} s (kept runs cost "
        f"nothing), {record['made']}, solver version {version}."
    )
    return "\n\n".join(parts) + "\n"
