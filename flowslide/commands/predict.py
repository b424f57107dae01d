"""`flowslide predict CASE --residual-strength 18+-5`: how far such a slide would run."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options

OPTION, KINDS = "--residual-strength", ("lognormal", "normal")


DESCRIPTION = (
    "The distribution of the runout that follows from the distribution of the "
    "residual strength: exceedance curve, envelope of the final sections, table."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    parser.add_argument(
        OPTION, dest="strengths", metavar="MEAN+-STD", action="append", required=True,
        help="kPa, such as 18+-5; of some zones: 1,6=4+-1; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--zones", metavar="NAMES", help="zones of a single strength, such as 1,6; default: those "
        "whose strength inversion.yaml seeks, else the liquefied ones",
    )  # fmt: skip
    parser.add_argument("--distribution", choices=KINDS, default=KINDS[0])
    parser.add_argument("--samples", type=int, default=20_000, metavar="N", help="default: 20000")
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N",
        help="jitter seeds that measure the numerical noise; 0: none. Default: 3",
    )  # fmt: skip
    options.add_spacing(parser)
    options.add_out(parser, "default: results/<case>/prediction")
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Predict, write, print."""
    from flowslide import api
    from pipeline.config import load_config
    from pipeline.progress import Progress
    from report.prediction import summary

    settings = load_config(arguments.config, arguments.overrides)
    case = api.load_case(arguments.case, settings=settings)
    folder = Path(arguments.out or Path(settings.results_folder) / case.name / "prediction")
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        document = api.predict(
            case,
            arguments.strengths,
            out=folder,
            zones=[zone.strip() for zone in (arguments.zones or "").split(",") if zone.strip()],
            distribution=arguments.distribution,
            samples=arguments.samples,
            seeds=arguments.seeds,
            spacing_m=arguments.spacing,
            device=arguments.device,
            threads=arguments.threads,
            progress=bar.report,
        )
        bar.say(f"wrote {folder}")
    print(summary(document))
