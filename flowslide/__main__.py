"""`python -m flowslide`: the same as the console command `flowslide`."""

from __future__ import annotations

from typing import NoReturn

from flowslide.command_line import main
from pipeline.cli import main_exit


def console() -> NoReturn:
    """The console command `flowslide`."""
    main_exit(main)


if __name__ == "__main__":
    console()
