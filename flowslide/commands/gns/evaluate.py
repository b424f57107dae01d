"""`flowslide gns evaluate`: judge a model on held-out runs and write its card."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from gns.data.dataset import Windows
    from gns.data.metadata import Metadata
    from gns.evaluation.card import Accuracy, Card
    from gns.evaluation.evaluate import Evaluated
    from gns.network.simulator import Simulator
    from pipeline.config import Config

SPLITS = ("valid", "test")


DESCRIPTION = (
    "Roll out held-out runs, compare them with the simulations, print a table, "
    "and write card.yaml, evaluation.csv, worst.png and training.png next to the weights."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_scale(parser, "scale of the data; names data and model")
    parser.add_argument("--data", metavar="DIR", help="default: RESULTS/SCALE/dataset")
    parser.add_argument("--model", metavar="DIR", help="default: RESULTS/SCALE/model")
    parser.add_argument("--split", choices=SPLITS, default="test", help="default: test")
    parser.add_argument("--runs", type=int, help="number of runs, from the first; default: all")
    parser.add_argument(
        "--mpm", metavar="FILE", help="runs.csv of the data, for the time of the simulations"
    )
    parser.add_argument("--name", help="of the model, in the card; default: its folder's or scale")
    parser.add_argument("--note", default="", help="a sentence for the card")
    options.add_device(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, print, write."""
    from pipeline.config import load_config
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    data, model = _folders(arguments, config)

    from gns.data.dataset import Windows
    from gns.evaluation.baselines import baselines, judge, summary
    from gns.evaluation.card import CARD_FILE, accuracy, write_card
    from gns.evaluation.evaluate import evaluate, read_mpm_seconds, save_scores
    from gns.network.simulator import Simulator, read_document
    from gns.training.checkpoints import METRICS_FILE, MODEL_FILE, ModelFolder
    from gns.training.processes import check_device, use_threads
    from report.pictures.rollouts import save_history

    check_device(arguments.device)
    use_threads(arguments.threads)
    document = read_document(model / MODEL_FILE)
    simulator = Simulator.from_document(document, str(model / MODEL_FILE)).to(arguments.device)
    every = Windows(data, arguments.split)
    learned_from = _learned_from(document, every.metadata, model)
    windows = Windows(data, arguments.split, stride=simulator.stride_in(every.metadata))
    if not len(windows.runs):
        raise InputError(f"{data}: no run in the split {arguments.split}")
    runs = _unseen(simulator, windows)[: arguments.runs]
    if not runs:
        raise InputError(f"{data}: the model has learned from every run of {arguments.split}")
    mpm_seconds = None if arguments.mpm is None else read_mpm_seconds(arguments.mpm)
    lines = ModelFolder(model).read_metrics()
    with Progress(len(runs), "evaluating", quiet=arguments.quiet) as bar:
        found = evaluate(
            simulator,
            windows,
            runs=runs,
            mpm_seconds=mpm_seconds,
            on_run=lambda one: bar.advance(1, f"run {one.score.run}"),
        )
    guesses = {}
    for baseline in baselines(Windows(data, "train")):
        judged = [one for one in judge(baseline, every) if one.run in set(runs)]
        guesses[baseline.name] = summary(judged)
    result = accuracy(arguments.split, found, guesses)
    save_scores(model / "evaluation.csv", found)
    _draw_worst(simulator, windows, found, model / "worst.png")
    if (model / METRICS_FILE).is_file():
        save_history(lines, model / "training.png", f"{model}: {len(lines)} lines of metrics")
    name = arguments.name or arguments.scale or model.resolve().name
    write_card(
        model / CARD_FILE,
        _card(name, arguments, config, simulator, model, document, learned_from, found, result),
    )
    _print(result)
    print(f"wrote {model / CARD_FILE}")
    return 0


def _unseen(simulator: Simulator, windows: Windows) -> list[int]:
    """The runs of a split that can judge a model.

    It has not learned from their scenes, in this training or in one that it went on from, and they
    have a second frame.
    """
    unseen, seen, short = [], [], []
    for run, frames in zip(map(int, windows.runs), windows.frames, strict=True):
        start, facts = windows.positions(run, 0, 1)[0], windows.facts(run)
        if simulator.known is not None and simulator.known.holds(start, facts):
            seen.append(run)
        elif frames <= windows.stride:
            short.append(run)
        else:
            unseen.append(run)
    for runs, why in ((seen, "the model has learned from them"), (short, "they end at once")):
        if runs:
            print(f"not judged by runs {', '.join(map(str, runs))}: {why}")
    return unseen


