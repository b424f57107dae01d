"""The whole back-analysis by a learned simulator: a block, a law it was taught, the real judge."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from geometry.case import load_case
from inversion.back_analysis.by_engine import back_analysis_by, chosen_engine
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import Result, load_result, schema_text
from inversion.back_analysis.result_files import answered, side_by_side
from inversion.back_analysis.with_learned_simulator import SOURCE, SurrogateAnalysis
from inversion.engines.registry import engine_named
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.run_store import RunStore
from inversion.engines.trained_model import load_model
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.progress import Watch
from report.back_analysis import summary
from report.data.back_analysis import BackAnalysisData
from tests.inversion.small_slide import simulator, taught, write_case
from tests.inversion.test_invert import timeless

QUICK = ["inversion.starts=1", "inversion.noise_seeds=0", "inversion.variants=false"]
MORE = {
    "sensitivities": [
        {"name": "density", "kind": "property", "zones": ["soil"], "property": "density",
         "std": 50.0},
        {"name": "time step", "kind": "time_step", "factor": 0.5},
    ],
}  # fmt: skip


class Killed(Exception):
    """Stands for a signal that ends the process."""


class MortalStore(RolloutStore):
    """Fails after a given number of rollouts and derivatives."""

    def __init__(self, folder, lives: int) -> None:
        super().__init__(folder)
        self.lives = lives

    def keep_rows(self, key, rows) -> None:
        super().keep_rows(key, rows)
        self.lives -= 1
        if not self.lives:
            raise Killed


def analysis(case: Path, model: Path, folder: Path, store=None, **more) -> SurrogateAnalysis:
    return SurrogateAnalysis(
        inversion_case(load_case(case, load_config(None, QUICK)), **more),
        RunStore(folder / "runs", threads=1),
        lambda line: None,
        model=load_model(model),
        rollouts=store or RolloutStore(folder / "rollouts"),
    )


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Case folder, folder of the model."""
    folder = tmp_path_factory.mktemp("block")
    case = write_case(folder / "block", **MORE)
    taught(case).save(folder / "taught" / "model.pt")
    return case, folder / "taught"


@pytest.fixture(scope="module")
def solved(block, tmp_path_factory):
    """The case solved without interruption; the result, its folder, the analysis."""
    folder = tmp_path_factory.mktemp("results") / "block" / "inversion_gns"
    done = analysis(*block, folder)
    return answered(done, folder), folder, done


@pytest.mark.slow
def test_the_answer_is_corrected_towards_what_the_material_point_method_says(solved):
    result, _, done = solved
    assert result.engine == "gns" and result.answer.reached
    (strength,) = result.answer.parameters
    assert strength.value == done.found.values[0]
    alone, at_alone, own, judged = result.engines
    assert [row.engine for row in result.engines] == ["gns", "mpm", "gns", "mpm"]
    # Alone it fits the toe, and the material point method does not agree with it there ...
    assert alone.predicted["toe"] == pytest.approx(7.0, abs=0.4)
    assert abs(at_alone.predicted["toe"] - 7.0) > 1.0
    # ... and corrected they agree to within what the surrogate's error is said to be.
    assert own.predicted["toe"] == pytest.approx(7.0, abs=0.4)
    off = judged.predicted["toe"] - own.predicted["toe"]
    assert abs(off) < 3.0 * result.surrogate.std["toe"] < 2.0
    assert own.values == judged.values != alone.values


@pytest.mark.slow
def test_the_error_of_the_surrogate_is_in_the_standard_deviation(solved):
    result, _, done = solved
    surrogate = result.surrogate
    (strength,) = result.answer.parameters
    differences = [pair.mpm["toe"] - pair.surrogate["toe"] for pair in surrogate.pairs]
    assert len(differences) >= 5, "more where the answer was settled by runs at it"
    assert surrogate.settled == (len(differences) > 5)
    assert min(differences) <= surrogate.mean_difference["toe"] <= max(differences)
    assert surrogate.std["toe"] == pytest.approx(np.sqrt(1.3) * np.std(differences, ddof=1))
    own = strength.std_by_source[SOURCE]
    slope = abs(result.answer.derivative["toe"]["S_r"])
    assert own == pytest.approx(surrogate.std["toe"] / slope, rel=0.05) and own > 0.05
    assert own == surrogate.answer_std["S_r"]
    assert strength.std_data == pytest.approx(0.5 / slope, rel=0.05)  # the survey's 0.5 m
    squares = sum(value**2 for value in strength.std_by_source.values())
    assert strength.std_total == pytest.approx(np.sqrt(strength.std_data**2 + squares))
    (toe,) = [line for line in result.measurements if line.name == "toe"]
    assert toe.std == pytest.approx(np.hypot(0.5, surrogate.std["toe"]))
    # The stress before failure is the material point method's: 5 m of soil, 88 kPa at the base.
    assert 35 < strength.sigma_v0_kpa < 50 and strength.ratio_std > own / strength.sigma_v0_kpa


