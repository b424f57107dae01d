"""`flowslide posterior CASE`: the whole posterior of a case folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options

DESCRIPTION = (
    "Everything that CASE/inversion.yaml leaves unknown, before and after the measurements: the "
    "strengths with all sensitivities as nuisances, by an emulator of many coarse and a few fine "
    "simulations and a nested sampler. Started again after a kill, it goes on where it stopped."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    options.add_out(
        parser,
        "default: results/<case>/posterior, of another engine posterior_direct, ..., of a "
        "scene3d.yaml posterior_on_maps",
    )
    options.add_engine(parser, default=None)
    options.add_set_of_measurements(parser)
    options.add_spacing(parser)
    parser.add_argument(
        "--use-constructed", action="store_true", help="let constructed data enter the fit"
    )
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Find the posterior, write it, print it."""
    from flowslide import api
    from inversion.engines.registry import MPM, engine_named
    from pipeline.config import load_config
    from pipeline.progress import Progress
    from report.posterior import summary

    settings = load_config(arguments.config, arguments.overrides)
    asked = api.load_question(
        arguments.case,
        settings=settings,
        measurement_set=arguments.set_of_measurements,
        spacing_m=arguments.spacing,
        use_constructed=arguments.use_constructed,
    )
    own = f"posterior{engine_named(arguments.engine or MPM.name).suffix}"
    own = "posterior_on_maps" if asked.dimensions == 3 else own
    folder = Path(arguments.out or Path(settings.results_folder) / asked.name / own)
    with Progress(0, asked.title, quiet=arguments.quiet) as bar:
        document = api.posterior(
            asked,
            out=folder,
            engine=arguments.engine,
            device=arguments.device,
            threads=arguments.threads,
            progress=bar.report,
        )
        bar.say(f"wrote {folder}")
    print(summary(document))
