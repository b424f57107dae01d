"""The machinery of effects: off is off, what is refused, users' files, both schedules, the words.

After a change of an effect's words or numbers, the table of docs/effects.md is written anew by

    PYTHONPATH=. python tests/mpm_taichi/test_effects.py
"""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from geometry.scene import load_scene, save_scene, scene_from_mapping
from mpm_taichi import simulate as simulation
from mpm_taichi.batch import run_batch, run_key
from mpm_taichi.effects import (
    effect,
    effects,
    effects_on,
    effects_table,
    load_effects_file,
    registry,
)
from mpm_taichi.effects.registry import LIBRARY, faults, kernel_effects, library
from mpm_taichi.initial_state import prepare
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import read_run
from pipeline.cli import InputError
from pipeline.config import SimulationSettings

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "my_effect.py"
TABLE = re.compile(r"(<!-- table: .*? -->\n).*?(<!-- end of table -->)", re.DOTALL)
SHORT = SimulationSettings(duration_s=2.0, early_stop=False)


def slump(effects=None, **changes):
    """Liquefied soil (S_r 5 kPa) under sand, 20 m x 8 m, in a pool on the left; 160 points."""
    document = {
        "name": "slump",
        "domain": {"x_min": 0, "x_max": 60, "y_max": 20, "walls": "closed"},
        "ground": {"points": [[0, 0], [60, 0]]},
        "zones": [
            {"name": "a", "material": "silt", "polygon": [[20, 0], [40, 0], [40, 6], [20, 6]]},
            {"name": "b", "material": "sand", "polygon": [[20, 6], [40, 6], [40, 8], [20, 8]]},
        ],
        "materials": {
            "silt": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True},
            "sand": {"friction_deg": 30, "cohesion_kpa": 5},
        },
        "water_level": 7.0,
        "phreatic_line": [[0, 7], [30, 7], [40, 2], [60, 2]],
        "spacing": 1.0,
        "effects": effects or {},
    }
    return scene_from_mapping({**document, **changes})


@pytest.fixture
def users():
    """No user effects before, and none left behind."""
    registry._users.clear()
    yield registry._users
    registry._users.clear()


ON = {"strain_softening": 1.0, "shaking": 0.2, "weak_base": 0.3}


# --- off is off ---


def test_amplitude_zero_is_the_base_model_to_the_bit_and_by_key():
    off = {name: {"amplitude": 0.0} if name == "shaking" else 0.0 for name in effects()}
    base, same = simulate([slump(), slump(off)], SHORT)
    assert np.array_equal(base.positions, same.positions)
    assert np.array_equal(base.stress, same.stress)
    assert "effect_work" not in same.energy
    assert kernel_effects(slump(off)) == ()
    assert run_key(slump(), SHORT, "cpu") == run_key(slump(off), SHORT, "cpu")


def test_an_effect_that_is_off_leaves_no_trace_beside_one_that_is_on():
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


# --- a run hangs on nothing but its scene ---


def test_company_threads_and_growing_arrays_change_nothing(monkeypatch):
    (alone,) = simulate([slump(ON)], SHORT, threads=1)
    big = slump(
        {"rate_strengthening": 0.1},
        zones=[{"name": "a", "material": "silt", "polygon": [[5, 0], [55, 0], [55, 12], [5, 12]]}],
        materials={"silt": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True}},
    )
    quick = slump({"overburden_strength": 1.0}, seed=3, jitter=0.2)
    monkeypatch.setitem(simulation.SLOTS, "cpu", 2)
    settings = SHORT.model_copy(update={"early_stop": True})
    runs = simulate([quick, slump(ON), big, slump(), slump({"shaking": 0.1})], settings, threads=2)
    assert [run.status for run in runs] == ["finished"] * 5
    assert np.array_equal(alone.positions[: len(runs[1].positions)], runs[1].positions)
    assert np.array_equal(runs[3].positions, simulate([slump()], settings)[0].positions)


