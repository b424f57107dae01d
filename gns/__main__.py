"""Commands of the learned simulator: `python -m gns pack|show|...`.

Each command is a module with `add_parser(subparsers)` and `run(arguments)`; `COMMANDS` lists them.
All are imported to read the command line, so none imports torch before its `run`.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.cli import main_exit, run_command

COMMANDS = (
    "gns.pack_command",
    "gns.show_command",
    "gns.train_command",
    "gns.evaluate_command",
    "gns.rollout_command",
    "gns.schema_command",
    "gns.baselines_command",
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
