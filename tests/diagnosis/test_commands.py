"""The commands on a coarse case: what they print and leave, how they go on, what they refuse."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.example import write_survey
from benchmarks.hidden_effects.making.sections import load_section
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.hypothesis_file import load_hypothesis
from diagnosis.verdict.fitted_models import kept_step
from diagnosis.verdict.verdict import CompareDocument, ExplainDocument, load_verdict
from geometry.case import load_case
from inversion.problem.state import state
from pipeline.cli import InputError
from report.sentences.finding import headline
from report.table import plain
from tests.commands import diagnose as main

pytestmark = pytest.mark.slow

QUICK = [
    "--threads", "1", "--page", "no", "--quiet",
    *(part for name, value in {
        "replicates": 3, "draws": 300, "starts": 1, "rounds": 1, "refitted": 1, "max_runs": 70,
    }.items() for part in ("--set", f"diagnosis.{name}={value}")),
]  # fmt: skip
ASKED = """
synthetic: true
spacing_m: 2.0
finer_share: 0.0
finer_share_std: 0.2
effects: [overburden_strength, weak_base]
forbid: {strain_softening: a test says so}
"""
#: So large that no draw of the points can hide it: chi2 of the base model is about 200 on 30.
HIDDEN = {"weak_base": 0.8}


@pytest.fixture(scope="module")
def folder(root, tmp_path_factory, kept_runs):
    """The example, surveyed after a slide over a base that is much weaker than the model's."""
    folder = tmp_path_factory.mktemp("case") / "embankment"
    shutil.copytree(root / "docs" / "examples" / "hidden_effect", folder)
    (folder / "diagnosis.yaml").write_text(ASKED)
    model = diagnosis_case(load_case(folder)).model(kept_runs)
    (measured,) = model.predict([state((9.2, 33.0), HIDDEN, seed=11)])
    places = np.loadtxt(folder / "profile.csv", delimiter=",", skiprows=1)[:, 0]
    write_survey(load_section(folder), folder, np.round(measured, 3), places)
    return folder


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    """Results of one case, shared by the tests that go on where others ended."""
    return tmp_path_factory.mktemp("results")


def ask(command: str, folder, out, *options) -> None:
    assert not main([command, str(folder), "--out", str(out), *map(str, options), *QUICK])


def runs_told(text: str) -> tuple[int, int, int]:
    found = re.search(r"(\d+) forward runs \(at most (\d+)\), (\d+) of them simulated now", text)
    return tuple(int(number) for number in found.groups())


@pytest.fixture(scope="module")
def verdict_text(folder, out) -> str:
    """The verdict of an uninterrupted run."""
    ask("run", folder, out)
    return (out / "verdict.json").read_text()


def test_compare(folder, out, verdict_text, capsys):
    ask("compare", folder, out)
    text = capsys.readouterr().out
    asked, most, computed = runs_told(text)
    assert 10 < asked <= most == 70 and computed == 0, "the run had made them already"
    assert "S_r of the loose sand" in text and "the held-out data" in text
    assert "toe in time at 7 s" in text
    document = CompareDocument.model_validate(json.loads((out / "compare.json").read_text()))
    assert document.runs.asked <= asked and document.runs.computed is None
    assert document.case == "embankment" and document.base.effects == {}
    assert plain(headline(document)) in text


def test_explain(folder, out, verdict_text, capsys):
    ask("explain", folder, out)
    text = capsys.readouterr().out
    assert runs_told(text)[2] == 0
    assert re.search(r"strain softening .* ruled out by the engineer: a test says so", text)
    assert re.search(r"pore pressure .* can do nothing here: there is no water", text)
    document = ExplainDocument.model_validate(json.loads((out / "explain.json").read_text()))
    assert [c.name for c in document.candidates if not c.left_out] == document.confounding.names
    assert set(document.confounding.names) == {"overburden_strength", "weak_base"}
    assert {c.left_out for c in document.candidates if c.name == "shaking"} == {"not asked for"}
    assert document.signatures.measurements[0] == "surface at x -33.26 m"


