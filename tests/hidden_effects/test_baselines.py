"""Baselines on slides that are linear in everything, and curves that were worked out by hand."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import log_softmax

from benchmarks.hidden_effects.__main__ import main
from benchmarks.hidden_effects.baselines import run
from benchmarks.hidden_effects.baselines.answers import (
    Answer,
    aic,
    bic,
    nearest_signature,
    own_answer,
)
from benchmarks.hidden_effects.baselines.classifier import (
    NOTHING,
    Simulator,
    amplitudes,
    noiseless,
    slope,
    steps,
    trained,
)
from benchmarks.hidden_effects.baselines.curve import METHODS, OWN, Curve, Row, draw, rows_of
from benchmarks.hidden_effects.baselines.discrepancy import discrepancy, kernel, marginal
from benchmarks.hidden_effects.baselines.network import Network
from benchmarks.hidden_effects.baselines.slide import Refitted, Slide, slide_of
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.scoring.by_other_codes import gives_name, is_right
from benchmarks.hidden_effects.scoring.calibration import covers
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.hidden_effects.scoring.sets import SETS
from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from pipeline.cli import InputError
from tests.diagnosis.straight import straight
from tests.hidden_effects.judges import digest

TRUE = np.log(15.0)


@cache
def slide(seed: int, *hidden: tuple[str, float]) -> Slide:
    """What is kept of a linear slide; S_r is 15 kPa."""
    options = Options(draws=200, replicates=3, seed=seed)
    return slide_of("x", diagnose(straight(seed, dict(hidden)), options))


def redrawn(one: Slide, rng: np.random.Generator, hidden: np.ndarray | float = 0.0) -> Slide:
    """The same with other errors of survey and priors, and something else hidden in it."""
    factor = np.linalg.cholesky(one.covariance)
    k, r = len(one.residual), len(one.prior_residual)
    residual = factor @ rng.standard_normal(k) + hidden
    new = {"residual": residual.tolist(), "prior_residual": rng.standard_normal(r).tolist()}
    return Slide.model_validate(one.model_dump() | new)


# --- what is kept ---


def test_what_is_kept_gives_the_scores_of_the_diagnosis():
    found = diagnose(straight(2, {"step": 2.0}), Options(draws=200, replicates=3, seed=2))
    kept = Slide.model_validate_json(slide_of("x", found).model_dump_json())
    linear, own = kept.system, found.comparison.judged
    assert linear.project(kept.augmented) == pytest.approx(own.residual, abs=1e-5)
    assert np.sqrt(linear.posterior[0, 0]) == pytest.approx(np.sqrt(own.system.posterior[0, 0]))
    for one in kept.suspects:
        scored = found.explanation.scores.best(one.name)
        s = linear.project(linear.augmented(one.signature))
        assert s == pytest.approx(scored.projected, abs=1e-5)
    assert {tuple(one.names) for one in kept.refitted} >= set(found.tried_models.models)


def test_the_best_scores_are_refitted_where_nothing_was_found():
    found = diagnose(straight(1, {}), Options(draws=200, replicates=3, seed=1))
    assert found.decision.verdict == "adequate" and list(found.tried_models.models) == [()]
    assert len(slide_of("x", found).refitted) > 2


# --- names ---


@pytest.mark.parametrize("hidden", [("step", 2.0), ("late", 2.5)])
@pytest.mark.parametrize("answer", [nearest_signature, aic, bic])
def test_what_was_hidden_is_named(answer, hidden):
    said = answer(slide(2, hidden))
    assert said.names == [hidden[0]] and said.families == ["physics"] and said.alarm
    assert abs(said.ln_strength - TRUE) < 2.5 * said.ln_std


@pytest.mark.parametrize("answer", [nearest_signature, bic])
def test_nothing_is_named_where_nothing_is_hidden(answer):
    said = answer(slide(1))
    assert said.names == [] and not said.given and not said.alarm


def test_the_nearest_signature_refits_the_strength_with_it():
    """`late` lowers the toe as a lower strength does: S_r is as far off as it hides, then not."""
    one = slide(2, ("late", 2.5))
    base = one.system.imitating(one.augmented)[0] * one.per_unit
    said = nearest_signature(one)
    assert abs(base) < 1e-4, "the base model is at its fit"
    assert abs(one.ln_strength - TRUE) > abs(said.ln_strength - TRUE)


def models(*deviances: tuple[str, float, int]) -> Slide:
    rows = [
        Refitted(names=name.split(), deviance=d, free=q, ln_strength=float(len(name)), ln_std=0.1)
        for name, d, q in deviances
    ]
    return slide(1).model_copy(update={"refitted": rows})


def test_criteria_pay_for_unknowns_and_mix_by_weight():
    """-2 ln L falls by 3: AIC, which asks for 2, takes the effect; BIC, ln 29 = 3.4, does not."""
    some = models(("", 20.0, 2), ("bend", 17.0, 3))
    assert len(some.residual) > np.exp(3.0)
    assert aic(some).names == ["bend"] and bic(some).names == []
    weight = 1.0 / (1.0 + np.exp(-0.5))
    assert aic(some).confidence == pytest.approx(0.5, abs=1e-3)
    assert aic(some).ln_strength == pytest.approx(4.0 * weight, abs=1e-4)
    spread = np.sqrt(0.01 + 16.0 * weight * (1.0 - weight))
    assert aic(some).ln_std == pytest.approx(spread, abs=1e-4)


# --- the discrepancy ---


def test_the_likelihood_is_that_of_the_residuals_without_the_parameters():
    """Against the density of numbers from which no parameter can be seen, and a wide prior."""
    one = slide(2, ("bend", 1.5))
    wide, none = 1e4, np.zeros((len(one.residual),) * 2)
    moving = np.array(one.moving)
    design = np.vstack([one.derivative, one.prior_rows])[:, moving]
    left = np.concatenate([one.residual, one.prior_residual])

    def direct(added: np.ndarray) -> float:
        c = np.eye(len(left))
        c[: len(added), : len(added)] = np.array(one.covariance) + added
        c = c + wide**2 * design @ design.T
        return -0.5 * (left @ np.linalg.solve(c, left) + np.linalg.slogdet(c)[1])

    some = kernel(one, np.log(np.full(5, 0.7)))
    gain = marginal(one, some).ln_likelihood - marginal(one, none).ln_likelihood
    assert gain == pytest.approx(direct(some) - direct(none), abs=1e-3)


def test_without_a_discrepancy_it_is_the_least_squares_of_the_base_model():
    one = redrawn(slide(1), np.random.default_rng(0))
    found = marginal(one, np.zeros((len(one.residual),) * 2))
    assert found.step[0] == pytest.approx(one.system.imitating(one.augmented)[0])
    assert found.covariance[0, 0] == pytest.approx(one.system.posterior[0, 0])


def test_a_discrepancy_widens_the_strength_and_leaves_it_unbiased():
    """Planted in toe and history, which know the strength: the stated deviation has it."""
    one, rng = slide(1), np.random.default_rng(3)
    ln = np.log([5.0, 1e-3, 0.3, 5.0, 0.5])  # toe; profile, its length; history, its length
    added = kernel(one, ln)
    factor = np.linalg.cholesky(added + 1e-9 * np.eye(len(added)))
    known, blind = [], []
    for _ in range(300):
        hidden = factor @ rng.standard_normal(len(added))
        drawn = redrawn(one, rng, hidden)
        known.append(marginal(drawn, added))
        blind.append(marginal(drawn, np.zeros_like(added)))
    steps_known = np.array([found.step[0] for found in known])
    std = np.sqrt(known[0].covariance[0, 0])
    assert abs(steps_known.mean()) < 3.0 * std / np.sqrt(300)
    assert steps_known.std() == pytest.approx(std, rel=0.15)
    assert std > 1.3 * np.sqrt(blind[0].covariance[0, 0])
    assert np.std([found.step[0] for found in blind]) > 1.3 * np.sqrt(blind[0].covariance[0, 0])


def test_what_is_hidden_raises_its_alarm_and_widens_it():
    calm, hidden = discrepancy(slide(1)), discrepancy(slide(2, ("late", 2.5)))
    assert not calm.alarm and hidden.alarm
    assert calm.names == hidden.names == [] and not hidden.given
    assert hidden.ln_std > 1.2 * calm.ln_std


# --- the classifier ---


def test_simulated_slides_have_what_they_are_said_to_have():
    one, rng = slide(1), np.random.default_rng(0)
    drawn = Simulator.of(one, rng).draw(3000, rng)
    assert np.mean(drawn.kind == 0) == pytest.approx(NOTHING, abs=0.03)
    assert not drawn.changes[drawn.kind == 0].any()
    for place, suspect in enumerate(one.suspects, start=1):
        own, along = drawn.changes[drawn.kind == place], suspect.signature / suspect.rung
        found = own @ along / (along @ along)
        assert own == pytest.approx(np.outer(found, along), abs=1e-6)
        assert np.abs(found).max() <= max(np.abs(suspect.amplitudes)) + 1e-6
    known = one.suspects[0].model_copy(update={"prior": (0.5, 0.1)})
    assert amplitudes(known, 500, rng).mean() == pytest.approx(0.5, abs=0.03)
    switch = known.model_copy(update={"switch": True, "rung": 1.0})
    assert set(amplitudes(switch, 5, rng)) == {1.0}


def test_the_network_learns_by_the_slopes_of_its_loss():
    rng = np.random.default_rng(2)
    network = Network.fresh((4, 5, 6, 5), rng)
    rows, kind, off = rng.standard_normal((7, 4)), rng.integers(0, 3, 7), rng.standard_normal(7)

    def loss() -> float:
        out = network.layers(rows)[-1]
        ln = log_softmax(out[:, :-2], axis=1)[np.arange(7), kind]
        return float(np.mean(0.5 * ((off - out[:, 3]) * np.exp(-out[:, 4])) ** 2 + out[:, 4] - ln))

    layers = network.layers(rows)
    slopes = network.slopes(layers, slope(layers[-1], kind, off))
    for weights, own in zip(network.weights, slopes, strict=True):
        for place in ((0, 1), (2, 3), (-1, 2)):
            value, ends = weights[place], []
            for sign in (1.0, -1.0):
                weights[place] = value + sign * 1e-5
                ends.append(loss())
            weights[place] = value
            assert own[place] == pytest.approx((ends[0] - ends[1]) / 2e-5, abs=1e-6)


def test_the_network_knows_names_and_strengths_that_it_has_not_seen():
    one, rng = slide(1), np.random.default_rng(5)
    network = trained(one, slides=2000, epochs=20)
    drawn = Simulator.of(one, rng).draw(800, rng)
    whole = noiseless(one, drawn) + rng.standard_normal((800, len(one.augmented)))
    said = network.says(whole)
    right = np.argmax(said[:, :-2], axis=1) == drawn.kind
    most = np.bincount(drawn.kind).max() / 800
    assert right.mean() > most + 0.15
    off = -(whole @ steps(one)) / network.unit
    z = (off - said[:, -2]) / np.exp(said[:, -1])
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.04)
    assert np.sqrt(np.mean((off - said[:, -2]) ** 2)) < 0.95 * np.std(off)


# --- answers against truths ---


def said(names="", *, given=True, confidence=1.0, off=0.0, families=("physics",), members=()):
    return Answer(names=names.split(), families=list(families) if names else [],
                  members=list(members), given=given and bool(names), alarm=bool(names),
                  confidence=confidence, ln_strength=np.log(20.0) + off, ln_std=0.1)  # fmt: skip


def hidden(kind, *names, source="smoothed_particles"):
    own = {} if source is None else {"source": source}
    return {"kind": kind, "effects": dict.fromkeys(names, {"amplitude": 1.0}),
            "parameters": {"strength": 20.0}, **own}  # fmt: skip


@pytest.mark.parametrize(
    ("truth", "answer", "right"),
    [
        (hidden("single", "shaking"), said("shaking"), True),
        (hidden("single", "shaking"), said("bingham"), False),  # of physics the name alone
        (hidden("single", "pool"), said("pool_on_the_left", families=["water"]), True),
        (hidden("single", "pool"), said("pool shaking", families=["physics", "water"]), False),
        (hidden("null"), said("pool", families=["water"]), False),
        (hidden("outside", "wave"), said("shaking"), False),
        (hidden("single", "pool"), said(), False),
        (hidden("pair", "bingham", "shaking", source=None), said("shaking bingham"), True),
        (hidden("single", "bingham", source=None), said("shaking"), False),
    ],
)
def test_what_is_right(truth, answer, right):
    assert answer.right(truth) is right


def rows(*cases):
    """Of (truth, answer of the diagnosis, answer of all others)."""
    return [
        Row(of="a set", truth={"name": f"case_{k}", **truth},
            answers={name: own if name == OWN else other for name in METHODS})
        for k, (truth, own, other) in enumerate(cases)
    ]  # fmt: skip


CASES = rows(
    (hidden("single", "shaking"), said("shaking", confidence=0.9), said("bingham", confidence=9)),
    (hidden("single", "shaking"), said("shaking", confidence=0.5, given=False, off=0.3),
     said("shaking", confidence=7)),
    (hidden("outside", "wave"), said("shaking", confidence=0.7, off=-0.15), said()),
    (hidden("null"), said(), said("shaking", confidence=2, off=0.19)),
)  # fmt: skip


def test_a_curve_by_hand():
    """The surest first: right, wrong, right of four slides; and wrong, right, wrong."""
    own, other = Curve.of(CASES, OWN), Curve.of(CASES, "nearest")
    assert own.right.tolist() == [True, False, True]
    assert own.coverage.tolist() == [0.25, 0.5, 0.75]
    assert own.risk == pytest.approx([0.0, 1 / 2, 1 / 3])
    assert other.risk == pytest.approx([1.0, 1 / 2, 2 / 3])
    assert own.at(2) == 0.5 and own.at(0) is None and own.at(4) is None
    assert own.mean(3) == pytest.approx(5 / 18) and other.mean(3) == pytest.approx(13 / 18)


def test_the_table_by_hand(tmp_path):
    table = rows_of(CASES)
    assert table[0][1:] == ["1 of 2", "0, 1", "50 %", "28 %", "0, 3", "8, 29 %", "3"]
    assert table[1][1:5] == ["1 of 3", "1, 0", "50 %", "72 %"]
    assert draw(tmp_path / "curve.png", CASES).stat().st_size > 5000


def test_the_diagnosis_answers_with_its_best_explanation():
    one = hidden("single", "effect_1", source=None)
    quoted = {"strength": {"95%": (16.0, 25.0)}}
    named = digest(one, "identified", ["effect_1"]).model_copy(update={"quoted": quoted})
    several = named.model_copy(update={"verdict": "ambiguous", "shares": [0.6, 0.4]})
    unknown = named.model_copy(update={"verdict": "unknown_effect"})
    answers = [own_answer(Judged(one, told)) for told in (named, several, unknown)]
    assert [said.given for said in answers] == [True, False, False]
    assert [said.names for said in answers] == [["effect_1"], ["effect_1"], []]
    assert answers[0].confidence > answers[1].confidence > 0.0
    assert answers[0].ln_strength == pytest.approx(np.log(20.0), abs=1e-4)
    assert answers[0].holds(one) and answers[0].right(one)


@pytest.mark.parametrize("words", ["fourth", "fifth", "sixth"])
def test_the_diagnosis_is_counted_as_in_its_own_score(words):
    (opened,) = [one for one in SETS if one.words == words]
    for one in opened.cases():
        said = own_answer(one)
        assert said.given == gives_name(one) and said.holds(one.truth) == covers(one, "95%")
        assert not said.given or said.right(one.truth) == is_right(one)


# --- a set ---


def judged_set(places, *opened):
    """Three sealed slides, of which two have a verdict; `opened` have a truth."""
    names = [f"case_000{k}" for k in (1, 2, 3)]
    sealed = [{"name": name, "section": "s", "survey": "profile", "sha256": "0" * 64}
              for name in names]  # fmt: skip
    run.write_json(places.sealed, sealed)
    told = hidden("single", "shaking") | {
        "section": "s", "survey": "profile", "lambda": 9.0, "spacing_factor": 1.0,
        "jitter_seed": 1,
    }  # fmt: skip
    quoted = {"strength": {"95%": (16.0, 25.0)}}
    verdict = digest(told, "identified", ["shaking"]).model_copy(update={"quoted": quoted})
    for name in (names[0], names[2]):
        run.write_json(places.verdict(name, "method"), verdict.model_dump(mode="json"))
    for name in opened:
        run.write_json(places.truth(name), told | {"name": name})


def test_only_judged_and_opened_slides_are_asked(tmp_path):
    places = Places(tmp_path)
    run.write_json(places.sealed, [])
    with pytest.raises(InputError, match="no case has been diagnosed"):
        run.judged_cases(places)
    judged_set(places, "case_0001")
    with pytest.raises(InputError, match="is sealed"):
        run.judged_cases(places)
    judged_set(places, "case_0001", "case_0003")
    assert run.judged_cases(places) == ["case_0001", "case_0003"]
    run.write_json(tmp_path / "judged_by.json", "by another version")
    with pytest.raises(InputError, match="other settings or another version"):
        main(["baselines", "--out", str(tmp_path), "--quiet"])


def test_slides_are_looked_at_once_and_kept(tmp_path, monkeypatch):
    places, asked = Places(tmp_path), []
    judged_set(places, "case_0001", "case_0003")

    def look(folder, name, store, config):
        asked.append(name)
        return slide(1).model_copy(update={"name": name})

    monkeypatch.setattr(run, "looked_at", look)
    monkeypatch.setattr(run, "METHODS", {"nearest": nearest_signature})
    found = [run.run_baselines(places, None, "a set") for _ in range(2)]
    assert found[0] == found[1] and asked == ["case_0001", "case_0003"]
    path = tmp_path / "record.json"
    run.save_answers(found[0][:1], path)
    run.save_answers(found[0], path)
    assert run.load_answers(path) == found[0]
