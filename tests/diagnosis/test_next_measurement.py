"""The next measurement: separation by hand, greedy choice, and cases where the best is known."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.diagnose import diagnose, next_measurements
from diagnosis.hypotheses.model import Proposal, Proposing
from diagnosis.options import Options
from diagnosis.selection import next_measurement
from diagnosis.selection.next_measurement import (
    Readable,
    Rival,
    greedy,
    one_against,
    outcomes,
    proposal_error,
    read_at,
    separation,
    told_apart,
)
from inversion.estimation.hold_out import HoldOut
from inversion.problem.state import State
from tests.budget import examples
from tests.diagnosis.straight import Straight, straight

QUICK = Options(draws=300, replicates=3, starts=1, rounds=1, synthetic=True)


def rival(mean, weight=0.5, spread=0.0) -> Rival:
    mean = np.array(mean, dtype=float)
    return Rival((), weight, mean, spread * np.eye(len(mean)))


def proposal(name: str, *index: int) -> Proposal:
    return Proposal(name, name, index, np.eye(len(index)))


# --- separation ---


def test_separation_of_one_number_is_by_all_its_variances():
    rivals = [rival([5.0], spread=0.5), rival([2.0], spread=1.5)]
    assert separation(rivals, np.array([[2.0]]), [0]) == pytest.approx(9.0 / 4.0)


def test_separation_weighs_pairs_by_their_probabilities():
    rivals = [rival([0.0], 0.6), rival([1.0], 0.3), rival([3.0], 0.1)]
    by_hand = (0.6 * 0.3 * 1.0 + 0.6 * 0.1 * 9.0 + 0.3 * 0.1 * 4.0) / (0.18 + 0.06 + 0.03)
    assert separation(rivals, np.eye(1), [0]) == pytest.approx(by_hand)


def test_separation_of_two_numbers_knows_of_their_correlation():
    rivals = [rival([0.0, 0.0]), rival([2.0, 1.0])]
    error = np.array([[1.0, 0.8], [0.8, 1.0]])
    # d' C^-1 d with the inverse written out: determinant 1 - 0.64.
    by_hand = (4.0 - 2 * 0.8 * 2.0 + 1.0) / 0.36
    assert separation(rivals, error, [0, 1]) == pytest.approx(by_hand)
    assert separation(rivals, error, [1, 0]) == pytest.approx(by_hand)


def test_one_explanation_needs_no_telling_apart():
    assert separation([rival([1.0])], np.eye(1), [0]) == 0.0


# --- greedy choice ---


def test_the_test_of_an_answer_is_held_against_each_of_the_others():
    rivals = [rival([0.0, 0.0], 0.98), rival([3.0, 1.5], 0.01), rival([-3.0, 1.5], 0.01)]
    # The first number tells the others apart best, 6 of 3 and 3; the answer from both the second.
    assert separation(rivals[1:], np.eye(2), [0]) == pytest.approx(36.0)
    found = separation(one_against(rivals), np.eye(2), [0])
    assert found == pytest.approx(9.0, rel=0.01)


def test_a_candidate_counts_as_told_apart_at_three_standard_deviations():
    answer = rival([0.0, 0.0])
    candidates = [rival([100.0, 2.0]), rival([0.0, 2.0]), rival([np.nan, 2.0])]
    assert told_apart(answer, candidates, np.eye(2), [0]) == pytest.approx((9.0 + 0.0) / 2)
    assert told_apart(answer, candidates, np.eye(2), [1]) == pytest.approx(4.0)


def test_an_answer_is_tested_where_no_candidate_does_the_same():
    offers = [("like many", 0.0, {"bend": 2.0, "late": 1.0, "step": 1.0}), *OFFERS[1:]]
    found = diagnose(offering(3, {"bend": 1.5}, offers), QUICK)
    test = found.refutation
    assert found.decision.chance is not None and test is not None
    assert test.outcomes[0].names == tuple(found.decision.final.model.names)
    assert () in [one.names for one in test.outcomes], "what the base model says is told, too"
    assert 0.0 < test.gain <= 9.0
    assert diagnose(offering(21, {}, offers), QUICK).refutation is None, "there is no answer"
    assert diagnose(straight(3, {"bend": 1.5}), QUICK).refutation is None, "nothing is proposed"


def test_a_measurement_says_what_each_explanation_would_read():
    rivals = [rival([5.0, 1.0], spread=0.5), rival([2.0, 4.0], spread=1.5)]
    one, two = outcomes(proposal("marker", 1, 0), rivals, np.diag([1.0, 2.0]))
    assert one.values == pytest.approx([1.0, 5.0]) and two.values == pytest.approx([4.0, 2.0])
    assert two.std == pytest.approx(np.sqrt([3.5, 2.5]))


def test_the_second_measurement_is_not_the_first_once_more():
    # The first two show the same difference with nearly the same error; the third another.
    rivals = [rival([0.0, 0.0, 0.0]), rival([2.0, 1.95, 1.0])]
    error = np.array([[1.0, 0.99, 0.0], [0.99, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = greedy([proposal(n, i) for i, n in enumerate("abc")], rivals, error, 2)
    assert [one.proposal.name for one in found] == ["a", "c"]
    assert [one.gain for one in found] == pytest.approx([4.0, 5.0])


def test_a_marker_is_judged_by_both_its_numbers():
    rivals = [rival([0.0, 0.0, 0.0]), rival([1.5, 1.5, 2.0])]
    proposals = [proposal("marker", 0, 1), proposal("height", 2)]
    (one,) = greedy(proposals, rivals, np.eye(3), 1)
    assert one.proposal.name == "marker" and one.gain == pytest.approx(4.5)


def test_no_more_is_suggested_than_there_is():
    rivals = [rival([0.0]), rival([1.0])]
    assert len(greedy([proposal("a", 0)], rivals, np.eye(1), 5)) == 1
    assert greedy([], rivals, np.eye(0), 5) == []


@settings(max_examples=examples(25), deadline=None)
@given(st.integers(0, 10_000))
def test_greedy_choice_is_the_best_at_each_step(seed):
    draw = np.random.default_rng(seed)
    factor = draw.standard_normal((5, 5))
    error = factor @ factor.T + 0.1 * np.eye(5)
    rivals = [rival(draw.standard_normal(5), w, 0.2) for w in draw.uniform(0.1, 1.0, 3)]
    found = greedy([proposal(str(i), i) for i in range(5)], rivals, error, 5)
    order = [one.proposal.index[0] for one in found]
    for count, one in enumerate(found):
        before = order[:count]
        gains = {i: separation(rivals, error, [*before, i]) for i in range(5) if i not in before}
        assert one.gain == pytest.approx(max(gains.values()))
        assert gains[order[count]] == max(gains.values())
    # An additional measurement takes nothing away.
    assert all(b >= a - 1e-9 for a, b in zip(gains_of(found), gains_of(found)[1:], strict=False))
    best_pair = max(separation(rivals, error, pair) for pair in combinations(range(5), 2))
    assert found[1].gain <= best_pair + 1e-9


def gains_of(found) -> list[float]:
    return [one.gain for one in found]


# --- a model whose best measurement is known ---


@dataclass
class Offering(Straight):
    """A straight model that could also be asked for other numbers.

    Attributes:
        offers: name -> (what the number does by fitted strength, by effect).
    """

    offers: tuple[tuple[str, float, dict[str, float]], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self.proposals = [proposal(name, place) for place, (name, *_) in enumerate(self.offers)]

    def propose(self, states: list[State]) -> np.ndarray:
        found = np.empty((len(states), len(self.offers)))
        for row, state in enumerate(states):
            x = self.parameters.to_fitted(np.array(state.values))
            for place, (_, slope, does) in enumerate(self.offers):
                found[row, place] = slope * x[0] + sum(
                    does.get(name, 0.0) * amplitude for name, amplitude in state.effects
                )
        return found


def offering(seed: int, effects: dict[str, float], offers, **more) -> Offering:
    plain = straight(seed, effects)
    return Offering(plain.readings, offers=tuple(offers), noise=0.02, **more)


OFFERS = [
    ("more of the same", 0.0, {"bend": 1.0, "like_bend": 1.0}),
    ("what tells them apart", 0.0, {"bend": 2.0, "like_bend": -2.0}),
    ("strength once more", 3.0, {}),
]


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_what_tells_the_survivors_apart_comes_first(order):
    model = offering(3, {"bend": 1.5}, [OFFERS[place] for place in order],
                     hold_out=HoldOut(groups=("history",)))  # fmt: skip
    assert isinstance(model, Proposing)
    found = diagnose(model, QUICK)
    shares = found.decision.probability
    assert shares[("bend",)] > 0.02 and shares[("like_bend",)] > 0.02, "two survive"
    suggested = found.next_measurement
    assert suggested[0].proposal.name == "what tells them apart"
    # The two effects are about 1.5 each, so the numbers differ by about 6 standard deviations.
    assert suggested[0].gain > 10.0
    by_each = suggested[0].outcomes
    assert [one.names for one in by_each[:2]] in (
        [("bend",), ("like_bend",)],
        [("like_bend",), ("bend",)],
    )
    said = {one.names: float(one.values[0]) for one in by_each}
    assert said[("bend",)] == pytest.approx(3.0, abs=0.6)  # 2 x 1.5; the other has the other sign
    assert said[("like_bend",)] == pytest.approx(-3.0, abs=0.9)
    assert all(1.0 <= float(one.std[0]) < 1.5 for one in by_each), "the survey's own is 1"
    runs = model.computed
    assert [one.gain for one in next_measurements(found, 3)] == gains_of(suggested)
    assert model.computed == runs, "no run is asked for"


def test_where_the_model_is_adequate_it_is_what_would_have_shown_most():
    offers = [("blind", 0.0, {}), ("sees late motion", 0.0, {"late": 3.0})]
    model = offering(21, {}, offers)
    found = diagnose(model, QUICK)
    assert found.decision.verdict == "adequate"
    first, second = found.next_measurement
    assert first.proposal.name == "sees late motion" and first.gain > 1.0
    assert second.gain == pytest.approx(first.gain, rel=1e-6), "the blind one adds nothing"
    assert [one.names for one in first.outcomes] == [()], "what it reads if nothing hides"


def test_numbers_that_were_not_measured_are_read_from_the_runs():
    model = offering(3, {"bend": 1.5}, OFFERS)
    found = diagnose(model, QUICK)
    fit = found.tried_models.models[("bend",)].fit
    mean, slope = read_at(model, found.comparison, fit.space, fit.x)
    (exact,) = model.propose([fit.space.state(fit.x)])
    assert mean == pytest.approx(exact, abs=0.05)
    unit = fit.space.effects[0].scale.unit
    assert slope[:, 2] == pytest.approx([1.0 * unit, 2.0 * unit, 0.0], abs=0.1)
    assert slope[2, 0] == pytest.approx(3.0, abs=0.3)


@pytest.mark.slow
def test_the_error_of_a_proposal_is_the_survey_s_and_the_model_s():
    model = offering(3, {}, OFFERS)
    found = diagnose(model, QUICK)
    error, _ = proposal_error(model, found.comparison, QUICK)
    # These readings have no noise of the points, so what is left is the survey's.
    assert error == pytest.approx(np.eye(3), abs=1e-9)


@dataclass
class WithCells(Offering):
    """Finer cells read 0.6 more of the first number, the second scheme 0.3 more."""

    def propose(self, states: list[State]) -> np.ndarray:
        found = super().propose(states)
        more = {"own": 0.0, "fine": 0.6, "transfer": 0.3}
        found[:, 0] += [more[state.numerics] for state in states]
        return found


def test_a_proposal_is_read_as_in_finer_cells_and_less_surely():
    plain = straight(3, {})
    cells = np.full(len(plain.readings), 1e-6)
    model = WithCells(plain.readings, offers=tuple(OFFERS), noise=0.02, cells=cells)
    found = diagnose(model, QUICK)
    error, finer = proposal_error(model, found.comparison, QUICK)
    assert finer == pytest.approx([0.6, 0.0, 0.0])
    # The survey's own is 1; half of what finer cells change, and the scheme's change.
    assert np.diag(error) == pytest.approx([1.0 + (0.5 * 0.6) ** 2 + 0.3**2, 1.0, 1.0])
    runs = model.computed
    next_measurements(found, 2)
    assert model.computed == runs, "no run is asked for"


def test_a_model_that_proposes_nothing_gets_no_suggestion():
    assert next_measurements(diagnose(straight(3, {"bend": 1.5}), QUICK), 2) == []
    assert next_measurements(diagnose(offering(3, {"bend": 1.5}, []), QUICK), 2) == []


def test_what_no_run_can_read_takes_nothing_from_the_others():
    offers = [("of points that are not there", np.nan, {}), *OFFERS]
    found = diagnose(offering(3, {"bend": 1.5}, offers), QUICK)
    names = [one.proposal.name for one in found.next_measurement]
    assert names[0] == "what tells them apart" and offers[0][0] not in names
    assert found.next_measurement[0].gain > 10.0


@pytest.mark.parametrize(("unread", "kept"), [(1, "ab"), (3, "a")])
def test_what_many_runs_cannot_read_is_no_proposal(unread, kept):
    """A slip depth where nothing slipped; a run that failed has no reading of anything."""
    readings = np.ones((20, 3))
    readings[:unread, 1:] = np.nan
    readings[-4:] = np.nan
    model = SimpleNamespace(
        proposals=[proposal("a", 0), proposal("b", 1, 2)],
        propose=lambda states: readings[[int(state.values[0]) for state in states]],
    )
    space = SimpleNamespace(state=lambda x, seed: State((10.0 + seed,)))
    base = SimpleNamespace(
        surface=SimpleNamespace(space=space, x=None),
        seeds=3,
        runs=SimpleNamespace(every=[(State((float(number),)), None) for number in range(20)]),
    )
    found = Readable.of(model, SimpleNamespace(base=base))
    assert "".join(one.name for one in found.proposals) == kept
    columns = [place for one in found.proposals for place in one.index]
    assert columns == list(range(len(columns)))
    assert found.propose([State((5.0,))]).shape == (1, len(columns))


def test_what_cannot_be_read_is_not_suggested(monkeypatch):
    """A marker in soil that one rival carries away has no reading there."""
    proposals = [Proposal(name, name, (place,), np.eye(1)) for place, name in enumerate("ab")]
    gains = {(0,): np.nan, (1,): 3.0}
    monkeypatch.setattr(
        next_measurement, "separation", lambda _, __, index: gains.get(tuple(index), np.nan)
    )
    (only,) = next_measurement.greedy(proposals, [], np.eye(2), 2)
    assert only.proposal.name == "b" and only.gain == 3.0
