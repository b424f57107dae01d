"""`flowslide predict CASE --residual-strength 18+-5`: how far such a slide would run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import InputError, add_common

FILE_NAME, PICTURE = "prediction.json", "prediction.png"
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
    options.add_device(parser)
    options.add_effects(parser)
    options.add_measurements_code(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Predict, write, print."""
    from geometry.case import load_case
    from inversion.engines.mpm_engine import MPMEngine
    from inversion.engines.run_store import RunStore
    from inversion.prediction.known_strength import parse_strength, placed
    from inversion.prediction.predict import envelope, predict
    from inversion.prediction.prediction_case import prediction_case
    from inversion.prediction.prediction_document import document_of, summary
    from pipeline.batch_bar import BatchBar
    from pipeline.config import load_config
    from pipeline.files import write_json
    from report.charts.prediction import save_prediction_picture

    _check(arguments)
    config = load_config(arguments.config, arguments.overrides)
    read = [parse_strength(text, arguments.distribution) for text in arguments.strengths]
    case = prediction_case(load_case(arguments.case, config), spacing_m=arguments.spacing)
    if arguments.zones is not None and read[0].zones:
        raise InputError(f"--zones: {OPTION} names its zones already")
    given = [name.strip() for name in (arguments.zones or "").split(",") if name.strip()]
    strengths = placed(read, given or case.default_zones, case.scene)
    folder = Path(arguments.out or Path(config.results_folder) / case.name / "prediction")
    store = RunStore(
        folder / "runs",
        device=arguments.device,
        threads=arguments.threads,
        on_run=BatchBar(quiet=arguments.quiet),
    )
    found = predict(
        MPMEngine(case.setup(strengths), store),
        strengths,
        jittered=[
            MPMEngine(case.setup(strengths, jitter_seed=seed), store)
            for seed in range(1, arguments.seeds + 1)
        ],
        samples=arguments.samples,
    )
    sections = envelope(found, spacing=case.scene.spacing, ground=case.ground)
    document = document_of(case, strengths, found, sections)
    write_json(folder / FILE_NAME, document)
    save_prediction_picture(case.scene, document, folder / PICTURE)
    print(summary(document))
    if not arguments.quiet:
        print(f"wrote {folder}", file=sys.stderr)
    return 0


def _check(arguments: argparse.Namespace) -> None:
    for name, least in (("samples", 100), ("seeds", 0)):
        value = getattr(arguments, name)
        if value is not None and value < least:
            raise InputError(f"--{name} {value}: at least {least}")
