"""The validation: twins are honest, records survive, the page tells misses."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.back_analysis import lab, twins
from benchmarks.back_analysis.figures import Figure, at_least, at_most
from benchmarks.back_analysis.study import Validation
from benchmarks.back_analysis.twin_cases import (
    JITTER,
    Plan,
    height_of,
    plans,
    runout,
    truth_of,
    write_case,
)
from benchmarks.dam_section import dam_section
from geometry.case import load_case
from inversion.back_analysis.case import inversion_case
from inversion.engines.run_store import RunStore
from pipeline.cli import InputError


def plan(**more) -> Plan:
    scene = dam_section().changed(spacing=5.0)
    return Plan("dam", scene, ["1"], "left", (26.0, 28.0), 30.0, 3, **more)


@pytest.fixture(scope="module")
def truth():
    made = truth_of(plan(), lab.config(), RunStore(None, threads=1))
    assert made is not None
    return made


def test_the_truth_has_other_cells_and_jitter_than_the_fit(truth):
    assert truth.scene.spacing == pytest.approx(4.0)
    assert truth.scene.jitter == JITTER and truth.plan.scene.jitter == 0.0
    assert 26.0 <= truth.strength_kpa <= 28.0
    assert truth.runout_m == runout(truth.scene, truth.run, "left")
    assert 0.3 * truth.height <= truth.runout_m <= 76.0


def test_the_case_folder_knows_nothing_of_the_truth(truth, tmp_path):
    folder = tmp_path / "dam"
    write_case(truth, folder, cell_factor=0.8)
    case = inversion_case(load_case(folder, lab.config()))
    soil = next(z.material for z in case.scene.zones if z.name == "1")
    assert case.scene.materials[soil].cohesion_kpa == 30.0
    for path in folder.iterdir():
        assert f"{truth.strength_kpa:.2f}" not in path.read_text()
    targets = case.setup.targets
    toe, *surface = targets.measured
    assert 0 < abs(toe - truth.runout_m) < 4 * 0.03 * truth.height
    assert len(surface) == 14 and case.question.loss == "misfit"
    std = np.sqrt(np.diag(targets.covariance))
    assert std[0] == pytest.approx(np.hypot(0.03 * truth.height, 2.5), abs=1e-3)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    write_case(truth, folder, cell_factor=0.8)
    assert before == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_section_whose_runout_does_not_hang_on_the_strength_is_left_out():
    strong = Plan("dam", plan().scene, ["1"], "left", (500.0, 600.0), 30.0, 3)
    assert truth_of(strong, lab.config(), RunStore(None, threads=1)) is None


def test_plans_hold_both_dams_and_templates_with_a_liquefied_zone():
    found = []
    for group, made in plans(lab.config(), spacing_m=3.0):
        found.append(group)
        assert made.zones and height_of(made.scene) > 5.0
        if len(found) == 12:
            break
    assert {lab.LSFD, lab.LA_MARQUESA} < set(found)
    assert sum(group.startswith("template") for group in found) >= 6


def twin(truth: float, answer: float, std: float, starts=None) -> twins.Twin:
    return twins.Twin("t", "template a", truth, answer, std, 0.0, 0.0, std, starts or [answer], 1.0,
                      15, 40.0, 30.0, 100, 50)  # fmt: skip


def test_twins_are_judged_by_their_own_standard_deviations():
    good = [twin(20.0, 20.5, 0.4) for _ in range(17)]
    bad = [twin(20.0, 24.0, 0.5, [24.0, 20.0]) for _ in range(3)]
    rows = {figure.quantity: figure for figure in twins.figures(good + bad)}
    assert rows["S_r within 2 standard deviations"].measured == "85 %"
    assert rows["S_r within 2 standard deviations"].met
    assert rows["median error of S_r"].met
    assert rows["three starts within 1 % of the answer"].met is False
    assert rows["twins"].met
    worse = twins.figures(good[:-1] + [*bad, bad[0]])
    assert worse[1].met is False


def test_a_twin_that_is_kept_is_not_made_again(truth, tmp_path, monkeypatch):
    monkeypatch.setattr(lab, "FOLDER", tmp_path)
    monkeypatch.setattr(lab, "THREADS", 1)
    monkeypatch.setattr(twins, "CELL_FACTOR", 0.8)
    monkeypatch.setattr(
        twins, "SETTINGS",
        ("inversion.starts=1", "inversion.step_seeds=2", "inversion.noise_seeds=2",
         "inversion.sensitivities=false"),
    )  # fmt: skip
    first = twins.twin_of("dam", truth)
    assert first.answer_kpa == pytest.approx(truth.strength_kpa, rel=0.25)
    monkeypatch.setattr(twins, "BackAnalysis", None)  # nothing may be solved now
    assert twins.twin_of("dam", truth) == first
    monkeypatch.setattr(twins, "VERSION", -1)
    with pytest.raises(TypeError):
        twins.twin_of("dam", truth)


def test_limits_say_pass_or_miss():
    assert at_most("a", 2.0, 2.3).verdict == "pass" and at_most("a", 2.4, 2.3).verdict == "MISS"
    assert at_least("a", 85, 85).met and at_least("a", 84.9, 85).met is False
    assert at_most("a", float("nan"), 1.0).met is False
    assert Figure("a", "1").verdict == ""


class Elsewhere(Validation):
    """The validation with its records and its page in another place."""

    def __init__(self, folder):
        self.results_file, self.page = folder / "results.json", folder / "validation.md"

    @property
    def results(self):
        return self.results_file


def test_the_page_tells_misses_and_errors(tmp_path):
    study = Elsewhere(tmp_path)
    parts = [f"<!-- {name}: begin -->\n<!-- {name}: end -->\n" for name in ("summary", "parts")]
    study.page.write_text("".join(parts))
    good = study.record("twins", "Good", [Figure("a", "1 m", "≤ 2 m", True)], 1.0, "")
    figures = [Figure("b | c", "3 m", "≤ 2 m", False)]
    bad = study.record("derivative", "Bad", figures, 1.0, "Boom: no")
    study.keep("twins", good)
    study.keep("derivative", bad)
    kept = study.read()
    assert list(kept) == ["derivative", "twins"] and kept["twins"] == good
    assert study.missed(kept["derivative"]) == ["b | c", "did not run to its end: Boom: no"]
    text = study.summary(kept)
    assert "| [Bad](#derivative) | 1 | 0 | b / c; did not run" in text and "none |" in text
    section = study.part("derivative", bad)
    assert "**MISS**" in section and "| b / c |" in section and "Boom" in section
    assert section in study.page.read_text()


def test_the_stored_page_is_made_of_the_stored_records():
    """Run `python -m benchmarks.generated_pages` after a part was measured."""
    study = Validation()
    records = study.read()
    text = study.page.read_text(encoding="utf-8")
    assert list(records) == study.names()
    for name, entry in records.items():
        assert study.part(name, entry) in text
    assert study.summary(records) in text


def test_every_part_explains_itself():
    for name in Validation().names():
        assert len(Validation().explanation(name)) > 100


def test_an_unknown_part_is_refused():
    with pytest.raises(InputError, match="part 'x' is unknown"):
        Validation().main(["x"])
