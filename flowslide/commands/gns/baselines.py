"""`flowslide gns baselines`: what a trained model must beat on a data set."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options
from flowslide.commands.gns.evaluate import SPLITS
from pipeline.cli import InputError, add_common

DESCRIPTION = (
    "Guess the runouts of held-out runs from the nearest training run and from a "
    "sliding-block regression, and print how far off they are."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("data", nargs="?", metavar="DIR", help="packed data")
    options.add_scale(parser, "take RESULTS/SCALE/dataset instead")
    parser.add_argument("--split", choices=SPLITS, default="test", help="default: test")
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Fit on the training runs, print a table for each baseline by template."""
    from gns.data.dataset import Windows
    from gns.evaluation.baselines import baselines, judge, summary
    from pipeline.table import aligned

    folder = data_folder(arguments)
    held_out = Windows(folder, arguments.split)
    train = Windows(folder, "train")
    if not len(held_out.runs):
        raise InputError(f"{folder}: no run in the split {arguments.split}")
    rows: list[list[str]] = []
    for baseline in baselines(train):
        guesses = judge(baseline, held_out)
        groups = {"all": guesses}
        for letter in sorted({one.template for one in guesses}):
            groups[letter or "-"] = [one for one in guesses if one.template == letter]
        for name, members in groups.items():
            numbers = summary(members)
            rows = rows or [["baseline", "template", *numbers]]
            cells = [
                f"{value:.0f}" if key == "runs" else f"{value:.2f}"
                for key, value in numbers.items()
            ]
            rows.append([baseline.name if name == "all" else "", name, *cells])
    print(f"{folder}, split {arguments.split}: median errors of the runout, and the 90 % quantile;")
    print(f"fitted to {len(train.runs)} training runs")
    print(aligned(rows, left={0, 1}))


def data_folder(arguments: argparse.Namespace) -> Path:
    """The packed data that the options name."""
    if (arguments.data is None) == (arguments.scale is None):
        raise InputError("name a folder of packed data, or a --scale, and not both")
    if arguments.data is not None:
        return Path(arguments.data)
    from pipeline.config import load_config

    config = load_config(arguments.config, arguments.overrides)
    config.scale(arguments.scale)
    return Path(config.results_folder) / arguments.scale / "dataset"
