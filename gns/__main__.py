"""Commands of the learned simulator: `python -m gns pack|show|...`.

Each command is a module with `add_parser(subparsers)` and `run(arguments)`; `COMMANDS` lists them.
All are imported to read the command line, so none imports torch before its `run`.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.cli import main_exit, run_command

COMMANDS = (
    "flowslide.commands.gns_pack",
    "flowslide.commands.gns_show",
    "flowslide.commands.gns_train",
    "flowslide.commands.gns_evaluate",
    "flowslide.commands.gns_rollout",
    "flowslide.commands.gns_schema",
    "flowslide.commands.gns_baselines",
)
"""Modules of the commands, in the order of the help."""


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run one of the commands; the exit code is None or 0 for success."""
    return run_command(
        "python -m gns",
        "Learn from simulated slides, and simulate by what was learned.",
        COMMANDS,
        argv,
    )


if __name__ == "__main__":
    main_exit(main)
