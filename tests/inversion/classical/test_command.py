from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from flowslide.command_line import main
from geometry.case import load_case
from geometry.survey.measurements import load_measurements
from inversion.classical.analysis import options_of
from inversion.classical.judgement import Judgement, default_judgements, load_judgements
from inversion.classical.sections_of_case import case_sections, head_of
from pipeline.cli import InputError
from tests.dams import dam_with_pool

ROOT = Path(__file__).resolve().parents[3]
CASES = ROOT / "case_histories"
QUICK = {"unit_weight_factors": [], "zif_shares": [0.4], "sections": [], "slip_surfaces": []}


@pytest.fixture
def lsfd(tmp_path):
    """A copy of the case with fewer alternatives and sections."""
    folder = dam_with_pool(tmp_path / "dam")
    change(folder, sections=5, alternatives=QUICK)
    return folder


def change(folder: Path, **fields) -> None:
    path = folder / "classical.yaml"
    document = yaml.safe_load(path.read_text())
    document["analyses"][0].update(fields)
    path.write_text(yaml.safe_dump(document))


def classical(folder, out, *options) -> dict:
    assert main(["classical", str(folder), "--out", str(out), *map(str, options)]) == 0
    return json.loads((out / "classical.json").read_text())


def values(result: dict) -> dict[str, float]:
    return {m["method"]: m["value_kpa"] for m in result["analyses"][0]["methods"]}


@pytest.mark.slow
def test_lower_san_fernando(lsfd, tmp_path, capsys):
    out = tmp_path / "out"
    result = classical(lsfd, out)
    (slide,) = result["analyses"]
    found = values(result)
    # The method's figures for this section, ordinary slices: 18.8 (f 0.40); IMM 18.2.
    zif = next(m for m in slide["methods"] if m["method"] == "zif")
    assert found["zif"] == pytest.approx(19.1, abs=0.6)
    assert found["imm"] == pytest.approx(19.6, abs=0.8)
    assert 24.0 < found["kinetics"] < 34.0
    assert zif["low_kpa"] < found["zif"] < zif["high_kpa"]
    options = {option["name"]: option for option in zif["options"]}
    assert options["f = 0.40"]["value_kpa"] > found["zif"]
    assert options["no water"]["value_kpa"] > 2 * found["zif"]
    assert not options["no water"]["in_range"]
    inside = [o["value_kpa"] for o in zif["options"] if o["in_range"]]
    assert zif["high_kpa"] == pytest.approx(max([*inside, found["zif"]]))
    # The mass and what is known of it.
    assert slide["slide"]["centre_before_m"] == pytest.approx([157.6, 19.9], abs=0.1)
    assert slide["slide"]["centre_after_m"] == pytest.approx([123.1, 12.5], abs=0.1)
    assert slide["slide"]["area_before_over_after"] == pytest.approx(1.0, abs=0.01)
    energy = slide["energy"]
    assert energy["driving_mj_per_m"] < 0.8 * energy["gravity_mj_per_m"]
    # Constructed, machine-made and recalled values say so, in the file and on the screen.
    text = capsys.readouterr().out
    for words in ("constructed, not surveyed", "morphed by machine", "recalled"):
        assert words in text
    assert slide["section_after"]["kind"] == "constructed"
    assert slide["published"]["weber_2015_imm"]["confidence"] == "recalled"
    motion = slide["methods"][0]["motion"]
    assert motion["velocity_m_per_s"][-1] == 0.0
    assert motion["time_s"][-1] == pytest.approx(motion["duration_s"], abs=1e-3)
    assert (out / "upstream.png").stat().st_size > 50_000
    page = (out / "classical.html").read_text()
    for method in slide["methods"]:
        assert f"{method['value_kpa']:.1f}" in page, method["title"]


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--water", "none"),
        ("--water-line", "phreatic"),
        ("--base-strength", "place"),
        ("--unit-weight-factor", "1.1"),
        ("--method", "ordinary"),
        ("--zif-share", "0.5"),
        ("--sections", "7"),
        ("--path-end", "level"),
        ("--path-stages", "after"),
        ("--slip-surface", "search"),
        ("--liquefied-alone", None),
    ],
)
@pytest.mark.slow
def test_every_option_has_an_effect(lsfd, option, value):
    """Each judgement call changes a method's answer (solved without the other alternatives)."""
    from flowslide.commands.classical import _changes, add_arguments
    from inversion.classical.analysis import SOLVERS, Workbench
    from inversion.classical.slides import judgements
    from pipeline.cli import base_parser

    parser = base_parser("test", "")
    add_arguments(parser)
    given = [option] if value is None else [option, value]
    case = case_sections(load_case(lsfd))
    found = []
    for extra in ([], given):
        arguments = parser.parse_args(["x", "--sections", "5", *extra])
        (judgement,) = judgements(case, changes=_changes(arguments))
        bench = Workbench(case, judgement)
        found.append([SOLVERS[method](bench, judgement).strength for method in SOLVERS])
    assert max(abs(a - b) for a, b in zip(*found, strict=True)) > 10.0


