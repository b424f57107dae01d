"""`flowslide joint CASES`: one relation of the strength ratio over several slides."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import InputError, add_common

DESCRIPTION = (
    "One relation of the ratio S_r / sigma'_v0 over several slides, from the results that each "
    "has: its median, its scatter between slides, whether it rises with the blow count, and what "
    "slopes that stood make of it. Nothing is simulated."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "cases",
        metavar="CASES",
        nargs="+",
        help="case folders, or their names in case_histories, whose results are there",
    )
    options.add_out(parser, "default: results/joint")
    parser.add_argument(
        "--weight",
        dest="weights",
        metavar="CASE=W",
        action="append",
        default=[],
        help="quality of a slide, at most 1: its variance is divided by it; may be repeated",
    )
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Find the relation, write it, print it."""
    from flowslide import api
    from pipeline.config import load_config
    from report.joint import summary

    settings = load_config(arguments.config, arguments.overrides)
    document = api.joint(
        arguments.cases,
        out=(folder := Path(arguments.out or Path(settings.results_folder) / "joint")),
        weights=dict(_weight(text) for text in arguments.weights),
        settings=settings,
    )
    print(summary(document))
    if not arguments.quiet:
        print(f"\nwrote {folder}")


def _weight(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError(f"--weight {text!r}: must be CASE=W, such as my_dam=0.5") from None
