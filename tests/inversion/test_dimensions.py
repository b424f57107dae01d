"""A slide from a few numbers: its case, its unknowns, its posterior and its picture."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from flowslide import api
from flowslide.command_line import main
from geometry.case import load_case
from geometry.dimensions.stated import FILE_NAME
from inversion.back_analysis.case import InversionCase, inversion_case
from inversion.back_analysis.variants import sides
from inversion.engines.run_store import RunStore
from inversion.new_case.from_dimensions import case_of_dimensions
from inversion.posterior.document import load_posterior
from inversion.posterior.runs import CaseModel
from inversion.posterior.varied_case import varied_case
from inversion.problem.question import UnknownDimension
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.places import ROOT

FIVE = """# Five numbers.
slid_face: upstream
height_m: 10 +- 0.5
slope_h_per_v: {value: 2.2, how: read, source: a thesis}
crest_width_m: {low: 2, high: 4}
liquefied_thickness_m: {value: 4, std: 0.4}
pool_m: 6
runout_m: {value: 8, low: 6, high: 10, how: abstract, source: a paper}
duration_s: 12 +- 3
"""


#: Slides that ship with their numbers alone.
FAMILIES = ["fort_peck", "sheffield", "wachusett"]
#: What `new` leaves to its user, who may write more of it.
TEXT = "README.md"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cases") / "five_numbers"
    file = folder.parent / "five.yaml"
    file.write_text(FIVE)
    main(["new", str(folder), "--dimensions", str(file), "--spacing", "1"])
    return folder


@pytest.fixture(scope="module")
def case(made) -> InversionCase:
    return inversion_case(load_case(made))


def test_the_folder_checks_and_says_what_it_takes(made, case, capsys):
    main(["check", str(made)])
    assert "toe (toe_runout), duration (slide_duration)" in capsys.readouterr().out
    text = (made / FILE_NAME).read_text()
    assert text.startswith(FIVE) and "#   depth of the pool" not in text
    assert "#   reach of what liquefied: 0.5 to 1.2" in text
    toe, duration = case.measured
    assert (toe.std, toe.confidence, toe.source) == (1.0, "published", "a paper")
    assert (duration.std, duration.confidence) == (3.0, "recalled")
    assert list(case.setup.targets.fitted) == [True, True]
    assert not [path for path in made.iterdir() if "FILL IN" in path.read_text()]
    readme = (made / "README.md").read_text()
    assert "| slope of the slid face | 2.2 ± 0.11 h:v | read, a thesis |" in readme


def test_every_dimension_is_an_unknown_in_its_unit(case):
    varied = varied_case(case)
    strength, height, *_, friction = varied.unknowns
    assert len(varied.unknowns) == 10 and not varied.boundaries.any()
    assert (strength.unit, height.unit, friction.unit) == ("kPa", "m", "deg")
    assert height.at(0.5) == pytest.approx(10.0) and height.source == "recalled"
    assert friction.source.startswith("not stated: ")
    assert [varied.dimension_of(1), varied.dimension_of(9)] == ["height_m", "fill_friction_deg"]


def test_values_of_the_unknowns_become_a_section(case):
    varied = varied_case(case)
    values = np.array([float(one.at(0.5)) for one in varied.unknowns])
    assert varied.setup(values).scene == case.scene
    values[1], values[9] = 11.0, 30.0
    scene = varied.setup(values).scene
    assert scene.height == pytest.approx(11.0) and scene.materials["fill"].friction_deg == 30.0
    assert scene.spacing == case.spacing_m and scene.foot("left") == 0.0


def test_one_dimension_at_a_time_is_a_sensitivity(case):
    height = case.question.sensitivities[0]
    assert isinstance(height, UnknownDimension)
    higher, lower = sides(case.setup, height, "here")
    assert (higher.setup.scene.height, lower.setup.scene.height) == pytest.approx(
        (10.0 * np.exp(0.05), 10.0 * np.exp(-0.05)), abs=1e-3
    )
    assert higher.words == "one standard deviation above its median"


def test_a_section_that_was_changed_by_hand_is_refused(made, tmp_path):
    import shutil

    folder = shutil.copytree(made, tmp_path / "changed")
    scene = folder / "scene.yaml"
    scene.write_text(scene.read_text().replace("friction_deg: 35.0", "friction_deg: 33.0"))
    with pytest.raises(InputError, match="is not the median section of dimensions.yaml"):
        inversion_case(load_case(folder))
    question = folder / "inversion.yaml"
    question.write_text(question.read_text().replace("dimension: pool_m", "dimension: pool"))
    with pytest.raises(InputError, match="no 'pool'; dimensions.yaml has height_m, "):
        inversion_case(load_case(folder))


@pytest.mark.parametrize("name", FAMILIES)
def test_a_slide_that_ships_is_what_its_numbers_make(name, tmp_path):
    shipped, made = ROOT / "case_histories" / name, tmp_path / name
    case_of_dimensions(str(made), str(shipped / FILE_NAME))
    assert {path.name for path in shipped.iterdir()} == {path.name for path in made.iterdir()}
    for path in made.iterdir():
        if path.name != TEXT:
            assert path.read_bytes() == (shipped / path.name).read_bytes(), path.name
    lines = (shipped / TEXT).read_text().splitlines()
    table = [line for line in (made / TEXT).read_text().splitlines() if line.startswith("|")]
    assert len(table) > 9 and [line for line in lines if line in table] == table
    case = inversion_case(load_case(shipped))
    assert case.setup.family is not None and case.setup.targets.fitted.all()


def test_a_final_slope_is_an_inclination_with_its_error(tmp_path):
    """1 in 20 is 2.86 degrees; an error of 2 in 20 is a tenth of it."""
    file = tmp_path / "numbers.yaml"
    file.write_text("slid_face: dry\nheight_m: 10\nfinal_slope_h_per_v: 20 +- 2\n")
    made = case_of_dimensions(str(tmp_path / "flat"), str(file))
    case = inversion_case(load_case(made.folder))
    targets = case.setup.targets
    assert targets.names == ["final slope"] and made.runouts == []
    assert targets.measured == pytest.approx([2.862], abs=0.001)
    assert targets.covariance == pytest.approx(np.array([[0.286**2]]), abs=1e-3)


def test_a_range_of_final_slopes_bends(tmp_path):
    """Uniform from 2 to 40: the mean of atan(1 / f) is about ln(20) / 38 rad, no atan(1 / 21)."""
    file = tmp_path / "numbers.yaml"
    file.write_text("slid_face: dry\nheight_m: 10\nfinal_slope_h_per_v: {low: 2, high: 40}\n")
    case = inversion_case(load_case(case_of_dimensions(str(tmp_path / "wide"), str(file)).folder))
    (mean,), std = case.setup.targets.measured, case.setup.targets.covariance[0, 0] ** 0.5
    slopes = np.degrees(np.arctan(1.0 / np.random.default_rng(0).uniform(2.0, 40.0, 200_000)))
    assert mean == pytest.approx(slopes.mean(), rel=0.01)
    assert std == pytest.approx(slopes.std(), rel=0.01)
    assert mean == pytest.approx(math.degrees(math.log(20.0) / 38.0), rel=0.02)


def test_a_prediction_says_that_the_section_is_the_median_one(made, tmp_path):
    known = api.predict(
        str(made), ["8+-1"], samples=200, seeds=0, spacing_m=1.0, out=tmp_path / "known"
    )
    assert any("every dimension at its median" in line for line in known["remarks"])


def test_a_dry_slide_says_what_its_ratio_lacks(tmp_path, capsys):
    file = tmp_path / "numbers.yaml"
    file.write_text("slid_face: dry\nheight_m: 10\nrunout_m: 12\n")
    main(["new", str(tmp_path / "dry"), "--dimensions", str(file)])
    assert "doubtful: slid_face dry: sigma'_v0 has no pore pressure" in capsys.readouterr().out


def test_a_small_error_is_no_zero(tmp_path):
    file = tmp_path / "numbers.yaml"
    file.write_text("slid_face: dry\nheight_m: 10\nfinal_slope_h_per_v: 150 +- 0.1\n")
    case = inversion_case(load_case(case_of_dimensions(str(tmp_path / "sure"), str(file)).folder))
    sure = math.degrees(0.1 / (1.0 + 150.0**2))
    assert case.setup.targets.covariance[0, 0] ** 0.5 == pytest.approx(sure, rel=0.01)


def test_every_slide_that_ships_with_its_numbers_is_tried():
    there = (ROOT / "case_histories").glob(f"*/{FILE_NAME}")
    assert sorted(path.parent.name for path in there) == FAMILIES


@pytest.mark.parametrize("option", [["--runout", "left=3"], ["--liquefied", "fill"]])
def test_options_of_a_drawing_are_refused(option, made, tmp_path):
    with pytest.raises(InputError, match=f"^{option[0]}: belongs to a drawing"):
        main(["new", str(tmp_path / "x"), "--dimensions", str(made / FILE_NAME), *option])


@pytest.mark.slow
def test_the_strength_of_a_hidden_section_is_found(case, tmp_path):
    """The toe of the median section with 1 kPa; what is not stated widens the answer."""
    model = CaseModel(varied_case(case), RunStore(tmp_path / "runs", threads=1))
    values = np.array([[1.0, *(float(one.at(0.5)) for one in model.unknowns[1:])]])
    toe = float(model.run(values, coarse=False)[0, 0])
    file = tmp_path / "five.yaml"
    stated = FIVE.partition("runout_m")[0]
    file.write_text(f"{stated}runout_m: {{value: {toe:.3f}, std: 1.0}}\n")
    main(["new", str(tmp_path / "twin"), "--dimensions", str(file), "--spacing", "1"])
    settings = load_config(None, ["posterior.coarse_runs=32", "posterior.refined_runs=8",
                                  "posterior.live_points=50", "posterior.draws=200"])  # fmt: skip
    out = tmp_path / "out"
    api.posterior(tmp_path / "twin", out=out, settings=settings, threads=1)
    document = load_posterior(out)
    (strength,) = document.parameters
    low, high = strength.after.interval_95
    assert low < 1.0 < high  # a decade and more: the cells are coarse and the runs few
    assert [one.dimension for one in document.nuisances][:2] == ["height_m", "slope_h_per_v"]
    assert document.section is not None and document.section.height_m.value == 10.0
    assert (out / "sections.svg").stat().st_size > 10_000
    page = " ".join((out / "report.html").read_text().split())
    assert "not stated: assumed; 0.80 at Lower San Fernando" in page