def test_run(folder, out, verdict_text, capsys):
    verdict = load_verdict(out)
    assert verdict.tested == ["overburden_strength", "weak_base"]
    assert verdict.base.p_combined < 1e-6 and verdict.base.chi2 > 3.0 * verdict.base.dof
    assert verdict.verdict in ("identified", "ambiguous", "unknown_effect")
    scores = {c.name: c.z for c in verdict.candidates if not c.left_out}
    assert scores["weak_base"] > max(5.0, scores["overburden_strength"])
    last = verdict.steps[-1]
    assert set(last.effects) == {effect.name for effect in verdict.answer.effects}
    assert (verdict.final.chi2, verdict.final.values) == (last.chi2, last.values)
    if verdict.verdict != "unknown_effect":
        assert last.effects and last.chi2 < 0.5 * verdict.base.chi2
    assert verdict.runs.asked <= 70 and verdict.runs.computed is None
    assert verdict.seconds is None and set(verdict.hashes) >= {"scene.yaml", "profile.csv"}
    assert verdict.manifest["physics_versions"].keys() == {
        "geometry", "mpm_taichi", "inversion", "diagnosis"
    }  # fmt: skip
    timing = json.loads((out / "timing.json").read_text())["run"]
    assert timing["runs_asked"] >= verdict.runs.asked and timing["seconds"] > 0
    for number, step in enumerate(verdict.steps):
        name = "00_base" if not number else f"{number:02d}_{step.hypothesis}"
        assert kept_step(out, name).step.chi2 == pytest.approx(step.chi2)
    # Asked again it costs nothing and says the same.
    ask("run", folder, out)
    assert runs_told(capsys.readouterr().out)[2] == 0
    assert (out / "verdict.json").read_text() == verdict_text


def test_extend_and_track(folder, out, verdict_text, capsys):
    before = sorted(path.stem for path in (out / "hypotheses").glob("*.yaml"))
    ask("extend", folder, out, "--add", "weak_base", "--notes", "clay was seen")
    text = capsys.readouterr().out
    (name,) = {path.stem for path in (out / "hypotheses").glob("*.yaml")} - set(before)
    assert name.endswith("_weak_base") and f"{name}.yaml" in text
    model = load_hypothesis(out / "hypotheses" / f"{name}.yaml")
    assert (model.by, model.parent, model.notes) == ("extend", "00_base", "clay was seen")
    assert 0.0 <= model.effects["weak_base"].amplitude <= 1.0
    # A person goes on from there; the first effect is fitted again with the second.
    ask("extend", folder, out, "--hypothesis", name, "--add", "overburden_strength")
    both = max((out / "hypotheses").glob("*.yaml"))
    assert set(load_hypothesis(both).effects) == {"weak_base", "overburden_strength"}
    assert load_hypothesis(both).parent == name
    assert kept_step(out, both.stem).step.chi2 < kept_step(out, "00_base").step.chi2
    # And writes a model of their own, which is judged with the covariance of the base model.
    own = out / "hypotheses" / "20_looser_fill.yaml"
    own.write_text(
        "parent: 00_base\nnotes: looser\n"
        "scene_changes: {materials: {compacted_fill: {density: 1700}}}\n"
    )
    capsys.readouterr()
    ask("track", folder, out)
    assert "20_looser_fill: not judged yet" in capsys.readouterr().out
    ask("compare", folder, out, "--hypothesis", "20_looser_fill")
    capsys.readouterr()
    ask("track", folder, out)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("00_base") and lines[1].endswith("base model")
    assert any(line.startswith(name) and "by hand: clay was seen" in line for line in lines)
    assert any(line.startswith("20_looser_fill") and "by hand: looser" in line for line in lines)
    assert not any("outdated" in line for line in lines)
    # After the survey has changed, earlier findings are reported as outdated.
    text = (folder / "measurements.yaml").read_text()
    try:
        (folder / "measurements.yaml").write_text(text + "# resurveyed\n")
        ask("track", folder, out)
        assert "outdated" in capsys.readouterr().out
    finally:
        (folder / "measurements.yaml").write_text(text)


