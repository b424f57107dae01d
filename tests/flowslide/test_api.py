"""What a notebook calls: the numbers of the command line, progress, a way to stop, nothing left."""

from __future__ import annotations

import json
import os
import shutil
import threading

import pytest

import flowslide
from flowslide.command_line import main
from geometry.sides import outward_of
from mpm_taichi.effects import effects

CASE, COARSE = "lower_san_fernando_paper", 4.0


class Told:
    """A callback that keeps its calls."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, int, str]] = []
        self.tried: list[tuple[int, dict[str, float], float]] = []

    def __call__(self, done: int, total: int, message: str) -> None:
        self.calls.append((done, total, message))


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """A back-analysis by the library, its folder, and the calls of the callback."""
    folder, told = tmp_path_factory.mktemp("api") / "inversion", Told()
    result = flowslide.back_analyse(
        CASE, out=folder, spacing_m=COARSE, quick=True, threads=1, progress=told,
        evaluated=lambda *tried: told.tried.append(tried),
    )  # fmt: skip
    return result, folder, told


def untimed(result) -> dict:
    document = json.loads(result.model_dump_json())
    for line in document["iterations"]:
        line.pop("seconds", None)
    return {
        name: value
        for name, value in document.items()
        if name not in ("timings", "manifest", "runs")
    }


@pytest.mark.slow
def test_the_library_and_the_command_line_have_the_same_numbers(answered, tmp_path, capsys):
    from inversion.back_analysis.result import load_result
    from report.back_analysis import summary
    from report.data.back_analysis import load_back_analysis

    result, folder, _ = answered
    out = tmp_path / "inversion"
    line = ["invert", CASE, "--out", str(out), "--spacing", str(COARSE), "--quick", "--threads"]
    assert main([*line, "1", "--report", "none", "--quiet"]) == 0
    assert untimed(load_result(out)) == untimed(result) == untimed(load_result(folder))
    for name in ("history.csv", "sections.npz"):
        assert (out / name).read_bytes() == (folder / name).read_bytes(), name
    told = capsys.readouterr().out
    assert told.splitlines()[0] == summary(load_back_analysis(folder)).splitlines()[0]


def test_progress_counts_up_to_the_end(answered):
    result, _, told = answered
    done = [call[0] for call in told.calls]
    assert done == sorted(done) and done[-1] > 0
    assert all(call[0] <= call[1] for call in told.calls)
    assert told.calls[0][2].startswith("answer (1 of ")
    assert any(call[2].startswith("answer after") for call in told.calls)
    # Every value that the search tried, as the history of the result has it.
    assert told.tried == [(line.runs_so_far, line.values, line.loss) for line in result.iterations]


def test_nothing_is_printed_and_nothing_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    done = flowslide.simulate(CASE, spacing_m=COARSE, threads=1)
    assert done.run.positions.shape[1:] == (len(done.run.material), 2)
    assert {reading.name for reading in done.readings}
    assert capsys.readouterr().out == ""
    assert os.listdir(tmp_path) == []


def test_a_case_without_measurements_is_simulated(tmp_path, capsys):
    """The readings are those of a survey of both toes."""
    shutil.copy(flowslide.load_case(CASE).folder / "scene.yaml", tmp_path)
    out = tmp_path / "out"
    bare = flowslide.simulate(tmp_path, spacing_m=COARSE, threads=1, out=out)
    known = flowslide.simulate(CASE, spacing_m=COARSE, threads=1)
    read = {one.name: one.simulated for one in bare.readings}
    assert list(read) == ["left", "right"]
    (toe,) = [one for one in known.readings if one.type == "toe_runout"]
    side = toe.measurement.side
    moved = outward_of(side) * (known.case.feet[side] - bare.case.feet[side])  # a surveyed foot
    assert read[side] == pytest.approx(toe.simulated + moved)
    assert (out / "runout.png").stat().st_size > 10_000


@pytest.mark.slow
def test_a_back_analysis_stops_between_runs_and_goes_on(tmp_path):
    stop = threading.Event()

    def watch(done: int, total: int, message: str) -> None:
        if done == 2:
            stop.set()

    with pytest.raises(flowslide.Cancelled):
        flowslide.back_analyse(
            CASE, out=tmp_path, spacing_m=COARSE, quick=True, threads=1,
            progress=watch, cancel=stop,
        )  # fmt: skip
    kept = list((tmp_path / "runs").glob("*.npz"))
    assert kept and not (tmp_path / "result.json").exists()
    told = Told()
    flowslide.back_analyse(
        CASE, out=tmp_path, spacing_m=COARSE, quick=True, threads=1, progress=told
    )
    assert told.calls[-1][0] + len(kept) == len(list((tmp_path / "runs").glob("*.npz")))


def test_cancel_may_be_a_function(tmp_path):
    for call in (
        flowslide.simulate, flowslide.back_analyse, flowslide.compare, flowslide.explain,
        flowslide.diagnose,
    ):  # fmt: skip
        with pytest.raises(flowslide.Cancelled):
            call(CASE, out=tmp_path, spacing_m=COARSE, threads=1, cancel=lambda: True)
    with pytest.raises(flowslide.Cancelled):
        flowslide.classical(CASE, out=tmp_path, cancel=lambda: True)
    with pytest.raises(flowslide.Cancelled):
        flowslide.predict(
            CASE, ["18+-5"], out=tmp_path, spacing_m=COARSE, threads=1, cancel=lambda: True
        )


def test_effects_of_a_call_do_not_leak(root, tmp_path):
    own = root / "docs/examples/my_effect.py"
    before = set(effects())
    seen: list[set[str]] = []
    with pytest.raises(flowslide.Cancelled):
        flowslide.simulate(
            CASE, spacing_m=COARSE, threads=1, effect_files=[own],
            progress=lambda *_: seen.append(set(effects())), cancel=lambda: bool(seen),
        )  # fmt: skip
    assert seen[0] - before == {"strength_regain"}
    assert set(effects()) == before
    with pytest.raises(flowslide.InputError, match=r"none\.py"):
        flowslide.load_case(CASE, effect_files=[tmp_path / "none.py"])


def test_a_prediction_is_the_document_that_is_written(tmp_path):
    document = flowslide.predict(
        CASE, ["18+-5"], out=tmp_path, spacing_m=COARSE, seeds=0, samples=100, threads=1
    )
    assert json.loads((tmp_path / "prediction.json").read_text()) == json.loads(
        json.dumps(document)
    )


def test_a_page_is_written_of_what_a_folder_holds(answered, tmp_path):
    _, folder, _ = answered
    page = flowslide.write_report(folder, film=False)
    assert page == folder / "report.html" and "Lower San Fernando" in page.read_text()
    with pytest.raises(flowslide.InputError):
        flowslide.write_report(tmp_path)


def test_bad_input_is_one_line():
    with pytest.raises(flowslide.InputError, match="no such folder"):
        flowslide.load_case("nowhere")
    with pytest.raises(flowslide.InputError, match="no model|model"):
        flowslide.back_analyse(CASE, engine="mpm", model="thrust", spacing_m=COARSE)


def test_the_face_has_what_it_names():
    assert set(flowslide.__all__) <= set(dir(flowslide))
    for name in flowslide.__all__:
        assert getattr(flowslide, name).__doc__
    with pytest.raises(AttributeError, match="nothing"):
        _ = flowslide.nothing
