"""`flowslide predict CASE --residual-strength 18+-5`: how far such a slide would run.

With `--posterior` in place of strengths: those that `flowslide posterior` has drawn. With
`--from-blow-counts`: what published relations say without a fit.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Literal

from flowslide.commands import options

OPTION = "--residual-strength"
KINDS: tuple[Literal["lognormal", "normal"], ...] = ("lognormal", "normal")
FROM_COUNTS = "--from-blow-counts"
FROM_POSTERIOR = "--posterior"
OF_STRENGTHS = ("distribution", "samples", "seeds")
"""Options that belong to strengths that are given."""


DESCRIPTION = (
    "The distribution of the runout that follows from the distribution of the "
    "residual strength: exceedance curve, envelope of the final sections, table. Or, from the "
    "blow counts of the layers: what published relations predict without a fit. Of a scene3d.yaml "
    "in three dimensions: readings of the deposit, and maps of the probability that it is thicker "
    "than stated."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    asked = parser.add_mutually_exclusive_group(required=True)
    asked.add_argument(
        OPTION, dest="strengths", metavar="MEAN+-STD", action="append",
        help="kPa, such as 18+-5; of some zones: 1,6=4+-1; may be repeated",
    )  # fmt: skip
    asked.add_argument(
        FROM_POSTERIOR, metavar="DIR",
        help="strengths as `flowslide posterior` has drawn them: its folder, or a file in it",
    )  # fmt: skip
    asked.add_argument(
        FROM_COUNTS, action="store_true",
        help="strengths from CASE/blow_counts.yaml by five published relations, each with its "
        "scatter",
    )  # fmt: skip
    parser.add_argument(
        "--zones", metavar="NAMES", help="zones of a single strength, such as 1,6; default: those "
        "whose strength inversion.yaml seeks, else the liquefied ones. From blow counts: zones "
        "that liquefy, those of the scene among them",
    )  # fmt: skip
    parser.add_argument("--distribution", choices=KINDS, help=f"default: {KINDS[0]}")
    parser.add_argument("--samples", type=int, metavar="N", help="default: 20000")
    parser.add_argument(
        "--seeds", type=int, metavar="N",
        help="jitter seeds that measure the numerical noise; 0: none. Default: 3",
    )  # fmt: skip
    parser.add_argument(
        "--thicker-than", type=options.numbers, default=[], metavar="M,...",
        help="in 3-D: thicknesses [m] whose probability is mapped; default: that of a deposit",
    )  # fmt: skip
    options.add_engine(parser)
    options.add_spacing(parser)
    options.add_out(
        parser,
        "default: results/<case>/prediction, of another engine prediction_direct, of a "
        "scene3d.yaml prediction_3d, with mpm3d prediction_over_width",
    )
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Predict, write, print."""
    from flowslide import api
    from inversion.engines.registry import engine_named
    from pipeline.cli import InputError
    from pipeline.config import load_config
    from pipeline.progress import Progress

    # A section next to its scene3d.yaml is predicted as a section, unless the file is named.
    if options.is_3d(arguments.case) and not (Path(arguments.case) / "scene.yaml").is_file():
        _run_3d(arguments)
        return
    if arguments.thicker_than:
        raise InputError("--thicker-than: only in three dimensions, of a scene3d.yaml")
    chosen = {
        name: getattr(arguments, name)
        for name in OF_STRENGTHS
        if getattr(arguments, name) is not None
    }
    if arguments.from_blow_counts:
        for name in chosen:
            raise InputError(f"--{name}: belongs to {OPTION}; {FROM_COUNTS} has none")
    if arguments.posterior is not None and "distribution" in chosen:
        raise InputError(f"--distribution: belongs to {OPTION}; {FROM_POSTERIOR} has its own")
    zones = [zone.strip() for zone in (arguments.zones or "").split(",") if zone.strip()]
    settings = load_config(arguments.config, arguments.overrides)
    case = api.load_case(arguments.case, settings=settings)
    engine = engine_named(arguments.engine)
    own = "prediction_over_width" if engine.name == "mpm3d" else f"prediction{engine.suffix}"
    folder = Path(arguments.out or Path(settings.results_folder) / case.name / own)
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        shared = {
            "out": folder, "zones": zones, "spacing_m": arguments.spacing,
            "device": arguments.device, "threads": arguments.threads, "progress": bar.report,
            "engine": arguments.engine,
        }  # fmt: skip
        if arguments.from_blow_counts:
            from report.from_blow_counts import summary

            document = api.predict_from_blow_counts(case, **shared)
        else:
            from report.prediction import summary

            document = api.predict(
                case, arguments.strengths or (), posterior=arguments.posterior,
                **chosen, **shared,
            )  # fmt: skip
        bar.say(f"wrote {folder}")
    print(summary(document))


def _run_3d(arguments: argparse.Namespace) -> None:
    from flowslide import api
    from pipeline.config import load_config
    from pipeline.progress import Progress
    from report.prediction3d import summary

    refused = {
        FROM_COUNTS: arguments.from_blow_counts,
        "--seeds": arguments.seeds is not None,
        f"--engine {arguments.engine}": arguments.engine not in ("mpm", "mpm3d"),
        "--distribution with --posterior": arguments.posterior and arguments.distribution,
    }
    options.refuse_in_3d(arguments, refused)
    settings = load_config(arguments.config, arguments.overrides)
    name = options.name_3d(arguments.case)
    folder = Path(arguments.out or Path(settings.results_folder) / name / "prediction_3d")
    with Progress(0, name, quiet=arguments.quiet) as bar:
        found = api.predict_3d(
            arguments.case,
            arguments.strengths or (),
            posterior=arguments.posterior,
            out=folder,
            zones=[zone.strip() for zone in (arguments.zones or "").split(",") if zone.strip()],
            distribution=arguments.distribution or KINDS[0],
            thicker_than_m=arguments.thicker_than,
            samples=arguments.samples or 20_000,
            spacing_m=arguments.spacing,
            settings=settings,
            threads=arguments.threads,
            progress=bar.report,
        )
        bar.say(f"wrote {folder}")
    print(summary(found.document))