@pytest.mark.slow
def test_what_a_rollout_cannot_tell_is_left_out_and_said(solved):
    result, _, _ = solved
    assert [entry.name for entry in result.sensitivities] == ["density"]
    assert any("time step: left out: a learned engine has no time step" in line
               for line in result.remarks)  # fmt: skip


@pytest.mark.slow
def test_the_result_fits_its_schema_and_is_reported(solved):
    result, folder, _ = solved
    jsonschema.validate(json.loads((folder / "result.json").read_text()), json.loads(schema_text()))
    assert load_result(folder).surrogate.model == "taught"
    told = summary(BackAnalysisData(folder, result))
    assert "Diff-GNS" in told and "without correction" in told and "at that answer" in told
    assert result.manifest["model_sha256"] == result.surrogate.model_sha256
    with np.load(folder / "sections.npz", allow_pickle=False) as file:
        assert len(file["final"]) == len(result.iterations)
        assert file["values"][int(file["answer"])][0] == result.answer.parameters[0].value


@pytest.mark.slow
def test_killed_and_continued_leaves_the_same_bytes(block, solved, tmp_path):
    result, whole, done = solved
    folder = tmp_path / "inversion_gns"
    with pytest.raises(Killed):
        analysis(*block, folder, MortalStore(folder / "rollouts", 3)).run()
    kept = {path: path.stat().st_mtime_ns for path in (folder / "rollouts").glob("*.npz")}
    assert len(kept) >= 6
    again = analysis(*block, folder)
    answered(again, folder)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept, "computed once"
    assert 0 < again.rollouts.computed < done.rollouts.computed
    for name in ("history.csv", "sections.npz"):
        assert (folder / name).read_bytes() == (whole / name).read_bytes(), name
    assert timeless(folder / "result.json") == timeless(whole / "result.json")


