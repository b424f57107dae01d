"""Learning (paper, its section on the training of the GNS): one process or several, in pieces.

In: packed data, settings. Out: a folder with the model that was best in held-out rollouts, the
metrics, and the state from which a stopped training goes on. What a step sees follows from its
number (`sampling`), and the state holds everything else, so a training that is killed and continued
takes the same steps with the same numbers as one that is not. With several processes, each learns
from its own part of a step's windows, gradients are averaged, and all stay equal.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from gns import PHYSICS_VERSION
from gns.data.dataset import Windows
from gns.data.distance import KnownScenes, described
from gns.data.metadata import Metadata, Statistics
from gns.data.scene_facts import CONTACTS
from gns.data.statistics import merge, run_moments
from gns.network.growing import grown
from gns.network.simulator import Simulator, SimulatorConfig
from gns.training.checkpoints import ModelFolder
from gns.training.distributed import ProcessGroup
from gns.training.loss import TrainingObjective, soil_points
from gns.training.optimizers import Optimizers
from gns.training.sampling import Examples
from gns.training.stopping import StopRequest
from gns.training.validation import Validation, choose_runs, validate
from pipeline.cli import WorkFailed
from pipeline.config import TrainSettings

MODEL_SETTINGS = (
    "width",
    "message_passing_steps",
    "cutoff",
    "strength",
    "overburden",
    "grid_cell",
    "grid_rounds",
    "grid_everywhere",
    "symmetric",
)
"""Settings that a model keeps under the same name."""
SAME = 1e-3
"""Relative difference up to which a property of the runs counts as the same."""
SAMPLED_RUNS = 200
"""Most runs from which the spreads of thinned frames are found."""


@dataclass
class TrainingOutcome:
    """How a call of `train` ended.

    Attributes:
        step: last step taken.
        finished: it was the last of the training.
        cut_short: stopped from outside before that.
        best: the best validation so far; None before the first.
    """

    step: int
    finished: bool
    cut_short: bool
    best: Validation | None


@dataclass
class _Progress:
    """The numbers of a training that are not weights."""

    step: int = 0
    loss: float = 0.0  # sums over the steps since the last line of metrics
    norm: float = 0.0
    counted: int = 0
    seconds: float = 0.0
    best: dict[str, Any] | None = None
    best_step: int = 0


@dataclass
class _Training:
    """All that lives while a training runs."""

    settings: TrainSettings
    folder: ModelFolder
    group: ProcessGroup
    objective: TrainingObjective
    averaged: Simulator | None
    optimizer: Optimizers
    made_from: dict[str, Any]
    learned_from: dict[str, Any]
    state: _Progress = field(default_factory=_Progress)


def train(
    folder: ModelFolder,
    learned: Windows,
    held_out: Windows,
    settings: TrainSettings,
    group: ProcessGroup,
    *,
    start: Simulator | None = None,
    start_over: bool = False,
    stop: StopRequest | None = None,
    on_start: Callable[[int], None] | None = None,
    on_step: Callable[[int, float], None] | None = None,
    on_validation: Callable[[int, Validation], None] | None = None,
) -> TrainingOutcome:
    """Learn, or go on learning, until the last step or a stop.

    Args:
        folder: where the model, its metrics and its state are.
        learned: windows to learn from.
        held_out: of the split `valid`.
        settings: of the training.
        group: the processes that learn together.
        start: a model to learn on from (fine-tuning); None: random weights.
        start_over: set aside another training in the folder instead of refusing to work there.
        stop: when to stop early.
        on_start: called once with the number of steps that are there already.
        on_step: called after each step with its number and loss.
        on_validation: called after each validation with the step.

    Raises:
        InputError: the folder holds another training, or the data do not fit the model.
        WorkFailed: the loss is not a finite number.
    """
    training = _begin(folder, learned, settings, group, start, start_over)
    examples = Examples(learned, settings, group.device)
    runs = choose_runs(held_out, settings.validate_runs)
    wrapped = group.wrapped(training.objective)
    state, best = training.state, None
    if on_start is not None:
        on_start(state.step)
    while state.step < settings.steps:
        began = time.perf_counter()
        loss, stopping = _step(training, wrapped, examples, stop)
        state.seconds += time.perf_counter() - began
        if on_step is not None:
            on_step(state.step, loss)
        if state.step % _metrics_every(settings) == 0:
            _write_metrics(training)
        last = state.step == settings.steps
        # The end of a cycle is where a training of that one cycle would have ended.
        end = last or state.step in settings.restart_at
        if runs and (end or state.step % settings.validate_every == 0):
            best = _validate(training, held_out, runs)
            if on_validation is not None:
                on_validation(state.step, best)
        if end or stopping or state.step % settings.checkpoint_every == 0:
            _keep(training)
        if stopping and not last:
            break
    if not runs and state.step == settings.steps:
        _keep_model(training, None)
    group.wait()
    return TrainingOutcome(
        step=state.step,
        finished=state.step == settings.steps,
        cut_short=stop is not None and stop.cut_short,
        best=None if state.best is None else Validation(**state.best),
    )


def cycle_ends(settings: TrainSettings) -> list[int]:
    """Last steps of the cycles of the learning rate, of which there is one without restarts."""
    return [step for step in settings.restart_at if step < settings.steps] + [settings.steps]


def learning_rate(step: int, settings: TrainSettings) -> float:
    """Learning rate of a step, counted from 1.

    Each further cycle is a warm restart (Loshchilov and Hutter 2017, SGDR, eq. 5, with a lower
    peak).
    """
    first, last = settings.learning_rate, settings.final_learning_rate
    ends = cycle_ends(settings)
    number = bisect_left(ends, step)
    length = ends[number]
    if number > 0:
        first *= settings.restart_share
        step, length = step - ends[number - 1], length - ends[number - 1]
    if step <= settings.warmup_steps:
        return first * step / settings.warmup_steps
    share = (step - settings.warmup_steps) / max(length - settings.warmup_steps, 1)
    if settings.schedule == "constant":
        return first
    if settings.schedule == "cosine":
        return last + 0.5 * (first - last) * (1.0 + math.cos(math.pi * share))
    # The paper's kind of decay, from the first rate to the last.
    return first * (max(last, 1e-12) / first) ** share


def steps_in_a_row(step: int, settings: TrainSettings) -> int:
    """Steps through which the loss of a step, counted from 1, is differentiated."""
    ramp = settings.unroll_ramp * cycle_ends(settings)[0]
    if step > ramp:
        return settings.unroll
    return 1 + int((settings.unroll - 1) * (step - 1) / ramp)


def simulator_config(
    settings: TrainSettings, metadata: Metadata, cell: float, data: Statistics | None = None
) -> SimulatorConfig:
    """Statistics of the data that a simulator needs; spreads hold the noise as well.

    Args:
        settings: of the training.
        metadata: of the packed data.
        cell: edge of a cell in spacings.
        data: means and spreads of frames as far apart as the model's steps; None: `metadata`'s.
    """
    data = data or metadata.statistics
    interval = metadata.frame_interval * settings.frames_per_step
    mean = (0.0, data.velocity_mean[1]) if settings.mirror else data.velocity_mean
    pull = (0.0, data.acceleration_mean[1]) if settings.mirror else data.acceleration_mean
    return SimulatorConfig(
        **{name: getattr(settings, name) for name in MODEL_SETTINGS},
        radius=settings.radius_cells * cell,
        history=settings.past_velocities + 1,
        thrust=metadata.ranges["horizontal_body_force"][1] > 0.0,
        density=_varies(metadata, "relative_density"),
        stiffness=_varies(metadata, "youngs_modulus"),
        frame_interval=interval,
        velocity_mean=mean,
        velocity_std=tuple(math.hypot(std, settings.noise) for std in data.velocity_std),
        acceleration_mean=pull,
        acceleration_std=tuple(
            math.hypot(std, settings.noise / interval) for std in data.acceleration_std
        ),
        ranges=metadata.ranges,
    )


def _varies(metadata: Metadata, name: str) -> bool:
    """Whether the runs differ in a property: then it is an input."""
    low, high = metadata.ranges[name]
    return high > (1.0 + SAME) * low


def thinned_statistics(windows: Windows) -> Statistics:
    """Means and spreads of frames `windows.stride` apart, from SAMPLED_RUNS runs or more."""
    every = max(len(windows.runs) // SAMPLED_RUNS, 1)
    moments = [
        run_moments(windows.positions(int(run)), windows.facts(int(run)))
        for run in windows.runs[::every]
    ]
    velocity, acceleration = (merge(one) for one in zip(*moments, strict=True))
    return Statistics.of(velocity, acceleration)


# -- beginning ------------------------------------------------------------------------------------


def _begin(
    folder: ModelFolder,
    learned: Windows,
    settings: TrainSettings,
    group: ProcessGroup,
    start: Simulator | None,
    start_over: bool,
) -> _Training:
    """A training at its first step, or where it was stopped."""
    simulator = _first_simulator(learned, settings, start).to(group.device)
    if settings.precision == "bfloat16":
        simulator.network.edge_precision = torch.bfloat16
    simulator.known = _known_scenes(learned, None if start is None else start.known)
    optimizer = Optimizers(
        list(simulator.parameters()),
        rate=settings.learning_rate,
        muon_rate=settings.muon_learning_rate if settings.optimizer == "muon" else None,
    )
    made_from = _made_from(learned, settings, group, start)
    training = _Training(
        settings=settings,
        folder=folder,
        group=group,
        objective=TrainingObjective(simulator, settings.unroll, settings.balance),
        averaged=deepcopy(simulator) if settings.averaging > 0 else None,
        optimizer=optimizer,
        made_from=made_from,
        learned_from={
            "scale": learned.metadata.scale,
            "runs": len(learned.metadata.runs("train")),
            "spacing_m": learned.metadata.spacing_m,
        },
    )
    if start_over and group.leads:
        folder.set_aside(made_from, _beginnings(made_from))
    group.wait()
    document = folder.load_state(made_from, "cpu", _beginnings(made_from))
    if document is not None:
        simulator.load_state_dict(document["weights"])
        optimizer.load_state_dict(document["optimizer"])
        if training.averaged is not None:
            training.averaged.load_state_dict(document["averaged"])
        training.state = _Progress(**document["progress"])
    if group.leads:
        folder.cut_metrics(training.state.step)
    group.wait()
    return training


def _first_simulator(
    learned: Windows, settings: TrainSettings, start: Simulator | None
) -> Simulator:
    facts = learned.facts(int(learned.runs[0]))
    cell = facts.numbers["cell"] / facts.spacing
    spreads = None if learned.stride == 1 else thinned_statistics(learned)
    config = simulator_config(settings, learned.metadata, cell, spreads)
    config = config.model_copy(update={"contacts": _contacts(learned)})
    if start is None:
        torch.manual_seed(settings.seed)
        return Simulator(config)
    # A model keeps its form and its normalisation: its weights mean nothing without them.
    start = grown(start, config)
    start.scaled(facts)
    ranges = dict(start.config.ranges)
    for name, (low, high) in config.ranges.items():
        old = ranges.get(name, (low, high))
        ranges[name] = (min(low, old[0]), max(high, old[1]))
    contacts = sorted({*start.config.contacts, *config.contacts})
    start.config = start.config.model_copy(update={"ranges": ranges, "contacts": contacts})
    return start


def _known_scenes(learned: Windows, before: KnownScenes | None) -> KnownScenes:
    """What the model will have learned from, with what it has learned from before."""
    scenes = []
    for run in map(int, learned.runs):
        start = learned.positions(run, 0, 1)[0]
        scenes.append(described(start, learned.facts(run)))
    return KnownScenes.of(scenes) if before is None else before.joined(scenes)


def _contacts(learned: Windows) -> list[str]:
    """Kinds of ground in the data, from a run of each template and at most 50."""
    chosen = choose_runs(learned, 50)
    kinds = {int(learned.facts(run).numbers["ground_contact"]) for run in chosen}
    return [CONTACTS[kind] for kind in sorted(kinds)]


def _made_from(
    learned: Windows, settings: TrainSettings, group: ProcessGroup, start: Simulator | None
) -> dict[str, Any]:
    """Everything that determines a training; one with the same may be continued."""
    values = settings.model_dump(mode="json")
    # Two processes with one window each take the steps of one process with two.
    values["batch_size"] = settings.batch_size * group.size
    del values["checkpoint_every"]
    values["restart_at"] = cycle_ends(settings)[:-1]
    if not values["restart_at"]:
        del values["restart_at"], values["restart_share"]
    weights = None
    if start is not None:
        weights = float(sum(value.double().abs().sum() for value in start.state_dict().values()))
    return {
        **values,
        "data_hash": learned.metadata.data_hash,
        "physics_version": PHYSICS_VERSION,
        "from": weights,
    }


def _beginnings(made_from: dict[str, Any]) -> list[dict[str, Any]]:
    """The trainings of fewer cycles that are the beginning of this one."""
    restarts = made_from.get("restart_at", [])
    found = []
    for number, step in enumerate(restarts):
        one = {**made_from, "steps": step, "restart_at": restarts[:number]}
        if number == 0:
            del one["restart_at"], one["restart_share"]
        found.append(one)
    return found


# -- a step ---------------------------------------------------------------------------------------


def _step(
    training: _Training, wrapped: torch.nn.Module, examples: Examples, stop: StopRequest | None
) -> tuple[float, bool]:
    """One step of the optimiser; its loss, and whether any process is asked to stop."""
    settings, group, state = training.settings, training.group, training.state
    first = state.step * settings.batch_size * group.size + group.rank * settings.batch_size
    batch = [examples.at(first + place) for place in range(settings.batch_size)]
    asked = 1.0 if stop is not None and stop.wanted else 0.0
    points, asked = group.summed(torch.tensor([soil_points(batch), asked], dtype=torch.float64))
    rate = learning_rate(state.step + 1, settings)
    training.optimizer.set_rate(rate / settings.learning_rate)
    training.optimizer.zero_grad()
    training.objective.unroll = steps_in_a_row(state.step + 1, settings)
    # Processes average their gradients: times their number, a mean over all points.
    loss = wrapped(batch) * (group.size / float(points))
    loss.backward()
    limit = settings.gradient_clip or math.inf
    norm = float(torch.nn.utils.clip_grad_norm_(training.objective.parameters(), limit))
    value = float(group.summed(loss.detach().double().clone())) / group.size
    if not math.isfinite(value) or not math.isfinite(norm):
        raise WorkFailed(
            f"step {state.step + 1}: the loss is not a finite number; the state of step "
            f"{state.step - state.step % settings.checkpoint_every} is kept. Try a lower "
            "learning_rate"
        )
    training.optimizer.step()
    state.step += 1
    _average(training)
    state.loss += value
    state.norm += norm
    state.counted += 1
    return value, bool(asked > 0)


@torch.no_grad()
def _average(training: _Training) -> None:
    """Draw the averaged weights towards the present ones; at first faster, to forget the start."""
    if training.averaged is None:
        return
    step = training.state.step
    memory = min(training.settings.averaging, (1.0 + step) / (10.0 + step))
    present = training.objective.simulator.parameters()
    for average, now in zip(training.averaged.parameters(), present, strict=True):
        average.lerp_(now, 1.0 - memory)


# -- files ----------------------------------------------------------------------------------------


def _metrics_every(settings: TrainSettings) -> int:
    return max(1, min(100, settings.steps // 100))


def _write_metrics(training: _Training) -> None:
    state = training.state
    if training.group.leads:
        training.folder.write_metrics(
            {
                "step": state.step,
                "loss": state.loss / state.counted,
                "gradient_norm": state.norm / state.counted,
                "learning_rate": learning_rate(state.step, training.settings),
                "seconds": round(state.seconds, 1),
            }
        )
    state.loss = state.norm = 0.0
    state.counted = 0


def _validate(training: _Training, held_out: Windows, runs: list[int]) -> Validation:
    """Held-out rollouts; the model is kept if it is the best so far."""
    state, group = training.state, training.group
    began = time.perf_counter()
    simulator = training.averaged or training.objective.simulator
    found = validate(simulator, held_out, runs, group)
    took = time.perf_counter() - began
    state.seconds += took
    if group.leads:
        line = {"step": state.step, "validation": found.as_numbers(), "took_s": round(took, 1)}
        training.folder.write_metrics(line)
    if state.best is None or found.score < state.best["score"]:
        state.best, state.best_step = found.as_numbers(), state.step
        _keep_model(training, found)
    return found


def _keep_model(training: _Training, found: Validation | None) -> None:
    if training.group.leads:
        simulator = training.averaged or training.objective.simulator
        training.folder.save_model(
            simulator,
            step=training.state.step,
            validation={} if found is None else found.as_numbers(),
            made_from=training.made_from,
            learned_from=training.learned_from,
        )


def _keep(training: _Training) -> None:
    """Write the state."""
    if training.group.leads:
        averaged: Mapping[str, Tensor] = {}
        if training.averaged is not None:
            averaged = training.averaged.state_dict()
        training.folder.save_state(
            training.made_from,
            weights=training.objective.simulator.state_dict(),
            averaged=averaged,
            optimizer=training.optimizer.state_dict(),
            progress=vars(training.state),
        )
