"""The workflow: files made, files made again and why, files left by a failure."""

from __future__ import annotations

import re

import pytest
import yaml

from pipeline.config import Config


@pytest.mark.slow
def test_targets_work_as_typed(bench):
    bench.settings = {}
    assert bench.planned("simulate_large") == {
        "sample_scenes": 25,
        "simulate_batch": 25,
        "list_runs": 1,
    }
    assert bench.planned("geometry_small") == {"sample_scenes": 25, "draw_gallery": 1}
    assert bench.planned("pack_large") == {
        "sample_scenes": 25,
        "simulate_batch": 25,
        "list_runs": 1,
        "pack_trajectories": 1,
    }
    evaluated = bench.planned("evaluate_small")
    assert evaluated["train_model"] == 1 and bench.planned("train_small") == evaluated
    # The tests below use the short name.
    for verb, jobs in (
        ("simulate", ["simulate_case"]),
        ("invert", ["invert_case", "classical_case"]),
        ("diagnose", ["diagnose_case"]),
    ):
        assert bench.planned(f"{verb}_lower_san_fernando") == dict.fromkeys(jobs, 1)


@pytest.mark.slow
def test_everything_is_made_once(bench):
    bench.snakemake("everything")
    for scale in ("large", "small", "coarse"):
        for name in ("gallery.png", "runs.csv", "runs.png", "runs.html", "failed.txt"):
            assert bench.path(f"{scale}/{name}").stat().st_size or name == "failed.txt"
    assert bench.path("large/trajectories/batch_001.h5").read_text().startswith("cpu")
    assert (
        bench.path("lower_san_fernando/simulation/summary.txt").read_text() == "toe_runout 53 m\n"
    )
    assert bench.path("lower_san_fernando/inversion/summary.txt").read_text() == "S_r 26 kPa\n"
    # Run 1 of the two that the stand-in lists for the large scale has failed.
    assert bench.path("large/failed.txt").read_text() == (
        "1\ts_1, seed 7, at 4.5 s: energy out of balance\n"
    )
    assert bench.path("small/failed.txt").read_text() == ""
    assert bench.path("large/dataset/metadata.json").read_text() == (
        "large 2 files\n1\ts_1, seed 7, at 4.5 s: energy out of balance\n"
    ), "what failed is left out by name"
    settings = yaml.safe_load(bench.path("config.yaml").read_text())
    assert set(settings) == set(Config.model_fields)
    assert bench.planned("everything") == {}

    report = bench.folder / "report.html"
    bench.snakemake("everything", options=["--report", str(report)])
    text = report.read_text()
    for word in ("gallery.png", "runs.png", "runs.html", "runout.mp4", "report.html"):
        assert word in text


@pytest.mark.slow
def test_a_dry_run_leaves_the_settings_of_a_running_workflow(bench):
    bench.snakemake("geometry_coarse")
    before = bench.path("config.yaml").read_text()
    bench.settings["simulation"]["courant"] = 0.11
    assert "simulate_batch" in bench.planned("simulate_coarse")
    assert bench.path("config.yaml").read_text() == before
    bench.snakemake("simulate_coarse")
    assert "courant: 0.11" in bench.path("config.yaml").read_text()


@pytest.mark.slow
def test_a_case_may_have_folders_in_it(bench):
    drawings = bench.folder / "case_histories" / "lower_san_fernando" / "drawings"
    drawings.mkdir()
    (drawings / "a_section.dxf").touch()
    bench.snakemake("simulate_lsfd")
    made = bench.path("lower_san_fernando/simulation/observables.csv").read_text()
    assert made == "case_histories/lower_san_fernando"


@pytest.mark.slow
def test_what_is_made_again(bench):
    bench.snakemake("simulate_coarse", "geometry_coarse")
    targets = ("simulate_coarse", "geometry_coarse")
    simulation = {"simulate_batch": 2, "list_runs": 1}
    scenes = {"sample_scenes": 2, "draw_gallery": 1, **simulation}

    bench.set_physics("mpm_taichi", 1, docstring="Better words.")
    bench.stand_in("mpm_taichi").touch()
    assert bench.planned(*targets) == {}, "edits to programs make nothing again"

    bench.set_physics("mpm_taichi", 2)
    assert bench.planned(*targets) == simulation
    bench.set_physics("mpm_taichi", 1)
    bench.set_physics("geometry", 2)
    assert bench.planned(*targets) == scenes
    bench.set_physics("geometry", 1)
    bench.set_physics("mpm_taichi/effects", 2)
    assert bench.planned(*targets) == {}, "random scenes have no effects"

    bench.settings["simulation"]["courant"] = 0.2
    assert bench.planned(*targets) == simulation
    del bench.settings["simulation"]["courant"]
    bench.settings["geometry"]["seed"] = 1
    assert bench.planned(*targets) == scenes
    del bench.settings["geometry"]["seed"]
    bench.settings["scales"]["large"]["duration_s"] = 3.0
    assert bench.planned(*targets) == {}, "another scale is another matter"


