"""`flowslide gns direct-runs`: random sections, with and without effects, simulated once each."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import InputError, add_common

PARTS = 130

DESCRIPTION = (
    "Draw random dams and slopes, six of ten with effects, and simulate each at 2 m spacing, for "
    "the direct model. Started again after a kill, it goes on with the parts that are missing."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--out", metavar="DIR", help="default: RESULTS/direct/runs")
    parser.add_argument(
        "--parts",
        default=f"0-{PARTS - 1}",
        metavar="A-B",
        help=f"parts of 50 scenes, from the first to the last; default: 0-{PARTS - 1}",
    )
    options.add_threads(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Simulate what is missing."""
    from gns.direct.runs import simulate_parts
    from pipeline.config import load_config
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    folder = Path(arguments.out or Path(config.results_folder) / "direct" / "runs")
    parts = _parts(arguments.parts)
    with Progress(0, "runs for the direct models", quiet=arguments.quiet) as bar:
        simulate_parts(config, folder, parts, threads=arguments.threads, tell=bar.say)
    print(f"{folder}: parts {arguments.parts}")


def _parts(text: str) -> range:
    first, _, last = text.partition("-")
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
        raise InputError(f"--parts {text}: is two numbers from low to high, such as 0-59")
    return range(int(first), int(last) + 1)
