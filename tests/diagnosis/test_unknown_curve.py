"""The unknown strength curve: on slides with a hidden law, variable and curve are found."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.hypotheses.model import CURVE, Candidate, Curve
from diagnosis.options import Options
from diagnosis.selection.unknown_curve import PRIOR_STD, FoundCurve, runs_wanted
from diagnosis.verdict.verdict_builder import curve_part
from inversion.estimation.hold_out import HoldOut
from inversion.problem.state import State
from pipeline.cli import WorkFailed
from tests.diagnosis.straight import SIZE, Straight, errors, signatures, slopes

QUICK = Options(draws=300, replicates=3, starts=1, rounds=1, synthetic=True)
STRENGTH = 15.0
#: Change of a number by ln S [m].
SENSITIVITY = 5.0
CURVES = [
    Curve("overburden", "the weight above", "kPa", (0.0, 25.0, 50.0, 75.0, 100.0)),
    Curve("time", "the time", "s", (0.0, 2.5, 5.0, 7.5, 10.0)),
]


def variable(name: str) -> np.ndarray:
    """What each number of the prediction is governed by, (SIZE,): 5 to 95 % of the knots' range."""
    order = np.random.default_rng({"overburden": 5, "time": 6}[name]).permutation(SIZE)
    return (0.05 + 0.9 * order / (SIZE - 1)) * curve_of(name).knots[-1]


def law(curve: Curve, u: np.ndarray) -> np.ndarray:
    """The hidden law: ln multiplier of the strength, by the variable of a curve."""
    return np.interp(u, curve.knots, [0.3, -0.5, -0.1, 0.4, 0.6])


def curve_of(name: str) -> Curve:
    (found,) = (curve for curve in CURVES if curve.variable == name)
    return found


@dataclass
class Layered(Straight):
    """Every number is governed by the strength at one place, so by the curve at one u.

    Attributes:
        hidden: variable of the hidden law; only the truth has one.
        unseen: weight from which no number depends on the strength [kPa].
    """

    hidden: str = ""
    unseen: float = np.inf
    sensitive: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.candidates = [Candidate("late", "physics", "late", "m", -3.0, 3.0,
                                     (-2.0, -1.0, -0.4, 0.4, 1.0, 2.0))]  # fmt: skip
        self.curves = list(CURVES)
        self.sensitive = variable("overburden") < self.unseen

    def _run(self, state: State) -> np.ndarray:
        found = 20.0 + slopes()[:, 1] * (state.values[1] - 32.0) / 4.0
        for name, amplitude in state.effects:
            if not name.startswith(CURVE):
                found = found + amplitude * signatures()[name]
        ln_strength = np.zeros(SIZE)
        for curve in self.curves:
            given = dict(state.effects)
            c = [given.get(name, 0.0) for name in curve.names]
            ln_strength += np.interp(variable(curve.variable), curve.knots, c)
        if self.hidden:
            ln_strength += law(curve_of(self.hidden), variable(self.hidden))
        # ln S at the place of each number; mildly bent, as an e-fold more changes less.
        ln_s = np.log(state.values[0] / STRENGTH) + ln_strength
        return found + SENSITIVITY * self.sensitive * ln_s * (1.0 - 0.05 * ln_s)


def layered(seed: int, hidden: str, **more) -> Layered:
    """A model whose readings come from a hidden law, with a draw of the survey's errors."""
    (truth,) = Layered(np.ones(SIZE), hidden=hidden, **more).predict([State((STRENGTH, 32.0))])
    return Layered(truth + errors(seed), hold_out=HoldOut(groups=()), **more)


def sought(seed: int, hidden: str, **more) -> Diagnosis:
    return diagnose(layered(seed, hidden, **more), QUICK)


def expected(found: Diagnosis) -> np.ndarray:
    """ln multiplier of the calibrated strength that the hidden law means, at the knots."""
    fit = found.tried_models.way[-1].model.fit
    curve = found.curve.curve
    return np.log(STRENGTH / fit.space.values(fit.x)[0]) + law(curve, np.array(curve.knots))


