"""`flowslide invert CASE`: the back-analysis of a case folder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import add_common

if TYPE_CHECKING:
    from inversion.back_analysis.back_analysis import BackAnalysis
    from inversion.back_analysis.case import InversionCase
    from inversion.engines.registry import Choice
    from inversion.engines.run_store import RunStore
    from pipeline.config import Config


DESCRIPTION = (
    "Find the strengths that CASE/inversion.yaml asks for, how sure they are, and "
    "what every other assumption does to them. Started again after a kill, it goes on where it "
    "stopped."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder of the results; default: results/<case>/inversion, with the engine gns "
        "inversion_gns beside it",
    )
    parser.add_argument(
        "--engine",
        choices=("mpm", "gns"),
        help="material point method, or a learned simulator that is differentiated; default: the "
        "question's, else inversion.engine",
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
    options.add_device(parser)
    options.add_effects(parser)
    options.add_measurements_code(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Find the answer, write it, print it."""
    from geometry.case import load_case
    from inversion.back_analysis.case import inversion_case
    from inversion.back_analysis.result_files import save_all
    from inversion.engines.registry import FOLDERS, chosen_engine
    from inversion.engines.run_store import RunStore
    from pipeline.batch_bar import BatchBar
    from report.back_analysis.summary import summary

    config = _config(arguments)
    case = inversion_case(
        load_case(arguments.case, config),
        measurement_set=arguments.set_of_measurements,
        spacing_m=arguments.spacing,
        use_constructed=arguments.use_constructed,
    )
    choice = chosen_engine(case, arguments.engine, arguments.model)
    beside = Path(config.results_folder) / case.name
    folder = Path(arguments.out or beside / FOLDERS[choice.name])
    store = RunStore(
        folder / "runs",
        device=arguments.device,
        threads=arguments.threads,
        on_run=BatchBar(quiet=arguments.quiet),
    )

    def say(line: str) -> None:
        if not arguments.quiet:
            print(line, file=sys.stderr, flush=True)

    analysis = _analysis(choice, case, store, say, folder, arguments)
    result = analysis.run()
    result = save_all(analysis, result, folder)
    print(summary(result))
    if arguments.report != "none":
        from report.back_analysis.page import write_report  # matplotlib takes its time

        write_report(folder, case.folder, film=arguments.report == "film")
    say(f"wrote {folder}")
    return 0


def _analysis(
    choice: Choice,
    case: InversionCase,
    store: RunStore,
    say: Callable[[str], None],
    folder: Path,
    arguments: argparse.Namespace,
) -> BackAnalysis:
    """The back-analysis with the engine that was chosen."""
    if choice.name == "mpm":
        from inversion.back_analysis.back_analysis import BackAnalysis

        return BackAnalysis(case, store, say)
    from inversion.back_analysis.with_learned_simulator import SurrogateAnalysis
    from inversion.engines.gns_engine import prepare  # torch takes its time
    from inversion.engines.rollout_store import RolloutStore
    from inversion.engines.trained_model import load_model
    from pipeline.batch_bar import BatchBar

    prepare(arguments.device, arguments.threads)
    return SurrogateAnalysis(
        case,
        store,
        say,
        model=load_model(choice.model, arguments.device),
        rollouts=RolloutStore(folder / "rollouts"),
        on_frame=BatchBar(quiet=arguments.quiet, label="rolling out"),
    )


def _config(arguments: argparse.Namespace) -> Config:
    from pipeline.config import load_config

    overrides = list(arguments.overrides)
    if arguments.method is not None:
        overrides.append(f"inversion.method={arguments.method}")
    if arguments.quick:
        overrides += [
            "inversion.starts=1",
            "inversion.noise_seeds=0",
            "inversion.variants=false",
            "inversion.sensitivities=false",
        ]
    return load_config(arguments.config, overrides)
