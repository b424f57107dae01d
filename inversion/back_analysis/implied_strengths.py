"""Which measurement asks for which strength: at which S_r would it be met exactly?

Read off the runs that the search made, without new ones. A prediction is taken as linear in ln S_r
from run to run, and on each side of the answer as far as its derivative is known; beyond the runs
it goes on with its last slope, by a factor of 1.25 for a strength and of 2 for an error bar. With
several unknowns the others stay at the answer: a run counts where moving them there changes the
prediction by less than half a standard deviation.

The numbers of one measurement, such as a profile, are met together: where the mean of their squared
differences is least. Its error bar goes to where that mean has risen by 1, which of a single number
is where it is one standard deviation off. A profile's errors are thus taken to go together.

A measurement says nothing of a strength where halving it would move the prediction by less than one
standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inversion.back_analysis.result import Iteration, MeasurementAnswer, ParameterAnswer, Result
from inversion.estimation.data import Role

STRENGTHS = ("residual_strength_kpa", "cohesion_kpa")
ROLES: tuple[Role, ...] = ("fitted", "held out", "compared")
#: Logarithms of the factors beyond the runs: of a strength, of the ends of an error bar.
CLOSE, FARTHEST = float(np.log(1.25)), float(np.log(2.0))
#: Over this, ln S, a measurement must notice; runs nearer to each other than the second are one,
#: and nearer to the answer than the third are left to its derivative.
HALVED, SAME, NEAR = float(np.log(2.0)), 0.02, 0.1
#: Standard deviations: by which halving must move it; that the other unknowns may move a run; from
#: which on a strength that fits best does not meet it.
NOTICED, OTHERS_MOVE, UNMET = 1.0, 0.5, 1.0
#: Mean squares within this of the least are as good; strengths of the grid they are looked for on.
AS_WELL, STEPS = 0.01, 4001

Status = Literal["met", "less", "more", "unmet", "nothing"]


@dataclass(frozen=True)
class ImpliedStrength:
    """What one measurement asks for.

    Attributes:
        name: of the measurement.
        role: what the search did with it.
        numbers: how many it has.
        status: met: at `value`; less, more: beyond the runs, the last of which is `value`; unmet:
            no strength meets it, the nearest is `value`; nothing: it does not notice the strength.
        value: strength [kPa]; None: `nothing`.
        low: lower end of the error bar [kPa]; None: open, or there is no bar.
        high: upper end, likewise.
        off: root mean square of (predicted - measured) / std there, signed where it is one number.
        also: further strengths that meet it as well [kPa]: it does not rise or fall all the way.
        is_limit: a limit that was not exceeded: it asks for `value` at least.
    """

    name: str
    role: Role
    numbers: int
    status: Status
    value: float | None = None
    low: float | None = None
    high: float | None = None
    off: float | None = None
    also: tuple[float, ...] = ()
    is_limit: bool = False


@dataclass(frozen=True)
class ImpliedStrengths:
    """What all measurements ask of one strength.

    Attributes:
        parameter: as it was answered; its interval is the band of the plot.
        tried: least and largest strength of the runs that it was read from [kPa].
        others: labels of the other unknowns, which stay at the answer.
        each: in order of the file.
    """

    parameter: ParameterAnswer
    tried: tuple[float, float]
    others: list[str]
    each: list[ImpliedStrength]


def implied_strengths(result: Result) -> list[ImpliedStrengths]:
    """What the measurements of a back-analysis ask for, one entry for each strength it sought.

    Args:
        result: of a back-analysis; strengths are told as its answers are, in small cells.

    Returns:
        Empty where no strength was sought or no run can be read.
    """
    found = []
    for p in result.answer.parameters:
        if p.property not in STRENGTHS or not p.as_run > 0.0 or not p.value > 0.0:
            continue
        runs = _runs(result, p)
        if not runs:
            continue
        others = [q.label for q in result.answer.parameters if q.name != p.name]
        strengths = [_told(p, run.values[p.name]) for run in runs]
        each = [_implied(result, p, runs, lines) for lines in _groups(result)]
        tried = (min([*strengths, p.value]), max([*strengths, p.value]))
        found.append(ImpliedStrengths(p, tried, others, each))
    return found


def _runs(result: Result, p: ParameterAnswer) -> list[Iteration]:
    """Runs that finished, at the spacing of the answer, with a strength above 0."""
    return [
        run
        for run in result.iterations
        if run.loss is not None
        and run.spacing_m == result.spacing_m
        and run.values.get(p.name, 0.0) > 0.0
    ]


def _told(p: ParameterAnswer, of_run: float) -> float:
    """A strength of a run as the answer is told."""
    return of_run * p.value / p.as_run


def _groups(result: Result) -> list[list[MeasurementAnswer]]:
    """Measured numbers that are met together: of one measurement and one role."""
    found: dict[tuple[str, Role], list[MeasurementAnswer]] = {}
    for m in result.measurements:
        if m.role in ROLES and m.measured is not None and m.std:
            found.setdefault((m.group, m.role), []).append(m)
    return list(found.values())


def _implied(
    result: Result, p: ParameterAnswer, runs: Sequence[Iteration], lines: list[MeasurementAnswer]
) -> ImpliedStrength:
    """What the numbers of one measurement ask for."""
    name, role = lines[0].group, lines[0].role
    curves = [curve for m in lines if (curve := _curve(result, p, runs, m)) is not None]
    if not curves:
        return ImpliedStrength(name, role, len(lines), "nothing")
    logs = np.linspace(
        min(curve.logs[0] for curve in curves) - FARTHEST,
        max(curve.logs[-1] for curve in curves) + FARTHEST,
        STEPS,
    )
    off = np.stack([curve.off(logs) for curve in curves])
    limits = np.array([curve.is_limit for curve in curves])
    seen = _Seen(
        logs,
        off,
        np.where(limits[:, None], np.maximum(off, 0.0), off),
        (min(curve.known[0] for curve in curves), max(curve.known[1] for curve in curves)),
        float(np.log(p.value)),
    )
    return _read(seen, name, role, len(lines), is_limit=bool(np.all(limits)))


@dataclass(frozen=True)
class _Curve:
    """One number against ln S.

    Attributes:
        logs: ln S of the runs and of the derivative [ln kPa], ascending (n,).
        at_runs: (predicted - measured) / std there, (n,).
        known: ln S of the weakest and of the strongest run.
        is_limit: a limit that was not exceeded.
    """

    logs: np.ndarray
    at_runs: np.ndarray
    known: tuple[float, float]
    is_limit: bool

    def off(self, logs: np.ndarray) -> np.ndarray:
        """(predicted - measured) / std at other strengths, (n,)."""
        slopes = np.diff(self.at_runs) / np.diff(self.logs)
        between = np.interp(logs, self.logs, self.at_runs)
        below = slopes[0] * np.minimum(logs - self.logs[0], 0.0)
        above = slopes[-1] * np.maximum(logs - self.logs[-1], 0.0)
        return between + below + above


def _curve(
    result: Result, p: ParameterAnswer, runs: Sequence[Iteration], m: MeasurementAnswer
) -> _Curve | None:
    """How one number depends on the strength; None where nothing but the answer tells of it."""
    points, known = _near_answer(result, p, m)
    at_answer = float(np.log(p.value))
    # Here the derivative knows better: noise over a short way would be taken for a slope.
    near = SAME if len(points) == 1 else max(max(points) - at_answer, NEAR) + SAME
    for run in runs:
        place = float(np.log(_told(p, run.values[p.name])))
        predicted = _at_others(result, p, run, m)
        if predicted is None or abs(place - at_answer) <= near:
            continue
        twin = next((one for one in points if abs(one - place) <= SAME), None)
        if twin is None:
            points[place] = predicted
        else:
            points[twin] = 0.5 * (points[twin] + predicted)
        known.append(place)
    if len(points) < 2 or m.std is None or m.measured is None:
        return None
    logs = np.array(sorted(points))
    off = (np.array([points[one] for one in logs]) - m.measured) / m.std
    return _Curve(logs, off, (min(known), max(known)), m.censored)


def _near_answer(
    result: Result, p: ParameterAnswer, m: MeasurementAnswer
) -> tuple[dict[float, float], list[float]]:
    """Predictions by ln S, at the answer and a derivative's step to each side; ln S of runs."""
    at_answer = float(np.log(p.value))
    points, known = {at_answer: m.predicted}, [at_answer]
    slope = result.answer.derivative.get(m.name, {}).get(p.name)
    step = result.answer.steps.get(p.name, 0.0)
    if slope is None or not 0.0 < abs(step) < 0.5 * p.value:
        return points, known
    for change in (step, -step):
        points[float(np.log(p.value + change))] = m.predicted + change * slope
    known.append(float(np.log(p.value + step)))  # the other side was not run
    return points, known


