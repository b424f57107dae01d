"""Commands of the diagnosis: `python -m diagnosis compare|explain|extend|run|track|suggest`.

Each command is a module with `add_parser(subparsers)` and `run(arguments)`; `COMMANDS` lists them.
They are imported one by one and only when the command line is read.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.cli import main_exit, run_command

COMMANDS = (
    "flowslide.commands.diagnose",
    "flowslide.commands.compare",
    "flowslide.commands.explain",
    "flowslide.commands.extend",
    "flowslide.commands.track",
    "flowslide.commands.suggest",
    "flowslide.commands.diagnosis_schema",
)
"""Modules of the commands, in the order of the help."""


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run one of the commands; the exit code is None or 0 for success."""
    return run_command(
        "python -m diagnosis",
        "Find where a model disagrees with the measurements, and which physical effect it lacks.",
        COMMANDS,
        argv,
    )


if __name__ == "__main__":
    main_exit(main)