@pytest.mark.slow
def test_results_go_where_the_configuration_says(lsfd, tmp_path, capsys):
    folder = tmp_path / "elsewhere"
    assert main(["classical", str(lsfd), "--quiet", "--set", f"results_folder={folder}"]) == 0
    assert (folder / "dam" / "classical" / "classical.json").is_file()


@pytest.mark.slow
def test_la_marquesa_is_two_slides(tmp_path):
    case = case_sections(load_case(CASES / "la_marquesa"))
    judgements = load_judgements(case.folder, case.measurements)
    assert [(j.name, j.side) for j in judgements] == [("upstream", "left"), ("downstream", "right")]
    result = classical(CASES / "la_marquesa", tmp_path, "--slide", "downstream")
    (slide,) = result["analyses"]
    assert slide["side"] == "right"
    assert 5.0 < values(result)["imm"] < 13.0
    assert slide["slide"]["toe_after_m"] == pytest.approx(32.5, abs=0.1)


def test_a_simulated_deposit_may_be_the_section_after(lsfd, tmp_path):
    from dataclasses import replace

    from geometry.scenes.scene import load_scene
    from mpm_taichi.trajectory import POINT_FIELDS, Run, write_runs
    from pipeline.config import SimulationSettings

    scene = load_scene(lsfd / "scene.yaml").changed(spacing=2.0)
    case = case_sections(load_case(lsfd))
    (judgement,) = load_judgements(lsfd, case.measurements)
    after = case.after(judgement).points
    x = np.arange(24.0, 368.0, 2.0)
    last = np.array(
        [(at, y) for at in x for y in np.arange(3.0, np.interp(at, *after.T), 2.0)],
        dtype=np.float32,
    )
    fields = {
        name: np.zeros((len(last), *shape), kind) for name, (shape, kind) in POINT_FIELDS.items()
    }
    fields["initial_volume"] += scene.spacing**2
    run = Run.empty(scene, SimulationSettings(), reason="")
    run = replace(run, status="finished", positions=last[None], time=np.zeros(1), **fields)
    path = tmp_path / "run.h5"
    write_runs(path, {0: run})
    found = case_sections(load_case(lsfd), run=path).after(judgement)
    assert found.kind == "simulated"
    assert np.interp(150.0, *found.points.T) == pytest.approx(
        float(np.interp(150.0, *after.T)), abs=1.5
    )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"side": "up"}, "analyses.0.side"),
        ({"zif_share": 1.4}, "analyses.0.zif_share"),
        ({"sections": 4}, "analyses.0.sections"),
        ({"colour": "red"}, "docs/method/classical.md"),
        ({"slip_surface": "none.csv"}, "none.csv: no such file"),
        ({"published": ["nobody"]}, "published: 'nobody'"),
        ({"side": "right"}, "not to the right"),
    ],
)
def test_bad_judgements_are_refused_in_one_line(lsfd, run_module, fields, words):
    change(lsfd, **fields)
    done = run_module("flowslide", "classical", lsfd, "--out", lsfd / "out")
    assert done.returncode == 2, done.stderr
    assert words in done.stderr and done.stderr.count("\n") == 1
    assert not (lsfd / "out").exists()


