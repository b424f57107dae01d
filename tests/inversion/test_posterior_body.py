"""The posterior of a body in three dimensions: the questions of a section, asked of a map."""

from __future__ import annotations

import numpy as np
import pytest

import flowslide
from flowslide.command_line import main
from inversion.engines.body_engine import BodyStore
from inversion.engines.body_setup import KeptMaps
from inversion.posterior.summary import principal, shares
from pipeline.cli import InputError
from pipeline.config import load_config
from tests.inversion.test_invert_body import RUNOUT, asked, slide

pytest.importorskip("dynesty", reason="needs the extra `posterior`")
FILL = {"name": "fill", "kind": "property", "zones": ["dam"], "property": "cohesion_kpa",
        "std": 2.0}  # fmt: skip
QUICK = ["posterior.coarse_runs=32", "posterior.refined_runs=8", "posterior.draws=400",
         "posterior.live_points=80"]  # fmt: skip


@pytest.fixture
def by_formula(monkeypatch):
    """Runs whose runout is 50 / S_r + (c - 14) / 4 of the fill, in place of the solver's."""
    simulated = []

    def run(store, setup, scene, problem, key):
        soil = {zone.name: scene.soil.materials[zone.material] for zone in scene.soil.zones}
        slimes, dam = soil["slimes"].cohesion_kpa, soil["dam"].cohesion_kpa
        simulated.append((slimes, dam))
        readings = {"runout_valley_m": 50.0 / slimes + (dam - 14.0) / 4.0}
        return KeptMaps(np.zeros((2, 2)), readings, [], True, "", 0.0, {"slimes": [9.0, 50.0, 5.0]})

    monkeypatch.setattr(BodyStore, "_simulated", run)
    return simulated


@pytest.fixture
def maps(monkeypatch):
    """A deposit of which readings alone are taken."""
    from inversion.engines.body_setup import BodySetup
    from tests.inversion.body_maps import deposit

    monkeypatch.setattr(BodySetup, "deposit_map", lambda setup, values, kept: deposit(kept))


@pytest.mark.slow
def test_the_strength_of_a_body_and_what_else_is_unknown_of_it(tmp_path, by_formula, maps):
    folder = asked(slide(tmp_path / "dam"), RUNOUT, sensitivities=[FILL], loss="misfit")
    settings = load_config(None, QUICK)
    found = flowslide.posterior(folder, out=tmp_path / "out", settings=settings, threads=1)
    assert found.engine == "mpm3d" and found.runs.simulated_now == len(by_formula) == 40
    strength, fill = found.unknowns
    # 20 +- 2 m measured; a softer fill takes away up to half a metre a standard deviation.
    assert strength.after.median == pytest.approx(2.5, rel=0.1)
    # Runout and fill leave 13 %; the cells, of five points in the height, far more.
    assert 0.45 < strength.after.std / 2.5 < 0.65
    assert strength.ratio is not None
    assert strength.ratio.median == pytest.approx(strength.after.median / 50.0, rel=0.02)
    assert fill.after.std > 0.8  # one runout says little of it
    assert (tmp_path / "out/report.html").is_file()
    again = flowslide.posterior(folder, out=tmp_path / "out", settings=settings, threads=1)
    assert again.runs.simulated_now == 0 and again.unknowns == found.unknowns


def test_a_body_has_one_engine(tmp_path):
    folder = asked(slide(tmp_path / "dam"), RUNOUT)
    with pytest.raises(InputError, match="--engine direct: not in three dimensions"):
        main(["posterior", str(folder), "--engine", "direct", "--out", str(tmp_path / "out")])
    assert not (tmp_path / "out").exists()


def test_numbers_of_a_map_move_a_strength_as_one():
    random = np.random.default_rng(5)
    level, own = random.standard_normal((2, 4000))
    surface = level[:, None] + 0.1 * random.standard_normal((4000, 50))
    inputs = np.hstack([principal(surface, 3), own[:, None]])
    found = {one.name: one for one in shares(2.0 * level + own, inputs, ["map"] * 3 + ["other"])}
    assert found["map"].first == pytest.approx(0.8, abs=0.03)
    assert found["other"].total == pytest.approx(0.2, abs=0.03)
