"""What a slide releases: volumes by hand, hydrographs, first order, items of a breach study."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import flowslide
from benchmarks.verification.three_dimensions import slab_scene
from geometry.case import load_case
from geometry.scenes3d.scene3d import load_scene_3d
from geometry.survey.measured import Deposit
from inversion.engines.body_engine import BodyStore
from inversion.engines.body_setup import KeptMaps
from inversion.prediction.first_order import covariance
from inversion.prediction.hydrograph import discharge, hydrograph, hydrograph_csv, passed
from inversion.prediction.in_plan import lines_alone, prediction_setup
from inversion.prediction.known_strength import DrawnStrength, KnownStrength
from inversion.prediction.predict import predict
from inversion.prediction.prediction_case import prediction_case
from inversion.prediction.volumes import (
    MobilisedVolume,
    PeakDischarge,
    ReleasedVolume,
    volume_entries,
)
from mpm_taichi.readings3d import volumes_across
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.files import write_text, yaml_text
from report.charts.hydrograph import save_hydrographs
from report.sentences.prediction import bends, first_order_words
from report.tables.dam_breach import dam_breach_table, unanswered
from tests.inversion.analytic import Formula

UNITS = ("m3/m", "m3/s per m")


def block(speed=2.0, seconds=10.0, frames=41):
    """A block 20 m long and 3 m high, points 1 m apart, that moves to the right."""
    x, y = np.meshgrid(np.arange(0.5, 20.0), np.arange(0.5, 3.0))
    start = np.stack([x.ravel(), y.ravel()], axis=1)
    time = np.linspace(0.0, seconds, frames)
    positions = start + np.array([1.0, 0.0]) * speed * time[:, None, None]
    return Deposit(
        position=positions[-1], initial_position=start, volume=1.0, spacing=1.0,
        foot={"left": 0.0, "right": 20.0}, positions=positions, time=time,
    )  # fmt: skip


def test_a_block_releases_its_speed_times_its_height():
    line = {"x_m": 20.0, "side": "right", "steps": 12}
    released = ReleasedVolume(name="released", **line).observe(block())
    # 2 m/s x 3 m; the first and last half point spread over the line; it stands still after 10 s.
    np.testing.assert_allclose(released[:10], 6.0 * np.arange(10.0), atol=1.6)
    assert released[10:] == pytest.approx([60.0] * 3, abs=1e-9)
    (peak,) = PeakDischarge(name="peak", **line).observe(block())
    assert peak == pytest.approx(6.0, abs=0.05)
    against = ReleasedVolume(name="released", **{**line, "x_m": 0.0, "side": "left"})
    assert against.observe(block())[-1] == pytest.approx(0.0, abs=1e-9)  # it moves the other way
    (moved,) = MobilisedVolume(name="mobilised").observe(block())
    (little,) = MobilisedVolume(name="mobilised").observe(block(speed=0.05))
    assert (moved, little) == (60.0, 0.0)


def test_ordinates_have_the_volume_that_passed():
    random = np.random.default_rng(2)
    volume = np.concatenate([[0.0], np.cumsum(random.normal(1.0, 2.0, 40))])
    ordinates = discharge(volume)
    assert passed(ordinates) == pytest.approx(volume[-1], rel=1e-12)
    assert ordinates[0] == ordinates[-1] == 0.0 and len(ordinates) == len(volume) + 2


def slides():
    """Volumes of 400 slides that pass at an even rate for 20 s, and the same at the end."""
    ends = np.linspace(50.0, 150.0, 400)
    smooth = ends[:, None] * np.clip(np.arange(31) / 20.0, 0.0, 1.0)
    return smooth, ends * np.random.default_rng(0).normal(1.0, 0.1, 400)


def test_a_hydrograph_ends_with_the_volumes_of_the_table_and_keeps_them_as_text(tmp_path):
    smooth, at_end = slides()
    found = hydrograph("line", smooth, at_end, units=UNITS)
    write_text(
        tmp_path / "hydrograph.csv", hydrograph_csv([found, {**found, "line": "two, below"}])
    )
    table = np.genfromtxt(tmp_path / "hydrograph.csv", delimiter=",", names=True)
    np.testing.assert_allclose(np.diff(table["time_s"]), 1.0)
    for percent in (5, 50, 95):
        expected = np.percentile(at_end, percent)
        assert found["volume"][str(percent)][-1] == pytest.approx(expected, rel=1e-6)
        assert passed(table[f"line_{percent}"]) == pytest.approx(expected, rel=1e-5)
        assert table[f"two_below_{percent}"].max() == pytest.approx(expected / 20.0, rel=1e-5)
    chart = save_hydrographs([found], tmp_path / "hydrograph.svg")
    assert "<svg" in chart.read_text() and save_hydrographs([], tmp_path / "none.svg") is None
    assert not (tmp_path / "none.svg").exists()


def lognormal(mean, std, zone="1"):
    return KnownStrength((zone,), mean, std, "lognormal")


def asked(formula, strengths, names=("toe",)):
    engine = Formula(formula, list(names))
    return predict(engine, engine, strengths, samples=20_000)


def test_first_order_is_exact_where_a_number_is_linear():
    strengths = [lognormal(18.0, 3.0), lognormal(10.0, 2.0, "2")]
    found = asked(lambda v: np.array([100.0 - 2.0 * v[0] - 3.0 * v[1]]), strengths)
    assert found.first_order.mean[0] == pytest.approx(34.0, abs=0.3)
    assert found.first_order.std[0] == pytest.approx(np.hypot(6.0, 6.0), rel=0.04)
    alone = asked(lambda v: np.array([100.0 - 2.0 * v[0]]), strengths[:1])
    assert alone.first_order.mean[0] == pytest.approx(64.0, abs=0.05)
    assert alone.first_order.std[0] == pytest.approx(6.0, rel=0.01)
    assert alone.samples.std() == pytest.approx(6.0, rel=0.02)


def entry(found, number=0):
    samples, linear = found.samples[:, number], found.first_order
    return {
        "name": found.names[number], "mean": samples.mean(), "std": samples.std(),
        "first_order": {"mean": linear.mean[number], "std": linear.std[number]},
    }  # fmt: skip


def test_a_number_that_bends_is_told():
    """A toe moves below a strength alone: at the mean nothing changes."""
    found = asked(
        lambda v: np.array([100.0 - v[0], max(0.0, 12.0 - v[0]) ** 2]),
        [lognormal(20.0, 5.0)], ("straight", "bent"),
    )  # fmt: skip
    entries = [entry(found, number) for number in (0, 1)]
    assert [bends(one) for one in entries] == [False, True]
    (line,) = first_order_words({"quantities": entries})
    assert "bent" in line and "straight" not in line
    assert first_order_words({"quantities": entries[:1]}) == []


def test_draws_of_a_posterior_keep_their_covariance():
    first = np.random.default_rng(0).normal(20.0, 2.0, 500)
    strengths = [
        DrawnStrength((zone,), draws.mean(), draws.std(), "posterior", draws=tuple(draws))
        for zone, draws in (("1", first), ("2", 50.0 - first))
    ]
    own = covariance(strengths)
    assert own[0, 1] == pytest.approx(-own[0, 0]) == pytest.approx(-first.var())
    assert covariance([lognormal(20.0, 2.0), lognormal(9.0, 3.0)]).tolist() == [[4, 0], [0, 9]]


def test_some_numbers_of_a_distribution_keep_what_is_theirs():
    found = asked(lambda v: np.array([v[0], 2.0 * v[0], 3.0]), [lognormal(18.0, 3.0)], "abc")
    some = found.of([0, -1])
    assert some.names == ["a", "c"] and some.runs.shape[1] == some.samples.shape[1] == 2
    assert some.first_order.mean == pytest.approx([18.0, 3.0], abs=0.02)


def test_the_line_lies_at_the_foot_unless_it_is_given(root):
    case = prediction_case(load_case(root / "case_histories/lower_san_fernando_paper"))
    mobilised, peak, released = volume_entries(case, None)
    assert released.side == "left" and released.x_m == peak.x_m == case.feet["left"]
    assert len(released.values) == np.ceil(case.simulation.duration_s) + 1
    (_, _, right) = volume_entries(case, case.feet["right"] - 5.0)
    assert right.side == "right" and right.reading_key(case.feet) != released.reading_key(case.feet)
    with pytest.raises(InputError, match="--through 9999: lies outside the domain"):
        volume_entries(case, 9999.0)
    with pytest.raises(ValueError, match="has no derivative"):
        mobilised.observe_with_derivative(block())


def document(**more):
    quantiles = {"5": 1.0, "25": 2.0, "50": 3.0, "75": 4.0, "95": 5.0}
    named = [("left toe", "toe_runout", "m"), ("mobilised volume", "mobilised_volume", "m3/m"),
             ("released volume", "released_volume", "m3/m"),
             ("peak discharge", "peak_discharge", "m3/s per m")]  # fmt: skip
    quantities = [
        {"name": name, "type": kind, "unit": unit, "quantiles": quantiles}
        for name, kind, unit in named
    ]
    strengths = [{"words": "S_r 18 ± 5 kPa"}]
    return {"strengths": strengths, "quantities": quantities, "samples": 20_000, **more}


def test_the_items_of_a_breach_study_are_numbered_and_own_up():
    table = dam_breach_table(document())
    assert [row[0] for row in table.rows] == [str(n) for n in range(1, 13)]
    answers = dict(row[1:] for row in table.rows)
    assert answers["released volume, with its interval"] == "released volume 3.0 m³/m (1.0 to 5.0)"
    assert unanswered(document()) == [6, 8, 9, 10, 11, 12]
    deposit_alone = document()
    deposit_alone["quantities"] = deposit_alone["quantities"][:1]
    assert unanswered(deposit_alone) == [2, 3, 4, 6, 8, 9, 10, 11, 12]
    area = {"thicker_than_m": 1.0, "area_m2": {"50": 900.0}}
    mapped = document(inundation=[area])
    assert 6 not in unanswered(mapped)


def test_through_is_refused_where_there_is_no_line(tmp_path, root):
    slab(tmp_path)
    with pytest.raises(InputError, match="--through: of a section"):
        flowslide.predict(tmp_path / "scene3d.yaml", ["4+-1"], through_m=3.0)
    paper = root / "case_histories/lower_san_fernando_paper"
    with pytest.raises(InputError, match="--through: the engine direct predicts the deposit alone"):
        flowslide.predict(paper, ["20+-1"], engine="direct", through_m=30.0)


def slab(folder):
    """A slab over a width, with a line across it."""
    write_text(folder / "scene.yaml", yaml_text(slab_scene(spacing=2.0)))
    section = {"file": "scene.yaml", "width_m": 12.0}
    scene = {"name": "slab", "section": section, "lines": {"gate": [[30, 0], [30, 12]]}}
    write_text(folder / "scene3d.yaml", yaml_text(scene))
    return load_scene_3d(folder)


def test_what_crosses_a_line_is_read_over_time():
    """Three points of 4 m3 walk over a line one after the other."""
    start = np.array([[8.0, 1.0, 0.5], [6.0, 1.0, 0.5], [4.0, 1.0, 0.5]])
    steps = np.arange(4.0)[:, None, None] * np.array([2.0, 0.0, 0.0])
    scene = SimpleNamespace(document=SimpleNamespace(lines={"gate": ((9.0, 0.0), (9.0, 2.0))}))
    problem = SimpleNamespace(volume=np.full(3, 4.0))
    run = SimpleNamespace(positions=start + steps, time=np.array([0.0, 1.0, 2.0, 3.0]))
    found = volumes_across(scene, problem, run, np.array([0.0, 1.0, 1.5, 3.0, 9.0]))
    assert found["gate"].tolist() == [0.0, 4.0, 6.0, 12.0, 12.0]


def test_a_kept_run_of_a_body_without_the_volumes_over_time_is_made_again(tmp_path, monkeypatch):
    setup = prediction_setup(slab(tmp_path), SimulationSettings(duration_s=3.0), [
        KnownStrength(("bank",), 4.0, 1.0, "lognormal")
    ])  # fmt: skip
    old = KeptMaps(setup.before.before.values, {"toe_runout_m": 1.0}, [], True, "", 1.0)
    new = replace(old, across={"gate": [0.0, 1.0, 4.0, 5.0]})
    answers = iter([old, new])
    monkeypatch.setattr(BodyStore, "_simulated", lambda *_: next(answers))
    values = np.array([4.0])
    BodyStore(tmp_path / "runs").fetch(replace(setup, over_time=False), values)
    store = BodyStore(tmp_path / "runs")
    assert store.fetch(replace(setup, over_time=False), values).across == {}
    kept = store.fetch(setup, values)
    assert store.computed == 1 and kept.across == new.across
    read = lines_alone(setup).prediction(values, BodyStore(tmp_path / "runs").fetch(setup, values))
    assert read.values.tolist() == [2.0, 0.0, 1.0, 4.0, 5.0]
