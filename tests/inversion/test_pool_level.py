"""The level of the pool as a calibrated parameter."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.case import load_case
from geometry.scenes.scene import Scene
from inversion.back_analysis.case import inversion_case
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import ParameterSpec
from inversion.problem.scene_changes import moves_with_pool, pool_at
from pipeline.cli import InputError
from tests.gns.scenes import small_scene

LEVEL = "  - {name: pool, property: water_level, start: 35.9, low: 33, high: 38}\n"


def asking(lsfd, *changes: tuple[str, str]):
    """The case with the level among the calibrated parameters."""
    path = lsfd / "inversion.yaml"
    text = path.read_text().replace("fit: [", LEVEL + "fit: [", 1)
    text = text.replace("  - {name: pool level, kind: water_level, std_m: 0.5}\n", "")
    text = text.replace("variants:\n  - {name: dry, water: none}\n", "")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return inversion_case(load_case(lsfd))


def test_pool_and_phreatic_line_move_together():
    scene = small_scene()
    assert list(moves_with_pool(scene)) == [True, True, False]
    moved = Scene.model_validate(pool_at(scene, 5.0))
    assert moved.water_level == 5.0
    assert [y for _, y in moved.phreatic_line] == [5.0, 5.0, 2.5]
    flat = scene.changed(phreatic_line=None)
    assert list(moves_with_pool(flat)) == [True, True]
    assert pool_at(flat, 5.0)["phreatic_line"] is None


def test_the_level_goes_into_the_scene_and_changes_the_slide(lsfd):
    case = asking(lsfd)
    spec = case.parameters.specs[2]
    assert (spec.unit, spec.words, spec.zones) == ("m", "level of the pool", [])
    values = np.array([25.0, 30.0, 35.9])
    engine = MPMEngine(RunStore(None, threads=1))
    assert case.setup.at(values - [0, 0, 2]).scene.water_level == pytest.approx(33.9)
    before, after = engine.predict(
        [case.setup.at(one) for one in (values, values - np.array([0.0, 0.0, 2.9]))]
    )
    assert abs(after.values[0] - before.values[0]) > 0.5
    assert np.isnan(before.sigma_v0_kpa[2]) and np.isfinite(before.sigma_v0_kpa[0])


def test_it_is_fitted_as_it_is():
    spec = ParameterSpec(name="pool", property="water_level", start=4.0, low=-1.0, high=6.0)
    parameters = Parameters([spec])
    assert not parameters.logarithmic[0] and not parameters.strengths[0]
    assert np.allclose(parameters.to_values(parameters.to_fitted(np.array([3.0]))), [3.0])
    assert parameters.scene(small_scene(), np.array([4.9])).water_level == 4.9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("property: water_level", 'zones: ["1"], property: water_level')], "has none"),
        ([(', zones: ["7"], property: friction_deg', ", property: friction_deg")],
         "at least one must be named for friction_deg"),
        ([(LEVEL, LEVEL + LEVEL.replace("name: pool", "name: lake"))],
         "water_level of the pool is calibrated by 'pool' and by 'lake'"),
        ([("spacing_m: 4", "spacing_m: 4\nvariants: [{name: dry, water: none}]")],
         "dry: water: none: the level of the pool is calibrated by 'pool'"),
        ([("kind: time_step, factor: 0.5", "kind: water_level, std_m: 0.5")],
         "the level of the pool is calibrated by 'pool'"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_a_line(lsfd, changes, message):
    with pytest.raises(InputError) as caught:
        asking(lsfd, *changes)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_level_is_sought_only_where_there_is_water(lsfd):
    path = lsfd / "scene.yaml"
    kept = [line for line in path.read_text().splitlines() if not line.startswith("water_level")]
    path.write_text("\n".join(kept))
    with pytest.raises(InputError, match="water_level"):
        asking(lsfd)