def test_bad_input_is_refused_in_one_line(lsfd, tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        main(["classical", str(tmp_path / "nothing")])
    with pytest.raises(InputError, match="the case has upstream"):
        main(["classical", str(lsfd), "--slide", "downstream"])
    with pytest.raises(InputError, match="zif_share"):
        main(["classical", str(lsfd), "--zif-share", "2"])
    with pytest.raises(InputError, match="no such file"):
        main(["classical", str(lsfd), "--run", str(tmp_path / "none.h5")])
    with pytest.raises(SystemExit) as left:
        main(["classical", str(lsfd), "--water", "salty"])
    assert left.value.code == 2
    scene = (lsfd / "scene.yaml").read_text().replace("liquefied: true", "liquefied: false")
    (lsfd / "scene.yaml").write_text(scene)
    with pytest.raises(InputError, match="no S_r to find"):
        main(["classical", str(lsfd)])


def test_without_a_file_every_side_with_a_runout_is_analysed():
    found = default_judgements(load_measurements(CASES / "la_marquesa"), "case")
    assert [(j.name, j.side, j.water_line) for j in found] == [
        ("upstream", "left", "level"),
        ("downstream", "right", "phreatic"),
    ]
    nothing = load_measurements(CASES / "lower_san_fernando_paper")
    kept = [m for m in nothing.sets["field"] if m.type != "toe_runout"]
    nothing = nothing.model_copy(update={"sets": {"field": kept}})
    with pytest.raises(InputError, match="name the side"):
        default_judgements(nothing, "case")


def test_a_slip_surface_without_liquefied_soil_is_refused_in_one_line(tmp_path):
    folder = shutil.copytree(CASES / "lower_san_fernando", tmp_path / "dam")
    (folder / "slip_surface.csv").write_text("x_m,y_m\n121.6,19.1\n180,19.1\n202,24\n214.5,37.4\n")
    with pytest.raises(InputError, match="passes through no liquefied soil"):
        main(["classical", str(folder), "--slide", "upstream", "--out", str(tmp_path / "out")])


@pytest.mark.slow
def test_sections_that_make_no_slide_are_a_finding_where_nobody_said_they_do(lsfd, tmp_path):
    (lsfd / "classical.yaml").unlink()
    (lsfd / "post_failure_profile.csv").write_text(
        "x_m,y_m,part\n20,2,constructed\n40,30,constructed\n214,46,constructed\n"
    )
    result = classical(lsfd, tmp_path / "out")
    assert result["analyses"] == []
    assert "slip surface" in result["not_analysed"][0] or "area" in result["not_analysed"][0]
    with pytest.raises(InputError):
        main(["classical", str(lsfd), "--slide", "upstream"])


def test_head_of_the_mass_follows_from_the_surfaces():
    for name, side, head in (
        ("lower_san_fernando_paper", "left", 214.5),
        ("la_marquesa", "left", 13.5),
        ("la_marquesa", "right", 13.5),
    ):
        case = case_sections(load_case(CASES / name))
        judgement = Judgement(name="x", side=side)
        after = case.after(judgement).points
        assert head_of(case.section(judgement), after, side) == pytest.approx(head, abs=1.0)


def test_options_differ_from_the_judgement():
    judgement = Judgement(name="x", side="left")
    options = list(options_of(judgement, has_water=True))
    assert len({(o.name, o.methods) for o in options}) == len(options)
    for option in options:
        assert judgement.model_copy(update=option.changes) != judgement
    dry = [o.name for o in options_of(judgement, has_water=False)]
    assert not any("water" in name for name in dry)
