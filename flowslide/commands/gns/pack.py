"""`flowslide gns pack`: trajectory files -> packed data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from gns.data.metadata import Metadata
    from gns.data.pack import PackingPlan
    from pipeline.config import Config

FORMATS = ("npz", "geoelements")


DESCRIPTION = (
    "Pack trajectory files into shards, split by run, with their statistics. "
    "Started again after a kill, it keeps the shards that are whole."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "files", nargs="*", metavar="FILE", help="trajectory files; default: all of --scale"
    )
    options.add_scale(parser, "the scale that the runs are of")
    options.add_out(parser, "default: RESULTS/SCALE/dataset")
    parser.add_argument(
        "--leave-out",
        metavar="FILE",
        help="list of runs to leave out, such as failed.txt; failed runs are left out anyway",
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default="npz",
        help="npz: ours (default); geoelements: for other GNS codes, read with pickles",
    )
    parser.add_argument(
        "--properties",
        choices=("both", "friction"),
        help="geoelements only: tan phi and c/100 kPa (default), or tan phi alone",
    )
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Pack, and print what there is now."""
    from gns.data.pack import pack, plan_packing
    from gns.data.trajectories import read_left_out
    from pipeline.config import load_config
    from pipeline.manifest import manifest
    from pipeline.progress import Progress

    if arguments.properties is not None and arguments.format != "geoelements":
        raise InputError(
            "--properties: is for --format geoelements; our own layout has all of them"
        )
    config = load_config(arguments.config, arguments.overrides)
    files, out = _places(arguments, config)
    settings = config.gns.pack
    left_out = read_left_out(arguments.leave_out) if arguments.leave_out else {}
    plan = plan_packing(files, settings, left_out)
    found = plan.sources[0].alike["scale"]
    if arguments.scale is not None and found != arguments.scale:
        raise InputError(
            f"{plan.sources[0].path}: its runs are of the scale {found or 'none'}, not of "
            f"{arguments.scale}"
        )
    label = f"packing {found or 'runs'}"
    with Progress(plan.runs, label, quiet=arguments.quiet) as progress:
        if arguments.format == "geoelements":
            from gns.data.geoelements import write_geoelements

            write_geoelements(
                plan, out, properties=arguments.properties or "both", on_run=progress.advance
            )
            print(left_out_lines(plan))
            print(f"wrote {plan.runs} runs to {out}, to be read with allow_pickle=True")
            return
        seeds = {"splits": settings.seed}
        result = pack(plan, out, _timeless(manifest(settings, seeds)), progress.advance)
    print(summary(result.metadata, out))
    print(left_out_lines(plan))
    print(f"{result.written} shards written, {result.reused} were there already: {out}")


def summary(metadata: Metadata, folder: Path) -> str:
    """The packed data, by split, as a table."""
    from pipeline.table import aligned

    rows = [["split", "runs", "by template", "points a run", "frames a run", "windows", "MB"]]
    for split, shards in metadata.splits.items():
        runs = metadata.runs(split)
        count = max(len(runs), 1)
        letters = sorted({run.template for run in runs})
        rows.append(
            [
                split,
                str(len(runs)),
                " ".join(
                    f"{letter or '-'}:{sum(run.template == letter for run in runs)}"
                    for letter in letters
                ),
                f"{sum(run.points for run in runs) / count:.0f}",
                f"{sum(run.frames for run in runs) / count:.0f}",
                str(sum(run.frames - 1 for run in runs)),
                f"{sum((folder / shard.file).stat().st_size for shard in shards) / 1e6:.1f}",
            ]
        )
    found = metadata.statistics
    speed = ", ".join(f"{value:.3f}" for value in found.velocity_std)
    change = ", ".join(f"{value:.3f}" for value in found.acceleration_std)
    return (
        f"{aligned(rows, left={0, 2})}\n"
        f"moving points: velocity std (x, y) {speed} sqrt(g d), acceleration std {change} g"
    )


def left_out_lines(plan: PackingPlan) -> str:
    """The runs that were left out, by name."""
    if not plan.left_out:
        return "no run was left out"
    return "\n".join(f"left out: run {run}: {why}" for run, why in plan.left_out.items())


def _places(arguments: argparse.Namespace, config: Config) -> tuple[list[Path], Path]:
    """The trajectory files and the folder to write to."""
    if not arguments.files and arguments.scale is None:
        raise InputError(
            "name trajectory files, or a --scale whose files are in the results folder"
        )
    files = [Path(file) for file in arguments.files]
    home = None
    if arguments.scale is not None:
        batches = config.scale(arguments.scale).number_of_batches
        home = Path(config.results_folder) / arguments.scale
        files = files or [
            home / "trajectories" / f"batch_{batch:03d}.h5" for batch in range(batches)
        ]
    if arguments.out is not None:
        return files, Path(arguments.out)
    if home is None or arguments.format != "npz":
        raise InputError("--out: say where to; only --scale in our own format has a default")
    return files, home / "dataset"


def _timeless(made: dict) -> dict:
    """The manifest without time and machine: the same input leaves the same bytes."""
    return {key: value for key, value in made.items() if key not in ("made", "machine")}
