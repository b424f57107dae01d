from __future__ import annotations

import csv
import subprocess
import sys
import types

import h5py
import pytest

from flowslide.command_line import main
from geometry.scenes.scene import save_scene
from mpm_taichi.trajectory import list_runs, read_run, write_runs
from pipeline.cli import InputError, WorkFailed
from tests.mpm_taichi import ballistic
from tests.mpm_taichi.ballistic import FAST, make_scene

FAST_SETTINGS = ["--set", "simulation.duration_s=1.0", "--set", "scales.coarse.duration_s=1.0"]


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    """The ballistic solver and one-line scenes in place of the real ones: no Taichi in here."""
    solver = types.ModuleType("mpm_taichi.simulate")
    solver.simulate = ballistic.simulate
    monkeypatch.setitem(sys.modules, "mpm_taichi.simulate", solver)
    templates = types.ModuleType("geometry.random_scenes.templates")
    templates.draw_scene = lambda config, scale, index: make_scene(index)
    monkeypatch.setitem(sys.modules, "geometry.random_scenes.templates", templates)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "batch_000.h5"
    runs = ballistic.simulate([make_scene(12), make_scene(13)], FAST)
    write_runs(path, {12: runs[0], 13: runs[1]})
    return path


def test_run_a_scene_file(tmp_path, capsys):
    save_scene(make_scene(3), tmp_path / "my.yaml")
    main(
        [
            "scenes",
            "simulate",
            str(tmp_path / "my.yaml"),
            "--out",
            str(tmp_path / "out"),
            *FAST_SETTINGS,
        ]
    )
    run = read_run(tmp_path / "out" / "block_3.h5", 0)
    assert run.settings.duration_s == 1.0
    assert "1 runs, 0 failed" in capsys.readouterr().out


def test_run_scene_folders(tmp_path):
    for number in (1, 2):
        (tmp_path / str(number)).mkdir()
        save_scene(make_scene(number), tmp_path / str(number) / "scene.yaml")
    folders = [str(tmp_path / "1"), str(tmp_path / "2")]
    main(["scenes", "simulate", *folders, "--out", str(tmp_path), *FAST_SETTINGS])
    assert [run.scene for run in list_runs(tmp_path / "runs.h5")] == ["block_1", "block_2"]


def test_run_a_batch_with_failures(tmp_path, capsys):
    options = ["--set", "scales.coarse.runs_per_batch=4", "--out", str(tmp_path)]
    main(["scenes", "simulate", "--scale", "coarse", "--batch", "3", *options, *FAST_SETTINGS])
    runs = list_runs(tmp_path / "batch_003.h5")
    assert [run.index for run in runs] == [12, 13, 14, 15]
    out, err = capsys.readouterr()
    assert "failed: run 13 (block_13, seed 13) at 1.25 s: energy balance off by 7 %\n" in err
    assert "4 runs, 1 failed" in out
    main(["scenes", "simulate", "--scale", "coarse", "--batch", "3", *options, *FAST_SETTINGS])
    assert "4 of the runs were there already" in capsys.readouterr().out


def test_run_one_scene_of_a_scale_from_its_file(tmp_path):
    (tmp_path / "scenes").mkdir()
    save_scene(make_scene(41), tmp_path / "scenes" / "00007.json")
    choice = ["--scale", "coarse", "--index", "7", "--scenes", str(tmp_path / "scenes")]
    main(["scenes", "simulate", *choice, "--out", str(tmp_path), "--quiet", *FAST_SETTINGS])
    (run,) = list_runs(tmp_path / "coarse_00007.h5")
    assert (run.index, run.scene) == (7, "block_41")
    settings = read_run(tmp_path / "coarse_00007.h5", 7, fields=[]).settings
    assert settings.duration_s == 1.0  # the scale's own


def test_a_batch_in_which_all_fail_is_an_error(tmp_path):
    save_scene(make_scene(13), tmp_path / "my.yaml")
    with pytest.raises(WorkFailed, match="every run failed; the first: energy balance"):
        main(["scenes", "simulate", str(tmp_path / "my.yaml"), "--out", str(tmp_path)])
    assert list_runs(tmp_path / "block_13.h5")[0].status == "failed"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "give scene files, or --scale with --batch"),
        (["--scale", "coarse"], r"needs --batch \(0 to 6\) or --index \(0 to 699\)"),
        (["--scale", "coarse", "--batch", "7"], "batch 7: allowed are 0 to 6"),
        (["--scale", "coarse", "--index", "700"], "--index 700: allowed are 0 to 699"),
        (["--scale", "huge", "--batch", "0"], "scale 'huge' is unknown: allowed are large"),
        (["x.yaml", "--scale", "coarse", "--batch", "0"], "cannot be combined"),
        (["--batch", "0"], "--batch: needs --scale"),
        (["missing.yaml"], "missing.yaml: no such file"),
        (["missing.yaml", "--set", "simulation.corant=1"], "did you mean courant"),
    ],
)
def test_bad_choices_are_one_line(tmp_path, arguments, complaint):
    with pytest.raises(InputError, match=complaint):
        main(["scenes", "simulate", *arguments, "--out", str(tmp_path)])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("value", ["0", "-1", "two"])
