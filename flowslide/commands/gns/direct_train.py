"""`flowslide gns direct-train`: runs -> a direct model, calibrated and judged."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from flowslide.commands import options
from pipeline.cli import add_common

DESCRIPTION = (
    "Learn the deposit of a section in one pass, without stepping; calibrate the intervals, judge "
    "the model on scenes it has not seen and write card.yaml next to it. Started again after a "
    "kill, it goes on where it stopped."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--data", metavar="DIR", help="default: RESULTS/direct/runs")
    options.add_out(parser, "default: RESULTS/direct/direct")
    parser.add_argument("--steps", type=int, help="default: as the models that ship")
    parser.add_argument(
        "--networks", type=int, metavar="N", default=1, help="whose mean answers; default: 1"
    )
    parser.add_argument(
        "--network",
        type=int,
        metavar="K",
        help="train the K-th of them alone, from 1, for several jobs; without, what is left",
    )
    parser.add_argument(
        "--begin-with",
        metavar="FILE",
        help="direct.pt whose weights the networks begin with, at half the rate; it may know fewer "
        "effects",
    )
    options.add_threads(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Train, calibrate, judge, write."""
    from gns.direct.judge import calibrated, card, table_text, write_card
    from gns.direct.network import DirectConfig, DirectModel
    from gns.direct.predictor import MODEL_FILE, DirectPredictor
    from gns.direct.runs import learned_effects
    from gns.direct.train import TrainingPlan, read_samples, train
    from gns.training.processes import use_threads
    from pipeline.cli import InputError, at_least_one
    from pipeline.config import load_config
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    base = Path(config.results_folder) / "direct"
    folder = Path(arguments.out or base / "direct")
    plan = TrainingPlan()
    if arguments.steps is not None:
        plan = replace(plan, steps=at_least_one("--steps", arguments.steps))
    data = Path(arguments.data or base / "runs")
    networks = at_least_one("--networks", arguments.networks)
    alone = arguments.network
    if alone is not None and not 1 <= alone <= networks:
        raise InputError(f"--network: {alone}; allowed are 1 to {networks} (--networks)")
    size = DirectConfig(networks=networks, effects=learned_effects(data))
    given = arguments.begin_with
    begin = None if given is None else DirectPredictor.load(Path(given)).model
    if begin is not None:
        DirectModel(size).check_begin(begin)  # before all runs are encoded
        plan = plan.later
    use_threads(arguments.threads)
    with Progress(0, "direct model", quiet=arguments.quiet) as bar:
        if alone is not None:
            some = read_samples(data, ["train"])
            train(some, folder, size, plan, bar.say, alone=alone - 1, begin=begin)
            return
        samples = list(read_samples(data))
        model = train(samples, folder, size, plan, bar.say, begin=begin)
        predictor = calibrated(model, samples)
    predictor.save(folder / MODEL_FILE)
    facts = card(
        predictor,
        samples,
        {
            "steps": plan.steps,
            "restart_at": plan.first_cycle,
            "seed": plan.seed,
            "networks": size.networks,
            "effects": list(size.effects),
            "begun with": None if given is None else Path(given).name,
        },
    )
    write_card(folder, MODEL_FILE, facts)
    print(table_text(facts))
