"""Jobs on a body: what they find is what the commands find, and the page gets its maps."""

from __future__ import annotations

import pytest

import flowslide
from flowslide.studio import body_jobs, job_process
from flowslide.studio.job_answers import simulation_3d
from flowslide.studio.jobs import Job, JobOptions
from geometry.scenes.fill import fill
from geometry.scenes3d.scene3d import load_scene_3d
from mpm_taichi.solver3d import problem
from mpm_taichi.solver3d.problem import has_sloping_water
from pipeline.files import read_json, write_json
from pipeline.places import CASES, shipped
from tests.studio.bodies import write_bank, write_gully
from tests.studio.messages import unpack


def _run(folder, case, kind, **options):
    """A job that is done in this process: its state, and the folder of its results."""
    options = JobOptions(**options)
    job = Job(id="20261128-090000-abcdef", kind=kind, case=case.name, folder=str(case), threads=1,
              body=True, options=options)  # fmt: skip
    place = folder / ".studio" / case.name / "jobs" / job.id
    write_json(place / "job.json", job.model_dump(mode="json"))
    assert job_process.main(place) == 0, read_json(place / "state.json")
    return read_json(place / "state.json"), place


@pytest.mark.slow
def test_a_simulation_is_that_of_the_command_and_fills_its_scene_once(tmp_path, monkeypatch):
    case, filled = write_bank(tmp_path / "bank"), []
    monkeypatch.setattr(problem, "fill", lambda scene: filled.append(scene) or fill(scene))
    state, place = _run(tmp_path, case, "simulate", strengths_kpa={"soil": 8.0})
    assert len(filled) == 1
    own = flowslide.simulate_3d(case, threads=1, strengths_kpa={"soil": 8.0})
    assert state["answer"] == simulation_3d(own)["answer"]
    assert state["answer"][0].startswith("toe runout: ")
    header, arrays = unpack((place / "simulation" / body_jobs.SLIDE).read_bytes())
    assert header["strengths_kpa"] == {"soil": 8.0} and header["job"] == "20261128-090000-abcdef"
    assert header["times"][-1] == pytest.approx(own.run.time[-1], abs=1e-3)
    assert (arrays["thickness"][-1] == own.maps.after.values.astype("f4")).all()
    toe = next(row for row in header["readings"] if row["label"] == "toe runout")
    assert toe["simulated"] == own.readings["toe_runout_m"]
    assert (place / "simulation" / "report.html").is_file()


@pytest.mark.slow
def test_a_prediction_leaves_its_probabilities(tmp_path):
    case = write_gully(tmp_path / "gully")
    state, place = _run(tmp_path, case, "predict", strengths=["lower=2+-0.3"], spacing_m=2.0,
                        thicker_than_m=[1.0, 2.0])  # fmt: skip
    header, arrays = unpack((place / "prediction" / body_jobs.EXCEEDANCE).read_bytes())
    assert header["thicker_than_m"] == [1.0, 2.0]
    assert 0.0 <= arrays["exceedance"].min() < 0.5 < arrays["exceedance"].max() <= 1.0
    assert (arrays["exceedance"][0] >= arrays["exceedance"][1]).all()
    assert any("thinner than the spacing" in line.lower() for line in state["answer"])


def test_what_is_asked_of_a_section_over_its_width(tmp_path):
    dam = shipped(CASES) / "lower_san_fernando"
    gully = write_gully(tmp_path / "gully")

    def asked(folder):
        return body_jobs._question_of(
            Job(id="x", kind="back_analyse", case="y", folder=str(folder), body=True,
                options=JobOptions())
        )  # fmt: skip

    assert asked(dam) == (dam, "mpm3d")
    assert asked(gully) == (gully / "scene3d.yaml", None)


def test_water_that_slopes_stays_where_it_is(tmp_path):
    """Three dimensions have no moving one: who asks is told."""
    assert has_sloping_water(load_scene_3d(shipped(CASES) / "lower_san_fernando"))
    bank = load_scene_3d(write_bank(tmp_path / "bank"))
    assert bank.section.water_level is None and not has_sloping_water(bank)
