"""`flowslide gns show`: a quick look at packed data."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError

if TYPE_CHECKING:
    from gns.data.shard import Shard
    from report.pictures.packed_data import RunNumbers


DESCRIPTION = (
    "Draw one run as a learner is shown it; without its number an overview of "
    "all runs of a folder or of one shard."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "data", metavar="DATA[:RUN]", help="folder of packed data or one shard, number of a run"
    )
    options.add_out(parser, "png, svg or pdf", metavar="FILE", required=True)


def run(arguments: argparse.Namespace) -> None:
    """Draw, and say what was drawn."""
    from report.pictures import packed_data

    path, number = _split(arguments.data)
    shards = _shards(path)
    if number is None:
        runs = list(_numbers(shards))
        if not runs:
            raise InputError(f"{path}: holds no run")
        packed_data.save_overview(runs, arguments.out, f"{path}: {len(runs)} runs")
    else:
        split, shard, template = _find(path, shards, number)
        packed = shard.read_run(number)
        frames, points, _ = packed.positions.shape
        kind = f", template {template}" if template else ""
        title = f"run {number} ({split}{kind}): {points} points, {frames} frames"
        packed_data.save_run_picture(packed, arguments.out, title)
        print(title)
    print(f"wrote {arguments.out}")


def _split(text: str) -> tuple[Path, int | None]:
    """`FOLDER:12` -> (FOLDER, 12)."""
    found = re.fullmatch(r"(.+):(?:run_)?(\d+)", text)
    return (Path(found[1]), int(found[2])) if found else (Path(text), None)


def _shards(path: Path) -> list[tuple[str, Shard]]:
    """The shards of a folder with their splits, or the one shard that is named."""
    from gns.data.metadata import read_metadata
    from gns.data.shard import Shard

    if path.is_dir() or not path.exists():
        splits = read_metadata(path).splits
        return [(split, Shard(path / one.file)) for split, many in splits.items() for one in many]
    return [(path.stem.rpartition("_")[0], Shard(path))]


def _find(path: Path, shards: list[tuple[str, Shard]], number: int) -> tuple[str, Shard, str]:
    for split, shard in shards:
        if number in shard.run_numbers:
            return split, shard, _template(shard, number)
    known = sorted(run for _, shard in shards for run in shard.run_numbers)
    held = f"{len(known)} runs, {known[0]} to {known[-1]}" if known else "none"
    raise InputError(f"{path}: no run {number}; it holds {held}")


def _numbers(shards: list[tuple[str, Shard]]) -> Iterator[RunNumbers]:
    """Of every run, from its first and last frame."""
    from report.pictures.packed_data import numbers_of

    for split, shard in shards:
        for number in shard.run_numbers:
            frames = shard.shape(number)[0]
            first = shard.positions(number, 0, 1)[0]
            last = shard.positions(number, frames - 1, frames)[0]
            facts = shard.facts(number)
            yield numbers_of(split, _template(shard, number), first, last, frames, facts)
        shard.close()


def _template(shard: Shard, number: int) -> str:
    """Letter of a run's template, from its scene."""
    import json

    return (json.loads(shard.scene(number)).get("origin") or {}).get("template", "")
