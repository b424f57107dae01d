"""Forward engines that are formulas: smooth, with known answers, in no time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np

from geometry.survey.toe_runout import ToeRunout
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.forward import Forward, Prediction, Request
from inversion.estimation.misfit import Objective
from inversion.estimation.search import Search
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import ParameterSpec


def strength(name: str, start: float = 30.0, low: float = 5.0, high: float = 90.0, **more):
    return ParameterSpec(
        name=name,
        zones=[name],
        property="residual_strength_kpa",
        start=start,
        low=low,
        high=high,
        **more,
    )


def angle(name: str, start: float = 30.0, low: float = 27.0, high: float = 37.0, **more):
    return ParameterSpec(
        name=name, zones=[name], property="friction_deg", start=start, low=low, high=high, **more
    )


def toes(*values: float, std: float = 1.0) -> list[ToeRunout]:
    return [
        ToeRunout(
            type="toe_runout",
            name=f"toe {place}",
            side="left",
            value_m=value,
            std_m=std,
            confidence="paper",
            source="test",
        )
        for place, value in enumerate(values)
    ]


def targets(*values: float, std: float = 1.0, loss: str = "runout") -> Targets:
    return make_targets(toes(*values, std=std), fit=None, loss=loss, source="test")


class Formula(Forward):
    """`inversion.estimation.forward.Forward` by a formula: values (p,) -> numbers (m,).

    It is its own reading of a question: any of them runs requests of all of them.
    """

    def __init__(
        self,
        formula: Callable[[np.ndarray], np.ndarray],
        names: list[str],
        *,
        parameters: Parameters | None = None,
        noise: float = 0.0,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.formula, self.noise, self.seed = formula, noise, seed
        self.targets, self.parameters = (
            SimpleNamespace(names=names, groups=[*range(len(names))]),
            parameters,
        )
        self.asked: list[np.ndarray] = []

    def at(self, values: np.ndarray) -> Request:
        return Request(self, np.asarray(values, dtype=float))

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        self.runs += len(requests)
        return [request.setup._one(request.values) for request in requests]

    def _one(self, values: np.ndarray) -> Prediction:
        self.asked.append(values)
        numbers = np.asarray(self.formula(values), dtype=float)
        if self.noise:
            bits = np.frombuffer(np.round(values, 9).tobytes(), np.uint32)
            draw = np.random.default_rng([self.seed, *bits.tolist()])
            numbers = numbers + self.noise * draw.standard_normal(len(numbers))
        status = "finished" if np.all(np.isfinite(numbers)) else "failed"
        return Prediction(numbers, np.zeros(len(numbers)), status=status, reason="test")


def problem(
    specs: Sequence[ParameterSpec],
    formula: Callable[[np.ndarray], np.ndarray],
    goal: Targets,
    *,
    loss: str = "runout",
    tolerance: float = 0.1,
    noise: float = 0.0,
    **more,
) -> Search:
    """A search on a formula."""
    parameters = Parameters(list(specs))
    engine = Formula(formula, goal.names, noise=noise)
    steps = FiniteSteps(parameters, np.zeros(int(goal.fitted.sum())))
    return Search(engine, engine, Objective(parameters, goal, loss, tolerance), steps, **more)