def _at_others(
    result: Result, p: ParameterAnswer, run: Iteration, m: MeasurementAnswer
) -> float | None:
    """Prediction of a run with the other unknowns at the answer; None where they move it far."""
    predicted = run.predicted.get(m.name)
    slopes = result.answer.derivative.get(m.name, {})
    moved = 0.0
    for q in result.answer.parameters:
        change = q.value - _of(q, run)
        if q.name != p.name and change:
            moved += slopes.get(q.name, np.inf) * change
    if predicted is None or not np.isfinite(predicted):
        return None
    return predicted + moved if abs(moved) <= OTHERS_MOVE * (m.std or 0.0) else None


def _of(q: ParameterAnswer, run: Iteration) -> float:
    """Another unknown in a run, as the answer is told."""
    return run.values[q.name] * (q.value / q.as_run if q.as_run else 1.0)


@dataclass(frozen=True)
class _Seen:
    """All numbers of a measurement on a grid of strengths.

    Attributes:
        logs: ln S (n,), evenly apart.
        off: (predicted - measured) / std, (m, n).
        missed: the same, 0 where a limit is kept.
        known: ln S of the weakest and of the strongest run.
        answer: ln S of the answer.
    """

    logs: np.ndarray
    off: np.ndarray
    missed: np.ndarray
    known: tuple[float, float]
    answer: float

    @property
    def square(self) -> np.ndarray:
        """Mean of the squared differences, (n,)."""
        return np.mean(self.missed**2, axis=0)

    @property
    def close(self) -> np.ndarray:
        """Places of the grid between the runs or close to them."""
        low, high = self.known[0] - CLOSE - 1e-9, self.known[1] + CLOSE + 1e-9
        return np.flatnonzero((self.logs >= low) & (self.logs <= high))

    def moved(self, low: float, high: float) -> float:
        """Root mean square of what the numbers change between two ln S [std]."""
        ends = [np.array([np.interp(at, self.logs, row) for row in self.off]) for at in (low, high)]
        return float(np.sqrt(np.mean((ends[1] - ends[0]) ** 2)))

    def notices(self) -> bool:
        """Halving the strength somewhere on the way moves it enough."""
        lows = np.arange(self.known[0] - HALVED, self.known[1] + 1e-9, HALVED / 8.0)
        return any(self.moved(low, low + HALVED) >= NOTICED for low in lows)

    def best(self) -> list[int]:
        """Places at which it is met as well as anywhere, the nearest to the answer first."""
        close = self.close
        square = self.square[close]
        around = np.concatenate([[np.inf], square, [np.inf]])
        lowest = (square <= around[:-2]) & (square < around[2:])
        good = close[lowest & (square <= square.min() + AS_WELL)]
        return sorted(good.tolist(), key=lambda place: abs(self.logs[place] - self.answer))


