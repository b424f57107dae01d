"""How good a model is while it learns: rollouts of runs that it does not learn from.

A low loss of single steps says little about a rollout of a hundred; so a model is chosen by
rollouts of some runs of the split `valid`, from their first frame to their last. The score of a
model is the mean over these runs of the final position error in spacings, where a rollout that
fails counts as `FAILED_ERROR`. Runs are shared out among the processes of a training.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from gns.data.dataset import Windows
from gns.evaluation.metrics import RolloutScore, score
from gns.network.simulator import Simulator
from gns.rollout.rollout import rolled_out
from gns.training.distributed import ProcessGroup

FAILED_ERROR = 100.0
"""Error [spacings] as which a rollout that fails counts; larger ones count no more than it."""


@dataclass(frozen=True)
class Validation:
    """Held-out rollouts of one model; errors in spacings.

    Attributes:
        score: mean of the final position errors: the less, the better.
        position_error: mean over the runs of the root mean square over points and frames.
        runout_error: median of the absolute errors.
        runout_error_90: their 90th percentile.
        runs: how many.
        failed: how many of them failed.
    """

    score: float
    position_error: float
    runout_error: float
    runout_error_90: float
    runs: int
    failed: int

    def as_numbers(self) -> dict[str, float | int]:
        """For a line of metrics."""
        return asdict(self)


def choose_runs(windows: Windows, number: int) -> list[int]:
    """Runs to validate by: spread over the templates as evenly as may be, always the same.

    Args:
        windows: of the split `valid`.
        number: how many at most.
    """
    by_template: dict[str, list[int]] = {}
    for run, template in zip(windows.runs, windows.templates, strict=True):
        by_template.setdefault(template, []).append(int(run))
    queues = [by_template[template] for template in sorted(by_template)]
    chosen: list[int] = []
    place = 0
    while len(chosen) < number and any(place < len(queue) for queue in queues):
        chosen += [queue[place] for queue in queues if place < len(queue)]
        place += 1
    return sorted(chosen[:number])


def validate(
    simulator: Simulator, windows: Windows, runs: Sequence[int], group: ProcessGroup
) -> Validation:
    """Roll out held-out runs and compare them with the simulations."""
    own = [score_run(simulator, windows, run) for run in runs[group.rank :: group.size]]
    scores = [one for part in group.gathered(own) for one in part]
    return summary(scores)


def score_run(simulator: Simulator, windows: Windows, run: int) -> RolloutScore:
    """A rollout of one packed run, from its first frame to its last, against the run itself."""
    simulated, facts = windows.positions(run), windows.facts(run)
    _, predicted = rolled_out(simulator, simulated, facts)
    return score(predicted, simulated, facts, run=run, template=windows.template_of(run))


def summary(scores: Sequence[RolloutScore]) -> Validation:
    """The numbers of a validation from the scores of its runs."""
    final = [_capped(one.final_position_error_m / one.spacing_m) for one in scores]
    whole = [_capped(one.position_error_m / one.spacing_m) for one in scores]
    runout = [_capped(abs(one.runout_error_spacings)) for one in scores]
    return Validation(
        score=statistics.fmean(final),
        position_error=statistics.fmean(whole),
        runout_error=float(np.median(runout)),
        runout_error_90=float(np.quantile(runout, 0.9)),
        runs=len(scores),
        failed=sum(not one.finite for one in scores),
    )


def _capped(error: float) -> float:
    return FAILED_ERROR if math.isnan(error) else min(error, FAILED_ERROR)
