"""Which measurement asks for which strength, where it is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from inversion.back_analysis.implied_strengths import ImpliedStrength, implied_strengths
from inversion.back_analysis.result import Result
from report.sentences.implied_strengths import asked_words, how_words
from tests.inversion.report_case import document, friction, measurement, parameter

S_R = "residual_strength_1"
Law = Callable[[float], float]


def toe(strength: float) -> float:
    """Runout [m] of a slide: 14 m less for each factor of e."""
    return 90.0 - 14.0 * float(np.log(strength))


def crest(strength: float) -> float:
    """Settlement [m] of a crest: 3 m less for each factor of e."""
    return 30.0 - 3.0 * float(np.log(strength))


def result(
    laws: Mapping[str, tuple[Law, float, float]],
    *,
    answer: float = 20.0,
    tried: tuple[float, ...] = (10.0, 30.0),
    factor: float = 1.0,
    slopes: bool = True,
    **more: dict,
) -> Result:
    """A back-analysis whose runs follow laws: name -> (law of a run's strength, measured, std)."""
    step = -0.05 * answer
    iterations = [
        {"iteration": k, "kind": "gauss_newton", "spacing_m": 2.0, "accepted": True,
         "values": {S_R: value}, "loss": 1.0, "runs_so_far": k + 1, "seconds": 1.0,
         "predicted": {name: law(value) for name, (law, _, _) in laws.items()}}
        for k, value in enumerate((*tried, answer))
    ]  # fmt: skip
    made = document(
        [parameter(S_R, value=factor * answer, value_of_run=answer)],
        iterations=iterations,
        measurements=[
            measurement(name, measured=measured, std=std, predicted=law(answer), low=None,
                        high=None, difference_in_std=0.0, **more.get(name, {}))
            for name, (law, measured, std) in laws.items()
        ],
    )  # fmt: skip
    if slopes:
        made["answer"]["derivative"] = {
            name: {S_R: (law(answer + step) - law(answer)) / step / factor}
            for name, (law, _, _) in laws.items()
        }
        made["answer"]["steps"] = {S_R: factor * step}
    return Result.model_validate(made)


def asked(found: Result) -> dict[str, ImpliedStrength]:
    (one,) = implied_strengths(found)
    return {each.name: each for each in one.each}


@pytest.mark.parametrize("factor", [1.0, 1.15])
def test_two_measurements_that_ask_for_different_strengths(factor):
    """The toe was made with 12 kPa, the crest with 28; told in small cells both are more."""
    held_out = {"crest": {"role": "held out"}}
    laws = {"toe": (toe, toe(12.0), 2.0), "crest": (crest, crest(28.0), 0.5)}
    found = asked(result(laws, factor=factor, **held_out))
    for name, truth, width in (("toe", 12.0, 2.0 / 14.0), ("crest", 28.0, 0.5 / 3.0)):
        one = found[name]
        assert (one.status, one.also) == ("met", ())
        assert one.value == pytest.approx(factor * truth, rel=1e-3)
        # The error bar is that of the survey, turned into strength.
        assert one.low == pytest.approx(factor * truth * np.exp(-width), rel=2e-3)
        assert one.high == pytest.approx(factor * truth * np.exp(width), rel=2e-3)
    assert found["crest"].role == "held out"


def test_what_lies_beyond_the_runs_is_not_made_up():
    laws = {"far": (toe, toe(80.0), 2.0), "near": (toe, toe(35.0), 2.0), "low": (toe, 90.0, 2.0)}
    found = asked(result(laws))
    assert found["far"].status == "more" and found["far"].value == pytest.approx(30.0, rel=1e-3)
    assert found["far"].low is None and found["far"].off > 2.0
    assert asked_words(found["far"]).startswith("more than 30.0 kPa: there still 6.9 std too large")
    assert found["near"].status == "met" and found["near"].value == pytest.approx(35.0, rel=0.01)
    assert found["low"].status == "less" and found["low"].value == pytest.approx(10.0, rel=1e-3)


def test_a_measurement_that_does_not_notice_the_strength_says_so():
    """It happens to be met at 20 kPa, and so it would be at any other strength."""
    laws = {"toe": (toe, toe(20.0), 2.0), "flat": (crest, crest(20.0), 5.0)}
    found = asked(result(laws))
    assert found["toe"].status == "met"
    assert found["flat"].status == "nothing" and found["flat"].value is None
    assert "says nothing" in asked_words(found["flat"])


def test_what_no_strength_meets():
    """The runout has a greatest value, at 15 kPa, well short of what was measured."""

    def peaked(strength: float) -> float:
        return 40.0 - 30.0 * abs(float(np.log(strength / 15.0)))

    found = asked(result({"toe": (peaked, 50.0, 2.0)}, tried=(8.0, 15.0, 30.0)))["toe"]
    assert found.status == "unmet" and found.value == pytest.approx(15.0, rel=0.01)
    assert asked_words(found).startswith("no strength that was tried: 5.0 std too small")


def test_two_strengths_that_meet_it_are_both_told():
    def peaked(strength: float) -> float:
        return 40.0 - 30.0 * abs(float(np.log(strength / 15.0)))

    found = asked(result({"toe": (peaked, peaked(20.0), 2.0)}, tried=(8.0, 15.0, 30.0)))["toe"]
    assert found.value == pytest.approx(20.0, rel=0.01)
    assert found.also == pytest.approx([15.0**2 / 20.0], rel=0.02)


def test_a_limit_asks_for_a_strength_at_least():
    laws = {"toe": (toe, toe(16.0), 1.0)}
    limit = {"toe": {"censored": True}}
    found = asked(result(laws, **limit))["toe"]
    assert (found.status, found.is_limit, found.high) == ("met", True, None)
    assert found.value == pytest.approx(16.0, rel=0.01)
    assert asked_words(found) == "at least 16.0 kPa"
    kept = asked(result({"toe": (toe, 99.0, 1.0)}, **limit))["toe"]
    assert kept.status == "nothing"


def test_a_profile_is_met_as_a_whole():
    laws = {
        f"profile at x {x} m": (lambda s, x=x: crest(s) * x, crest(14.0) * x, 0.5 * x)
        for x in (1, 2, 3)
    }
    series = {name: {"group": "profile"} for name in laws}
    found = asked(result(laws, **series))
    assert set(found) == {"profile"} and found["profile"].numbers == 3
    assert found["profile"].value == pytest.approx(14.0, rel=0.01)
    # As wide as a single one of them: their errors are taken to go together.
    assert found["profile"].high == pytest.approx(14.0 * np.exp(0.5 / 3.0), rel=0.01)


def test_one_run_tells_by_its_slope_alone():
    found = asked(result({"toe": (toe, toe(21.0), 1.0)}, tried=()))["toe"]
    assert found.status == "met" and found.value == pytest.approx(21.0, rel=0.01)
    alone = asked(result({"toe": (toe, toe(21.0), 1.0)}, tried=(), slopes=False))["toe"]
    assert alone.status == "nothing"


def test_other_unknowns_stay_at_the_answer():
    """A run counts where moving the others to the answer hardly changes the prediction."""
    other = "friction_7"

    def both(strength: float, angle: float) -> float:
        return toe(strength) - 3.0 * (angle - 30.0)

    runs = [(10.0, 34.0), (30.0, 30.1), (20.0, 30.0)]
    made = document([parameter(S_R, value=20.0), friction(other)])
    made["iterations"] = [
        {**made["iterations"][0], "iteration": k, "values": {S_R: s, other: angle},
         "predicted": {"toe": both(s, angle)}}
        for k, (s, angle) in enumerate(runs)
    ]  # fmt: skip
    made["measurements"] = [
        measurement("toe", measured=toe(26.0), std=2.0, predicted=toe(20.0), low=None, high=None)
    ]
    made["answer"]["derivative"] = {"toe": {S_R: -14.0 / 20.0, other: -3.0}}
    made["answer"]["steps"] = {S_R: -1.0, other: 0.5}
    (found,) = implied_strengths(Result.model_validate(made))
    assert found.others == ["friction angle of the rolled fill"]
    assert "friction angle of the rolled fill as answered" in how_words(found)
    assert found.each[0].value == pytest.approx(26.0, rel=0.01)


def test_runs_at_another_spacing_and_failed_ones_are_left_out():
    found = result({"toe": (toe, toe(12.0), 2.0)})
    lines = [
        line.model_copy(update={"spacing_m": 4.0} if k == 0 else {"loss": None} if k == 1 else {})
        for k, line in enumerate(found.iterations)
    ]
    (one,) = implied_strengths(found.model_copy(update={"iterations": lines}))
    assert one.tried == (20.0, 20.0)
    assert one.each[0].status == "less"
