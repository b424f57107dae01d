"""Experiments as cases: what is missing is on trial, and a verdict is judged by name."""

import pytest

from benchmarks.studies import diagnosed_experiments as study
from diagnosis.case import diagnosis_case
from geometry.case import load_case
from inversion.engines.run_store import RunStore


def test_every_experiment_is_judged():
    folders = {path.name for path in study.CASES.iterdir() if path.is_dir()}
    assert folders == set(study.EXPERIMENTS)


@pytest.mark.parametrize("name", study.EXPERIMENTS)
def test_right_names_are_on_trial(name, tmp_path):
    model = diagnosis_case(load_case(study.CASES / name)).model(RunStore(tmp_path))
    tried = {candidate.name for candidate in model.candidates}
    assert study.EXPERIMENTS[name].names <= tried


@pytest.mark.parametrize(
    ("name", "verdict", "leading", "judged"),
    [
        ("aluminium_bars", "identified", ["inertial_friction"], "right"),
        ("aluminium_bars", "identified", ["dilatancy"], "false"),
        ("aluminium_bars", "adequate", [], "missed"),
        ("granular_column", "ambiguous", ["dilatancy"], "silent"),
        ("granular_column_short", "adequate", [], "right"),
        ("granular_column_short", "unknown_effect", [], "false"),
        ("granular_cylinder", "identified", ["radial_spreading"], "right"),
        ("granular_cylinder", "unknown_effect", [], "silent"),
        ("granular_cylinder", "ambiguous", ["radial_spreading"], "right leads"),
        ("granular_cylinder", "unknown_effect", ["shaking"], "silent"),
        ("granular_cylinder", "identified", ["shaking"], "false"),
    ],
)
def test_judgement(name, verdict, leading, judged):
    assert study.judged(study.EXPERIMENTS[name], verdict, leading) == judged
