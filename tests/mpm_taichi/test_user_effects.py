"""Effects of users: the worked example, keys, what is refused, the command line."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from geometry.scenes.scene import save_scene
from mpm_taichi.batch import run_key
from mpm_taichi.effects import effects, load_effects_file
from mpm_taichi.effects.framework import registry
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import prepare
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import SHORT, slump

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "my_effect.py"
ON = {"strain_softening": 1.0, "shaking": 0.2, "weak_base": 0.3}


@pytest.fixture
def users():
    """No user effects before, and none left behind."""
    registry._users.clear()
    yield registry._users
    registry._users.clear()


@pytest.mark.slow
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


@pytest.mark.slow
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
    "nothing": ("x = 1\n", "no MaterialLaw; see docs/how-to/extend.md"),
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
    "draw": (("    strength=strength,\n", '    strength=strength,\n    realisation="seed",\n'),
             "realisation 'seed' is none of its parameters"),
    "words": (('looks_like="', 'looks_like="" and "'), "must say something"),
    "text": (('words="', 'words=7 or "'), "words: 7 is not text"),
    "name of a kind": (('name="strength_regain"', "name=3"), "effect 3: name: 3 is not text"),
    "no amplitude": (("amplitude=Amplitude(", "amplitude=dict("), "amplitude: {'unit': '', "),
    "bound": (("high=5.0", 'high="5"'), "amplitude: high: '5' is not a finite number"),
    "no number": (("low=0.0", 'low=float("nan")'), "amplitude: low: nan is not a finite number"),
    "endless": (("high=5.0", 'high=float("inf")'), "amplitude: high: inf is not a finite number"),
    "huge": (("high=5.0", "high=10**400"), "is not a finite number"),
    "steps": (("(0.25, 0.5, 1.0)", "0.25"), "ladder 0.25: three positive amplitudes"),
    "step": (("(0.25, 0.5, 1.0)", "(0.25, None, 1.0)"), "amplitude: ladder: None is not a finite"),
    "signs": (("high=5.0,", 'high=5.0, two_signed="no",'), "two_signed: 'no' is neither True"),
    "unit": (("high=5.0,", "high=5.0, si=0.0,"), "amplitude: si: 0 makes every number of it 0"),
    "parameter": (('"time_s", "s"', '"time s", "s"'), "'time s' cannot be written as eff"),
    "keyword": (('"time_s", "s"', '"from", "s"'), "'from' cannot be written as effect"),
    "limits": (("10.0, 0.1, 1000.0", '10.0, 0.1, float("inf")'), "high: inf is not a finite"),
    "no comma": (("is regained\"),\n", "is regained\")\n"), "parameters: a tuple is wanted"),
    "hook": (("    strength=strength,", '    strength="strength",'), "'strength' is not a plain"),
    "host": (("    until=until,", "    until=5.0,"), "hook until: 5.0 is not a function"),
    "applies": (("applies=needs_liquefied_soil", "applies=None"), "None is not a function"),
    "constants": (("    until=until,", '    constant_names=("k"), constants=until,'),
                  "constant_names: a tuple of names is wanted"),
}  # fmt: skip


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


def test_two_effects_of_one_name_are_refused(users, tmp_path):
    path = tmp_path / "mine.py"
    again = "from dataclasses import replace\n\nAGAIN = replace(STRENGTH_REGAIN, source='mine')\n"
    path.write_text(EXAMPLE.read_text() + again)
    with pytest.raises(InputError, match="'strength_regain': the file has two effects of this"):
        load_effects_file(path)
    assert not users


def test_files_that_are_not_there_or_no_python(users, tmp_path):
    with pytest.raises(InputError, match="no_such.py: No such file"):
        load_effects_file(tmp_path / "no_such.py")
    (tmp_path / "mine.txt").write_text("x = 1\n")
    with pytest.raises(InputError, match="is not a Python file"):
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
@pytest.mark.slow
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
        [sys.executable, "-m", "flowslide", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_the_option_of_the_command_line(tmp_path):
    save_scene(slump({"strength_regain": 1.0}), tmp_path / "scene.yaml")
    run = [
        "scenes",
        "simulate",
        tmp_path / "scene.yaml",
        "--out",
        tmp_path,
        "--threads",
        "1",
        "--quiet",
    ]
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


def test_a_file_that_ends_the_program_is_reported(tmp_path):
    path = tmp_path / "ends.py"
    path.write_text("import sys\n\nsys.exit(0)\n")
    with pytest.raises(InputError, match="ends.py: does not load: SystemExit"):
        load_effects_file(path)
