"""The machinery of effects: off is off, what is refused, both schedules, the words."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from benchmarks.generated_pages import EFFECTS_PAGE, around, effects_part
from geometry.scenes.scene import load_scene, save_scene
from mpm_taichi import simulate as simulation
from mpm_taichi.batch import run_batch, run_key
from mpm_taichi.effects import (
    effect,
    effects,
    effects_on,
)
from mpm_taichi.effects.framework.faults import faults
from mpm_taichi.effects.framework.registry import LIBRARY, kernel_effects, library
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import read_run
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import SHORT, slump

ROOT = Path(__file__).resolve().parents[2]
COARSE = {"inertial_friction": {"grain_size_mm": 300.0}}
"""Parameters with which an effect is seen on the slump: grains of a millimetre brake nothing."""
ON = {"strain_softening": 1.0, "shaking": 0.2, "weak_base": 0.3}


# --- off is off ---


@pytest.mark.slow
def test_amplitude_zero_is_the_base_model_to_the_bit_and_by_key():
    off = {name: {"amplitude": 0.0} if name == "shaking" else 0.0 for name in effects()}
    base, same = simulate([slump(), slump(off)], SHORT)
    assert np.array_equal(base.positions, same.positions)
    assert np.array_equal(base.stress, same.stress)
    assert "effect_work" not in same.energy
    assert kernel_effects(slump(off)) == ()
    assert run_key(slump(), SHORT, "cpu") == run_key(slump(off), SHORT, "cpu")


@pytest.mark.slow
def test_an_effect_that_is_off_leaves_no_trace_next_to_one_that_is_on():
    alone = slump({"weak_base": 0.3})
    beside = slump({"weak_base": 0.3, "strain_softening": 0.0, "bingham": 0.0, "water_drag": 0.0})
    first, second = simulate([alone, beside], SHORT)
    assert np.array_equal(first.positions, second.positions)
    assert run_key(alone, SHORT, "cpu") == run_key(beside, SHORT, "cpu")


def test_run_key_holds_what_is_on_however_it_is_written(monkeypatch):
    def key(entry):
        return run_key(slump({"shaking": entry}), SHORT, "cpu")

    assert key(0.2) == key({"amplitude": 0.2}) == key({"amplitude": 0.2, "frequency_hz": 1.0})
    assert len({key(0.2), key(-0.2), key({"amplitude": 0.2, "frequency_hz": 2.0}), key(0)}) == 4
    before, base = key(0.2), key(0)
    monkeypatch.setattr("mpm_taichi.effects.PHYSICS_VERSION", 99)
    assert key(0.2) != before
    assert key(0) == base


# --- a run depends on its scene alone ---


@pytest.mark.slow
def test_company_threads_and_growing_arrays_change_nothing(monkeypatch):
    (alone,) = simulate([slump(ON)], SHORT, threads=1)
    big = slump(
        {"rate_strengthening": 0.1},
        zones=[{"name": "a", "material": "silt", "polygon": [[5, 0], [55, 0], [55, 12], [5, 12]]}],
        materials={"silt": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True}},
    )
    quick = slump({"overburden_strength": 1.0}, seed=3, jitter=0.2)
    monkeypatch.setitem(simulation.SLOTS, "cpu", 2)
    monkeypatch.setattr(simulation, "PER_THREAD", 1)
    settings = SHORT.model_copy(update={"early_stop": True})
    runs = simulate([quick, slump(ON), big, slump(), slump({"shaking": 0.1})], settings, threads=2)
    assert [run.status for run in runs] == ["finished"] * 5
    assert np.array_equal(alone.positions[: len(runs[1].positions)], runs[1].positions)
    assert np.array_equal(runs[3].positions, simulate([slump()], settings)[0].positions)


@pytest.mark.slow
def test_an_open_domain_is_bit_for_bit_a_wide_one():
    """Place and time that an effect sees must not depend on how often the grid has grown."""
    pushed = {"shaking": {"amplitude": 0.5, "frequency_hz": 0.3}, "side_friction": 0.1,
              "weak_base": {"amplitude": 0.9, "x_to_m": 30.0}}  # fmt: skip
    domain = {"y_max": 20, "walls": "open", "left": "free", "right": "free"}
    settings = SHORT.model_copy(update={"duration_s": 5.0})
    narrow, wide = simulate(
        [
            slump(pushed, domain={"x_min": 16, "x_max": 44, **domain}),
            slump(pushed, domain={"x_min": -48, "x_max": 112, **domain}),
        ],
        settings,
    )
    assert narrow.positions[-1, :, 0].min() < 16, "the soil must outrun the first domain"
    assert np.abs(narrow.positions - wide.positions).max() < 1e-3
    assert np.abs(narrow.plastic_shear_strain - wide.plastic_shear_strain).max() < 1e-3


@pytest.mark.slow
def test_a_batch_that_was_killed_continues_to_the_same_bits(tmp_path):
    scenes = {0: slump(ON), 1: slump({"dilatancy": 0.1}), 2: slump()}
    whole = run_batch(scenes, SHORT, tmp_path / "whole.h5", threads=1)
    assert not whole.failures

    def dies(scenes, settings, **options):
        for place, run in enumerate(simulate(scenes[:1], settings, device="cpu", threads=1)):
            options["on_finished"](place, run)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_batch(scenes, SHORT, tmp_path / "part.h5", simulate=dies)
    again = run_batch(scenes, SHORT, tmp_path / "part.h5", threads=1)
    assert again.reused == 1
    for index in scenes:
        one, other = (read_run(tmp_path / f"{name}.h5", index) for name in ("whole", "part"))
        assert np.array_equal(one.positions, other.positions)
        assert np.array_equal(one.stress, other.stress)
        assert one.scene.effects == scenes[index].effects


@pytest.mark.slow
def test_the_point_schedule_agrees(monkeypatch):
    mixed = {
        "strain_softening": 1.0, "overburden_strength": 0.5, "rate_strengthening": 0.1,
        "weak_base": 0.2, "shaking": 0.1, "water_drag": 1.0, "dilatancy": 0.1, "cracking": 0.5,
    }  # fmt: skip
    settings = SHORT.model_copy(update={"duration_s": 1.0})
    (by_scene,) = simulate([slump(mixed)], settings)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    (by_point,) = simulate([slump(mixed)], settings)
    assert by_scene.status == by_point.status == "finished"
    assert by_scene.steps == by_point.steps
    assert np.abs(by_scene.positions - by_point.positions).max() < 0.01
    for name, values in by_scene.energy.items():
        scale = np.abs(values).max()
        assert np.abs(values - by_point.energy[name]).max() <= 0.01 * scale, name


# --- every effect ---


@pytest.mark.parametrize("name", [one for one in LIBRARY if one != "strength_curve"])
def test_every_effect_moves_the_slump_and_keeps_the_energy_account(name):
    one = effect(name)
    settings = SimulationSettings(duration_s=6.0)
    strongest = one.amplitude.ladder[2]
    amplitudes = [strongest, -strongest] if one.amplitude.two_signed else [strongest]
    numbers = COARSE.get(name, {})
    scenes = [slump(), *(slump({name: {"amplitude": a, **numbers}}) for a in amplitudes)]
    base, *runs = simulate(scenes, settings)
    for run in runs:
        assert run.status == "finished", run.reason
        frames = min(len(base.positions), len(run.positions))
        moved = np.abs(run.positions[frames - 1] - base.positions[frames - 1])
        assert moved.max() > 0.02, "an effect that is on must be seen"
        # A vertical face that falls onto flat ground loses energy in the impact, the more the
        # faster it slides away; work that is not in the account would show in size or sign.
        assert 0.0 < run.audit["numerical_share"] < 0.15


@pytest.mark.parametrize("name", LIBRARY)
def test_every_effect_is_described_without_fault(name):
    one = effect(name)
    assert one.name == name
    assert faults(one) == ""


def test_the_table_of_the_document_is_that_of_the_library():
    before, after = around(EFFECTS_PAGE, "table")
    written = EFFECTS_PAGE.read_text()[len(before) : -len(after)]
    assert written == f"\n{effects_part()}\n", "out of date: python -m benchmarks.generated_pages"


def test_effects_are_listed_without_starting_taichi():
    script = "import sys; from mpm_taichi.effects import effects; print(len(effects())); " \
             "print('taichi' in sys.modules)"  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [str(len(effects())), "False"]
    assert "strength_curve" not in effects()
    assert effect("strength_curve").internal


# --- what is refused ---


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"rain": 1.0}, "slump: effect 'rain' is unknown; known are: strain_softening, "),
        ({"weak_base": 1.5}, "effects: weak_base: amplitude 1.5: allowed are 0 to 1"),
        ({"weak_base": -0.1}, "effects: weak_base: amplitude -0.1: allowed are 0 to 1"),
        ({"shaking": {"amplitude": 3}}, "effects: shaking: amplitude 3: allowed are -2 to 2 g"),
        ({"shaking": {"frequency_hz": 1}}, "effects: shaking: amplitude is missing"),
        (
            {"shaking": {"amplitude": 0.1, "frequency_hz": 90}},
            "effects: shaking: frequency_hz 90: allowed are 0.05 to 20 1/s",
        ),
        (
            {"shaking": {"amplitude": 0.1, "speed": 1}},
            "effects: shaking: 'speed' is unknown; known are: amplitude, frequency_hz, ",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(entry, message):
    for refused in (
        lambda: simulate([slump(entry)], SHORT),
        lambda: run_key(slump(entry), SHORT, "cpu"),
    ):
        with pytest.raises(InputError) as error:
            refused()
        assert message in str(error.value)
        assert "\n" not in str(error.value)


def test_an_effect_that_can_do_nothing_is_refused():
    dry = slump({"water_drag": 1.0}, water_level=None)
    with pytest.raises(InputError, match="water_drag: can do nothing in this scene: "):
        effects_on(dry)
    bonded = slump({"weak_base": 0.2}, ground={"points": [[0, 0], [60, 0]], "contact": "no_slip"})
    with pytest.raises(InputError, match="weak_base: can do nothing .* no_slip"):
        effects_on(bonded)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("shaking", "is a mapping"),
        ({"shaking": "strong"}, "shaking: 'strong' is not a number"),
        ({"shaking": {"amplitude": True}}, "shaking.amplitude: True is not a number"),
        ({"shaking": None}, "shaking: None is not a number"),
    ],
)
def test_a_scene_refuses_what_is_no_number(entry, message):
    with pytest.raises(InputError, match=re.escape(message)):
        slump(entry)
    with pytest.raises(ValidationError):
        type(slump()).model_validate({**slump().model_dump(), "effects": {"shaking": np.nan}})


def test_effects_survive_the_file_of_a_scene(tmp_path):
    scene = slump({"shaking": {"amplitude": 0.2, "frequency_hz": 2.0}, "weak_base": 0.5})
    for name in ("scene.yaml", "scene.json"):
        save_scene(scene, tmp_path / name)
        assert load_scene(tmp_path / name) == scene


def test_library_names_are_modules_and_in_one_table():
    files = {path.stem for path in (ROOT / "mpm_taichi" / "effects").glob("*.py")}
    assert set(LIBRARY) <= files
    assert [one.name for one in library()] == list(LIBRARY)
