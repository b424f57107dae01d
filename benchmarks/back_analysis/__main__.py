"""Measure what the back-analysis must show: `python -m benchmarks.back_analysis [part ...]`.

Prints the table; without --quick also stores it in `results.json` and updates the figures and
tables of `docs/records/validation.md`. Exits with 1 if a part fails or misses a target.
Simulations are cached by content in results/benchmarks/back_analysis, so a killed run resumes.
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from benchmarks.back_analysis import page, record
from benchmarks.generated_pages import run_part, wide_console
from pipeline.cli import CommandParser, InputError, base_parser, main_exit


def parser() -> CommandParser:
    """The command line."""
    result = base_parser(
        "python -m benchmarks.back_analysis",
        "What the back-analysis must show: measured figures beside those asked for.",
    )
    result.add_argument("parts", nargs="*", metavar="PART", help="parts to run; none: all")
    result.add_argument("--list", action="store_true", help="print the names of the parts")
    result.add_argument(
        "--page", action="store_true", help="run nothing, renew the page from what is stored"
    )
    result.add_argument(
        "--quick", action="store_true", help="coarse and few; nothing is stored or drawn"
    )
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run parts; returns 1 if any of them failed or missed something."""
    options = parser().parse_args(argv)
    if options.list:
        print("\n".join(record.PARTS))
        return 0
    if options.page:
        page.write_page(record.read_records())
        return 0
    for name in options.parts:
        if name not in record.PARTS:
            raise InputError(f"part {name!r} is unknown: allowed are {', '.join(record.PARTS)}")
    done: dict[str, record.Record] = {}
    for name in [n for n in record.PARTS if n in (options.parts or record.PARTS)]:
        folder = None if options.quick else page.PICTURES
        measured = run_part("benchmarks.back_analysis", name, folder, quick=options.quick)
        done[name] = record.make_record(measured)
        if not options.quick:
            record.write_records({**record.read_records(), name: done[name]})
            page.write_page(record.read_records())
    print_table(done)
    return 1 if any(record.missed(entry) for entry in done.values()) else 0


def print_table(records: dict[str, record.Record]) -> None:
    """Print the figures of some parts."""
    table = Table(title="Back-analysis", title_justify="left")
    for heading in ("part", "quantity", "measured", "asked, or compared with", ""):
        table.add_column(heading, overflow="fold")
    for name, entry in records.items():
        for figure in record.figures_of(entry):
            style = {True: "green", False: "bold red", None: "none"}[figure.met]
            table.add_row(
                name, figure.quantity, figure.measured, figure.asked,
                f"[{style}]{figure.verdict}[/]",
            )  # fmt: skip
        if entry["error"]:
            table.add_row(name, entry["error"], "", "", "[bold red]FAIL[/]")
        table.add_section()
    wide_console().print(table)


if __name__ == "__main__":
    main_exit(main)
