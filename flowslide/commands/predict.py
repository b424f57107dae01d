"""`flowslide predict CASE --residual-strength 18+-5`: how far such a slide would run.

With `--posterior` in place of strengths: those that `flowslide posterior` has drawn; with `--joint`
the ratio that `flowslide joint` has from other slides. With
`--from-blow-counts`: what published relations say without a fit.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from flowslide.commands import options

OPTION, RATIO_OPTION = "--residual-strength", "--strength-ratio"
KINDS: tuple[Literal["lognormal", "normal"], ...] = ("lognormal", "normal")
FROM_COUNTS = "--from-blow-counts"
FROM_POSTERIOR, FROM_JOINT = "--posterior", "--joint"
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
        OPTION,
        dest="strengths",
        metavar="MEAN+-STD",
        action="append",
        help="kPa, such as 18+-5; of some zones: 1,6=4+-1; may be repeated",
    )
    asked.add_argument(
        RATIO_OPTION,
        dest="ratios",
        metavar="MEAN+-STD",
        action="append",
        help="strength over the vertical effective stress before failure, such as 0.12+-0.03; of "
        "some zones: 1,6=0.1+-0.02; may be repeated",
    )
    asked.add_argument(
        FROM_POSTERIOR,
        metavar="DIR",
        help="strengths as `flowslide posterior` has drawn them: its folder, or a file in it",
    )
    asked.add_argument(
        FROM_JOINT,
        metavar="DIR",
        help="a strength ratio as `flowslide joint` has it from other slides: its folder, or "
        "joint.json",
    )
    asked.add_argument(
        FROM_COUNTS,
        action="store_true",
        help="strengths from CASE/blow_counts.yaml by five published relations, each with its "
        "scatter",
    )
    parser.add_argument(
        "--zones",
        metavar="NAMES",
        help="zones of a single strength, such as 1,6; default: those "
        "whose strength inversion.yaml seeks, else the liquefied ones. From blow counts: zones "
        "that liquefy, those of the scene among them",
    )
    parser.add_argument("--distribution", choices=KINDS, help=f"default: {KINDS[0]}")
    parser.add_argument("--samples", type=int, metavar="N", help="default: 20000")
    parser.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        help="jitter seeds that measure the numerical noise; 0: none. Default: 3",
    )
    parser.add_argument(
        "--thicker-than",
        type=options.numbers,
        default=[],
        metavar="M,...",
        help="in 3-D: thicknesses [m] whose probability is mapped; default: that of a deposit",
    )
    parser.add_argument(
        "--through",
        type=float,
        metavar="X",
        help="in 2-D: x [m] of the line through which the released volume is told over time; "
        "default: the foot of the side to which it slides. In 3-D: the lines of the scene3d.yaml",
    )
    options.add_engine(parser, default=None)
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
    from geometry.scenes3d.scene3d import is_body
    from inversion.engines.registry import engine_named
    from pipeline.cli import InputError
    from pipeline.config import load_config
    from pipeline.progress import Progress

    body = is_body(arguments.case)
    refused = {FROM_COUNTS: arguments.from_blow_counts}
    if body:
        options.refuse_in_3d(arguments, refused)
    chosen = {
        name: getattr(arguments, name)
        for name in OF_STRENGTHS
        if getattr(arguments, name) is not None
    }
    if arguments.from_blow_counts:
        if arguments.through is not None:
            raise InputError(f"--through: not with {FROM_COUNTS}")
        for name in chosen:
            raise InputError(f"--{name}: is of strengths that are given; {FROM_COUNTS} has none")
    for option, given in ((FROM_POSTERIOR, arguments.posterior), (FROM_JOINT, arguments.joint)):
        if given is not None and "distribution" in chosen:
            raise InputError(
                f"--distribution: is of strengths that are given; {option} has its own"
            )
    settings = load_config(arguments.config, arguments.overrides)
    case = arguments.case if body else api.load_case(arguments.case, settings=settings)
    name = options.name_3d(arguments.case) if body else case.name
    engine = engine_named(arguments.engine or "mpm")
    own = "prediction_over_width" if engine.name == "mpm3d" else f"prediction{engine.suffix}"
    own = "prediction_3d" if body else own
    folder = Path(arguments.out or Path(settings.results_folder) / name / own)
    with Progress(0, name if body else case.title, quiet=arguments.quiet) as bar:
        shared = {
            "out": folder,
            "zones": [zone.strip() for zone in (arguments.zones or "").split(",") if zone.strip()],
            "spacing_m": arguments.spacing,
            "device": arguments.device,
            "threads": arguments.threads,
            "settings": settings,
            "progress": bar.report,
        }
        if arguments.from_blow_counts:
            document = api.predict_from_blow_counts(case, engine=engine.name, **shared)
        else:
            document = api.predict(
                case,
                arguments.strengths or (),
                ratios=arguments.ratios or (),
                posterior=arguments.posterior,
                joint=arguments.joint,
                engine=arguments.engine,
                thicker_than_m=arguments.thicker_than,
                through_m=arguments.through,
                **chosen,
                **shared,
            )
        bar.say(f"wrote {folder}")
    print(_summary(arguments, body)(document))


def _summary(arguments: argparse.Namespace, body: bool) -> Callable[[dict[str, Any]], str]:
    """What is printed of a document."""
    if arguments.from_blow_counts:
        from report import from_blow_counts

        return from_blow_counts.summary
    if body:
        from report import prediction3d

        return prediction3d.summary
    from report import prediction

    return prediction.summary
