"""`python -m inversion`: the commands of this package; `flowslide --help` has all of them."""

from __future__ import annotations

from functools import partial

from flowslide.command_line import package_main
from pipeline.cli import main_exit

main = partial(package_main, "inversion")

if __name__ == "__main__":
    main_exit(main)
