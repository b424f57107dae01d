"""`flowslide gns train`: learn from packed data, alone or under torchrun, in any number of pieces.

    flowslide gns train --scale coarse
    torchrun --nproc_per_node 3 -m flowslide gns train --scale large

Started again, it goes on where it was stopped. It stops by itself on SIGTERM, after `--minutes`,
and two minutes before the end of a Slurm job.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, WorkFailed, add_common, at_least_one

if TYPE_CHECKING:
    from gns.data.dataset import Windows
    from gns.network.simulator import Simulator
    from gns.training.checkpoints import ModelFolder
    from gns.training.distributed import ProcessGroup
    from gns.training.train import TrainingOutcome
    from gns.training.validation import Validation
    from pipeline.config import Config, TrainSettings
    from pipeline.progress import Progress

LONG_H = 48.0
"""A training on processors that would take longer than this has to be confirmed [h]."""
TRIAL_STEPS = 3
"""Steps from which that is estimated, after one that is not counted."""


DESCRIPTION = "Learn from packed data. Started again, it goes on where it was stopped."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_scale(parser, "scale of the data; its settings, data and folder")
    parser.add_argument("--data", metavar="DIR", help="default: RESULTS/SCALE/dataset")
    options.add_out(parser, "default: RESULTS/SCALE/model")
    parser.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help="learn on from the weights of this model (folder, model.pt, or name in models/)",
    )
    parser.add_argument(
        "--start-over",
        action="store_true",
        help="where --out holds a training with other settings or data, set it aside (renamed)",
    )
    parser.add_argument("--steps", type=int, help="steps in all; default: of the settings")
    parser.add_argument("--minutes", type=float, help="stop after this time, to go on later")
    parser.add_argument(
        "--device", choices=("auto", "cpu", "cuda"), default="auto", help="default: auto"
    )
    parser.add_argument("--threads", type=int, help="CPU threads of a process; default: all")
    parser.add_argument(
        "--processes",
        type=int,
        default=1,
        help="number of processes that learn together, as with torchrun; default: 1",
    )
    parser.add_argument(
        "--joint-batch",
        action="store_true",
        help="batch_size is that of all processes together, not of each; --processes are then as "
        "many, at most, as share it out evenly",
    )
    parser.add_argument(
        "--yes", action="store_true", help=f"start even what takes over {LONG_H:g} h without a GPU"
    )
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Train; 0 when it is done or `--minutes` are over."""
    from gns.training.processes import in_processes, use_threads
    from pipeline.config import load_config

    config = load_config(arguments.config, arguments.overrides)
    settings, data, out = _what(arguments, config)
    at_least_one("--processes", arguments.processes)
    if arguments.minutes is not None and not arguments.minutes > 0.0:
        raise InputError(f"--minutes {arguments.minutes:g}: must be greater than 0")
    learned, held_out = open_windows(data, settings)
    if arguments.processes > 1 and "WORLD_SIZE" not in os.environ:
        processes = arguments.processes
        while arguments.joint_batch and settings.batch_size % processes:
            processes -= 1
        if processes > 1:
            return in_processes(processes, ["flowslide", *sys.argv[sys.argv.index("gns") :]])

    from gns.training.checkpoints import ModelFolder
    from gns.training.distributed import group

    threads = arguments.threads
    if threads is None and "WORLD_SIZE" not in os.environ:
        threads = len(os.sched_getaffinity(0))
    use_threads(threads)
    with group(arguments.device) as members:
        if arguments.joint_batch:
            settings = _shared_out(settings, members.size)
        folder = ModelFolder(out)
        if not members.leads:
            return _train(arguments, settings, learned, held_out, folder, members)
        with folder.alone():
            return _train(arguments, settings, learned, held_out, folder, members)


def _shared_out(settings: TrainSettings, processes: int) -> TrainSettings:
    """The settings of one of the processes that take a joint batch."""
    each, rest = divmod(settings.batch_size, processes)
    if rest:
        raise InputError(
            f"--joint-batch: gns.train.batch_size is {settings.batch_size}, which {processes} "
            "processes cannot share out evenly"
        )
    return settings.model_copy(update={"batch_size": each})


def open_windows(data: str | Path, settings: TrainSettings) -> tuple[Windows, Windows]:
    """Training and validation data."""
    from gns.data.dataset import Windows

    history, stride = settings.past_velocities + 1, settings.frames_per_step
    ahead = settings.pushforward + settings.unroll
    return (
        Windows(data, "train", window=history + ahead, history=history, stride=stride),
        Windows(data, "valid", window=history + 1, history=history, stride=stride),
    )


