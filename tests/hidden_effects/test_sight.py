"""What can be seen on a section: nothing of nothing; amplitudes stay believable."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.making import base_model
from benchmarks.hidden_effects.making import sight as sight_file
from benchmarks.hidden_effects.making.base_model import BaseModel, strength_of
from benchmarks.hidden_effects.making.detectability import bin_of
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.plan import Planned
from benchmarks.hidden_effects.making.sections import Section, load_section
from benchmarks.hidden_effects.making.sight import BEYOND_LADDER, Sight, strongest
from benchmarks.hidden_effects.making.truth import Maker
from mpm_taichi.effects import Amplitude, effects
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.random_numbers import Stream

pytestmark = pytest.mark.slow


FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "hidden_effects" / "sections"


@pytest.fixture(scope="module")
def sight():
    """A section with few points, strong enough for short runs; a coarse base model."""
    section = load_section(FOLDER / "tailings_dam")
    scene = section.scene.changed(spacing=3.6)
    section = Section(section.folder, scene, section.question, section.survey)
    with pytest.MonkeyPatch.context() as patch:
        for name, number in {"LEVELS": 13, "REPLICATES": 3, "PAIRS": 1}.items():
            patch.setattr(base_model, name, number)
        patch.setattr(base_model, "JUDGE", replace(base_model.JUDGE, finer_runs=1))
        laboratory = Laboratory(SimulationSettings(duration_s=40.0), threads=1)
        base = BaseModel.simulate(laboratory, section)
    return Sight(laboratory, base, "markers", np.array([22.0, 34.0]))


def test_nothing_hidden_is_not_seen_and_refits_to_itself(sight):
    found = sight.seen_for_good({})
    assert found.seen < 3.0
    strength, friction = sight.base.joined(found.u, found.held)
    assert strength == pytest.approx(22.0, rel=0.1)
    assert friction == pytest.approx(34.0, abs=2.0)


def test_a_strong_effect_is_seen_better_than_a_faint_one(sight):
    faint, strong = (sight.seen({"overburden_strength": a}) for a in (0.05, 0.9))
    assert strong > 5.0 and strong > 2.0 * faint


def test_what_does_not_slide_is_not_seen(sight):
    assert np.isnan(sight.seen({"side_shear": 10.0}))


def test_an_amplitude_that_is_found_is_believable(sight):
    scale = effects()["side_friction"].amplitude
    amplitude, _ = sight.amplitude("side_friction", 1e6, Stream(1), {})
    assert 0.0 < amplitude <= BEYOND_LADDER * scale.ladder[-1]


def test_parameters_split_and_join(sight):
    values = np.array([27.0, 31.5])
    u, held = sight.base.split(values)
    assert held == pytest.approx([-1.25])  # (31.5 - 34) / 2
    assert sight.base.joined(u, held) == pytest.approx(values)


def test_curves_are_read_once_for_toes_that_lie_near(sight):
    one, near, far = (sight.base.curve("profile", toe) for toe in (150.4, 151.2, 158.0))
    assert one is near and one is not far
    assert np.all(np.diff(one.u) > 0.0)
    assert one.halves.shape == (2, len(one.u), 21) and one.slopes.shape == (len(one.u), 21, 1)


@pytest.mark.parametrize(
    ("low", "high", "sign", "expected"),
    [(0.0, 10.0, 1.0, 3.0), (0.0, 2.0, 1.0, 2.0), (-0.5, 10.0, -1.0, 0.5)],
)
def test_truths_are_no_stronger_than_three_top_rungs(low, high, sign, expected):
    scale = Amplitude("", low, high, (0.1, 0.3, 1.0), "", two_signed=low < 0.0)
    assert strongest(scale, sign) == expected


def test_a_section_with_two_free_parameters_is_refused():
    section = load_section(FOLDER / "tailings_dam")
    question = section.question.model_copy(deep=True)
    question.parameters[1] = question.parameters[1].model_copy(update={"prior": None})
    with pytest.raises(InputError, match="2 parameters without prior"):
        strength_of(Section(section.folder, section.scene, question, section.survey))


def test_a_case_is_made_in_its_bin_and_twice_the_same(sight):
    """Written effects were seen; the numerics are not the judge's; nothing depends on chance."""
    planned = Planned("case_0003", "single", ("overburden_strength",), "tailings_dam", "markers", 1)
    made = [
        Maker(sight.laboratory, 11, lambda section: sight.base).make(planned, sight.section)
        for _ in range(2)
    ]
    truth = made[0].truth
    assert truth == made[1].truth
    assert bin_of(truth["lambda"]) == 1
    assert 0.75 <= truth["spacing_factor"] <= 0.85
    assert truth["effects"]["overburden_strength"] > 0.0
    assert set(truth["refitted"]) == set(truth["parameters"])


def test_a_pair_has_two_effects_that_can_be_seen(sight):
    """Cracking is faint here, so that no pair is made of it."""
    names = ("cracking", "overburden_strength")
    planned = Planned("case_0004", "pair", names, "tailings_dam", "markers", 2)
    maker = Maker(sight.laboratory, 11, lambda section: sight.base)
    assert maker.make(planned, sight.section) is None


def test_the_fainter_of_two_is_seen_less_next_to_the_other_than_both_are(sight):
    """Each stands for a part of what the other does."""
    both = {"overburden_strength": 0.6, "side_friction": 0.9}
    assert 3.0 < sight.beside(both) < 0.6 * sight.seen_for_good(both).seen


def test_what_an_effect_does_where_the_parameters_have_given_way_to_it_counts(sight, monkeypatch):
    """Softening and strength by overburden: with another strength the one nearly does both."""
    both = {"overburden_strength": 0.6, "strain_softening": 0.75}
    found = sight.beside(both)
    monkeypatch.setattr(sight_file, "RETURNS", 0)
    assert found < sight.beside(both)


def test_what_is_nothing_alone_is_nothing_next_to_another(sight):
    assert sight.seen_for_good({"overburden_strength": 0.6}).seen > 10.0
    assert sight.beside({"overburden_strength": 0.6, "cracking": 1e-4}) < 3.0


def test_an_amplitude_out_of_bounds_is_not_simulated(sight):
    assert sight.beside({"overburden_strength": 1.5, "side_friction": 0.5}) is None


def test_a_pair_is_made_so_that_both_are_seen(sight):
    names = ("overburden_strength", "side_friction")
    planned = Planned("case_0006", "pair", names, "tailings_dam", "markers", 0)
    truth = (
        Maker(sight.laboratory, 6, lambda section: sight.base).make(planned, sight.section).truth
    )
    assert set(truth["effects"]) == set(names)
    assert bin_of(truth["beside"]) == 0
    assert truth["beside"] < truth["lambda"] < 200.0


def test_a_null_costs_one_run(sight):
    planned = Planned("case_0005", "null", (), "tailings_dam", "markers", 0)
    before = sight.laboratory.runs
    made = Maker(sight.laboratory, 11, lambda section: sight.base).make(planned, sight.section)
    assert made.truth["effects"] == {} and made.truth["lambda"] == 0.0
    assert sight.laboratory.runs - before <= 3  # draws that are not flow slides are rejected
