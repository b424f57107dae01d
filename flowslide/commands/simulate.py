"""`flowslide simulate`: a case history, next to what was measured."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options

FILMS = ("mp4", "gif", "none")
DESCRIPTION = (
    "Simulate the section of a case history, write runout.png, a film and observables.csv, and "
    "print what was measured next to what was simulated."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    options.add_out(parser, "folder of the results; default: results/<case>/simulation")
    parser.add_argument("--no-water", action="store_true", help="without reservoir and groundwater")
    options.add_spacing(parser)
    parser.add_argument(
        "--strength",
        type=_strength,
        action="append",
        default=[],
        metavar="MATERIAL=KPA",
        help="cohesion of a material, which is S_r where it liquefied; may be repeated",
    )
    options.add_set_of_measurements(parser)
    parser.add_argument("--film", choices=FILMS, default=FILMS[0], help=f"default: {FILMS[0]}")
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, write, print."""
    from flowslide import api
    from mpm_taichi import comparison
    from pipeline.config import load_config
    from pipeline.progress import Progress

    settings = load_config(arguments.config, arguments.overrides)
    case = api.load_case(arguments.case, settings=settings)
    out = Path(arguments.out or Path(settings.results_folder) / case.name / "simulation")
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        done = api.simulate(
            case,
            out=out,
            film=arguments.film,
            strengths_kpa=dict(arguments.strength),
            water=not arguments.no_water,
            spacing_m=arguments.spacing,
            measurement_set=arguments.set_of_measurements,
            device=arguments.device,
            threads=arguments.threads,
            progress=bar.report,
        )
        bar.report(bar.total, bar.total, f"ended at {done.run.time[-1]:.1f} s")
    print(
        comparison.heading(done.case, done.run),
        comparison.table(done.case, done.readings),
        sep="\n\n",
    )
    print(comparison.energy_line(done.run))
    print(f"Picture: {out / 'runout.png'}; numbers: {out / 'observables.csv'}", end="")
    print("" if arguments.film == "none" else f"; film: {out / 'runout'}.{arguments.film}")


def _strength(text: str) -> tuple[str, float]:
    """`clay_core=30` -> ("clay_core", 30.0)."""
    name, separator, value = text.partition("=")
    try:
        cohesion = float(value)
    except ValueError:
        cohesion = -1.0
    if not separator or not name or not 0.0 <= cohesion < float("inf"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not MATERIAL=KPA with a cohesion of at least 0, such as clay_core=30"
        )
    return name, cohesion