def _what(arguments: argparse.Namespace, config: Config) -> tuple[TrainSettings, Path, Path]:
    """Settings, data and folder; each from the options or from the scale."""
    scale = arguments.scale
    if scale is None and (arguments.data is None or arguments.out is None):
        raise InputError("--scale, or both --data and --out: one of them has to be given")
    if scale is not None:
        config.scale(scale)
    settings = config.training_for(scale or "")
    if arguments.steps is not None:
        if arguments.steps < 1:
            raise InputError(f"--steps {arguments.steps}: at least 1 is allowed")
        settings = settings.model_copy(update={"steps": arguments.steps})
    folder = Path(config.results_folder) / (scale or "")
    return (
        settings,
        Path(arguments.data or folder / "dataset"),
        Path(arguments.out or folder / "model"),
    )


def _train(
    arguments: argparse.Namespace,
    settings: TrainSettings,
    learned: Windows,
    held_out: Windows,
    folder: ModelFolder,
    members: ProcessGroup,
) -> int:
    from gns.training.stopping import StopRequest
    from gns.training.train import train

    start = _start(arguments.start, settings)
    quiet = arguments.quiet or not members.leads
    with StopRequest(arguments.minutes) as stop:
        watch = _TrainingWatch(settings, quiet, members, arguments.yes)
        try:
            outcome = train(
                folder,
                learned,
                held_out,
                settings,
                members,
                start=start,
                start_over=arguments.start_over,
                stop=stop,
                on_start=watch.begin,
                on_step=watch.step,
                on_validation=watch.validated,
            )
        finally:
            watch.end()
    if members.leads:
        _tell(outcome, folder, settings)
    if outcome.cut_short and not outcome.finished:
        raise WorkFailed(
            f"stopped after step {outcome.step} of {settings.steps}; start again to continue"
        )
    return 0


def _start(path: str | None, settings: TrainSettings) -> Simulator | None:
    """The model to learn on from."""
    if path is None:
        return None
    from gns.network.simulator import Simulator
    from gns.training.checkpoints import MODEL_FILE
    from pipeline.places import MODELS, resolve

    folder = resolve(path, MODELS)
    file = folder / MODEL_FILE if folder.is_dir() else folder
    simulator = Simulator.load(file)
    if simulator.config.history != settings.past_velocities + 1:
        raise InputError(
            f"gns.train.past_velocities: {settings.past_velocities}; {file} sees "
            f"{simulator.config.history - 1}: set it to that to learn on from it"
        )
    return simulator


def _tell(outcome: TrainingOutcome, folder: ModelFolder, settings: TrainSettings) -> None:
    """The result, as a table of two columns."""
    state = "trained" if outcome.finished else "stopped; start again to continue"
    print(f"{folder.model}: {state}, step {outcome.step} of {settings.steps}")
    if outcome.best is not None:
        best = outcome.best
        print(
            f"held-out rollouts of {best.runs} runs, {best.failed} failed; errors in spacings: "
            f"final position {best.score:.2f}, position {best.position_error:.2f}, "
            f"runout {best.runout_error:.2f} (median; 90 %: {best.runout_error_90:.2f})"
        )


class _TrainingWatch:
    """Progress, and the question whether a long training is meant."""

    def __init__(
        self, settings: TrainSettings, quiet: bool, members: ProcessGroup, confirmed: bool
    ) -> None:
        self.settings, self.quiet, self.members = settings, quiet, members
        self.confirmed = confirmed or members.device.type == "cuda"
        self.bar: Progress | None = None
        self.first, self.began = 0, 0.0
        self.mean: float | None = None
        self.note = ""

    def begin(self, done: int) -> None:
        """There are `done` steps already."""
        from pipeline.progress import Progress

        self.first = done
        left = self.settings.steps - done
        self.bar = Progress(left, "training", quiet=self.quiet).__enter__()

    def step(self, number: int, loss: float) -> None:
        """A step is done."""
        self.mean = loss if self.mean is None else 0.99 * self.mean + 0.01 * loss
        if self.bar is not None:
            self.bar.advance(1, f"loss {self.mean:.3f}{self.note}")
        taken = number - self.first
        if taken == 1:
            self.began = time.monotonic()
        elif taken == 1 + TRIAL_STEPS and not self.confirmed:
            hours = (time.monotonic() - self.began) / TRIAL_STEPS / 3600.0
            hours *= self.settings.steps - number
            if hours > LONG_H:
                raise WorkFailed(
                    f"without a GPU this training takes about {hours / 168:.1f} weeks "
                    f"({hours:.0f} h); give --yes to start it all the same"
                )

    def validated(self, step: int, found: Validation) -> None:
        """Held-out rollouts are there."""
        self.note = f", held out {found.score:.2f} spacings"
        if not self.quiet and not sys.stderr.isatty():
            print(
                f"step {step}: held-out final position error {found.score:.2f} spacings, runout "
                f"{found.runout_error:.2f} (median), {found.failed} of {found.runs} failed",
                file=sys.stderr,
                flush=True,
            )

    def end(self) -> None:
        """Close the bar."""
        if self.bar is not None:
            self.bar.__exit__(*sys.exc_info())
