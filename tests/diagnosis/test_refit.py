"""Refits of models whose parameters must give way to an effect, and the error an effect brings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.selection.effect_error import doubting, weighed_again
from diagnosis.selection.explain import Explanation, explain
from diagnosis.selection.refit import ANCHORED, FittedModel, judge, refit, weighed
from diagnosis.selection.tried_models import accepted, why_not
from diagnosis.verdict.verdict_builder import verdict_document
from inversion.estimation import response_surface
from inversion.problem.state import State
from tests.diagnosis.straight import SIZE, Straight, errors, signatures, straight, truth

OPTIONS = Options(draws=400, replicates=3)
RIDGE = {"late": (0.35, 4.0)}


def looked_at(model: Straight, options: Options = OPTIONS) -> tuple[Comparison, Explanation]:
    comparison = compare(model, options)
    return comparison, explain(model, comparison, options)


def refitted(
    comparison: Comparison, explanation: Explanation, *names: str, near: np.ndarray | None = None
) -> FittedModel:
    ladders = {name: one.ladder for name, one in explanation.signatures.items()}
    surface = comparison.base.surface.with_ladders(ladders)
    found = refit(explanation.context, surface, names, seeds=ANCHORED, near=near)
    assert found is not None
    return found


def on_a_ridge(seed: int, amplitude: float) -> Straight:
    """Data of a large effect to which the strength has given way."""
    quiet = Straight(np.ones(SIZE), ridge=RIDGE)
    readings = quiet.predict([State((8.0, 32.0)).with_effects({"late": amplitude})])[0]
    return Straight(readings + errors(seed), ridge=RIDGE)


@pytest.mark.parametrize("seed", range(4))
def test_a_refit_follows_the_parameters_to_an_amplitude_beyond_the_ladder(seed):
    model = on_a_ridge(seed, 2.8)
    comparison, explanation = looked_at(model)
    found = refitted(comparison, explanation, "late")
    assert max(explanation.signatures["late"].ladder.rungs) == 2.0
    amplitude = found.fit.space.amplitudes(found.fit.x)["late"]
    assert amplitude == pytest.approx(2.8, abs=0.8)
    # No worse than a search that is given its starting point.
    told = np.concatenate([model.parameters.to_fitted(np.array([8.0, 32.0])),
                           [2.8 / found.fit.space.effects[0].scale.unit]])  # fmt: skip
    best = refitted(comparison, explanation, "late", near=told)
    assert found.fit.total < best.fit.total + 1.0


@pytest.mark.parametrize("seed", range(4))
def test_parameters_may_give_way_farther_than_a_surrogate_is_believed(seed, monkeypatch):
    """The search ends at the edge of its surrogate, far from any fit, and goes on from there."""
    comparison, explanation = looked_at(on_a_ridge(seed, 2.8))
    free = refitted(comparison, explanation, "late").fit
    monkeypatch.setattr(response_surface, "REACH", 1.2)
    held = refitted(comparison, explanation, "late").fit
    assert np.max(np.abs(held.x[:2] - comparison.base.surface.x)) > 1.2
    assert held.total < free.total + 1.0
    assert held.space.amplitudes(held.x)["late"] == pytest.approx(2.8, abs=0.8)


def test_a_fourth_effect_has_one_first_guess_and_is_fitted_from_there():
    names = ("bend", "late", "like_strength", "step")
    model = straight(1, {"late": 1.0, "step": 1.0})
    comparison, explanation = looked_at(model)
    before = refitted(comparison, explanation, *names[:3])
    ladders = {"step": explanation.signatures["step"].ladder}
    surface = before.surface.with_ladders(ladders)
    found = refit(explanation.context, surface, names, seeds=ANCHORED)
    assert found is not None and found.names == names
    assert found.fit.total < before.fit.total


def test_an_effect_adds_to_the_error_what_finer_cells_make_of_it():
    model = Straight(truth({"late": 2.0}) + errors(1), skewed={"late": ("step", 0.5)})
    comparison, explanation = looked_at(model)
    after = refitted(comparison, explanation, "late")
    context = doubting(explanation.context, comparison.base, after, OPTIONS)
    grown = context.data.covariance - explanation.context.data.covariance
    bias = 0.5 * after.fit.space.amplitudes(after.fit.x)["late"] * signatures()["step"]
    doubt = OPTIONS.finer_share**2 + OPTIONS.finer_share_std**2
    expected = doubt * (0.7 * np.outer(bias, bias) + 0.3 * np.diag(bias**2))
    assert np.allclose(grown, expected, atol=1e-9)
    again = weighed_again(context, after)
    assert again.fit.total <= after.fit.total and np.array_equal(again.fit.x, after.fit.x)
    # Without the finer run, or without the runs to make it, nothing is doubted.
    plain = replace(OPTIONS, finer_share=0.0, finer_share_std=0.0)
    change = doubting(explanation.context, comparison.base, after, plain).data.covariance
    assert np.allclose(change, explanation.context.data.covariance)
    comparison.base.runs.allowance = comparison.base.runs.asked
    other = replace(after, fit=replace(after.fit, x=after.fit.x + 0.01))
    assert doubting(explanation.context, comparison.base, other, OPTIONS) is None


@pytest.mark.slow
def test_no_second_effect_for_what_the_cells_make_of_the_first():
    """Much of the first effect's signature depends on the cells, in the form of another effect."""
    needless, wanted = 0, 0
    for seed in range(6):
        readings = truth({"late": 2.8, "step": 2.5}) + errors(seed)
        model = Straight(readings, skewed={"late": ("step", 0.9)})
        options = replace(OPTIONS, seed=seed)
        needless += (
            len(verdict_document(diagnose(model, options), case="c", title="t").answer.effects) > 1
        )
        exact = straight(seed, {"late": 2.8, "step": 2.5})
        wanted += (
            len(verdict_document(diagnose(exact, options), case="c", title="t").answer.effects) > 1
        )
    assert needless <= 1 and wanted >= 5


