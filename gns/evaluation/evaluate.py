"""How good a model is: rollouts of runs that it has neither learned from nor been chosen by.

In: a simulator and a split of packed data. Out: of each run its score (`metrics`), the error of
single steps in addition to that of constant velocity, and the time it took compared with the
material point method's. `card` keeps the tables, `draw_rollouts` draws the worst.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from gns.data.dataset import Windows
from gns.data.scene_facts import SceneFacts, before
from gns.evaluation.metrics import RolloutScore, one_step_error, score
from gns.network.simulator import Simulator
from gns.rollout.rollout import rolled_out
from pipeline.cli import InputError
from pipeline.files import atomic_path, read_text

ONE_STEP_STRIDE = 7
"""Single steps are judged from every n frames."""


@dataclass(frozen=True)
class Evaluated:
    """One run.

    Attributes:
        score: of its rollout.
        one_step_error: root mean square over moving points of single steps, without noise [d].
        constant_velocity_error: the same of positions that go on as they went; NaN where no point
            moves.
        seconds: time of the rollout [s].
        mpm_seconds: time of the material point method, where it is known.
    """

    score: RolloutScore
    one_step_error: float
    constant_velocity_error: float
    seconds: float
    mpm_seconds: float | None = None


def evaluate(
    simulator: Simulator,
    windows: Windows,
    *,
    runs: Sequence[int] | None = None,
    mpm_seconds: Mapping[int, float] | None = None,
    on_run: Callable[[Evaluated], None] | None = None,
) -> list[Evaluated]:
    """Judge a model on whole runs.

    Args:
        simulator: the model.
        windows: the split.
        runs: which of its runs; None: all.
        mpm_seconds: time that the material point method took, by run.
        on_run: called with each run as it is done.
    """
    found = []
    for run in windows.runs if runs is None else runs:
        positions, facts = windows.positions(int(run)), windows.facts(int(run))
        result, predicted = rolled_out(simulator, positions, facts)
        found.append(
            Evaluated(
                score(
                    predicted,
                    positions,
                    facts,
                    run=int(run),
                    template=windows.template_of(int(run)),
                ),
                *one_step_errors(simulator, positions, facts),
                seconds=result.wall_time_s,
                mpm_seconds=None if mpm_seconds is None else mpm_seconds.get(int(run)),
            )
        )
        if on_run is not None:
            on_run(found[-1])
    return found


def one_step_errors(
    simulator: Simulator, positions: np.ndarray, facts: SceneFacts
) -> tuple[float, float]:
    """Errors of single steps from true positions: the model's and that of constant velocity [d]."""
    history = simulator.config.history
    earlier = before(positions[0], facts.initial_velocity, facts.frame_time, history - 1)
    frames = np.concatenate([earlier, positions])
    squares = []
    for place in range(0, len(positions) - 1, ONE_STEP_STRIDE):
        window = frames[place : place + history + 1]
        known = window[:-1]
        straight = 2.0 * known[-1].astype(np.float64) - known[-2]
        straight[facts.type != 0] = known[-1][facts.type != 0]
        errors = [
            one_step_error(one, window, facts) for one in (simulator.step(known, facts), straight)
        ]
        if all(map(math.isfinite, errors)):
            squares.append(np.square(errors))
    if not squares:
        return math.nan, math.nan
    model, constant = np.sqrt(np.mean(squares, axis=0))
    return float(model), float(constant)


def save_scores(path: str | Path, found: Sequence[Evaluated]) -> None:
    """One line a run, as CSV; the file appears when whole."""
    rows = [
        {
            **asdict(one.score),
            "one_step_error_spacings": one.one_step_error,
            "constant_velocity_error_spacings": one.constant_velocity_error,
            "seconds": round(one.seconds, 3),
            "mpm_seconds": "" if one.mpm_seconds is None else round(one.mpm_seconds, 3),
        }
        for one in found
    ]
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_mpm_seconds(path: str | Path) -> dict[int, float]:
    """Time of each run in a table of `flowslide runs status --csv` [s].

    Raises:
        InputError: no such file, or not such a table.
    """
    try:
        rows = list(csv.DictReader(read_text(path).splitlines()))
        found = {int(row["index"]): float(row["wall_time_s"]) for row in rows}
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: has no numbers in columns index and wall_time_s; it is to be a table of "
            "flowslide runs status --csv"
        ) from None
    for index, seconds in found.items():
        if not 0.0 <= seconds < math.inf:
            raise InputError(
                f"{path}: run {index}: wall_time_s {seconds:g}: at least 0, and finite"
            )
    return found