def test_a_loop_from_a_persons_model_keeps_its_effects(folder, out, verdict_text, tmp_path):
    shutil.copytree(out, tmp_path / "own")
    hypotheses = tmp_path / "own" / "hypotheses"
    (hypotheses / "30_deep.yaml").write_text(
        "parent: 00_base\neffects: {overburden_strength: 0.2}\n"
    )
    before = set(hypotheses.glob("*.yaml"))
    ask("run", folder, tmp_path / "own", "--hypothesis", "30_deep")
    (found,) = set(hypotheses.glob("*.yaml")) - before
    model = load_hypothesis(found)
    assert (model.by, model.parent) == ("run", "30_deep")
    assert set(model.effects) == {"overburden_strength", "weak_base"}
    assert model.effects["overburden_strength"].amplitude == 0.2, "as it was given"
    assert kept_step(tmp_path / "own", found.stem).step.effects["overburden_strength"] == 0.2


def test_suggest(folder, out, verdict_text, capsys):
    ask("suggest", folder, out, "--n", 2)
    text = capsys.readouterr().out
    assert runs_told(text)[2] == 0
    assert "measure next" in text and len(re.findall(r", to [\d.]+ m? ?s? +[\d.]+", text)) == 2


@pytest.mark.long
def test_a_killed_run_goes_on_and_gives_the_same_bytes(folder, tmp_path, verdict_text):
    command = [
        sys.executable,
        "-m",
        "flowslide",
        "diagnose",
        "run",
        str(folder),
        "--out",
        str(tmp_path),
    ]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    process = subprocess.Popen([*command, *QUICK], env=environment, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60.0
    while len(list((tmp_path / "runs").glob("*.npz"))) < 20 and process.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    there = len(list((tmp_path / "runs").glob("*.npz")))
    assert there >= 20 and not (tmp_path / "verdict.json").exists()
    done = subprocess.run(
        [*command, *QUICK], env=environment, capture_output=True, text=True, check=True
    )
    asked, _, computed = runs_told(done.stdout)
    assert computed <= asked - there + 1, "kept runs are not simulated again"
    assert (tmp_path / "verdict.json").read_text() == verdict_text
    assert (tmp_path / "sections.npz").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["compare", "nowhere"], "nowhere: no such folder; a case has scene.yaml"),
        (["run", "{folder}", "--spacing", "0"], "--spacing 0: must be greater than 0"),
        (["run", "{folder}", "--threads", "0"], "--threads 0: at least 1"),
        (
            ["run", "{folder}", "--hypothesis", "x"],
            "--hypothesis x: no such file, and no hypothesis of",
        ),
        (["explain", "{folder}", "--effects", "none.py"], "none.py: No such file"),
        (["extend", "{folder}", "--add", "magic"], "--add magic: no such effect here"),
        (["suggest", "{folder}", "--n", "0"], "--n 0: at least 1"),
        (["track", "{folder}", "--out", "{empty}"], "no model has been judged; begin with"),
    ],
)
def test_bad_input_is_one_line(folder, tmp_path, arguments, complaint):
    command, *rest = arguments
    given = [command, *QUICK, *rest]
    given = [text.format(folder=folder, empty=tmp_path / "empty") for text in given]
    if "--out" not in given:
        given += ["--out", str(tmp_path)]
    with pytest.raises(InputError, match=complaint) as caught:
        main(given)
    assert "\n" not in str(caught.value)


def test_the_commands_end_as_they_should(run_module, tmp_path):
    done = run_module("flowslide", "diagnose", "run", tmp_path / "nowhere")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    listed = run_module("flowslide", "diagnose", "--help")
    for name in ("run", "compare", "explain", "extend", "track", "suggest"):
        assert name in listed.stdout
