"""Scores of candidates before any of them is fitted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnosis.adequacy.compare import compare
from diagnosis.options import Options
from diagnosis.selection.explain import explain
from tests.diagnosis.straight import straight

QUIET = Options(replicates=2, second_scheme=False, finer_share=0.0, finer_share_std=0.0)


def scored(seed: int, effects: dict[str, float], prior: tuple[float, float] | None):
    model = straight(seed, effects)
    options = QUIET if prior is None else replace(QUIET, priors={"late": prior})
    if prior is not None:
        model.candidates = [
            replace(one, prior_mean=prior[0], prior_std=prior[1]) if one.name == "late" else one
            for one in model.candidates
        ]
    return explain(model, compare(model, options), options)


@pytest.mark.parametrize("seed", [1, 4])
def test_what_is_believed_of_one_effect_says_nothing_of_another(seed):
    """An effect that nobody hid, believed to be 2 +- 0.4, pays at 0 what nobody pays without it."""
    plain, other = (scored(seed, {"bend": 0.9}, prior) for prior in (None, (2.0, 0.4)))
    assert plain.scores.p_largest < 0.02
    assert other.scores.p_largest == pytest.approx(plain.scores.p_largest, abs=0.02)
    assert other.scores.ranked[0] == plain.scores.ranked[0] == "bend"
    assert other.scores.best("late").drop < 3.0
