"""Pictures and remarks of a posterior: also where it lies outside its prior."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inversion.posterior.summary import prior_remarks
from report import style
from report.charts.corner import _range, draw_corner
from report.charts.posterior import draw_predicted
from tests.budget import examples

PLACES = st.floats(-1e6, 1e6)
WIDTHS = st.sampled_from([0.0, 1e-9, 0.03, 2.0, 1e4])


def drawn(mean: float, std: float, number: int = 400) -> np.ndarray:
    return mean + std * np.random.default_rng(0).standard_normal(number)


@settings(max_examples=examples(200), deadline=None)
@given(PLACES, WIDTHS, PLACES, WIDTHS, st.sampled_from(["parameter", "nuisance"]))
def test_an_axis_holds_what_it_shows(after, narrow, before, wide, kind):
    shown, prior = drawn(after, narrow), drawn(before, wide)
    low, high = _range(shown, prior, kind)
    assert low < high
    inside = np.mean((shown >= low) & (shown <= high))
    assert inside > 0.98 or narrow <= 1e-9
    np.histogram(shown, np.linspace(low, high, 41))


def test_an_axis_of_nothing():
    assert style.span([]) == (0.0, 1.0)
    assert style.span([np.nan, 2.0], [np.inf]) == pytest.approx((2.0, 2.0), abs=1e-4)


def test_a_posterior_outside_its_prior_is_drawn_and_said(tmp_path):
    """A friction of 26.05 +- 0.03 degrees under a prior N(34, 2) within 26 to 42."""
    prior = np.clip(drawn(34.0, 2.0), 26.0, 42.0)
    posterior = drawn(26.05, 0.03)
    one = SimpleNamespace(name="friction", unit="deg", kind="parameter", sobol=[])
    other = SimpleNamespace(name="top of sand", unit="std", kind="nuisance", sobol=[])
    document = SimpleNamespace(
        unknowns=[one, other],
        parameters=[one],
        nuisances=[other],
        numbers=[
            SimpleNamespace(
                name="toe",
                group="toe",
                unit="m",
                role="fitted",
                measured=53.0,
                std=0.0,
                censored=False,
            )
        ],
    )
    draws = SimpleNamespace(
        posterior=np.stack([posterior, drawn(9.0, 0.01)], axis=1),
        prior=np.stack([prior, drawn(0.0, 1.0)], axis=1),
        numbers=["toe"],
        prior_predictive=np.full((400, 1), 53.0),
        posterior_predictive=np.full((400, 1), 53.0),
    )
    assert draw_corner(document, draws, tmp_path / "corner.png").stat().st_size > 5000
    assert draw_predicted(document, draws, tmp_path / "toe.svg").stat().st_size > 1000

    unknowns = [
        SimpleNamespace(label="friction of the fill", unit="deg"),
        SimpleNamespace(label="S_r of the sand", unit="kPa"),
    ]
    found = SimpleNamespace(
        inference=SimpleNamespace(unknowns=unknowns),
        prior=np.stack([prior, drawn(20.0, 5.0)], axis=1),
        told=np.stack([posterior, drawn(24.0, 1.0)], axis=1),
    )
    (line,) = prior_remarks(found)
    assert line.startswith(
        "friction of the fill: the measurements and its prior disagree: 26.05 ± 0.03 deg with"
    )
    assert "4.0 standard deviations of the prior apart" in line
