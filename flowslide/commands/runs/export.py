"""`flowslide runs export`: runs for ParaView, or as tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import InputError

DESCRIPTION = "Write runs for ParaView (vtkhdf) or as tables (csv)."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "file", metavar="FILE[:RUN]", help="trajectory file; with several runs, --out is a folder"
    )
    parser.add_argument("--format", choices=("vtkhdf", "csv"), required=True)
    options.add_out(
        parser, "file to write, or folder for several runs", metavar="FILE", required=True
    )
    parser.add_argument(
        "--times",
        type=options.numbers,
        metavar="S,S,...",
        help="csv only: positions at these moments [s] instead of the whole state at the end",
    )


def run(arguments: argparse.Namespace) -> None:
    """Write them."""
    from mpm_taichi.export import export_csv, export_vtkhdf
    from mpm_taichi.trajectory import file_and_run, group_name, list_runs, read_run
    from mpm_taichi.trajectory3d import is_run_3d, read_run_3d

    if arguments.format == "vtkhdf" and arguments.times is not None:
        raise InputError("--times: is for --format csv; a vtkhdf file holds every frame")
    write = export_vtkhdf if arguments.format == "vtkhdf" else export_csv
    if is_run_3d(arguments.file):
        if arguments.times is not None:
            raise InputError("--times: not in three dimensions")
        write(read_run_3d(Path(arguments.file)), arguments.out)
        print(f"wrote {arguments.out}")
        return
    path, index = file_and_run(arguments.file)
    indices = [run.index for run in list_runs(path)] if index is None else [index]
    for number in indices:
        out = Path(arguments.out)
        if len(indices) > 1:
            out = out / f"{group_name(number)}.{arguments.format}"
        chosen = read_run(path, number)
        if len(indices) > 1 and chosen.frames == 0:
            print(f"{group_name(number)}: no frames ({chosen.reason})", file=sys.stderr)
            continue
        if arguments.format == "vtkhdf":
            export_vtkhdf(chosen, out)
        else:
            export_csv(chosen, out, times=arguments.times)
        print(f"wrote {out}")
