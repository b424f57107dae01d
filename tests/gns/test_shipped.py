"""The models that ship: whole, belonging to their cards, and as good as these say."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from geometry import draw_scene
from gns.data.scene_facts import start_of
from gns.evaluation.card import read_card
from gns.evaluation.metrics import score
from gns.rollout.rollout import rolled_out
from gns.training.checkpoints import MODEL_FILE
from inversion.engines.trained_model import load_model
from mpm_taichi.simulate import simulate
from pipeline.config import load_config
from tests.conftest import ROOT

MODELS = sorted(path.parent for path in (ROOT / "models").glob(f"*/{MODEL_FILE}"))


def test_a_model_ships():
    assert [folder.name for folder in MODELS] == ["thrust"]


@pytest.mark.parametrize("folder", MODELS, ids=lambda folder: folder.name)
def test_a_model_belongs_to_its_card(folder):
    model, card = load_model(folder), read_card(folder / "card.yaml")
    assert card.name == folder.name
    assert sum(weights.numel() for weights in model.simulator.parameters()) == card.parameters
    assert card.accuracy.runs >= 50
    assert card.accuracy.runs_that_travel_far >= card.accuracy.runs / 2
    assert card.accuracy.by_template["all"]["not finite"] == 0
    for name in ("worst.png", "training.png", "evaluation.csv"):
        assert (folder / name).is_file()


@pytest.mark.slow
def test_it_does_on_a_held_out_scene_what_its_table_says():
    """Drawn, simulated and rolled out again: the smallest of the scenes that it never saw."""
    folder = ROOT / "models" / "thrust"
    with (folder / "evaluation.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["template"] != "e"]
    row = min(rows, key=lambda one: int(one["points"]) * int(one["frames"]))
    config = load_config(ROOT / "config" / "thrust.yaml")
    scene = draw_scene(config, "coarse", int(row["run"]))
    (run,) = simulate([scene], config.simulation_for("coarse"), threads=1)
    simulator = load_model(folder).simulator
    stride = round(simulator.config.frame_interval / config.simulation.frame_interval)
    settings = simulator.settings(config.simulation_for("coarse"))
    facts, start = start_of(scene, settings)
    simulated = run.positions[::stride]
    # The table is of the physics that the model was trained on: points have other volumes since.
    assert abs(len(simulated) - int(row["frames"])) <= 1
    np.testing.assert_allclose(simulated[0], start, atol=1e-4)
    _, predicted = rolled_out(simulator, simulated, facts)
    found = score(predicted, simulated, facts, run=int(row["run"]), template=row["template"])
    for name in ("runout_error_spacings", "position_error_m"):
        assert getattr(found, name) == pytest.approx(float(row[name]), abs=0.1), name
