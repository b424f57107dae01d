"""Compare: is the base model adequate, and where does it fail?

    comparison = compare(model, options)

costs about 35 forward runs: a scan and searches of the base model, replicates, the second transfer
scheme and the finer cells. `explain`, `diagnose` and `suggest` go on from a comparison; in another
process make it again, from a model that keeps its runs it costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.adequacy.adequacy import Adequacy, ProjectedFit, assess, judged
from diagnosis.adequacy.calibration import Base, calibrate
from diagnosis.adequacy.windows import WorstWindow, worst_window
from diagnosis.hypotheses.model import Model
from diagnosis.options import Options
from inversion.estimation.data import Places, places_of


@dataclass(frozen=True)
class Comparison:
    """The base model against the measurements.

    Attributes:
        base: the calibrated model with C and the memory of its runs.
        places: of the measurements.
        judged: its projected residual, and noise.
        adequacy: tests; the largest score is added by `explain`.
        window: where it fails worst; None where no series was measured.
    """

    base: Base
    places: list[Places]
    judged: ProjectedFit
    adequacy: Adequacy
    window: WorstWindow | None


def compare(model: Model, options: Options) -> Comparison:
    """Calibrate the base model, find its own error, and test it.

    Args:
        model: the model to diagnose.
        options: the seed of the case and what else may be asked for.

    Raises:
        WorkFailed: no run of the base model could be read.
        InputError: the hold-out does not fit the measurements.
    """
    base = calibrate(model, options)
    places = places_of(model.targets)
    found = judged(base.data, base.fit, draws=options.draws, seed=options.seed)
    return Comparison(base, places, found, assess(found, places), worst_window(found, places))
