"""Studies whose figures are kept as records, and the parts of pages that are generated.

A study is a package of parts: modules with a `TITLE`, a `run(folder, quick=...)` that returns
measured rows, and a docstring that explains them. The record of a part is written to
`results.json` as soon as the part is done, so an interrupted run keeps what it had.

A generated part of a page stands between `<!-- name: begin -->` and `<!-- name: end -->`; what is
outside is written by hand. Every page whose figures are kept is renewed by

    python -m benchmarks.generated_pages
"""

from __future__ import annotations

import ast
import importlib
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from pipeline.cli import CommandParser, InputError, base_parser, main_exit
from pipeline.files import read_json, read_text, write_json, write_text
from pipeline.manifest import code_version, machine

ROOT = Path(__file__).resolve().parent.parent
RECORDS = ROOT / "docs" / "records"
EFFECTS_PAGE = ROOT / "docs" / "method" / "effects.md"

Record = dict[str, Any]


# --- pages ---


def around(page: Path, part: str) -> tuple[str, str]:
    """What a page has before and after a generated part, markers included.

    Raises:
        InputError: there is no such page, or it does not have the markers.
    """
    whole = read_text(page)
    markers = [f"<!-- {part}: {end} -->" for end in ("begin", "end")]
    begin, end = (whole.find(marker) for marker in markers)
    if not 0 <= begin < end:
        raise InputError(f"{page}: the lines {markers[0]} and {markers[1]} are missing")
    return whole[: begin + len(markers[0])], whole[end:]


def renew(page: Path, **parts: str) -> None:
    """Replace generated parts of a page, given by name."""
    for part, text in parts.items():
        before, after = around(page, part)
        write_text(page, f"{before}\n{text.rstrip()}\n{after}")