def test_an_open_domain_is_bit_for_bit_a_wide_one():
    """Place and time that an effect sees must not hang on how often the grid has grown."""
    pushed = {"shaking": {"amplitude": 0.5, "frequency_hz": 0.3}, "side_friction": 0.1,
              "weak_base": {"amplitude": 0.9, "x_to_m": 30.0}}  # fmt: skip
    domain = {"y_max": 20, "walls": "open"}
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
    scenes = [slump(), slump({name: strongest})]
    if one.amplitude.two_signed:
        scenes.append(slump({name: -strongest}))
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
    text = (ROOT / "docs" / "effects.md").read_text()
    assert table_renewed(text) == text, "write the table anew: see the head of this file"


def table_renewed(text):
    table = effects_table(effects().values())
    return TABLE.sub(lambda m: f"{m[1]}{table}\n{m[2]}", text)


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


# --- users' files ---


def test_the_example_of_the_document_runs_and_is_its_law(users):
    (regain,) = load_effects_file(EXAMPLE)
    assert list(effects())[-1] == "strength_regain" == regain.name
    entry = {"amplitude": 2.0, "time_s": 0.5}
    settings = SHORT.model_copy(update={"duration_s": 4.0})
    base, held = simulate([slump(), slump({"strength_regain": entry})], settings)
    assert held.status == "finished"
    travel = [np.ptp(run.positions[-1, :, 0]) - 20.0 for run in (base, held)]
    assert 0.0 < travel[1] < 0.7 * travel[0]
    rest = slump({"strength_regain": {"amplitude": 5.0, "time_s": 2.0}},
                 materials={"silt": {"friction_deg": 0, "cohesion_kpa": 200, "liquefied": True},
                            "sand": {"friction_deg": 30, "cohesion_kpa": 200}})  # fmt: skip
    (run,) = simulate([rest], SimulationSettings(duration_s=20.0))
    assert run.time[-1] > 10.0, "five times T, though it rests from the start"
    assert prepare(rest, SHORT).busy_until == 10.0


def test_a_user_effect_changes_no_bits_of_others(users):
    before = simulate([slump(ON)], SHORT)[0]
    load_effects_file(EXAMPLE)
    after, with_it = simulate([slump(ON), slump({**ON, "strength_regain": 1.0})], SHORT)
    assert np.array_equal(before.positions, after.positions)
    assert not np.array_equal(before.positions, with_it.positions)


def test_the_key_holds_the_content_of_the_file(users, tmp_path):
    scene = slump({"strength_regain": 1.0})
    load_effects_file(EXAMPLE)
    key, base = run_key(scene, SHORT, "cpu"), run_key(slump(), SHORT, "cpu")
    changed = tmp_path / "mine.py"
    changed.write_text(EXAMPLE.read_text().replace("1.0 - ti.exp", "1.01 - ti.exp"))
    load_effects_file(changed)
    assert run_key(scene, SHORT, "cpu") != key
    assert run_key(slump(), SHORT, "cpu") == base
    load_effects_file(EXAMPLE)
    assert run_key(scene, SHORT, "cpu") == key


