"""Strength laws outside the library against those in it: the same variable, the same shape."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.making.benchmark import load_benchmark
from benchmarks.hidden_effects.scoring.curves import recovered, runs_alike
from benchmarks.hidden_effects.scoring.digest import CurveDigest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "hidden_effects"


@pytest.fixture(scope="module")
def benchmark():
    """With it the effects outside the library are known."""
    return load_benchmark(FOLDER)


def scene(benchmark, effect, amplitude=0.5):
    return benchmark.sections["tailings_dam"].scene.changed(effects={effect: amplitude})


@pytest.mark.parametrize(
    ("hidden", "named", "expected"),
    [
        ("two_layers", {"overburden_strength": 0.6}, True),
        ("two_layers", {"rate_strengthening": 0.5}, False),  # depends on another variable
        ("two_layers", {"overburden_strength": 0.6, "shaking": 0.3}, False),
        ("two_layers", {"side_friction": 0.6}, False),  # changes no strength
        ("two_layers", {"datum_shift": 0.6}, False),  # is not an effect
        ("root_of_rate", {"rate_strengthening": 0.5}, True),
        ("root_of_rate", {"strain_softening": 0.5}, False),
        ("strength_in_time", {"overburden_strength": 0.6}, False),
        ("strong_lens", {"spatial_variability": 0.0}, False),
        ("two_layers", {"spatial_variability": 0.5}, False),  # a field depends on the place
        ("strength_in_time", {"overburden_strength": 1.0}, False),  # no strength at no overburden
    ],
)
def test_laws_of_the_library_that_run_like_a_stranger(benchmark, hidden, named, expected):
    law = benchmark.plan.laws[hidden]
    assert runs_alike(named, scene(benchmark, hidden), hidden, law) is expected


def test_a_curve_is_recovered_by_its_variable_and_its_shape(benchmark):
    knots = np.linspace(20.0, 180.0, 5).tolist()
    layers = [0.7, 0.7, 1.0, 1.5, 1.5]

    def found(variable, multiplier):
        curve = CurveDigest(variable=variable, knots=knots, multiplier=multiplier)
        return recovered(curve, scene(benchmark, "two_layers"), "two_layers", "overburden")

    assert found("overburden", layers)
    assert not found("overburden", layers[::-1])
    assert not found("position", layers)
    assert not recovered(None, scene(benchmark, "two_layers"), "two_layers", "overburden")