def table(header: Sequence[str], rows: Sequence[Sequence[str]], align: str = "") -> str:
    """A Markdown table.

    Args:
        header: of the columns.
        rows: of cells.
        align: a letter for each column, l or r; empty: all to the left.
    """
    rule = "|".join("---:" if letter == "r" else "---" for letter in align or "l" * len(header))
    head = "|".join(f" {cell} " if cell else " " for cell in header)
    lines = [f"|{head}|", f"|{rule}|"]
    lines += ["| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


# --- studies ---


class Study(ABC):
    """A package of parts that are measured one by one, their records and their page."""

    package: str
    """Of the parts, as in `python -m <package>`."""
    about: str
    """The study in a sentence, for its help."""
    noun: str
    """What a part is called."""
    rows: str
    """What the rows of a record are called in its file."""
    page: Path
    pictures: Path
    columns: tuple[str, ...]
    """Of a row between its quantity and its verdict."""

    @property
    def folder(self) -> Path:
        """Where the parts are."""
        return ROOT.joinpath(*self.package.split("."))

    @property
    def results(self) -> Path:
        """The file of the records."""
        return self.folder / "results.json"

    @abstractmethod
    def names(self) -> list[str]:
        """The parts, in the order of the page."""

    @abstractmethod
    def state(self, name: str) -> dict[str, Any]:
        """What the figures of a part depend on; a record with another state is out of date."""

    @abstractmethod
    def row(self, values: Mapping[str, Any]) -> Any:
        """A row as it was measured, from its record."""

    @abstractmethod
    def cells(self, row: Any) -> tuple[str, ...]:
        """A row's `columns` and its verdict, as text."""

    @abstractmethod
    def met(self, row: Any) -> bool | None:
        """Whether a row is as it must be; None: nothing is asked of it."""

    @abstractmethod
    def write_pages(self, records: Mapping[str, Record]) -> None:
        """Renew what is generated from the records."""

    # --- records ---

    def record(self, name: str, title: str, rows: Sequence[Any], seconds: float, error: str):
        """The record of a part; `error` is empty if it ran to its end."""
        return {
            "title": title,
            "made": datetime.now(UTC).date().isoformat(),
            "seconds": round(seconds, 1),
            "code_version": code_version(),
            **self.state(name),
            "processor": machine()["processor"],
            "error": error,
            self.rows: [self.plain(row) for row in rows],
        }

    def plain(self, row: Any) -> dict[str, Any]:
        """A row as it is stored."""
        return asdict(row)

    def rows_of(self, record: Record) -> list[Any]:
        """The rows of a record."""
        return [self.row(values) for values in record[self.rows]]

    def missed(self, record: Record) -> list[str]:
        """Figures that fail their bounds."""
        found = [row.quantity for row in self.rows_of(record) if self.met(row) is False]
        return found + ([f"did not run to its end: {record['error']}"] if record["error"] else [])

    def is_current(self, name: str, record: Record | None) -> bool:
        """True for a stored part that ran to its end and would not come out differently now."""
        if not record or record["error"]:
            return False
        return all(record.get(key) == value for key, value in self.state(name).items())

    def read(self) -> dict[str, Record]:
        """All records, in the order of the page; none where there is no file."""
        stored = read_json(self.results)[f"{self.noun}s"] if self.results.exists() else {}
        return {name: stored[name] for name in self.names() if name in stored}

    def keep(self, name: str, record: Record) -> None:
        """Put a record to those of the other parts, and renew the pages."""
        records = {**self.read(), name: record}
        ordered = {name: records[name] for name in self.names() if name in records}
        write_json(self.results, {f"{self.noun}s": ordered})
        self.write_pages(ordered)

    # --- text ---

    def explanation(self, name: str) -> str:
        """Description of a part, from the head of its file."""
        text = (self.folder / f"{name}.py").read_text(encoding="utf-8")
        return ast.get_docstring(ast.parse(text)) or ""

    def shown(self, name: str, record: Record) -> str:
        """What the page has of the explanation."""
        return self.explanation(name)

    def picture(self, name: str) -> str:
        """File name of the picture of a part."""
        return f"{name}.png"

    def section(self, name: str, record: Record, rows: str, remark: str) -> str:
        """Heading, explanation, picture and rows of a part.

        Args:
            name: of the part.
            record: its record.
            rows: its table.
            remark: what follows the command, the time and the date.
        """
        parts = [f'<a id="{name}"></a>', f"## {record['title']}", self.shown(name, record)]
        if (self.pictures / self.picture(name)).is_file():
            shown = f"../images/{self.page.stem}/{self.picture(name)}"
            parts.append(f"![{name}]({shown})")
        parts.append(rows)
        if record["error"]:
            parts.append(f"Did not run to its end: {record['error']}")
        parts.append(f"`python -m {self.package} {name}`, {record['seconds']:.0f} s{remark}.")
        return "\n\n".join(parts) + "\n"

    def verdict(self, row: Any) -> str:
        """The verdict of a row, bold where it is a miss."""
        text = self.cells(row)[-1]
        return f"**{text}**" if self.met(row) is False else text

    # --- the command ---

    def parser(self) -> CommandParser:
        """The command line."""
        noun, result = self.noun, base_parser(f"python -m {self.package}", self.about)
        result.add_argument(
            "parts", nargs="*", metavar=noun.upper(), help=f"{noun}s to run; none: all"
        )
        result.add_argument("--list", action="store_true", help=f"print the names of the {noun}s")
        result.add_argument(
            "--page", action="store_true", help="run nothing, renew the page from what is stored"
        )
        result.add_argument(
            "--stored", action="store_true", help="run nothing, print every row that is stored"
        )
        result.add_argument(
            "--quick",
            action="store_true",
            help="small versions; nothing is stored, pictures only with --out",
        )
        result.add_argument(
            "--resume",
            action="store_true",
            help=f"leave out {noun}s that are stored and whose sources have not changed since",
        )
        result.add_argument(
            "--out",
            type=Path,
            metavar="FOLDER",
            help=f"folder of the pictures; default docs/images/{self.page.stem}",
        )
        return result

    def main(self, argv: Sequence[str] | None = None) -> int:
        """Run parts; returns 1 if any of them failed or missed something."""
        options, known = self.parser().parse_args(argv), self.names()
        if options.list:
            print("\n".join(known))
            return 0
        if options.page:
            self.write_pages(self.read())
            return 0
        for name in options.parts:
            if name not in known:
                raise InputError(f"{self.noun} {name!r} is unknown: allowed are {', '.join(known)}")
        folder = options.out or (None if options.quick else self.pictures)
        stored, done = self.read(), {}
        asked = [one for one in known if one in (options.parts or known)]
        if options.stored:
            self.print_table({name: stored[name] for name in asked if name in stored})
            return 0
        for name in asked:
            if options.resume and not options.quick and self.is_current(name, stored.get(name)):
                done[name] = stored[name]
                continue
            done[name] = self.measured(name, folder, quick=options.quick)
            if not options.quick:
                self.keep(name, done[name])
        self.print_table(done)
        return 1 if any(self.missed(record) for record in done.values()) else 0

    def measured(self, name: str, folder: Path | None, *, quick: bool) -> Record:
        """Run one part; an error ends that part alone and is kept in its record."""
        print(f"{name} ...", flush=True)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        began, rows, error, title = time.perf_counter(), [], "", name
        try:
            module = importlib.import_module(f"{self.package}.{name}")
            title = module.TITLE
            rows = module.run(folder, quick=quick)
        except Exception as problem:
            traceback.print_exc()
            error = " ".join(f"{type(problem).__name__}: {problem}".split())
        seconds = time.perf_counter() - began
        print(f"{name}: {seconds:.1f} s", flush=True)
        return self.record(name, title, rows, seconds, error)

    def print_table(self, records: Mapping[str, Record]) -> None:
        """Print the rows of some parts."""
        shown = Table(title=self.page.stem.title(), title_justify="left")
        shown.add_column(self.noun, no_wrap=True)
        for heading in ("quantity", *self.columns, ""):
            shown.add_column(heading, overflow="fold")
        for name, record in records.items():
            for row in self.rows_of(record):
                style = {True: "green", False: "bold red", None: "none"}[self.met(row)]
                *texts, verdict = self.cells(row)
                quantity = f"{row.quantity} ({row.note})" if row.note else row.quantity
                shown.add_row(name, quantity, *texts, f"[{style}]{verdict}[/]")
            if record["error"]:
                empty = [""] * len(self.columns)
                shown.add_row(name, record["error"], *empty, "[bold red]FAIL[/]")
            shown.add_section()
        console = Console()
        (console if console.is_terminal else Console(width=150)).print(shown)


def effects_part() -> str:
    """The generated part of `docs/method/effects.md`."""
    from mpm_taichi.effects import effects, effects_table

    return effects_table(effects().values())


def main(argv: Sequence[str] | None = None) -> int:
    """Renew every page whose figures are kept."""
    from benchmarks.back_analysis.study import Validation
    from benchmarks.hidden_effects import strangers
    from benchmarks.hidden_effects.baselines import run as baselines
    from benchmarks.hidden_effects.scoring import sets
    from benchmarks.verification.study import Verification

    base_parser("python -m benchmarks.generated_pages", "Renew the generated pages.").parse_args(
        argv
    )
    for study in (Verification(), Validation()):
        study.write_pages(study.read())
    renew(EFFECTS_PAGE, table=effects_part())
    renew(
        sets.PAGE,
        sets=sets.sets_table(),
        strangers=strangers.strangers_page(),
        baselines=baselines.baselines_page(),
    )
    return 0


if __name__ == "__main__":
    main_exit(main)
