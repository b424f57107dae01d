"""Commands of the back-analysis: `python -m inversion invert|...`.

Each command is a module with `add_parser(subparsers)` and `run(arguments)`; `COMMANDS` lists them.
They are imported one by one and only when the command line is read, so a command may be heavy.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.cli import main_exit, run_command

COMMANDS = (
    "flowslide.commands.invert",
    "flowslide.commands.predict",
    "flowslide.commands.inversion_show",
    "flowslide.commands.classical",
    "flowslide.commands.new",
    "flowslide.commands.catalogue",
    "flowslide.commands.inversion_schema",
)
"""Modules of the commands, in the order of the help."""


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run one of the commands; the exit code is None or 0 for success."""
    return run_command(
        "python -m inversion",
        "Find the residual strength of liquefied soil from how far it ran.",
        COMMANDS,
        argv,
    )


if __name__ == "__main__":
    main_exit(main)
