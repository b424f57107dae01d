"""`flowslide runs show`: a run as a picture or a film."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import InputError

COLOURS = ("displacement", "plastic_strain", "speed", "material")
FIELDS = ("positions", "time", "material", "velocity", "plastic_shear_strain", "kinematic")
DESCRIPTION = "Draw a run: a picture (png, svg, pdf) or an animation (mp4, gif)."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("file", metavar="FILE[:RUN]", help="trajectory file and number of the run")
    options.add_out(parser, "file to write; its suffix says what", metavar="FILE", required=True)
    parser.add_argument("--colour", choices=COLOURS, default=COLOURS[0])
    parser.add_argument(
        "--times",
        type=options.numbers,
        metavar="S,S,...",
        help="moments of a picture [s]; default: end",
    )
    parser.add_argument(
        "--frames",
        type=options.positive,
        default=150,
        help="most frames of an animation; default: 150",
    )


def run(arguments: argparse.Namespace) -> None:
    """Draw it."""
    from mpm_taichi.trajectory import read_run, run_named
    from report.pictures import simulated_run

    path, index = run_named(arguments.file)
    chosen = read_run(path, index, FIELDS)
    out = Path(arguments.out)
    if out.suffix in simulated_run.VIDEO_SUFFIXES:
        if arguments.times is not None:
            raise InputError(f"--times: is for pictures, and {out} is an animation")
        simulated_run.save_animation(chosen, out, colour=arguments.colour, frames=arguments.frames)
    else:
        simulated_run.save_picture(chosen, out, colour=arguments.colour, times=arguments.times)
    print(f"wrote {out}")
