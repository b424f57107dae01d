"""What a direct model is worth: its intervals calibrated, its errors on scenes it has not seen.

The runout of a scene is that of the side that ran farther. Errors are in spacings d of the run, and
for runouts beyond FAR in per cent of them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gns.direct.arrivals import SHARES, WAY
from gns.direct.network import DirectModel
from gns.direct.predictor import COVERED, DirectPredictor, described, unit_of
from gns.direct.sections import Outcome
from gns.direct.train import SPLITS, Sample, answers
from pipeline.files import file_hash, write_text, yaml_text

#: Runouts beyond this [d] are far.
FAR = 10.0
#: Least scale of an error, so that a side that stands still has an interval as well [d].
LEAST_SCALE = 0.05
CARD_FILE = "card.yaml"
#: Places in SHARES of the middle, and of the end of a duration, which begins at the first.
_MIDDLE, _END = SHARES.index(0.5), SHARES.index(0.95)
#: Column of the share of runouts within their interval.
COVERAGE = "covered, %"


@dataclass(frozen=True)
class DirectScores:
    """Errors of one scene each, (n,).

    Attributes:
        template: a to d, or what kind of dam.
        acting: an effect acts.
        travel: of the side that ran farther [d].
        runout: error of its toe [d]; profile: of the deposit [share of the section's area].
        covered: its interval held it.
        arrival: error of the middle arrival time of that toe, as a share of it; NaN: it stays.
        arrival_covered: share of its arrival times within their intervals.
        duration: error of the duration, as a share of it; NaN: nothing moved.
    """

    template: np.ndarray
    acting: np.ndarray
    travel: np.ndarray
    runout: np.ndarray
    profile: np.ndarray
    covered: np.ndarray
    arrival: np.ndarray
    arrival_covered: np.ndarray
    duration: np.ndarray

    def only(self, kept: np.ndarray) -> DirectScores:
        """The scores of some scenes."""
        return DirectScores(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))

    def row(self) -> dict[str, float]:
        """Numbers of a table."""
        far = self.travel > FAR
        per_cent = 100.0 * self.runout[far] / self.travel[far]
        row: dict[str, float] = {
            "runs": len(self.runout),
            "far": int(far.sum()),
            "travel, d": _median(self.travel),
            "runout, d": _median(self.runout),
            "90 %, d": float(np.quantile(self.runout, 0.9)) if len(self.runout) else np.nan,
            "runout of far ones, d": _median(self.runout[far]),
            "runout of far ones, %": _median(per_cent),
            "profile, % of area": 100.0 * _median(self.profile),
            COVERAGE: 100.0 * float(np.mean(self.covered)) if len(self.covered) else np.nan,
        }
        if np.isfinite(self.arrival).any():
            row |= {
                "half-way time, %": 100.0 * float(np.nanmedian(self.arrival)),
                "duration, %": 100.0 * float(np.nanmedian(self.duration)),
                "times covered, %": 100.0 * float(np.nanmean(self.arrival_covered)),
            }
        return {name: float(f"{value:.4g}") for name, value in row.items()}

    def table(self) -> dict[str, dict[str, float]]:
        """Rows of all scenes, of those without and with effects, and of each template."""
        names = sorted(set(self.template.tolist()))
        acting = {
            words: self.only(self.acting == on).row()
            for words, on in (("no effect", False), ("effects", True))
            if self.acting.any()
        }
        return {"all": self.row(), **acting} | {
            name: self.only(self.template == name).row() for name in names
        }


def calibrated(model: DirectModel, samples: list[Sample]) -> DirectPredictor:
    """The model with intervals that hold COVERED of the runs of the split `calibration`."""
    held = [one for one in samples if one.split == "calibration"]
    answer = answers(model, held)
    side, toes = _side(held), _toes(held)
    rows = np.arange(len(held))
    error = np.abs(answer.toes.numpy() - toes)[rows, side]
    ratio = error / answer.toe_scale.numpy()[rows, side]
    deposit = np.stack([one.outcome.thickness for one in held])
    off = np.abs(answer.thickness.numpy() - deposit) / answer.thickness_scale.numpy()
    moved = deposit > 0.0
    late = np.abs(answer.log_times.numpy() - np.log(_times(held))) / answer.time_scale.numpy()
    known = np.stack([described(one.section) for one in samples if one.split == "train"])
    return DirectPredictor(
        model,
        _conformal(ratio),
        _conformal(off[moved]),
        _conformal(late[np.isfinite(late)]),
        known,
        unit_of(known),
    )


def judged(predictor: DirectPredictor, samples: list[Sample]) -> DirectScores:
    """Scores of a model on samples."""
    answer = answers(predictor.model, samples)
    return _errors(
        samples,
        answer.toes.numpy(),
        answer.thickness.numpy(),
        predictor.toe_factor * answer.toe_scale.numpy(),
        answer.log_times.numpy(),
        predictor.time_factor * answer.time_scale.numpy(),
    )


def judged_run(samples: list[Sample], outcomes: list[Outcome]) -> DirectScores:
    """Scores of other outcomes of the same scenes, which state no interval and no times."""
    toes = np.stack([one.toes for one in outcomes])
    deposit = np.stack([one.thickness for one in outcomes])
    unknown = np.full(_times(samples).shape, np.nan)
    return _errors(samples, toes, deposit, np.zeros(toes.shape), unknown, unknown)


def seconds_a_case(predictor: DirectPredictor, samples: list[Sample], count: int = 50) -> float:
    """Time of one forecast from features up, mean of `count`, one after the other [s]."""
    chosen = [samples[i % len(samples)] for i in range(count)]
    began = time.perf_counter()
    for one in chosen:
        predictor.predict(one.section, one.outcome.toes_before)
    return (time.perf_counter() - began) / count


def write_card(folder: Path, model_file: str, facts: dict) -> None:
    """Write the card next to the model, with the hash of its weights."""
    facts = {**facts, "weights_sha256": file_hash(folder / model_file)}
    write_text(folder / CARD_FILE, yaml_text(facts))


def card(predictor: DirectPredictor, samples: list[Sample], training: dict) -> dict:
    """What is stated with a model."""
    test = [one for one in samples if one.split == "test"]
    seconds = float(np.mean([one.seconds for one in samples]))
    return {
        "kind": "direct",
        "parameters": sum(one.numel() for one in predictor.model.parameters()),
        "runs": {name: sum(one.split == name for one in samples) for name in SPLITS},
        "covers": COVERED,
        "training": training,
        "accuracy": judged(predictor, test).table(),
        "seconds_a_case": float(f"{seconds_a_case(predictor, test):.3g}"),
        "solver_seconds_a_case": float(f"{seconds:.3g}"),
    }


def _errors(
    samples: list[Sample],
    toes: np.ndarray,
    deposit: np.ndarray,
    interval: np.ndarray,
    log_times: np.ndarray,
    log_interval: np.ndarray,
) -> DirectScores:
    side, rows = _side(samples), np.arange(len(samples))
    spacing = np.array([one.section.spacing for one in samples])
    before = np.stack([one.outcome.toes_before for one in samples])
    error = np.abs(toes - _toes(samples))[rows, side]
    true = np.stack([one.outcome.thickness for one in samples])
    times = _times(samples)
    late = np.abs(log_times - np.log(times))[rows, side]
    within = np.where(np.isfinite(late), late <= log_interval[rows, side], np.nan)
    lasts = np.exp(log_times[:, WAY, _END]) - np.exp(log_times[:, WAY, 0])
    duration = times[:, WAY, _END] - times[:, WAY, 0]
    return DirectScores(
        np.array([one.template for one in samples]),
        np.array([one.acting for one in samples]),
        np.abs(_toes(samples) - before)[rows, side] / spacing,
        error / spacing,
        np.abs(deposit - true).sum(axis=1) / true.sum(axis=1),
        error <= interval[rows, side] + LEAST_SCALE * spacing,
        np.expm1(late[:, _MIDDLE]),
        within.mean(axis=1),
        np.abs(lasts - duration) / duration,
    )


def _times(samples: list[Sample]) -> np.ndarray:
    return np.stack([one.times for one in samples])


def _toes(samples: list[Sample]) -> np.ndarray:
    return np.stack([one.outcome.toes for one in samples])


def _side(samples: list[Sample]) -> np.ndarray:
    """The side that ran farther, 0 or 1, (n,)."""
    before = np.stack([one.outcome.toes_before for one in samples])
    return np.argmax(np.abs(_toes(samples) - before), axis=1)


def _conformal(ratio: np.ndarray) -> float:
    """The factor that holds COVERED of the ratios, with the correction for their finite number."""
    level = min(COVERED * (1.0 + 1.0 / len(ratio)), 1.0)
    return float(np.quantile(ratio, level))


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def table_text(facts: dict) -> str:
    """The accuracy of a card for a terminal."""
    rows = facts["accuracy"]
    columns = list(rows["all"])
    lines = ["".join(["template".ljust(10), *(f"{name:>24}" for name in columns)])]
    lines += [
        "".join([name.ljust(10), *(f"{row.get(column, np.nan):>24.4g}" for column in columns)])
        for name, row in rows.items()
    ]
    lines.append(
        f"{1000 * facts['seconds_a_case']:.1f} ms a case in the network; runs take "
        f"{1000 * facts['solver_seconds_a_case']:.0f} ms"
    )
    return "\n".join(lines)