def _folders(arguments: argparse.Namespace, config: Config) -> tuple[Path, Path]:
    """Packed data and model, from the options or from the scale."""
    scale = arguments.scale
    if scale is None and (arguments.data is None or arguments.model is None):
        raise InputError("--scale, or both --data and --model: one of them has to be given")
    if scale is not None:
        config.scale(scale)
    folder = Path(config.results_folder) / (scale or "")
    return Path(arguments.data or folder / "dataset"), Path(arguments.model or folder / "model")


def _card(
    name: str,
    arguments: argparse.Namespace,
    config: Config,
    simulator: Simulator,
    model: Path,
    document: dict[str, Any],
    learned_from: dict[str, Any],
    found: list[Evaluated],
    result: Accuracy,
) -> Card:
    """The card of a model that has been evaluated."""
    from gns.evaluation.card import Card, Training, known_failures
    from gns.training.checkpoints import MODEL_FILE
    from pipeline.files import file_hash
    from pipeline.manifest import manifest

    settings = dict(document.get("made_from", {}))
    network = simulator.config.model_dump(mode="json")
    ranges, contacts = network.pop("ranges"), network.pop("contacts")
    return Card(
        name=name,
        note=arguments.note,
        network=network,
        parameters=sum(parameter.numel() for parameter in simulator.parameters()),
        ranges=ranges,
        contacts=contacts,
        training=Training(
            step=int(document.get("step", 0)),
            data_hash=str(settings.pop("data_hash", "")),
            settings=settings,
            data_scale=learned_from["scale"],
            runs=learned_from["runs"],
            spacing_m=learned_from["spacing_m"],
            validation=document.get("validation", {}),
        ),
        accuracy=result,
        known_failures=known_failures(found),
        weights_sha256=file_hash(model / MODEL_FILE),
        manifest=manifest(config, {"training": int(settings.get("seed", 0))}),
    )


def _learned_from(document: dict[str, Any], metadata: Metadata, model: Path) -> dict[str, Any]:
    """Scale, number and spacing of the runs that a model has learned from.

    A model that does not say so itself has them from the data, if it has learned from these.
    """
    from gns.training.checkpoints import MODEL_FILE

    if "learned_from" in document:
        return document["learned_from"]
    made_from = document.get("made_from", {}).get("data_hash")
    if made_from not in (None, metadata.data_hash):
        raise InputError(
            f"{model / MODEL_FILE}: does not say what it has learned from, and these data "
            f"({metadata.data_hash}) are others ({made_from})"
        )
    return {
        "scale": metadata.scale,
        "runs": len(metadata.runs("train")),
        "spacing_m": metadata.spacing_m,
    }


def _draw_worst(simulator: Simulator, windows: Windows, found: list[Evaluated], path: Path) -> None:
    from gns.evaluation.score_tables import worst
    from gns.rollout.rollout import rolled_out
    from report.pictures.rollouts import Pair, save_pairs

    pairs = []
    for one in worst([item.score for item in found]):
        positions, facts = windows.positions(one.run), windows.facts(one.run)
        result, _ = rolled_out(simulator, positions, facts)
        title = f"run {one.run} ({one.template}), {one.runout_error_spacings:+.1f} d"
        pairs.append(Pair(title, result.positions, positions, facts))
    save_pairs(pairs, path, f"The {len(pairs)} worst of {len(found)} rollouts by their runout")


def _print(result: Accuracy) -> None:
    from pipeline.table import aligned

    columns = list(result.by_template["all"])
    rows = [["template", *columns]]
    table = {**result.by_template, **({"far": result.far} if result.far else {})}
    for name, row in table.items():
        rows.append([name, *[_cell(row[column]) for column in columns]])
    print(aligned(rows))
    if result.far:
        print("far: runs that travel more than 10 spacings, of all templates")
    shared = ("runout, m", "runout, d", "90 %, d", "runout, % of travel")
    rows = [["guess without simulating", *shared]]
    rows += [
        [name, *[_cell(row.get(column)) for column in shared]]
        for name, row in result.baselines.items()
    ]
    print(aligned(rows))
    print(
        f"single steps, in spacings: {_cell(result.one_step_error_spacings)}; constant velocity: "
        f"{_cell(result.constant_velocity_error_spacings)}"
    )
    mpm = (
        ""
        if result.mpm_seconds_a_run is None
        else (f"; the material point method: {result.mpm_seconds_a_run:.2f} s")
    )
    print(f"a rollout takes {result.seconds_a_run:.2f} s (median){mpm}")


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
