"""A slide of finite width as a paired difference on plane runs, and as a hypothesis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.case import diagnosis_case
from geometry.case import load_case
from geometry.scenes3d.scene3d import Section
from inversion.back_analysis.case import inversion_case
from inversion.engines.finite_width import FiniteWidth, knots, paired, refused
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.problem.state import state
from pipeline.config import load_config
from tests.inversion.test_invert_3d import question

STRENGTH = np.array([12.0])
SHORT = ["simulation.duration_s=4"]


@pytest.fixture(scope="module")
def bank(tmp_path_factory):
    """The question of a bank at 2 m: its case folder and its setup."""
    folder = question(tmp_path_factory.mktemp("width") / "bank")
    case = inversion_case(load_case(folder, load_config(None, SHORT)), spacing_m=2.0)
    return folder, case.setup


@pytest.fixture(scope="module")
def engine():
    store = RunStore(None, threads=1)
    return FiniteWidth(MPMEngine(store), store)


def toe(engine, setup, ratio: float) -> float:
    wide = replace(setup, height_over_width=ratio)
    return float(engine.predict([wide.at(STRENGTH)])[0].values[0])


def test_the_difference_is_that_of_a_pair_at_a_coarser_spacing(bank, engine):
    _, setup = bank
    pair = paired(setup)
    assert (pair.scene.spacing, pair.scene.domain.walls) == (3.0, "closed")
    places, widths = knots(pair.scene)
    assert np.all(widths % pair.scene.cell_size == 0.0) and np.all(np.diff(places) > 0.0)
    plane = toe(engine, setup, 0.0)
    assert engine.wide_runs == 0
    assert plane == MPMEngine(engine.store).predict([setup.at(STRENGTH)])[0].values[0]
    solid = RunStore3d(Section(file="", width_m=widths[2]), "rough", None, threads=1)
    wide, flat = (
        MPMEngine(store).predict([pair.at(STRENGTH)])[0].values[0]
        for store in (solid, RunStore(None, threads=1))
    )
    found = toe(engine, setup, places[2])
    assert found == pytest.approx(plane + wide - flat)
    assert found < plane - 0.5
    # Between the knots it is linear, and below the first one it goes to none in plane strain.
    half = toe(engine, setup, 0.5 * (places[1] + places[2]))
    assert half == pytest.approx(0.5 * (found + toe(engine, setup, places[1])))
    low = toe(engine, setup, places[0])
    assert toe(engine, setup, 0.25 * places[0]) == pytest.approx(plane + 0.25 * (low - plane))
    assert engine.wide_runs == 3


def test_no_pore_water_flows_in_a_pair(bank):
    _, setup = bank
    soils = setup.scene.model_dump()["materials"]
    for soil in soils.values():
        soil |= {"permeability_m_per_s": 1e-4, "excess_pressure_ratio": 0.3}
    wet = replace(setup, scene=setup.scene.changed(materials=soils))
    assert paired(wet).scene == paired(setup).scene


def test_what_else_is_on_trial_changes_the_plane_run_alone(bank):
    _, setup = bank
    changed = setup.with_scene(setup.scene.changed(jitter=0.5, seed=3, effects={"bingham": 5.0}))
    other = replace(changed, settings=setup.settings.model_copy(update={"transfer": "flip"}))
    assert paired(other).scene == paired(setup).scene
    assert paired(other).settings == paired(setup).settings
    assert not refused(other)


def test_the_width_is_a_candidate_where_it_is_asked_for(bank):
    folder, _ = bank
    names = {}
    for asked in ("false", "true"):
        config = load_config(None, [*SHORT, f"diagnosis.finite_width={asked}"])
        case = diagnosis_case(load_case(folder, config), spacing_m=2.0)
        model = case.model(RunStore(None, threads=1))
        names[asked] = {candidate.name: candidate for candidate in model.candidates}
    assert "finite_width" not in names["false"]
    assert names["true"]["finite_width"].family == "dimension"
    plane, wide = model.predict([state([12.0]), state([12.0], {"finite_width": 0.35})])
    assert wide[0] < plane[0] - 0.5
    assert model.wide_runs <= 2  # one at each knot next to it
