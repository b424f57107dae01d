"""What could be measured next: nothing that was, all over the section, without new runs."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.model import Proposing
from diagnosis.hypotheses.possible_measurements import possible_measurements, site_of
from geometry.case import load_case
from geometry.survey.slide_duration import SlideDuration
from geometry.survey.surface_profile import SurfaceProfile
from geometry.survey.toe_history import ToeHistory
from inversion.engines.run_store import RunStore
from inversion.problem.state import state


@pytest.fixture
def case(embankment):
    return diagnosis_case(load_case(embankment), spacing_m=2.0)


def test_what_was_measured_is_not_proposed(case):
    entries = possible_measurements(case.setup)
    assert site_of(case.setup).reach == (-37.059, 64.0)
    places = [e.profile.x[0] for e in entries if isinstance(e, SurfaceProfile)]
    # The survey has the surface every 4 m up to x = 40.
    assert places and min(places) > 40.0 + 2 * 2.0
    assert not any(isinstance(e, ToeHistory) for e in entries)
    assert any(isinstance(e, SlideDuration) for e in entries)
    stds = {type(e).__name__: e.std for e in entries}
    assert stds["SurfaceProfile"] == 0.5 and stds["MarkerDisplacement"] == 0.3


def test_a_dam_with_four_numbers_could_have_been_surveyed(root):
    case = diagnosis_case(
        load_case(root / "case_histories" / "lower_san_fernando_paper"), spacing_m=4
    )
    entries = possible_measurements(case.setup)
    names = [entry.name for entry in entries]
    assert sum(name == "surface" for name in names) == 10, "its profile is constructed"
    assert sum(name.startswith("stake") for name in names) == 6
    assert sum(name == "left toe" for name in names) == 6
    assert "duration of the slide" not in names and "freeboard of the remnant" not in names


def test_proposals_are_read_from_runs_that_were_made(case, tmp_path):
    store = RunStore(tmp_path, threads=1)
    model = case.model(store)
    states = [state((9.0, 33.0)), state((9.0, 33.0), {"weak_base": 0.2, "datum_shift": 1.0})]
    model.predict(states)
    computed = store.computed
    rows = model.propose(states)
    assert store.computed == computed == model.runs == 2
    last = model.proposals[-1].index[-1]
    assert rows.shape == (2, last + 1) and np.all(np.isfinite(rows))
    assert [i for p in model.proposals for i in p.index] == list(range(last + 1))
    (duration,) = [p for p in model.proposals if p.name == "duration of the slide"]
    assert 2.0 < rows[0, duration.index[0]] < 12.0
    stake = next(p for p in model.proposals if p.name.startswith("stake"))
    assert len(stake.index) == 2 and stake.covariance.shape == (2, 2)
    assert stake.words.endswith("to 0.3 m")
    assert isinstance(model, Proposing)
    # In another process the same runs are read again.
    assert np.array_equal(case.model(RunStore(tmp_path, threads=1)).propose(states), rows)