def _read(seen: _Seen, name: str, role: Role, numbers: int, *, is_limit: bool) -> ImpliedStrength:
    """The strength at which a measurement is met best, and how well."""
    nothing = ImpliedStrength(name, role, numbers, "nothing", is_limit=is_limit)

    def found(status: Status, place: int, also: Sequence[int] = ()) -> ImpliedStrength:
        low, high = _bar(seen, place) if status == "met" else (None, None)
        off = seen.missed[0, place] if numbers == 1 else np.sqrt(seen.square[place])
        return ImpliedStrength(
            name,
            role,
            numbers,
            status,
            float(np.exp(seen.logs[place])),
            low,
            high,
            float(off),
            tuple(float(np.exp(seen.logs[one])) for one in also),
            is_limit,
        )

    if not seen.notices():
        return nothing
    close = seen.close
    broken = close[seen.square[close] > 0.0]
    if is_limit and (not len(broken) or broken[-1] < close[-1]):
        return found("met", int(broken[-1]) + 1) if len(broken) else nothing
    place, *also = seen.best()
    if place not in (close[0], close[-1]):
        is_met = seen.square[place] <= UNMET**2 or numbers > 1
        return found("met", place, also) if is_met else found("unmet", place)
    is_weakest = place == close[0]
    end = seen.known[0] if is_weakest else seen.known[1]
    inside = (end, end + HALVED) if is_weakest else (end - HALVED, end)
    at_end = int(np.argmin(np.abs(seen.logs - end)))
    if seen.moved(*inside) < NOTICED:
        return found("unmet", at_end)
    return found("less" if is_weakest else "more", at_end)


def _bar(seen: _Seen, place: int) -> tuple[float | None, float | None]:
    """Ends of the error bar about a place of the grid [kPa]; None: open within what is known."""
    over = seen.square > seen.square[place] + 1.0
    below, above = np.flatnonzero(over[:place]), np.flatnonzero(over[place:])
    low = float(np.exp(seen.logs[below[-1] + 1])) if len(below) else None
    high = float(np.exp(seen.logs[place + above[0] - 1])) if len(above) else None
    return low, high