def test_threads_must_be_positive(tmp_path, value, capsys):
    with pytest.raises((InputError, SystemExit)) as caught:
        main(["scenes", "simulate", "x.yaml", "--out", str(tmp_path), f"--threads={value}"])
    said = capsys.readouterr().err or str(caught.value)
    assert said.count("--threads") == 1 and ("at least 1" in said or "'two'" in said)


def test_show(file, tmp_path):
    main(["runs", "show", f"{file}:12", "--out", str(tmp_path / "x.png"), "--colour", "material"])
    main(["runs", "show", f"{file}:12", "--out", str(tmp_path / "y.png"), "--times", "0,1"])
    main(["runs", "show", f"{file}:run_00012", "--out", str(tmp_path / "x.gif"), "--frames", "3"])
    assert {path.name for path in tmp_path.glob("*.*")} >= {"x.png", "y.png", "x.gif"}
    with pytest.raises(InputError, match="holds 2 runs; name one of 12 to 13, for instance"):
        main(["runs", "show", str(file), "--out", str(tmp_path / "z.png")])
    for time in ("nan", "99", "inf"):
        with pytest.raises(InputError, match=rf"no frame at {time} s; allowed are 0 to [\d.]+ s"):
            main(
                [
                    "runs",
                    "show",
                    f"{file}:12",
                    "--out",
                    str(tmp_path / "w.png"),
                    "--times",
                    f"0,{time}",
                ]
            )
        with pytest.raises(InputError, match=f"no frame at {time} s"):
            main(["runs", "export", str(file), "--format", "csv", "--out", str(tmp_path / "all"),
                  "--times", time])  # fmt: skip
    assert not (tmp_path / "w.png").exists() and not (tmp_path / "all").exists()
    with pytest.raises(InputError, match="--times: is for pictures"):
        main(["runs", "show", f"{file}:12", "--out", str(tmp_path / "x.gif"), "--times", "1"])


def test_export(file, tmp_path):
    main(["runs", "export", f"{file}:12", "--format", "csv", "--out", str(tmp_path / "x.csv")])
    assert (tmp_path / "x.csv").read_text().startswith("point,zone,material,x_initial_m")
    main(["runs", "export", str(file), "--format", "vtkhdf", "--out", str(tmp_path / "all")])
    names = sorted(path.name for path in (tmp_path / "all").iterdir())
    assert names == ["run_00012.vtkhdf", "run_00013.vtkhdf"]
    with h5py.File(tmp_path / "all" / names[0]) as exported:
        assert exported["VTKHDF"].attrs["Type"] == b"UnstructuredGrid"
    with pytest.raises(InputError, match="--times: is for --format csv"):
        main(["runs", "export", str(file), "--format", "vtkhdf", "--out", "x", "--times", "1"])


def test_status_prints_and_writes_a_table(file, tmp_path, capsys):
    main(["runs", "status", str(file)])
    out = capsys.readouterr().out.splitlines()
    assert out[0].split()[:4] == ["run", "scene", "points", "steps"]
    assert out[2].split()[:2] == ["13", "block_13"] and "failed (wall right)" in out[2]
    assert out[-2].startswith("failed: run 13 (block_13, seed 13) at 1.25 s: energy balance")
    assert out[-1].startswith("2 runs, 1 failed")

    main(["runs", "status", str(file), "--csv", str(tmp_path / "runs.csv")])
    with (tmp_path / "runs.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["index"] for row in rows] == ["12", "13"]
    assert rows[1]["reason"] == "energy balance off by 7 %"
    assert float(rows[0]["point_steps_per_s"]) > 0 and rows[0]["file"] == str(file)
    assert "block_12" not in capsys.readouterr().out


def test_a_run_that_failed_at_once_can_be_listed_but_not_drawn(tmp_path):
    save_scene(make_scene(666), tmp_path / "bad.yaml")
    save_scene(make_scene(1), tmp_path / "good.yaml")
    scenes = [str(tmp_path / "bad.yaml"), str(tmp_path / "good.yaml")]
    main(["scenes", "simulate", *scenes, "--out", str(tmp_path), *FAST_SETTINGS])
    main(["runs", "status", str(tmp_path / "runs.h5")])
    with pytest.raises(InputError, match="no frames to draw .the solver raised RuntimeError"):
        main(["runs", "show", f"{tmp_path / 'runs.h5'}:0", "--out", str(tmp_path / "x.png")])
    main(
        [
            "runs",
            "export",
            str(tmp_path / "runs.h5"),
            "--format",
            "csv",
            "--out",
            str(tmp_path / "all"),
        ]
    )
    assert [path.name for path in (tmp_path / "all").iterdir()] == ["run_00001.csv"]


def test_what_python_says_of_taichis_sources_is_not_shown():
    script = (
        "import warnings, mpm_taichi\n"
        "for place in ('taichi/tools/image.py', 'mine.py'):\n"
        "    warnings.warn_explicit('an escape', SyntaxWarning, '/lib/' + place, 60)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr == "/lib/mine.py:60: SyntaxWarning: an escape\n"
