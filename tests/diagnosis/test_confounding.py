"""What looks alike, how well an effect is seen and what it hides, on a model with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.adequacy.compare import compare
from diagnosis.options import Options
from diagnosis.selection.explain import explain
from diagnosis.signatures.confounding import look_alike
from tests.diagnosis.straight import signatures, straight

OPTIONS = Options(
    draws=200, replicates=0, starts=1, second_scheme=False, finer_share=0.0, finer_share_std=0.0
)


@pytest.fixture(scope="module")
def found():
    case = straight(0, {})
    comparison = compare(case, OPTIONS)
    return comparison, explain(case, comparison, OPTIONS)


def test_what_the_strength_imitates_is_not_seen_and_hides_in_it(found):
    comparison, explanation = found
    seen = explanation.visible["like_strength"]
    assert seen.fraction < 0.05
    # It does what 0.4 of the fitted strength does. Its ladder was drawn out to its bound, 3.
    base = comparison.base.fit
    before = base.space.values(base.x)[0]
    shifts = [base.space.values(base.x + [sign * 1.2, 0.0])[0] - before for sign in (-1.0, 1.0)]
    expected = [pytest.approx(100.0 * shift / before, rel=1e-3) for shift in shifts]
    assert seen.bias["S_r"] in expected
    assert seen.bias["phi"] == pytest.approx(0.0, abs=1e-6)
    assert abs(seen.smallest) > 3.0, "reported as it is, believed or not"


def test_what_no_parameter_imitates_is_seen_whole(found):
    comparison, explanation = found
    seen = explanation.visible["late"]
    linear = comparison.judged.system
    one = linear.project(linear.augmented(signatures()["late"]))
    assert abs(seen.smallest) == pytest.approx(OPTIONS.detectable / np.linalg.norm(one), rel=1e-6)
    whole = linear.augmented(signatures()["late"])
    assert seen.fraction == pytest.approx(np.linalg.norm(one) / np.linalg.norm(whole), rel=1e-6)


def test_what_looks_alike(found):
    _, explanation = found
    assert explanation.alike("bend", 0.95) == ["like_bend"]
    assert explanation.alike("late", 0.95) == []
    assert np.allclose(explanation.cosine, explanation.cosine.T)
    assert np.allclose(np.diag(explanation.cosine), 1.0)
    matrix = np.array([[1.0, -0.97, 0.2], [-0.97, 1.0, 0.1], [0.2, 0.1, 1.0]])
    assert look_alike(["a", "b", "c"], matrix, "a", 0.95) == ["b"]