@pytest.fixture(scope="module")
def by_weight() -> list[Diagnosis]:
    """Slides whose strength follows the weight above."""
    return [sought(seed, "overburden") for seed in range(5)]


@pytest.mark.slow
def test_the_variable_is_found(by_weight):
    for found in by_weight:
        assert found.decision.verdict == "unknown_effect"
        curve: FoundCurve = found.curve
        assert curve.curve.variable == "overburden"
        assert set(curve.calibrated) == {"overburden", "time"}
        assert curve.ln_evidence["overburden"] > curve.ln_evidence["time"] + 20.0
        # It leaves no more than the survey's errors: 29 numbers less 6 unknowns.
        assert curve.chi2["overburden"] < 50.0 < curve.chi2["time"]
        assert found.tried_models.way[0].adequacy.chi2 > 200.0
    by_time = sought(0, "time").curve
    assert by_time.curve.variable == "time"


def test_the_curve_is_found_within_its_band(by_weight):
    z = np.array([(f.curve.coefficients - expected(f)) / f.curve.std for f in by_weight])
    assert np.max(np.abs(z)) < 3.5 and 0.4 < np.sqrt(np.mean(z**2)) < 1.5
    for found in by_weight:
        assert np.all(found.curve.std < 0.12), "it says something"
        assert np.ptp(found.curve.coefficients) > 0.8
    within = [
        np.mean((low < np.exp(expected(f))) & (np.exp(expected(f)) < high))
        for f in by_weight
        for low, high in [f.curve.band]
    ]
    assert np.mean(within) > 0.45, "68 % are expected"


def test_where_nothing_is_measured_the_curve_says_so():
    found = sought(1, "overburden", unseen=60.0)
    assert found.curve.curve.variable == "overburden"
    seen, last = found.curve.std[:3], found.curve.std[-1]
    assert np.all(seen < 0.15) and last == pytest.approx(PRIOR_STD, rel=0.05)
    low, high = found.curve.band
    assert high[-1] / low[-1] == pytest.approx(np.exp(2 * PRIOR_STD), rel=0.1)


def test_the_verdict_tells_it(by_weight):
    found = by_weight[0]
    part = curve_part(found.curve)
    assert (part.variable, part.unit, part.knots) == ("overburden", "kPa", list(CURVES[0].knots))
    ratio = np.array(part.high) / np.array(part.multiplier)
    assert np.log(ratio) == pytest.approx(found.curve.std)
    assert np.array(part.multiplier) ** 2 == pytest.approx(np.array(part.low) * part.high)
    # No strength is reported from it: the answer is that of the model without the curve.
    assert not found.decision.final.model.names


def test_it_costs_about_what_is_kept_for_it():
    with_curves, without = layered(2, "overburden"), layered(2, "overburden")
    without.curves = []
    assert diagnose(without, QUICK).curve is None
    assert diagnose(with_curves, QUICK).curve is not None
    # A run of each coefficient, and two calibrations.
    assert 10 < with_curves.runs - without.runs <= runs_wanted(with_curves.curves) == 35


def test_no_curve_is_sought_where_the_model_is_adequate():
    plain = Layered(Layered(np.ones(SIZE)).predict([State((STRENGTH, 32.0))])[0] + errors(4),
                    hold_out=HoldOut(groups=()))  # fmt: skip
    found = diagnose(plain, QUICK)
    assert found.decision.verdict == "adequate" and found.curve is None
    assert not any(CURVE in name for state in plain._kept for name, _ in state.effects)


def test_no_curve_is_promised_where_the_allowance_is_over():
    model = layered(0, "overburden")
    found = diagnose(model, replace(QUICK, allowance=45))
    assert found.decision.verdict == "unknown_effect" and found.curve is None
    assert model.runs <= 60


def test_an_allowance_that_does_not_cover_the_base_model_is_refused():
    """Its unfinished fit would be taken for a model that does not fit."""
    with pytest.raises(
        WorkFailed, match="max_runs leaves 30 runs, .* no finer cells after 29 runs"
    ):
        diagnose(layered(0, "overburden"), replace(QUICK, allowance=30))