def test_a_fit_whose_runs_cannot_be_read_explains_nothing():
    model = straight(3, {"late": 2.0})
    comparison, explanation = looked_at(model)
    after = refitted(comparison, explanation, "late")
    model.broken = {"late": 0.1}  # from now on every run with it fails
    model._kept.clear()
    comparison.base.runs._known.clear()
    found = judge(explanation.context, replace(after, judged=False))
    assert found.unread
    base = weighed(explanation.context, comparison.base.fit, comparison.base.surface)
    assert why_not(base, found, OPTIONS) == Reason(kind="unread")
    assert accepted(base, [found], OPTIONS) is None


def test_an_explanation_that_changes_more_is_the_less_likely_one():
    """`source_effects`: what an effect does in the slide may differ from what it does here."""
    model = straight(1, {"step": 2.0})
    comparison, explanation = looked_at(model)
    after = refitted(comparison, explanation, "step")
    context = replace(explanation.context, share=0.2)
    doubted = weighed(context, after.fit, after.surface)
    change = 0.2 * after.fit.space.amplitudes(after.fit.x)["step"] * signatures()["step"]
    grown = context.data_for(after.fit).covariance - context.data.covariance
    assert np.allclose(grown, 0.7 * np.outer(change, change) + 0.3 * np.diag(change**2))
    more = replace(context, share=2.0)  # of a change three times as large, say
    assert weighed(more, after.fit, after.surface).ln_evidence < doubted.ln_evidence - 1.0
    assert weighed(context, comparison.base.fit, after.surface).ln_evidence == pytest.approx(
        weighed(explanation.context, comparison.base.fit, after.surface).ln_evidence
    )
    # An error of the survey is known exactly.
    exact = replace(context, exact=frozenset({"step"}))
    assert exact.data_for(after.fit) is context.data
