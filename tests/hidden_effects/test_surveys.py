"""Sections and surveys of the benchmark: files read back as they were written."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.laboratory import Laboratory, Request
from benchmarks.hidden_effects.making.make import write_case
from benchmarks.hidden_effects.making.plan import Planned
from benchmarks.hidden_effects.making.sections import load_section, normal
from benchmarks.hidden_effects.making.truth import Made
from diagnosis.case import diagnosis_case
from geometry.case import load_case
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.random_numbers import Stream

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "hidden_effects" / "sections"
SECTIONS = ("reservoir_dam", "tailings_dam")


@pytest.mark.parametrize("name", SECTIONS)
def test_a_survey_holds_all_of_the_one_before(name):
    section = load_section(FOLDER / name)
    rows = [
        surveys.entries_of(section, survey, 40.0) for survey in ("profile", "markers", "history")
    ]
    names = [[entry.name for entry in entries] for entries in rows]
    assert names[1][: len(names[0])] == names[0] and names[2][: len(names[1])] == names[1]
    assert len(names[0]) < len(names[1]) < len(names[2])
    stds = {entry.name.rstrip(" 0123456789"): entry.std for entry in rows[2]}
    assert stds == {"surface": 0.5, "toe": 1.0, "marker": 0.3, "toe in time": 1.0}


@pytest.mark.parametrize("name", SECTIONS)
def test_values_go_to_their_measurements(name):
    section = load_section(FOLDER / name)
    places = surveys.profile_places(section, 60.0 if section.survey.side == "left" else 150.0)
    entries = surveys.entries_of(section, "history", 50.0)
    values = np.arange(sum(len(entry.values) for entry in entries), dtype=float)
    filled = surveys.with_values(section, "history", places, values)
    assert np.concatenate([entry.values for entry in filled]).tolist() == values.tolist()
    documents = surveys.documents(section, "history", values, places)
    assert documents[1]["value_m"] == 20.0 and documents[2]["dx_m"] == 21.0


def test_the_profile_begins_inside_the_toe():
    section = load_section(FOLDER / "reservoir_dam")
    places = surveys.profile_places(section, 40.0)
    assert places[0] == pytest.approx(50.0) and places[-1] == 240.0
    assert np.ptp(np.diff(places)) < 0.02
    assert len(places) == 20


@pytest.mark.parametrize(("name", "toe"), [("reservoir_dam", -19.6), ("tailings_dam", 263.8)])
@pytest.mark.parametrize("survey", surveys.SURVEYS)
def test_a_slide_that_leaves_the_domain_is_surveyed_within_it(tmp_path, name, toe, survey):
    """A written case can be read again."""
    section = load_section(FOLDER / name)
    places = surveys.profile_places(section, toe)
    margin = 3.0 * section.scene.spacing
    domain = section.scene.domain
    front = places[0] if section.survey.side == "left" else places[-1]
    assert domain.x_min + margin <= front <= domain.x_max - margin
    assert len(set(places)) == len(places)
    values = np.full(60, 10.0)
    planned = Planned("case_0001", "null", (), name, survey, 0)
    profile = np.column_stack([places, values[: len(places)]])
    made = Made({}, surveys.documents(section, survey, values, places), profile)
    write_case(section, planned, made, Places(tmp_path), 40.0)
    loaded = diagnosis_case(load_case(tmp_path / "cases" / "case_0001"))
    assert loaded.name == "case_0001"


def test_a_section_that_has_not_moved_reads_nothing():
    """Strong soil: every displacement is nearly 0, and the surface is the section's own."""
    section = load_section(FOLDER / "tailings_dam")
    laboratory = Laboratory(SimulationSettings(duration_s=8.0), threads=1)
    (deposit,) = laboratory.deposits(section, [Request((80.0, 42.0))])
    entries = surveys.entries_of(section, "markers", 108.0)
    found = surveys.reading(entries, deposit)
    markers = found[21:]
    assert np.abs(markers).max() < 0.1
    surface = dict(zip(entries[0].profile.x.tolist(), found[:20], strict=True))
    x = min(surface, key=lambda place: abs(place - 30.0))
    assert surface[x] == pytest.approx(19.4 + 3.2 * x / 52.0, abs=0.8)


def test_true_parameters_follow_their_priors():
    section = load_section(FOLDER / "reservoir_dam")
    drawn = np.array([section.draw(Stream(5, k)) for k in range(400)])
    low, high = section.survey.strengths_kpa["residual_strength"]
    assert low <= drawn[:, 0].min() and drawn[:, 0].max() <= high
    assert np.log(drawn[:, 0]).mean() == pytest.approx(0.5 * np.log(low * high), abs=0.06)
    assert drawn[:, 1].mean() == pytest.approx(30.0, abs=0.3)
    assert drawn[:, 1].std() == pytest.approx(2.0, abs=0.25)


def test_normal_numbers():
    stream = Stream(1)
    drawn = np.array([normal(stream) for _ in range(4000)])
    assert drawn.mean() == pytest.approx(0.0, abs=0.05)
    assert drawn.std() == pytest.approx(1.0, abs=0.04)
    assert np.mean(np.abs(drawn) < 1.96) == pytest.approx(0.95, abs=0.012)


def test_the_laboratory_remembers_the_base_model_alone():
    section = load_section(FOLDER / "tailings_dam")
    laboratory = Laboratory(SimulationSettings(duration_s=8.0), threads=1)
    request = Request((70.0, 34.0))
    first = laboratory.deposits(section, [request, request])
    again = laboratory.deposits(section, [request])
    assert laboratory.runs == 1
    assert np.array_equal(first[0].position, again[0].position)
    laboratory.forget()
    laboratory.deposits(section, [request])
    assert laboratory.runs == 2


def test_a_section_without_its_survey_is_refused(tmp_path):
    for name in ("scene.yaml", "inversion.yaml"):
        text = (FOLDER / "tailings_dam" / name).read_text()
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="survey.yaml: no such file"):
        load_section(tmp_path)
    (tmp_path / "survey.yaml").write_text("side: up\n")
    with pytest.raises(InputError, match="survey.yaml: "):
        load_section(tmp_path)
