"""`flowslide scenes`, `check`, `show` as a user meets them: files, resuming, one-line errors."""

from __future__ import annotations

import pytest

from flowslide.command_line import main
from flowslide.commands.runs.sample import parse_indices
from geometry import draw_scene, load_scene
from geometry.scenes.scene import save_scene
from pipeline.cli import InputError


def test_sample_writes_resumes_and_repairs(tmp_path, capsys, config):
    out = tmp_path / "scenes"
    command = [
        "scenes",
        "sample",
        "--scale",
        "small",
        "--indices",
        "0-4,7",
        "--out",
        str(out),
        "--quiet",
    ]
    main(command)
    assert "6 scenes" in capsys.readouterr().out
    names = [path.name for path in sorted(out.iterdir())]
    assert names == [
        "00000.json",
        "00001.json",
        "00002.json",
        "00003.json",
        "00004.json",
        "00007.json",
    ]
    assert load_scene(out / "00007.json") == draw_scene(config, "small", 7)
    kept = (out / "00001.json").stat().st_mtime_ns
    (out / "00002.json").write_text("{")
    (out / "00003.json").unlink()
    main(command)
    assert "2 written, 4 already there" in capsys.readouterr().out
    assert (out / "00001.json").stat().st_mtime_ns == kept
    assert load_scene(out / "00002.json") == draw_scene(config, "small", 2)


def test_sample_tries_its_folder_before_the_first_scene(tmp_path, capsys):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot be written: File exists"):
        main(
            [
                "scenes",
                "sample",
                "--scale",
                "coarse",
                "--indices",
                "0",
                "--out",
                str(tmp_path / "file"),
            ]
        )
    assert capsys.readouterr().err == ""


def test_sample_follows_the_settings(tmp_path, capsys):
    out = str(tmp_path / "scenes")
    command = ["scenes", "sample", "--scale", "large", "--indices", "0-1", "--out", out, "--quiet"]
    main(command)
    main([*command, "--set", "geometry.seed=5"])
    assert "2 written, 0 already there" in capsys.readouterr().out.splitlines()[-1]


def test_check(tmp_path, capsys, case_folder):
    main(["check", str(case_folder)])
    out = capsys.readouterr().out
    assert "lower_san_fernando" in out and "6242" in out and "100.00 %" in out
    folder = str(tmp_path / "scenes")
    main(["scenes", "sample", "--scale", "large", "--indices", "0-9", "--out", folder, "--quiet"])
    main(["check", folder, "--quiet"])
    assert "10 valid" in capsys.readouterr().out


def test_show(tmp_path, case_folder):
    for name, arguments in {
        "dam.png": [str(case_folder), "--points"],
        "many.svg": ["--scale", "large", "--indices", "0-5", "--columns", "3"],
        "one.pdf": ["--scale", "small", "--indices", "4"],
    }.items():
        main(["show", *arguments, "--out", str(tmp_path / name)])
        assert (tmp_path / name).stat().st_size > 5000
    assert len(list(tmp_path.iterdir())) == 3


def test_pictures_are_the_same_every_time(tmp_path):
    for name in ("a.svg", "b.svg"):
        main(["show", "--scale", "large", "--indices", "0-1", "--out", str(tmp_path / name)])
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_indices():
    assert parse_indices("0-3,7,2") == [0, 1, 2, 3, 7]
    for text in ("", "a", "3-1", "1-", "-1", "1..3"):
        with pytest.raises(InputError, match="--indices"):
            parse_indices(text)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["scenes", "sample", "--scale", "huge", "--out", "x"],
            "scale 'huge' is unknown: allowed are large",
        ),
        (
            ["scenes", "sample", "--scale", "large", "--indices", "2500", "--out", "x"],
            "scenes 0 to 2499",
        ),
        (
            ["scenes", "sample", "--scale", "large", "--out", "x", "--set", "geometry.sed=1"],
            "did you mean seed",
        ),
        (["check", "none.yaml"], "none.yaml: no such file"),
        (["show", "--out", "x.png"], "give scene files, or --scale"),
        (["show", "--scale", "large", "--indices", "0", "--out", "x.bmp"], "allowed are .png"),
        (["import", "none.csv", "--out", "x.yaml"], "none.csv: no such file"),
        (["import", "none.csv", "--out", "x.txt"], "scene files end in .yaml or .json"),
        (
            ["import", "none.csv", "--out", "x.yaml", "--spacing", "0"],
            "--spacing 0: must be greater",
        ),
    ],
)
def test_errors_in_the_process(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        main(arguments)
    assert list(tmp_path.iterdir()) == []


def test_bad_scene_ends_with_one_line_and_code_2(run_module, tmp_path, case_folder):
    text = (case_folder / "scene.yaml").read_text()
    bad = tmp_path / "bad.yaml"
    bad.write_text(text.replace("cohesion_kpa: 21.5", "cohesion_kpa: -21.5"))
    done = run_module("flowslide", "check", case_folder, bad)
    assert done.returncode == 2
    assert done.stderr == (
        f"error: {bad}: materials.liquefied_hydraulic_fill.cohesion_kpa: "
        "Input should be greater than or equal to 0 (got -21.5)\n"
    )


def test_unknown_option_ends_with_code_2(run_module):
    done = run_module("flowslide", "scenes", "sample", "--scales", "large")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_check_says_what_is_too_thin_to_be_held(tmp_path, capsys, make_scene):
    berm = [(-50, 0), (0, 0), (3, 2), (-4, 2), (-6, 0.2), (-50, 0.2)]
    save_scene(make_scene([berm], spacing=0.5), tmp_path / "scene.yaml")
    main(["check", str(tmp_path / "scene.yaml")])
    assert "m² of soil are thinner than half a spacing" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"weak_bse": 0.3}, "effect 'weak_bse' is unknown"),
        ({"weak_base": -1.0}, "weak_base: amplitude -1: allowed are"),
        ({"pool_level": 1.0}, "pool_level: can do nothing in this scene"),
    ],
)
def test_check_refuses_the_effects_that_simulate_refuses(tmp_path, config, effects, words):
    scene = draw_scene(config, "small", 3).changed(effects=effects)
    save_scene(scene, tmp_path / "scene.yaml")
    with pytest.raises(InputError, match=words):
        main(["check", str(tmp_path / "scene.yaml")])
