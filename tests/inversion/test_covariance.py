"""The error of a code that made a measured slide, as a part of the covariance."""

import numpy as np
import pytest

from geometry.survey.profiles import WHOLE, Profile
from geometry.survey.registry import measurement_of
from inversion.estimation.covariance import SourceError, covariance, source_covariance

COMMON = {"std_m": 0.5, "confidence": "published", "source": "drawn"}


def _entries():
    profile = measurement_of({"name": "surface", "type": "surface_profile", "file": "x", **COMMON})
    places = np.array([0.0, 10.0, 30.0])
    profile.attach(Profile(places, np.zeros(3), [WHOLE] * 3))
    toe = measurement_of({"name": "toe", "type": "toe_runout", "side": "left", "value_m": 1.0,
                          **COMMON})  # fmt: skip
    marker = measurement_of({"name": "marker", "type": "marker_displacement", "x_m": 1.0,
                             "y_m": 2.0, "dx_m": 0.0, "dy_m": 0.0, **COMMON})  # fmt: skip
    return [profile, toe, marker]


def test_errors_hang_together_within_a_measurement_alone():
    errors = {"surface_profile": SourceError(0.6, 20.0), "toe_runout": SourceError(2.0)}
    found = source_covariance(_entries(), errors)
    assert found.shape == (6, 6)
    assert found[0, 1] == pytest.approx(0.36 * np.exp(-0.5))
    assert found[1, 2] == pytest.approx(0.36 * np.exp(-1.0))
    assert found[3, 3] == pytest.approx(4.0)
    assert np.all(found[:3, 3:] == 0.0) and np.all(found[4:] == 0.0)  # markers: none was stated


def test_it_is_a_part_of_its_own():
    survey = np.diag([1.0, 2.0])
    source = np.array([[0.5, 0.2], [0.2, 0.5]])
    found = covariance(survey, source=source)
    assert np.array_equal(found.total, survey + source)
    assert np.array_equal(found.survey, survey)
    assert not covariance(survey).source.any()
