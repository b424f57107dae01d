"""`flowslide new`: a folder for a dam of your own, from a drawn section and a survey."""

from __future__ import annotations

import argparse
import shlex

from flowslide.commands import options
from flowslide.commands.check import measurements_beside, print_doubts, print_ends

CASES = "case_histories"
DESCRIPTION = (
    "Make a commented, working case folder from a section (CSV, GeoJSON, DXF, FLAC2D) and, where "
    "it has slid, a measured runout or a surveyed profile. docs/start/your-own-case.md shows how."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "case",
        metavar="NAME",
        help=f"name of the case, made in {CASES}/; or a folder, recognised by a slash in it",
    )
    known = parser.add_mutually_exclusive_group(required=True)
    known.add_argument("--section", metavar="FILE", help="the drawing")
    known.add_argument(
        "--dimensions",
        metavar="FILE",
        help="a few numbers of a slide that nobody drew: height, slope, ..., runout; the options "
        "of a drawing do not go with it",
    )
    parser.add_argument(
        "--format",
        choices=("csv", "geojson", "dxf", "f2grid", "gsz"),
        help="of the drawing; default: from its suffix",
    )
    options.add_drawing(parser)
    options.add_spacing(parser, "height / 25")
    parser.add_argument(
        "--liquefied",
        action="append",
        default=[],
        metavar="ZONE",
        help="a zone whose S_r is unknown, may be repeated; in addition to those the drawing marks",
    )
    parser.add_argument("--water-level", type=float, metavar="Y", help="pool or water table, m")
    parser.add_argument(
        "--runout",
        action="append",
        default=[],
        metavar="SIDE=M",
        help="measured runout of the toe, such as left=53 or left=53+-6; may be repeated",
    )
    parser.add_argument("--profile", metavar="FILE", help="surveyed surface: CSV with x_m, y_m")
    parser.add_argument(
        "--profile-std", type=float, default=0.5, metavar="M", help="of the survey, m; default 0.5"
    )
    parser.add_argument(
        "--upstream", choices=("left", "right"), default="left", help="default: left"
    )


def run(arguments: argparse.Namespace) -> None:
    """Make the folder, check it as a back-analysis would, and say what comes next."""
    if arguments.dimensions is not None:
        _from_dimensions(arguments)
    else:
        _from_drawing(arguments)


def _from_dimensions(arguments: argparse.Namespace) -> None:
    from inversion.new_case.from_dimensions import case_of_dimensions, distribution_words

    _refuse_options_of_drawings(arguments)
    made = case_of_dimensions(arguments.case, arguments.dimensions, arguments.spacing)
    print(f"wrote {made.folder}: a family of sections, {len(made.dimensions)} unknown dimensions")
    for one in made.dimensions:
        print(f"  {one.label}: {distribution_words(one)} ({one.source})")
    for line in made.doubts:
        print(f"  doubtful: {line}")
    print_doubts(made.scene)
    typed = shlex.quote(str(made.folder))
    print("Next:")
    print(f"  flowslide show {typed} --out {made.folder.name}.png")
    print(f"  flowslide posterior {typed}")


def _refuse_options_of_drawings(arguments: argparse.Namespace) -> None:
    """An option of a drawing would change nothing of a slide that nobody drew."""
    from pipeline.cli import InputError

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    defaults = vars(parser.parse_args(["x", "--section", "x"]))
    for name in defaults.keys() - {"case", "section", "dimensions", "spacing"}:
        if getattr(arguments, name) != defaults[name]:
            option = name.replace("_", "-")
            raise InputError(f"--{option}: belongs to a drawing, not to --dimensions")


def _from_drawing(arguments: argparse.Namespace) -> None:
    from pathlib import Path

    from geometry.case import SCENE_FILE
    from inversion.new_case.make_case import Given, make_case

    made = make_case(
        arguments.case,
        Given(
            section=arguments.section,
            format=arguments.format,
            materials=arguments.materials,
            unit=arguments.unit,
            snap=arguments.snap,
            spacing_m=arguments.spacing,
            liquefied=arguments.liquefied,
            water_level=arguments.water_level,
            runouts=arguments.runout,
            profile=arguments.profile,
            profile_std_m=arguments.profile_std,
            upstream=arguments.upstream,
            ends=options.ends_of(arguments),
        ),
    )
    folder = made.folder
    for line in made.read:
        print(line)
    ran = ", ".join(f"{r.side} {r.value_m:g} +- {r.std_m:.2g} m" for r in made.runouts)
    ran = f"runout {ran}" if ran else "no slide was measured"
    print(f"wrote {folder}: {len(made.scene.zones)} zones; {ran}")
    print_ends(made.scene)
    print_doubts(made.scene, measurements_beside(folder / SCENE_FILE, made.scene))
    print("It works as it is; lines with FILL IN wait for what only you know. Next:")
    typed = shlex.quote(str(folder))
    print(f"  flowslide check {typed}")
    print(f"  flowslide show {typed} --out {folder.name}.png")
    if not made.runouts:
        print(f"  flowslide simulate {typed}")
        if any(soil.liquefied for soil in made.scene.materials.values()):
            print(f"  flowslide predict {typed} --residual-strength MEAN+-STD")
        return
    print(f"  flowslide invert {typed} --quick")
    if folder.resolve().parent == Path(CASES).resolve():
        print(f"  snakemake -c 2 answer_{folder.name}")