@pytest.mark.slow
def test_what_is_packed_again(bench):
    bench.snakemake("pack_coarse")
    bench.settings["gns"]["pack"]["seed"] = 5
    assert bench.planned("pack_coarse") == {"pack_trajectories": 1}
    del bench.settings["gns"]["pack"]["seed"]
    bench.set_physics("gns", 2)
    assert bench.planned("pack_coarse", "simulate_coarse") == {"pack_trajectories": 1}
    bench.set_physics("gns", 1)
    bench.settings["simulation"]["courant"] = 0.2
    again = {"simulate_batch": 2, "list_runs": 1, "pack_trajectories": 1}
    assert bench.planned("pack_coarse") == again


@pytest.mark.slow
def test_when_a_model_learns_again(bench):
    bench.snakemake("pack_coarse")
    (bench.folder / "break").touch()
    text = bench.snakemake("train_coarse", expect=1)
    assert "rule train_model" in text
    assert bench.path("coarse/model/state/last.pt").exists(), "the state survives a failure"
    (bench.folder / "break").unlink()
    bench.snakemake("train_coarse")
    assert bench.path("coarse/model/trained.txt").read_text() == "trained results/coarse/dataset\n"
    assert bench.path("coarse/model/evaluation.txt").read_text() == "runout 1.5 spacings\n"
    both = {"train_model": 1, "evaluate_model": 1}
    bench.settings["gns"]["train"]["pushforward"] = 1  # coarse has no value of its own for it
    assert bench.planned("train_coarse") == both
    del bench.settings["gns"]["train"]["pushforward"]
    bench.settings["gns"]["train_of_scale"]["coarse"]["width"] = 9
    assert bench.planned("train_coarse") == both
    bench.settings["gns"]["train_of_scale"]["coarse"]["width"] = 8
    assert bench.planned("train_coarse") == {}


@pytest.mark.slow
def test_a_model_at_hand_answers_too(bench):
    """Dropped into models/, or named; after the other engine, whose answer its page shows."""
    assert bench.planned("invert_lsfd") == {"classical_case": 1, "invert_case": 1}
    model = bench.folder / "models" / "thrust" / "model.pt"
    model.parent.mkdir(parents=True)
    model.write_text("weights")
    assert "invert_case_gns" not in bench.planned("answer_lsfd"), "what make lsfd asks for"
    bench.snakemake("invert_lsfd")
    found = bench.folder / "results" / "lower_san_fernando"
    assert (found / "inversion_gns" / "result.json").exists()
    assert bench.planned("invert_lsfd") == {}
    model.write_text("other weights")
    assert bench.planned("invert_lsfd") == {"invert_case_gns": 1}
    bench.settings["inversion"] = {"model": "no_such_model"}
    text = bench.snakemake("invert_lsfd", expect=1)
    assert "inversion.model: no_such_model: no folder with model.pt" in text


@pytest.mark.slow
def test_when_strengths_are_sought_again(bench):
    bench.snakemake("invert_lsfd")
    case = bench.folder / "case_histories" / "lower_san_fernando"
    (case / "README.md").write_text("better words\n")
    assert bench.planned("invert_lsfd") == {}, "words make nothing again"
    bench.settings["inversion"] = {"noise_seeds": 3}
    assert bench.planned("invert_lsfd") == {"invert_case": 1}
    del bench.settings["inversion"]
    bench.set_physics("inversion", 2)
    assert bench.planned("invert_lsfd") == {"invert_case": 1, "classical_case": 1}
    assert bench.planned("simulate_lsfd") == {"simulate_case": 1}, "never made, hence planned"
    bench.set_physics("inversion", 1)
    bench.set_physics("mpm_taichi/effects", 2)
    assert "invert_case" in bench.planned("invert_lsfd"), "its section may have one on"
    bench.set_physics("mpm_taichi/effects", 1)
    (case / "inversion.yaml").write_text("parameters: [{}]\n")
    assert "invert_case" in bench.planned("invert_lsfd")
    (case / "measurements.yaml").write_text("sets: {field: [{type: toe_runout}]}\n")
    assert bench.planned("invert_lsfd") == {"invert_case": 1}, "no surface, no classical methods"


