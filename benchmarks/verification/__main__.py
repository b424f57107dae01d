"""Run the verification cases: `python -m benchmarks.verification [case ...]`.

Prints the table; a full run also stores each case in `results.json` and renews the pictures and
the table of `docs/records/verification.md`. Ends with 1 if any row is outside its tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from benchmarks.generated_pages import run_part, wide_console
from benchmarks.verification import document, record
from pipeline.cli import CommandParser, InputError, base_parser, main_exit


def parser() -> CommandParser:
    """The command line."""
    result = base_parser(
        "python -m benchmarks.verification",
        "Closed forms, experiments and convergence: measured figures beside what they must be.",
    )
    result.add_argument("cases", nargs="*", metavar="CASE", help="cases to run; none: all")
    result.add_argument(
        "--page", action="store_true", help="run nothing, renew the page from what is stored"
    )
    result.add_argument("--list", action="store_true", help="print the names of the cases")
    result.add_argument(
        "--quick",
        action="store_true",
        help="small versions in a few seconds each; nothing is stored, pictures only with --out",
    )
    result.add_argument(
        "--resume",
        action="store_true",
        help="leave out cases that are stored and whose sources have not changed since",
    )
    result.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        default=None,
        help="folder of the pictures; default docs/images/verification",
    )
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run cases; returns 1 if any row, stored ones of other cases excepted, is off."""
    options = parser().parse_args(argv)
    known = record.case_names()
    if options.list:
        print("\n".join(known))
        return 0
    if options.page:
        document.write_documents(record.read_records())
        return 0
    for name in options.cases:
        if name not in known:
            raise InputError(f"case {name!r} is unknown: allowed are {', '.join(known)}")
    wanted = record.in_order(options.cases or known)
    stored = record.read_records()
    folder = options.out or (None if options.quick else document.PICTURES)
    done: dict[str, record.Record] = {}
    for name in wanted:
        if options.resume and not options.quick and is_current(name, stored.get(name)):
            done[name] = stored[name]
            continue
        done[name] = run_case(name, folder, quick=options.quick)
        if not options.quick:
            store(name, done[name])
    print_table(done)
    return 0 if all(record.passed(entry) for entry in done.values()) else 1


def is_current(name: str, entry: record.Record | None) -> bool:
    """True where a stored case ran to its end with the sources as they are."""
    return bool(entry) and not entry["error"] and entry["sources"] == record.sources_hash(name)


def run_case(name: str, folder: Path | None, *, quick: bool) -> record.Record:
    """Run one case; an error ends that case alone and is kept in its record."""
    measured = run_part("benchmarks.verification", name, folder, quick=quick)
    return record.make_record(name, measured)


def store(name: str, entry: record.Record) -> None:
    """Put one record beside those of the other cases, and renew the documents."""
    known = record.case_names()
    records = {case: old for case, old in record.read_records().items() if case in known}
    records[name] = entry
    record.write_records(records)
    document.write_documents(record.read_records())


def print_table(records: dict[str, record.Record]) -> None:
    """Print the rows of some cases."""
    table = Table(title="Verification", title_justify="left")
    table.add_column("case", no_wrap=True)
    table.add_column("quantity", overflow="fold")
    for heading in ("measured", "reference", "error", "tolerance"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for name, entry in records.items():
        for row in record.rows_of(entry):
            *texts, verdict = document.cells(row)
            style = "green" if row.passed else "bold red"
            table.add_row(name, row.quantity, *texts, f"[{style}]{verdict}[/]")
        if entry["error"]:
            table.add_row(name, entry["error"], "", "", "", "", "[bold red]FAIL[/]")
        table.add_section()
    wide_console().print(table)


if __name__ == "__main__":
    main_exit(main)
