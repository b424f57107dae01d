"""`flowslide invert CASE`: the back-analysis of a case folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options

DESCRIPTION = (
    "Find the strengths that CASE/inversion.yaml asks for, how sure they are, and "
    "what every other assumption does to them. Started again after a kill, it goes on where it "
    "stopped."
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
        "point method over the width of CASE/scene3d.yaml, a learned model in one pass, or coarse "
        "runs with a learned correction; default: the question's, else inversion.engine",
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
    from inversion.back_analysis.case import inversion_case
    from pipeline.config import load_config
    from pipeline.progress import Progress, Watch

    settings = load_config(arguments.config, arguments.overrides)
    case = inversion_case(
        api.with_choices(
            api.load_case(arguments.case, settings=settings), arguments.method, arguments.quick
        ),
        measurement_set=arguments.set_of_measurements,
        spacing_m=arguments.spacing,
        use_constructed=arguments.use_constructed,
    )
    # What takes a second to import waits: a fault of the question is reported at once.
    from inversion.back_analysis.by_engine import chosen_engine
    from report.back_analysis import summary, write_report
    from report.data.back_analysis import load_back_analysis

    choice = chosen_engine(case, arguments.engine, arguments.model)
    results = Path(case.config.results_folder) / case.name
    folder = Path(arguments.out or results / choice.engine.folder)
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        result = api.answer(
            case, choice, folder, Watch(bar.report),
            device=arguments.device, threads=arguments.threads,
        )  # fmt: skip
        data = load_back_analysis(folder, case, result)
        if arguments.report != "none":
            bar.report(bar.done, bar.total, "writing the report")
            write_report(data, film=arguments.report == "film")
        bar.say(f"wrote {folder}")
    print(summary(data))
