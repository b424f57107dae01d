"""Prediction: distributions of strengths, smooth responses, closed forms, the command."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from geometry.case import load_case
from geometry.scenes.scene import load_scene
from inversion.engines.small_cells import SmallCells
from inversion.estimation.forward import Prediction
from inversion.new_case.make_case import Given, make_case
from inversion.prediction.hydrograph import passed
from inversion.prediction.known_strength import (
    DrawnStrength,
    KnownStrength,
    parse_strength,
    placed,
    sampled_scores,
    strength_parameters,
    widened,
)
from inversion.prediction.predict import envelope, noise_at, predict
from inversion.prediction.prediction_case import prediction_case
from inversion.prediction.prediction_document import document_of
from inversion.prediction.response import Monotone, ProcessSurface, design, monotone, response
from inversion.problem.question import STRENGTH_RATIO
from inversion.problem.scene_changes import with_properties
from pipeline.cli import InputError, WorkFailed
from report.prediction import summary
from tests.inversion.analytic import Formula


def lognormal(mean=18.0, std=5.0, zones=("1",)):
    return KnownStrength(tuple(zones), mean, std, "lognormal")


def power_law(values):
    """Runout 53 m at 18 kPa, 1.8 % less for each per cent of strength."""
    return np.array([53.0 * (values[0] / 18.0) ** -1.8])


def closed_form(strength, beyond, *, power=1.8):
    """P(runout > beyond): the logarithm of the runout is normal."""
    variance = np.log1p((strength.std / strength.mean) ** 2)
    middle = np.log(53.0) - power * (np.log(strength.mean / 18.0) - 0.5 * variance)
    return ndtr((middle - np.log(beyond)) / (power * np.sqrt(variance)))


@pytest.mark.parametrize("text", ["18+-5", "18±5", " 18 +/- 5.0 ", "1.8e1+-5"])
def test_a_strength_is_read_in_any_of_its_forms(text):
    found = parse_strength(text, "lognormal")
    assert (found.mean, found.std, found.zones) == (18.0, 5.0, ())


def test_zones_stand_before_the_strength():
    found = parse_strength("1, 6=4+-1", "normal")
    assert found.zones == ("1", "6") and found.mean == 4.0 and found.kind == "normal"


@pytest.mark.parametrize(
    "text",
    [
        "18",
        "18+5",
        "18,5",
        "5,2",
        "+-5",
        "a+-b",
        "18+--5",
        "0+-1",
        "4+-0",
        "4+-5",
        "=4+-1",
        "1,=4+-1",
    ],
)
def test_what_is_no_strength_is_refused(text):
    with pytest.raises(InputError, match="--residual-strength"):
        parse_strength(text, "lognormal")


def test_a_ratio_is_read_alike_and_not_taken_for_kpa():
    found = parse_strength("1,6=0.12+-0.03", "lognormal", STRENGTH_RATIO)
    assert (found.zones, found.mean, found.std, found.unit) == (("1", "6"), 0.12, 0.03, "")
    assert found.words == "S_r/σ'_v0 0.12 ± 0.03 in zones 1, 6 (lognormal)"
    (spec,) = strength_parameters([found]).specs
    assert spec.changes(0.2)[0] == ("1", "strength_ratio", 0.2)
    assert spec.changes(1.3)[0] == ("1", "strength_ratio", 1.0)  # by the doubt of the cells
    for text, words in (
        ("18+-5", "at most 1 (kPa: --residual-strength)"),
        ("0.1", "must be MEAN+-STD, such as 0.12+-0.03"),
        ("0.1+-0.2", "a standard deviation of 0.2 exceeds the mean"),
    ):
        with pytest.raises(InputError, match=re.escape(words)) as refused:
            parse_strength(text, "lognormal", STRENGTH_RATIO)
        assert str(refused.value).startswith("--strength-ratio")


@pytest.mark.parametrize("kind", ["lognormal", "normal"])
def test_the_strength_has_its_mean_and_standard_deviation(kind):
    strength = KnownStrength(("1",), 18.0, 4.0, kind)
    values = strength.at(np.random.default_rng(0).standard_normal(200_000))
    assert values.mean() == pytest.approx(18.0, rel=0.005)
    assert values.std() == pytest.approx(4.0, rel=0.01)
    assert values.min() > 0
    assert np.all(np.diff(strength.at(np.linspace(-3, 3, 50))) > 0)


def test_a_normal_strength_stays_positive_however_wide():
    values = KnownStrength(("1",), 10.0, 9.0, "normal").at(np.linspace(-8, 8, 100))
    assert values.min() >= 1.0 - 1e-9 and np.all(np.diff(values) >= 0)


def test_zones_are_checked(root):
    scene = load_scene(root / "case_histories/lower_san_fernando_paper/scene.yaml")
    nameless = parse_strength("18+-5", "lognormal")
    assert placed([nameless], ["1"], scene)[0].zones == ("1",)
    for strengths, zones, words in (
        ([nameless], ["9"], "zone '9' is not in the scene"),
        ([nameless], [], "no zone of the scene is liquefied"),
        ([nameless, nameless], ["1"], "each must name its zones"),
        ([nameless], ["1", "1"], "given two strengths"),
        ([nameless], ["7"], "friction_deg 30"),
    ):
        with pytest.raises(InputError, match=words):
            placed(strengths, zones, scene)
    ratio = replace(nameless, mean=0.1, std=0.01, property=STRENGTH_RATIO)
    assert placed([ratio], ["1"], scene)[0].zones == ("1",)
    firm = with_properties(scene, [("1", "liquefied", False)])
    with pytest.raises(InputError, match="is not liquefied: true, and --strength-ratio"):
        placed([ratio], ["1"], firm)


def asked(engine: Formula, strengths, **more):
    """The prediction by a formula, which is its own reading of the question."""
    return predict(engine, engine, strengths, **more)


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_exceedance_of_a_power_law_is_its_closed_form(noise):
    strength = lognormal()
    engine = Formula(power_law, ["toe"], noise=noise)
    seeds = [Formula(power_law, ["toe"], noise=noise, seed=seed) for seed in (1, 2, 3)]
    found = asked(engine, [strength], jittered=seeds, samples=40_000)
    beyond = np.array([20.0, 40.0, 60.0, 80.0, 120.0])
    expected = closed_form(strength, beyond)
    np.testing.assert_allclose(found.exceedance(0, beyond), expected, atol=0.01 + 0.02 * noise)
    median = float(found.quantiles((50,))[0, 0])
    assert median == pytest.approx(53.0 * (strength.at(0.0) / 18.0) ** -1.8, rel=0.005 + noise / 50)
    assert engine.runs == len(design(1)) + 9 <= 29, "not one simulation per sample"


def test_strengths_of_the_soil_are_run_as_the_cells_need_them():
    cells = SmallCells(factor=1.25, log_std=0.2, spacing_m=1.0, other_spacing_m=2.0, words="")
    engine = Formula(power_law, ["toe"], parameters=strength_parameters([lognormal()]))
    found = asked(engine, [lognormal()], cells=cells, samples=40_000)
    ran = asked(engine, [widened(lognormal(18.0 / 1.25, 5.0 / 1.25), 0.2)], samples=40_000)
    np.testing.assert_allclose(found.quantiles(), ran.quantiles(), rtol=1e-6)
    assert found.strengths == pytest.approx(1.25 * ran.strengths)
    assert widened(lognormal(18.0, 3.0), 0.25).std == pytest.approx(np.hypot(3.0, 4.5))


def test_two_strengths_act_together():
    """R = 53 (a/18)^-1 (b/10)^-0.5: the logarithm is normal with both variances."""
    strengths = [lognormal(), lognormal(10.0, 3.0, ("2",))]
    engine = Formula(
        lambda v: np.array([53.0 * (v[0] / 18.0) ** -1.0 * (v[1] / 10.0) ** -0.5]), ["toe"]
    )
    found = asked(engine, strengths, samples=40_000)
    variances = [np.log1p((s.std / s.mean) ** 2) for s in strengths]
    middle = np.log(53.0) + 0.5 * variances[0] + 0.25 * variances[1]
    spread = np.sqrt(variances[0] + 0.25 * variances[1])
    beyond = np.array([30.0, 45.0, 60.0, 80.0, 100.0])
    expected = ndtr((middle - np.log(beyond)) / spread)
    np.testing.assert_allclose(found.exceedance(0, beyond), expected, atol=0.025)


def test_noise_is_what_the_jittered_runs_scatter_by_and_widens_the_distribution():
    still = lognormal(18.0, 0.01)
    seeds = [Formula(power_law, ["toe"], noise=2.0, seed=seed) for seed in range(1, 30)]
    noise = noise_at(seeds[0], seeds, [still], 1)
    assert noise[0] == pytest.approx(2.0, rel=0.25)
    found = asked(Formula(power_law, ["toe"]), [still], jittered=seeds)
    assert found.samples.std() == pytest.approx(noise[0], rel=0.05)
    assert noise_at(seeds[0], seeds[:1], [still], 1)[0] == 0.0


class Unsure(Formula):
    """An engine that states an error of its own: a tenth of the strength, in metres."""

    def error_std(self, request):
        return np.array([0.1 * request.values[0]])


def test_the_engines_own_error_widens_the_distribution():
    still = asked(Unsure(power_law, ["toe"]), [lognormal(30.0, 0.01)])
    assert still.samples.std() == pytest.approx(3.0, rel=0.02)
    strength = lognormal()
    sure = asked(Formula(power_law, ["toe"]), [strength])
    unsure = asked(Unsure(power_law, ["toe"]), [strength])
    # Independent of the strength's draw: variances add, E[(S/10)^2] = (mean^2 + std^2) / 100.
    expected = sure.samples.var() + (18.0**2 + 5.0**2) / 100.0
    assert unsure.samples.var() == pytest.approx(expected, rel=0.02)
    assert unsure.samples.mean() == pytest.approx(sure.samples.mean(), abs=0.1)


def test_a_response_is_monotone_and_keeps_to_its_runs():
    np.testing.assert_allclose(monotone(np.array([1.0, 3.0, 2.0, 4.0])), [1, 2.5, 2.5, 4])
    np.testing.assert_allclose(monotone(np.array([4.0, 2.0, 3.0, 1.0])), [4, 2.5, 2.5, 1])
    scores = design(1)
    curve = Monotone(scores[:, 0], np.maximum(0.0, 10.0 - 20.0 * scores))
    fine = curve(np.linspace(-5, 5, 300)[:, None])[:, 0]
    assert np.all(np.diff(fine) <= 1e-9) and fine.max() == 70.0 and fine.min() == 0.0
    assert curve.missed[0] == pytest.approx(0.0)


def test_a_surface_tells_what_it_misses():
    scores = design(2)
    smooth = ProcessSurface(scores, (scores @ [[3.0], [-2.0]]) + 1.0, np.zeros(1))
    assert smooth.missed[0] < 0.01
    np.testing.assert_allclose(smooth(np.array([[0.5, -0.5]])), [[3.5]], atol=0.01)
    rough = np.random.default_rng(0).standard_normal((len(scores), 1))
    assert ProcessSurface(scores, rough, np.zeros(1)).missed[0] > 0.5


def test_a_number_that_rises_and_falls_is_not_made_to_fall():
    """An elevation in the middle of a deposit: low where nothing comes, and where all has left."""

    def truth(scores):
        s = scores[:, 0]
        return np.stack([40.0 - 9.0 * s, 5.0 * np.exp(-((s - 0.3) ** 2)), np.full(len(s), 2.0)], 1)

    scores, fine = design(1), np.linspace(-2.5, 2.5, 200)[:, None]
    noise = 0.02 * np.random.default_rng(2).standard_normal((len(scores), 3))
    for groups in (None, np.array([0, 1, 1])):
        found = response(scores, truth(scores) + noise, groups)
        off = np.abs(found(fine) - truth(fine)).max(axis=0)
        assert np.all(off < [0.1, 0.25, 0.1]), "levelled it would be off by 2.5"
        assert np.all(found.missed < [0.1, 0.25, 0.1])
    assert np.all(np.diff(found(fine)[:, 0]) <= 1e-9), "a toe stays monotone"


def test_too_many_failures_end_the_work():
    engine = Formula(lambda v: np.array([np.nan if v[0] < 18 else 1.0]), ["toe"])
    with pytest.raises(WorkFailed, match="simulations failed"):
        asked(engine, [lognormal()])
    few = Formula(lambda v: np.array([np.nan if v[0] < 9 else 100.0 - v[0]]), ["toe"])
    found = asked(few, [lognormal()])
    assert found.failed > 0 and np.all(np.isfinite(found.samples))


class CutOff(Formula):
    """Weak soil is still in motion when its simulation ends."""

    def _one(self, values):
        return replace(super()._one(values), at_rest=bool(values[0] > 15))


def test_slides_cut_off_in_motion_are_reported(root):
    case = prediction_case(load_case(root / "case_histories/lower_san_fernando_paper"))
    case = replace(case, entries=[e for e in case.entries if e.name == "upstream toe"])
    found = asked(CutOff(power_law, ["upstream toe"]), [lognormal()])
    moving = int(sum(found.strengths[:, 0] <= 15))
    assert 0 < moving < len(found.strengths)
    document = document_of(case, [lognormal()], found, None)
    assert document["runs_cut_off"] == moving
    assert f"{moving} simulations were cut off in motion" in summary(document)


class Held(Formula):
    """Soft soil reaches the end of the drawing."""

    def _one(self, values):
        said = ("the slide reaches the left end",) if values[0] < 15 else ()
        return replace(super()._one(values), remarks=said)


def test_a_slide_that_reaches_the_end_of_the_drawing_is_reported(root):
    case = prediction_case(load_case(root / "case_histories/lower_san_fernando_paper"))
    case = replace(case, entries=[e for e in case.entries if e.name == "upstream toe"])
    found = asked(Held(power_law, ["upstream toe"]), [lognormal()])
    document = document_of(case, [lognormal()], found, None)
    (line,) = document["remarks"]
    assert line == f"with S_r {found.strengths.min():.3g} kPa the slide reaches the left end"
    assert line in summary(document)


def test_an_open_domain_has_no_edge_and_room_on_both_sides(root):
    case = prediction_case(load_case(root / "case_histories/lower_san_fernando_paper"))
    assert case.scene.domain.walls == "open"
    toe = next(entry for entry in case.entries if entry.name == "upstream toe")
    found = asked(Formula(power_law, [toe.name]), [lognormal()])
    near = case.scene.foot(toe.side) + (10.0 if toe.side == "right" else -10.0)
    side = "x_max" if toe.side == "right" else "x_min"
    shares = {}
    for walls in ("open", "closed"):
        domain = case.scene.domain.model_copy(update={"walls": walls, side: near})
        scene = case.scene.model_copy(update={"domain": domain})
        document = document_of(
            replace(case, scene=scene, entries=[toe]), [lognormal()], found, None
        )
        shares[walls] = document["quantities"][0]["probability_at_the_edge"]
    assert shares == {"open": 0.0, "closed": 1.0}


def test_the_other_toe_of_an_open_domain_is_predicted_however_it_is_drawn(lsfd, tmp_path):
    (lsfd / "measurements.yaml").unlink()
    (lsfd / "inversion.yaml").unlink()
    text = (lsfd / "scene.yaml").read_text()
    scene = load_scene(lsfd / "scene.yaml")
    tight = re.sub(r"x_max: [0-9.]+", f"x_max: {scene.foot('right') + 1.0:g}", text, count=1)
    assert tight != text
    for walls, toes in (("open", {"left toe", "right toe"}), ("closed", {"left toe"})):
        (lsfd / "scene.yaml").write_text(tight.replace("walls: open", f"walls: {walls}"))
        case = prediction_case(load_case(lsfd))
        assert {entry.name for entry in case.entries} == toes


def test_the_probability_of_a_flow_that_did_not_happen_is_reported(lsfd):
    text = (lsfd / "measurements.yaml").read_text()
    stood = (
        "    - {name: downstream toe, type: no_flow, side: right, limit_m: 40.0, std_m: 0.5,\n"
        "       confidence: assumed, source: a test}\n"
    )
    (lsfd / "measurements.yaml").write_text(text.replace("  field:\n", "  field:\n" + stood, 1))
    case = prediction_case(load_case(lsfd))
    assert "downstream toe" in case.known and "right toe" not in {e.name for e in case.entries}
    case = replace(case, entries=[e for e in case.entries if e.name == "downstream toe"])
    strength = lognormal()
    found = asked(Formula(power_law, ["downstream toe"]), [strength], samples=40_000)
    document = document_of(case, [strength], found, None)
    (flow,) = document["quantities"]
    expected = closed_form(strength, 40.0)
    assert flow["censored"] and flow["measured"] == 40.0
    assert flow["probability_beyond_measured"] == pytest.approx(expected, abs=0.01)
    shown = f"{100 * flow['probability_beyond_measured']:.1f} %"
    assert f"a toe that moves more than 40 m, is {shown}" in summary(document)


class Sheet(Formula):
    """A block of soil 2 m high whose front lies at the runout."""

    def _one(self, values):
        made = super()._one(values)
        x, y = np.meshgrid(np.arange(0.5, made.values[0], 1.0), [0.5, 1.5])
        points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
        volume = np.ones(len(points))
        return Prediction(made.values, made.at_start, positions=points, volume=volume)


def test_the_envelope_lies_where_the_fronts_are():
    found = asked(Sheet(power_law, ["toe"]), [lognormal()], samples=5000)
    band = envelope(found, spacing=1.0, ground=np.array([(-50.0, 0.0), (900.0, 0.0)]))
    low, middle, high = band.surfaces
    assert np.all(low <= middle + 1e-9) and np.all(middle <= high + 1e-9)
    for surface, percent in zip(band.surfaces, (5, 50, 95), strict=True):
        front = band.x[np.flatnonzero(surface > 1.0)[-1]]
        assert front == pytest.approx(float(found.quantiles((percent,))[0, 0]), abs=8.0)
    assert envelope(asked(Formula(power_law, ["toe"]), [lognormal()]), spacing=1.0,
                    ground=np.zeros((2, 2))) is None  # fmt: skip


def command(root, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "flowslide", "predict", *map(str, arguments)],
        cwd=root, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_the_command_predicts_a_dam_that_has_not_failed(root, lsfd, tmp_path):
    for name in ("measurements.yaml", "inversion.yaml", "post_failure_profile.csv"):
        (lsfd / name).unlink()
    arguments = (lsfd, "--residual-strength", "20+-2", "--spacing", 4, "--seeds", 0,
                 "--out", tmp_path / "out")  # fmt: skip
    done = command(root, *arguments)
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "out/prediction.json").read_text())
    toe, *volumes = document["quantities"]
    assert toe["name"] == "left toe" and toe["measured"] is None
    assert [one["name"] for one in volumes] == [
        "mobilised volume", "peak discharge", "released volume",
    ]  # fmt: skip
    (line,) = document["hydrographs"]
    for percent, released in line["volume"].items():
        assert released[-1] == pytest.approx(volumes[2]["quantiles"][percent], rel=1e-3)
        assert passed(line["discharge"][percent]) == pytest.approx(released[-1], rel=1e-5)
    assert 0 < line["volume"]["50"][-1] < volumes[0]["quantiles"]["50"]
    assert (tmp_path / "out/hydrograph.csv").read_text().startswith("time_s,x_")
    assert 25 < toe["quantiles"]["5"] < toe["quantiles"]["50"] < toe["quantiles"]["95"] < 90
    chances = toe["exceedance"]["probability"]
    assert chances[0] > 0.99 and chances[-1] < 0.01 and np.all(np.diff(chances) <= 0)
    sections = document["sections"]
    assert np.all(np.array(sections["y_5_m"]) <= np.array(sections["y_95_m"]))
    assert len(document["runs"]) <= 20
    assert (tmp_path / "out/prediction.png").stat().st_size > 10_000
    assert "probability that the toe runs farther than" in done.stdout
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/runs").iterdir()}
    again = command(root, *arguments)
    assert again.stdout == done.stdout
    assert before == {p: p.stat().st_mtime_ns for p in (tmp_path / "out/runs").iterdir()}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--residual-strength", "18"), "must be MEAN+-STD"),
        (("--residual-strength", "9=18+-5"), "zone '9' is not in the scene"),
        (("--residual-strength", "1=18+-5", "--zones", "1"), "--zones"),
        (("--residual-strength", "18+-5", "--samples", "3"), "--samples 3"),
        (("--residual-strength", "18+-5", "--spacing", "-1"), "--spacing -1"),
        ((), "--residual-strength"),
    ],
)
@pytest.mark.slow
def test_bad_input_ends_with_one_line(root, arguments, words):
    done = command(root, "lower_san_fernando_paper", *arguments)
    assert done.returncode == 2
    assert words in done.stderr and done.stderr.count("\n") == 1


def test_a_folder_that_is_not_there_is_named(root):
    done = command(root, "nowhere", "--residual-strength", "18+-5")
    assert done.returncode == 2 and "nowhere: no such folder" in done.stderr


def test_draws_of_a_posterior_are_sampled_together():
    random = np.random.default_rng(0)
    first = np.exp(random.normal(3.0, 0.3, 4000))
    second = 400.0 / first  # one rises as the other falls
    strengths = [
        DrawnStrength((zone,), draws.mean(), draws.std(), "posterior", draws=tuple(draws))
        for zone, draws in (("1", first), ("2", second))
    ]
    np.testing.assert_allclose(
        strengths[0].at(ndtri([0.1, 0.5, 0.9])), np.percentile(first, [10, 50, 90]), rtol=1e-2
    )
    scores = sampled_scores(strengths, 3000, np.random.default_rng(1))
    values = np.stack([one.at(scores[:, k]) for k, one in enumerate(strengths)], axis=1)
    np.testing.assert_allclose(values[:, 0] * values[:, 1], 400.0, rtol=1e-6)
    engine = Formula(lambda values: np.array([values[0] * values[1]]), ["product"])
    found = asked(engine, strengths, samples=2000)
    spread = np.percentile(found.samples[:, 0], [10, 90])
    assert 330.0 < spread[0] < spread[1] < 470.0  # independent, it would be 236 to 712


def test_a_section_without_a_toe_is_refused(tmp_path):
    rows = ["zone,x,y,material,friction_deg,cohesion_kpa,density,liquefied"]
    rows += ["sand,0,0,sand,0,5,1900,true", "sand,60,0,,,,,", "sand,60,9,,,,,", "sand,40,9,,,,,"]
    rows += ["sand,20,4,,,,,", "sand,0,4,,,,,"]
    (tmp_path / "bank.csv").write_text("\n".join(rows) + "\n")
    made = make_case(str(tmp_path / "bank"), Given(section=str(tmp_path / "bank.csv")))
    with pytest.raises(InputError, match="nothing to predict: the ground goes on on both sides"):
        prediction_case(load_case(made.folder))
