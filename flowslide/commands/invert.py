"""`flowslide invert CASE`: the back-analysis of a case, or of a scene in three dimensions."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options

DESCRIPTION = (
    "Find the strengths that CASE/inversion.yaml asks for, how sure they are, and "
    "what every other assumption does to them. Of a scene3d.yaml: from the map of what the slide "
    "left, CASE/measurements3d.yaml. Started again after a kill, it goes on where it stopped."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from inversion.engines.registry import engines

    options.add_case(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder of the results; default: results/<case>/inversion, with the engine gns "
        "inversion_gns next to it",
    )
    parser.add_argument(
        "--engine",
        choices=tuple(engines()),
        help="material point method, a learned simulator that is differentiated, the material "
        "point method over the width of CASE/scene3d.yaml, or a learned model in one pass; "
        "default: the question's, else inversion.engine",
    )
    parser.add_argument(
        "--model", metavar="DIR", help="of the engine gns: a folder, or a name in models/"
    )
    options.add_set_of_measurements(parser)
    options.add_spacing(parser)
    parser.add_argument(
        "--method", choices=("gauss_newton", "lbfgsb"), help="default: inversion.method"
    )
    parser.add_argument(
        "--use-constructed", action="store_true", help="let constructed data enter the fit"
    )
    parser.add_argument(
        "--quick", action="store_true", help="the answer alone: one start, no variants, no seeds"
    )
    parser.add_argument(
        "--report",
        choices=("film", "page", "none"),
        default="film",
        help="report.html with pictures and a film, without a new film, or none; default: film",
    )
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Find the answer, write it, print it."""
    from flowslide import api
    from flowslide.run import Call
    from pipeline.config import load_config
    from pipeline.progress import Progress

    settings = load_config(arguments.config, arguments.overrides)
    asked = api.load_question(
        arguments.case,
        settings=settings,
        method=arguments.method,
        quick=arguments.quick,
        measurement_set=arguments.set_of_measurements,
        spacing_m=arguments.spacing,
        use_constructed=arguments.use_constructed,
    )
    # What takes a second to import waits: a fault of the question is reported at once.
    from report.back_analysis import summary
    from report.data.back_analysis import load_back_analysis

    choice = api.choose_engine(asked, arguments.engine, arguments.model)
    own = "inversion_on_maps" if asked.dimensions == 3 else choice.engine.folder
    folder = Path(arguments.out or Path(settings.results_folder) / asked.name / own)
    with Progress(0, asked.title, quiet=arguments.quiet) as bar:
        run = Call(progress=bar.report, device=arguments.device, threads=arguments.threads)
        result = api.answer(asked, choice, folder, run, report=arguments.report)
        bar.say(f"wrote {folder}")
    print(summary(load_back_analysis(folder, asked, result)))