@pytest.mark.slow
def test_when_missing_physics_is_sought_again(bench):
    bench.snakemake("diagnose_lsfd", "invert_lsfd")
    told = bench.path("lower_san_fernando/diagnosis/verdict.json").read_text()
    assert told == "run case_histories/lower_san_fernando"
    summary = bench.path("lower_san_fernando/diagnosis/summary.txt").read_text()
    assert summary == "identified\n"
    case = bench.folder / "case_histories" / "lower_san_fernando"
    (case / "diagnosis.yaml").write_text("forbid: [shaking]\n")
    planned = bench.planned("diagnose_lsfd", "invert_lsfd")
    assert planned == {"diagnose_case": 1}, "a veto concerns the diagnosis alone"
    bench.snakemake("diagnose_lsfd")
    for group, change in (("diagnosis", {"replicates": 5}), ("simulation", {"courant": 0.2})):
        before = bench.settings.get(group)
        bench.settings[group] = {**(before or {}), **change}
        assert bench.planned("diagnose_lsfd") == {"diagnose_case": 1}
        bench.settings[group] = before or {}
    for package in ("diagnosis", "inversion", "mpm_taichi", "geometry"):
        bench.set_physics(package, 2)
        assert bench.planned("diagnose_lsfd") == {"diagnose_case": 1}, package
        bench.set_physics(package, 1)
    assert bench.planned("diagnose_lsfd") == {}


@pytest.mark.slow
def test_more_scenes_add_batches_only(bench):
    bench.snakemake("simulate_small")
    bench.settings["scales"]["small"]["number_of_scenes"] = 10
    assert bench.planned("simulate_small") == {
        "sample_scenes": 1,
        "simulate_batch": 1,
        "list_runs": 1,
    }


@pytest.mark.slow
def test_a_failed_batch_stops_nothing_else_and_is_made_at_the_next_start(bench):
    bench.snakemake("simulate_coarse")
    (bench.folder / "break").touch()
    bench.settings["simulation"]["courant"] = 0.2
    text = bench.snakemake("simulate_coarse", expect=1)
    assert "batch_001.h5" in text
    assert bench.path("coarse/trajectories/batch_000.h5").exists()
    assert not bench.path("coarse/trajectories/batch_001.h5").exists()
    parts = bench.path("coarse/trajectories/.batch_001.parts/run")
    assert parts.exists(), "what a job keeps for the next try is left alone"

    (bench.folder / "break").unlink()
    assert bench.planned("simulate_coarse") == {"simulate_batch": 1, "list_runs": 1}
    bench.snakemake("simulate_coarse")
    assert bench.planned("simulate_coarse") == {}


def test_a_gpu_is_a_resource(bench):
    bench.snakemake("simulate_small", options=["--set-resources", "simulate_batch:gpu=1"])
    assert bench.path("small/trajectories/batch_000.h5").read_text().startswith("cuda")


@pytest.mark.parametrize(
    ("group", "value", "message"),
    [
        ("simulation", {"courrant": 0.2}, "simulation.courrant: no such setting, did you mean"),
        ("scales", {"large": {"spacing_m": -1}}, "scales.large.spacing_m: -1: input should be"),
        ("trainning", {}, "trainning: no such setting; allowed are"),
    ],
)
def test_a_wrong_setting_is_named(bench, group, value, message):
    bench.settings[group] = value
    text = bench.snakemake("simulate_large", options=["--dry-run"], expect=1)
    assert message in text and "Traceback" not in text


def test_a_group_that_is_given_twice_is_refused(bench):
    path = bench.folder / "config" / "config.yaml"
    path.write_text(path.read_text() + "simulation: {courant: 0.2}\n")
    text = bench.snakemake("simulate_large", options=["--dry-run"], expect=1)
    assert "config.yaml: line " in text and "the key 'simulation' is given twice" in text
    assert "Traceback" not in text


def test_a_scale_may_not_be_called_like_a_case(bench):
    bench.settings["scales"]["lsfd"] = Config().scale("large").model_dump()
    text = bench.snakemake("simulate_lsfd", options=["--dry-run"], expect=1)
    assert "lsfd is the name of a case history" in text


def test_dry_run_on_a_cluster(bench):
    bench.settings = {}
    options = ["--workflow-profile", "profiles/slurm", "--dry-run", "--printshellcmds"]
    text = bench.snakemake("simulate_large", options=options)
    assert len(re.findall(r"--batch \d+ .*--threads 16", text)) == 25


def test_every_rule_is_complete(root):
    """Each rule that runs a program has log, benchmark, threads, resources, a message."""
    for path in sorted((root / "rules").glob("*.smk")):
        rules = re.split(r"^rule (\w+):$", path.read_text(), flags=re.MULTILINE)[1:]
        for name, body in zip(rules[::2], rules[1::2], strict=True):
            found = set(re.findall(r"^    (\w+):", body, flags=re.MULTILINE))
            needed = {"output", "log", "benchmark", "threads", "resources", "message", "shell"}
            assert needed <= found, f"{path.name}: {name} lacks {needed - found}"


def test_profiles_agree(root):
    local = yaml.safe_load((root / "profiles/local/config.yaml").read_text())
    slurm = yaml.safe_load((root / "profiles/slurm/config.yaml").read_text())
    assert (root / "profiles/default").resolve() == (root / "profiles/local").resolve()
    assert local["scheduler"] == slurm["scheduler"] == "greedy"
    for key in ("rerun-triggers", "rerun-incomplete", "keep-going"):
        assert local[key] == slurm[key], key
