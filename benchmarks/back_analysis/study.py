"""The validation of the back-analysis as a study: its parts, its records, and its page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.back_analysis.figures import Figure
from benchmarks.generated_pages import RECORDS, ROOT, Record, Study, renew, table
from inversion import PHYSICS_VERSION as INVERSION_VERSION
from mpm_taichi import PHYSICS_VERSION

PARTS = (
    "lower_san_fernando", "derivative", "wall_time", "reservoir", "la_marquesa", "misfits",
    "classical_methods", "twins",
)  # fmt: skip
"""Modules with a `TITLE` and a `run(folder, quick=...)`, in the order of the page."""

LONG_NOTE = 60
"""Characters from which on the note of a figure stays in the records, unless it is missed."""


class Validation(Study):
    """What the back-analysis must show."""

    package = "benchmarks.back_analysis"
    about = "What the back-analysis must show: measured figures and those asked for."
    noun, rows = "part", "figures"
    page = RECORDS / "validation.md"
    pictures = ROOT / "docs" / "images" / "validation"
    columns = ("measured", "asked, or compared with")

    def names(self) -> list[str]:
        """The parts, in the order of the page."""
        return list(PARTS)

    def state(self, name: str) -> dict[str, Any]:
        """The versions of the numbers."""
        return {"physics": {"mpm": PHYSICS_VERSION, "inversion": INVERSION_VERSION}}

    def row(self, values: Mapping[str, Any]) -> Figure:
        """A figure from its record."""
        return Figure(**values)

    def met(self, row: Figure) -> bool | None:
        """The figure is as asked; None: nothing was asked."""
        return row.met

    def cells(self, row: Figure) -> tuple[str, ...]:
        """Measured, asked and verdict."""
        return row.measured, row.asked, row.verdict

    def explanation(self, name: str) -> str:
        """Description of a part, below the title of its file."""
        return super().explanation(name).partition("\n\n")[2]

    def picture(self, name: str) -> str:
        """File name of the picture of a part."""
        return "history.png" if name == "lower_san_fernando" else super().picture(name)

    def write_pages(self, records: Mapping[str, Record]) -> None:
        """Renew what stands between the markers."""
        parts = [self.part(name, record) for name, record in records.items()]
        renew(self.page, summary=self.summary(records), parts="\n".join(parts))

    def summary(self, records: Mapping[str, Record]) -> str:
        """One line a part."""
        rows = []
        for name, record in records.items():
            figures = self.rows_of(record)
            met = sum(figure.met is True for figure in figures)
            missed = "; ".join(self.missed(record)) or "none"
            rows.append((f"[{record['title']}](#{name})", str(len(figures)), str(met), missed))
        return table(("part", "figures", "asked and met", "asked and missed"), rows, "lrrl")

    def part(self, name: str, record: Record) -> str:
        """Heading, explanation, picture and table of one part."""
        rows = [
            (_with_note(row), row.measured, row.asked, self.verdict(row))
            for row in self.rows_of(record)
        ]
        header = ("quantity", *self.columns, "")
        version = record["physics"]["mpm"]
        remark = f", solver version {version}"
        return self.section(name, record, table(header, rows, "lrll"), remark)


def _with_note(row: Figure) -> str:
    """What was measured, with its note; a long note is shown only where something is missed."""
    shown = row.note and (row.met is False or len(row.note) <= LONG_NOTE)
    return f"{row.quantity} ({row.note})" if shown else row.quantity
