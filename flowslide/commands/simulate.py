"""`flowslide simulate`: a case history, next to what was measured."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from flowslide.commands import options

if TYPE_CHECKING:
    from pipeline.config import Config

FILMS = ("mp4", "gif", "none")
DESCRIPTION = (
    "Simulate the section of a case history, write runout.png, a film and observables.csv, and "
    "print what was measured next to what was simulated. A scene3d.yaml is "
    "simulated in three dimensions: report.html, map.png, film, readings.csv, GeoTIFFs, run.h5."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    options.add_out(
        parser, "folder of the results; default: results/<case>/simulation, in 3-D simulation_3d"
    )
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
    parser.add_argument(
        "--film", choices=FILMS, help="default: mp4, or gif without the extra video"
    )
    options.add_simulating(parser)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, write, print."""
    from flowslide import api
    from geometry.scenes3d.scene3d import FILE_NAME as BODY_FILE
    from geometry.scenes3d.scene3d import is_body
    from mpm_taichi import comparison
    from pipeline.config import load_config
    from pipeline.progress import Progress

    settings = load_config(arguments.config, arguments.overrides)
    if is_body(arguments.case):
        _run_3d(arguments, settings)
        return
    film = arguments.film or _default_film()
    case = api.load_case(arguments.case, settings=settings)
    out = Path(arguments.out or Path(settings.results_folder) / case.name / "simulation")
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        done = api.simulate(
            case,
            out=out,
            film=film,
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
    if water := comparison.water_line(done.run):
        print(water)
    if (beside := case.folder / BODY_FILE).is_file():
        print(f"In three dimensions: flowslide simulate {beside}")
    print(f"Picture: {out / 'runout.png'}; numbers: {out / 'observables.csv'}", end="")
    print("" if film == "none" else f"; film: {out / 'runout'}.{film}")


def _default_film() -> Literal["mp4", "gif"]:
    from pipeline.extras import has

    return "mp4" if has("video") else "gif"


def _run_3d(arguments: argparse.Namespace, settings: Config) -> None:
    from flowslide import api
    from mpm_taichi.readings3d import named
    from pipeline.progress import Progress
    from report.simulation3d import warning

    refused = {
        "--set-of-measurements": arguments.set_of_measurements,
    }
    options.refuse_in_3d(arguments, refused)
    name = options.name_3d(arguments.case)
    out = Path(arguments.out or Path(settings.results_folder) / name / "simulation_3d")
    with Progress(0, name, quiet=arguments.quiet) as bar:
        done = api.simulate_3d(
            arguments.case,
            out=out,
            film=arguments.film or _default_film(),
            strengths_kpa=dict(arguments.strength),
            water=not arguments.no_water,
            spacing_m=arguments.spacing,
            settings=settings,
            threads=arguments.threads,
            progress=bar.report,
        )
    for quantity, value in done.readings.items():
        words, unit = named(quantity)
        print(f"{words:<32}{value:>12.5g} {unit}")
    if doubt := warning(done.walls, done.readings):
        print(doubt)
    print(f"Page: {out / 'report.html'}; map: {out / 'map.png'}; run: {out / 'run.h5'}")


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
