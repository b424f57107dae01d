"""The prototype slide: its blind cases, and how verdicts on them are counted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.diagnosis_prototype.__main__ import main, outcome, table
from benchmarks.diagnosis_prototype.cases import Setting, detectabilities, make_case
from diagnosis.hypotheses.model import Model, State
from pipeline.cli import InputError


def test_a_case_is_the_same_when_made_again():
    one, other = (make_case("single", 2, Setting()) for _ in range(2))
    assert one.effects == other.effects and one.survey == other.survey
    assert np.array_equal(one.model.targets.measured, other.model.targets.measured)
    assert make_case("single", 3, Setting()).effects != one.effects
    assert isinstance(one.model, Model)
    assert make_case("null", 2, Setting()).effects == {}


def test_the_hidden_effect_leaves_the_misfit_that_is_said():
    case = make_case("single", 2, Setting())
    (again,) = detectabilities([case.effects], case.values, case.survey, Setting())
    assert case.detectability == pytest.approx(again) and 3.0 <= again <= 200.0
    (nothing,) = detectabilities([{}], case.values, case.survey, Setting())
    assert nothing < 0.1


def test_noise_hangs_on_the_state_and_its_seed_alone():
    model = make_case("null", 0, Setting()).model
    states = [State((12.0, 32.0), seed=seed) for seed in (0, 1, 0)]
    rows = model.predict(states)
    assert np.array_equal(rows[0], rows[2]) and np.std(rows[0] - rows[1]) > 0.05


def said(verdict: str, effects: dict[str, float], sets=(), strength: float = 10.0):
    """What `outcome` reads of a verdict."""
    return SimpleNamespace(
        verdict=verdict,
        answer=SimpleNamespace(
            effects=[
                SimpleNamespace(name=name, interval_95=(a - 0.1, a + 0.1))
                for name, a in effects.items()
            ],
            set_90=[SimpleNamespace(names=list(names)) for names in sets],
        ),
        final=SimpleNamespace(values={"S_r": strength}, std={"S_r": 1.0}),
    )


def test_verdicts_are_counted():
    case = SimpleNamespace(
        name="single 0", kind="single", effects={"bingham": 5.0}, values=(11.0, 32.0),
        detectability=30.0, survey="full",
    )  # fmt: skip
    right = outcome(case, said("identified", {"bingham": 5.05}, [("bingham",)]))
    assert (right.named, right.false, right.in_the_set) == (True, False, True)
    assert right.amplitude and right.s_r
    far = outcome(case, said("identified", {"bingham": 6.0}, [("bingham",)], strength=20.0))
    assert far.named and not far.amplitude and not far.s_r
    wrong = outcome(case, said("identified", {"dilatancy": 1.0}, [("dilatancy",)]))
    assert (wrong.named, wrong.false, wrong.in_the_set) == (False, True, False)
    assert wrong.amplitude is None and wrong.s_r is None
    several = outcome(case, said("ambiguous", {"dilatancy": 1.0}, [("dilatancy",), ("bingham",)]))
    assert (several.named, several.false, several.in_the_set) == (False, False, True)
    text = table("single", [right, far, wrong, several], 3)
    assert "4 cases, 3 left out" in text and "50 % (15-85), 2 of 4" in text

    case.kind, case.effects = "null", {}
    assert outcome(case, said("suspect", {})).named
    assert outcome(case, said("identified", {"bingham": 1.0})).false
    case.kind, case.effects = "outside", {"outside_ridge": 1.0}
    assert outcome(case, said("unknown_effect", {})).named
    assert outcome(case, said("identified", {"bingham": 1.0})).false


def test_the_study_prints_its_table(capsys):
    assert not main(["--cases", "1", "--kinds", "null", "--each"])
    text = capsys.readouterr().out
    assert "null 0" in text and "null: 1 cases, 0 left out" in text
    with pytest.raises(InputError, match="--cases 0: at least 1"):
        main(["--cases", "0"])