BROKEN = {
    "nothing": ("x = 1\n", "defines no Effect; see docs/your-own-effect.md"),
    "syntax": ("def (:\n", "does not load: SyntaxError"),
    "import": ("import nothing_of_that_name\n", "does not load: ModuleNotFoundError"),
    "taken": (
        ('name="strength_regain"', 'name="shaking"'),
        "'shaking': the library has an effect of this name",
    ),
    "name": (('name="strength_regain"', 'name="Strength regain"'), "a name is lower-case letters"),
    "ladder": (("(0.25, 0.5, 1.0)", "(0.5, 0.25, 1.0)"), "ladder (0.5, 0.25, 1.0): three positive"),
    "sign": (("low=0.0", "low=-1.0"), "low -1: 0, or below it exactly where two_signed"),
    "default": (("10.0, 0.1", "10.0, 20.0"), "parameter time_s: default must lie between"),
    "arguments": (("strength(effect, soil, here)", "strength(effect, here)"), "hook strength: its"),
    "hooks": (("    strength=strength,\n", ""), "it has no hook that acts"),
    "words": (('looks_like="', 'looks_like="" and "'), "must say something"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_file_that_is_wrong_is_refused_in_one_line(users, tmp_path, kind):
    change, message = BROKEN[kind]
    path = tmp_path / "mine.py"
    text = EXAMPLE.read_text()
    path.write_text(change if isinstance(change, str) else text.replace(*change, 1))
    with pytest.raises(InputError) as error:
        load_effects_file(path)
    assert message in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert not users


def test_files_that_are_not_there_or_no_python(users, tmp_path):
    with pytest.raises(InputError, match="no_such.py: No such file"):
        load_effects_file(tmp_path / "no_such.py")
    (tmp_path / "mine.txt").write_text("x = 1\n")
    with pytest.raises(InputError, match="is no Python file"):
        load_effects_file(tmp_path / "mine.txt")


HOSTS = {
    "until": ("return 5.0 * parameters", "return 1 / 0 * parameters", "until: ZeroDivisionError: "),
    "applies": ("applies=needs_liquefied_soil", "applies=lambda scene: scene.nothing",
                "applies: AttributeError: "),
    "constants": ("    until=until,", "    constant_names=('k',), constants=lambda s, a, p: {},",
                  "constants: KeyError: "),
    "field": ("    until=until,", "    field=lambda s, x, a, p: x,", "field: ValueError: shape ("),
    "scene": ("    until=until,", "    scene=lambda s, a, p: s.changed(spacing=-1),",
              "scene: ValidationError: "),
    "compile": ("1.0 - ti.exp(", "1.0 - here.nothing * ti.exp(", "does not compile: "),
    "return": ("    return soil\n", "    soil.cohesion += 0.0\n", "does not compile: "),
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTS)
def test_a_hook_that_fails_is_named_in_one_line(users, tmp_path, kind):
    old, new, message = HOSTS[kind]
    path = tmp_path / "mine.py"
    assert old in EXAMPLE.read_text()
    path.write_text(EXAMPLE.read_text().replace(old, new))
    load_effects_file(path)
    with pytest.raises(InputError) as error:
        simulate([slump({"strength_regain": 1.0})], SHORT)
    assert str(error.value).startswith(f"effect 'strength_regain': {message}")
    assert "\n" not in str(error.value)


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "mpm_taichi", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip


def test_the_option_of_the_command_line(tmp_path):
    save_scene(slump({"strength_regain": 1.0}), tmp_path / "scene.yaml")
    run = ["run", tmp_path / "scene.yaml", "--out", tmp_path, "--threads", "1", "--quiet"]
    run += ["--set", "simulation.duration_s=0.5"]
    without = command(*run)
    assert without.returncode == 2
    assert "effect 'strength_regain' is unknown" in without.stderr
    assert len(without.stderr.strip().splitlines()) == 1
    done = command(*run, "--effects", EXAMPLE)
    assert done.returncode == 0, done.stderr
    assert "1 runs, 0 failed" in done.stdout
    listed = command("effects", "--effects", EXAMPLE, "strength_regain")
    assert listed.stdout.startswith("strength_regain: the liquefied soil regains strength")
    assert "time_s = 10 s (0.1 to 1000)" in listed.stdout
    wrong = command("effects", "rain")
    assert (wrong.returncode, len(wrong.stderr.strip().splitlines())) == (2, 1)


def test_library_names_are_modules_and_in_one_table():
    files = {path.stem for path in (ROOT / "mpm_taichi" / "effects").glob("*.py")}
    assert set(LIBRARY) <= files
    assert [one.name for one in library()] == list(LIBRARY)


if __name__ == "__main__":
    document = ROOT / "docs" / "effects.md"
    document.write_text(table_renewed(document.read_text()))