@pytest.mark.slow
def test_the_command_asked_again_costs_no_rollout(block, solved, tmp_path, run_module):
    """In another process, from what this one has kept."""
    case, model = block
    folder = tmp_path / "inversion_gns"
    shutil.copytree(solved[1], folder)
    (folder / "result.json").unlink()
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("r*s/*.npz")}
    line = ["--engine", "gns", "--model", model, "--threads", 1, "--report", "page"]
    line += [word for setting in QUICK for word in ("--set", setting)]
    done = run_module("flowslide", "invert", case, "--out", folder, *line)
    assert done.returncode == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in folder.glob("r*s/*.npz")} == kept
    assert timeless(folder / "result.json") == timeless(solved[1] / "result.json")
    assert "back-analysis by gns (Diff-GNS)" in done.stdout
    assert "material point method minus learned simulator: toe" in done.stderr
    page = (folder / "report.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert "by a learned simulator (Diff-GNS)" in page
    pairs = len(solved[0].surrogate.pairs)
    assert f"compared with the material point method at {pairs} states around the answer" in page
    judged = solved[0].engines[3].predicted["toe"]
    assert f"the toe moves {judged:.1f} m; 7 m was measured" in page
    assert page.count("material point method, at that answer") == 2


@pytest.mark.slow
def test_the_engines_stand_side_by_side(solved, tmp_path):
    """Each result's table holds what the other engine has answered, once it has."""
    result, folder, _ = solved
    assert side_by_side(result, folder) == result.engines
    document = result.model_dump(mode="json")
    document |= {"engine": "mpm", "surrogate": None, "engines": []}
    document["answer"]["parameters"][0] |= {"value": 8.3, "std_total": 0.4}
    own = Result.model_validate(document)
    for name, one in (("inversion", own), ("inversion_gns", result)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "result.json").write_text(one.model_dump_json())
    beside = side_by_side(result, tmp_path / "inversion_gns")
    assert beside[:4] == result.engines
    assert beside[4].values == {"S_r": 8.3} and beside[4].note == "its own answer"
    assert side_by_side(own, tmp_path / "inversion") == beside
    assert side_by_side(own, tmp_path / "elsewhere" / "inversion") == []
    other = own.model_copy(update={"measurement_set": "paper"})
    assert side_by_side(other, tmp_path / "inversion") == []


# -- which engine ---------------------------------------------------------------------------------


def choice(tmp_path: Path, asked: dict, settings: list[str], *line: str | None):
    case = inversion_case(
        load_case(write_case(tmp_path / "case", **asked), load_config(None, settings))
    )
    return chosen_engine(case, *line)


def test_command_line_question_and_settings_choose_the_engine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "thrust").mkdir(parents=True)
    settings = ["inversion.engine=gns", "inversion.model=here"]
    asked = {"engine": "gns", "model": "there"}
    assert choice(tmp_path / "a", {}, [], None, None).engine.name == "mpm"
    assert choice(tmp_path / "b", {}, settings, None, None).model == Path("here")
    assert choice(tmp_path / "c", asked, settings, None, None).model == Path("there")
    assert choice(tmp_path / "d", asked, settings, "gns", "given").model == Path("given")
    assert choice(tmp_path / "e", asked, settings, "mpm", None).engine.name == "mpm"
    named = choice(tmp_path / "f", {}, [], "gns", "thrust").model
    assert named == Path("models") / "thrust"
    needs = "engine: gns needs a model: .* models/ has thrust$"
    with pytest.raises(InputError, match=needs):
        choice(tmp_path / "g", {}, [], "gns", None)
    (tmp_path / "models" / "own").mkdir()
    (tmp_path / "models" / "own" / "model.pt").touch()
    with pytest.raises(InputError, match="models/ has own, thrust"):
        choice(tmp_path / "h", {}, [], "gns", None)
    monkeypatch.setattr("pipeline.places.ROOT", tmp_path / "nowhere")
    (tmp_path / "models" / "own" / "model.pt").unlink()
    with pytest.raises(InputError, match="models/ has none"):
        choice(tmp_path / "j", {}, [], "gns", None)
    with pytest.raises(InputError, match="--model given: goes with --engine gns"):
        choice(tmp_path / "i", {}, [], None, "given")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--engine", "gns"], "engine: gns needs a model"),
        (["--engine", "gns", "--model", "no_such"], "no_such/model.pt: no such file"),
        (["--engine", "learned"], "invalid choice: 'learned'"),
        (["--set", "inversion.surrogate_pairs=2"], "inversion.surrogate_pairs"),
    ],
)
@pytest.mark.slow
def test_bad_input_is_a_line_and_exit_2(tmp_path, run_module, more, message):
    case = write_case(tmp_path / "case")
    done = run_module("flowslide", "invert", case, "--out", tmp_path / "out", *more)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_wrong_file_is_a_line_and_exit_2(tmp_path, run_module):
    case = write_case(tmp_path / "case")
    (tmp_path / "model.pt").write_text("weights")
    done = run_module("flowslide", "invert", case, "--engine", "gns", "--model", tmp_path)
    assert done.returncode == 2
    assert "is damaged or not a model" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("thrust", [False, True])
def test_model_and_judge_have_the_water_that_the_model_knows(root, tmp_path, thrust):
    """A model without thrust says so, and its pairs have none; one with it leaves out nothing."""
    settings = load_config(None, [*QUICK, "inversion.spacing_factor=3"])
    case = inversion_case(load_case(root / "case_histories" / "lower_san_fernando", settings))
    assert case.setup.settings.water == "pore_pressure" and case.scene.head_falls
    simulator(thrust=thrust).save(tmp_path / "model" / "model.pt")
    store = RunStore(tmp_path / "runs", threads=1)
    gns = back_analysis_by(engine_named("gns"), case, store, Watch(), tmp_path / "model", tmp_path)
    known = gns.case.setup.settings
    if thrust:
        assert (known.water, known.water_face) == ("pore_pressure", "moving") and not gns.left_out
    else:
        assert known.water == "buoyant" and "leave out the thrust of the pool" in gns.left_out
