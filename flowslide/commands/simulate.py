"""`flowslide simulate`: a case history, next to what was measured."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import add_common

if TYPE_CHECKING:
    from collections.abc import Sequence

    from geometry.case import Case
    from mpm_taichi.comparison import Reading
    from mpm_taichi.trajectory import Run

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
    options.add_device(parser)
    options.add_effects(parser)
    options.add_measurements_code(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, write, print."""
    from geometry.case import load_case
    from mpm_taichi import comparison
    from pipeline.config import load_config
    from pipeline.out_folder import ready_folder
    from pipeline.progress import Progress
    from report.pictures.video import check_video

    config = load_config(arguments.config, arguments.overrides)
    case = load_case(arguments.case, config).with_set(arguments.set_of_measurements)
    case = case.resolved(spacing_m=arguments.spacing)
    case = case.changed(water=not arguments.no_water, strengths=dict(arguments.strength))
    out = Path(arguments.out or Path(config.results_folder) / case.name / "simulation")
    film = None if arguments.film == "none" else out / f"runout.{arguments.film}"
    if film is not None:
        check_video(film)
    files = ["runout.png", "observables.csv"]
    ready_folder(out, files if film is None else [*files, film.name])
    seconds = max(round(case.simulation.duration_s), 1)
    with Progress(
        seconds, f"simulating {case.title}, s of motion", quiet=arguments.quiet
    ) as progress:
        run = comparison.simulate_case(
            case,
            device=arguments.device,
            threads=arguments.threads,
            on_time=lambda time: progress.advance(max(min(int(time), seconds) - progress.done, 0)),
        )
        progress.advance(seconds - progress.done, note=f"ended at {run.time[-1]:.1f} s")
    readings = comparison.read_deposit(case, run)
    _write(case, run, readings, out, film)
    print(comparison.heading(case, run), comparison.table(case, readings), sep="\n\n")
    print(comparison.energy_line(run))
    print(f"Picture: {out / 'runout.png'}; numbers: {out / 'observables.csv'}", end="")
    print(f"; film: {film}" if film else "")


def _write(case: Case, run: Run, readings: Sequence[Reading], out: Path, film: Path | None) -> None:
    from mpm_taichi.comparison import write_observables
    from report.pictures.case_history import save_case_film, save_case_picture

    save_case_picture(case, run, readings, out / "runout.png")
    if film is not None:
        save_case_film(case, run, film)
    write_observables(out / "observables.csv", readings)


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
