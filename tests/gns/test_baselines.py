"""The baselines: what they see of a scene, and that they find what is there to be found."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gns.data.dataset import Windows
from gns.data.scene_facts import start_of
from gns.data.scene_features import NAMES, SideView, side_view, sliding_block
from gns.evaluation import baselines as module
from gns.evaluation.baselines import (
    Guess,
    NearestRun,
    SlidingBlock,
    TrainingSide,
    baselines,
    examples,
    guess_runout,
    judge,
    summary,
    wall_distance,
)
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.commands import gns as main
from tests.mpm_taichi.ballistic import make_scene

SETTINGS = SimulationSettings()


def dam(
    spacing: float = 0.5, scale: float = 1.0, *, cohesion: float = 10.0, mirror=False, water=4.0
):
    """A dam whose right side is liquefied; `scale` makes it larger, strengths with it."""

    def place(x: float, y: float) -> list[float]:
        return [scale * (60 - x if mirror else x), scale * y]

    zones = {"core": [(20, 0), (28, 0), (28, 10), (20, 10)], "fill": [(28, 0), (44, 0), (28, 10)]}
    soil = {"density": 1800}
    scene = make_scene().changed(
        domain={"x_min": 0, "x_max": 60 * scale, "y_max": 30 * scale},
        ground={"points": [[0, 0], [60 * scale, 0]]},
        zones=[
            {"name": name, "polygon": [place(*point) for point in points], "material": name}
            for name, points in zones.items()
        ],
        materials={
            "core": {**soil, "friction_deg": 30, "cohesion_kpa": 0},
            "fill": {**soil, "friction_deg": 0, "cohesion_kpa": cohesion * scale,
                     "liquefied": True},
        },
        water_level=None if water is None else water * scale,
        spacing=spacing * scale,
    )  # fmt: skip
    return start_of(scene, SETTINGS)


def features(*arguments, side="right", **options) -> dict[str, float]:
    facts, start = dam(*arguments, **options)
    return dict(zip(NAMES, side_view(start, facts, side).features, strict=True))


def test_features_are_what_they_say():
    found = features()
    length = math.sqrt(8 * 10 + 0.5 * 16 * 10)
    assert found["height"] == pytest.approx(10 / length, rel=0.04)
    assert found["width"] == pytest.approx(24 / length, rel=0.05)
    assert found["liquefied"] == pytest.approx(0.5, rel=0.04)
    assert found["wall"] == pytest.approx(16 / length, rel=0.05)
    assert found["fall"] == found["speed_outward"] == found["speed_upward"] == 0.0
    assert 1 - 1000 / 1800 < found["buoyancy"] < 1
    soft = 10e3 / (1800 * 9.81 * length)
    assert math.exp(found["weakest"]) == pytest.approx(soft, rel=0.5)
    assert features(cohesion=5.0)["strength"] < found["strength"]
    assert features(side="left")["wall"] == pytest.approx(20 / length, rel=0.04)


def test_the_strength_of_friction_is_that_of_the_soil_above():
    facts, start = dam(water=None)
    facts = replace(facts, properties=facts.properties.copy())
    facts.properties[:, 0], facts.properties[:, 1] = 0.5, 0.0
    view = side_view(start, facts, "left")
    strength = math.exp(dict(zip(NAMES, view.features, strict=True))["mean_strength"])
    column = [10 - y if x < 28 else 10 - (x - 28) * 10 / 16 - y for x, y in start]
    assert strength == pytest.approx(0.5 * np.mean(column) / view.length, rel=0.06)


def test_features_hang_neither_on_the_spacing_nor_on_the_size_nor_on_the_side():
    coarse, fine = features(1.0), features(0.25)
    large = features(0.5, 4.0)
    mirrored = features(0.5, mirror=True, side="left")
    base = features(0.5)
    for name in NAMES:
        assert coarse[name] == pytest.approx(fine[name], abs=0.12), name
        assert large[name] == pytest.approx(base[name], abs=1e-3), name
        assert mirrored[name] == pytest.approx(base[name], abs=0.03), name


def test_a_thrown_block_has_its_speed():
    facts, start = start_of(make_scene(2, spacing=0.5), SETTINGS)
    outward = side_view(start, facts, "right")
    share = np.mean(facts.zone == 1)
    speed = dict(zip(NAMES, outward.features, strict=True))["speed_outward"]
    assert speed == pytest.approx(share * 10 / math.sqrt(9.81 * outward.length), rel=1e-4)
    inward = dict(zip(NAMES, side_view(start, facts, "left").features, strict=True))
    assert inward["speed_outward"] == pytest.approx(-speed)


def test_the_sliding_block_in_closed_form():
    # 8 m wide and 4 m thick, S = 20 kPa, its centre 2 m over the ground, at 3 m/s.
    length, weight = math.sqrt(32), 1800 * 9.81
    given = {
        "width": 8 / length,
        "strength": math.log(20e3 / (weight * length)),
        "buoyancy": 1.0,
        "centre_height": 2 / length,
        "fall": 0.0,
        "speed_outward": 3 / math.sqrt(9.81 * length),
    }
    expected = (0.5 * 2.0 + 3**2 / (2 * 9.81)) / (20e3 / (weight * 4))
    assert sliding_block(given) * length == pytest.approx(expected)
    assert sliding_block({**given, "fall": -9.0, "speed_outward": -1.0}) == 0.0


# --- the guesses ---


def example(values, runout, template="a", wall=99.0, length=2.0, block_travel=1.0) -> TrainingSide:
    view = SideView(np.asarray(values, float), length, block_travel)
    return TrainingSide(view, template, wall, runout)


def test_the_nearest_run():
    generator = np.random.default_rng(0)
    places = generator.normal(0, [1.0, 100.0, 0.0], (30, 3))  # one of them does not vary
    known = [example(place, 10.0 * k, length=2.0 + k % 3) for k, place in enumerate(places)]
    nearest = NearestRun(known)
    for k, place in enumerate(places):
        view = SideView(place + [1e-3, 0.1, 0.0], 7.0, 1.0)
        assert nearest.guess(view, "z") == pytest.approx(10.0 * k / (2.0 + k % 3))
    three = NearestRun(known, neighbours=3)
    scaled = (places - places[5]) / [places[:, 0].std(), places[:, 1].std(), 1.0]
    order = np.argsort((scaled**2).sum(axis=1))[:3]
    expected = np.mean([known[k].runout / known[k].view.length for k in order])
    assert three.guess(known[5].view, "a") == pytest.approx(expected)
    assert "3" in three.name and three.name != nearest.name


def law(values, travel, template):
    """Runout in lengths: each template has its own share of the block's travel."""
    own = {"a": 0.5, "b": 0.8}.get(template, 0.0)
    return 1.0 + own + 0.3 * math.log(travel) + 0.2 * values[0]


def test_the_regression_finds_a_law():
    generator = np.random.default_rng(1)

    def draw(template, noise=0.0):
        values = generator.normal(3, 2, 4)
        travel = math.exp(generator.normal(0, 1))
        runout = 2.0 * (law(values, travel, template) + noise * generator.normal())
        return example(values, runout, template, block_travel=travel)

    known = [draw("ab"[k % 2], noise=0.02) for k in range(300)]
    # Sides at a wall say nothing of how far a slide runs, and would spoil the fit.
    known += [replace(draw("a"), wall=0.1, runout=0.0) for _ in range(100)]
    fitted = SlidingBlock(known)
    for template in "ab":
        for _ in range(20):
            new = draw(template)
            assert fitted.guess(new.view, template) == pytest.approx(new.runout / 2.0, abs=0.05)
    other = draw("e")
    assert abs(fitted.guess(other.view, "e") - fitted.guess(other.view, "")) < 1e-12
    middle = law(other.view.features, other.view.block_travel, "e") + 0.65
    assert fitted.guess(other.view, "e") == pytest.approx(middle, abs=0.3), "shared by a and b"


def test_runs_left_out_in_closed_form():
    generator = np.random.default_rng(2)
    matrix, target = generator.normal(size=(25, 4)), generator.normal(size=25)
    held = np.array([0.0, 1.0, 2.0, 0.5])
    errors = []
    for k in range(25):
        rest = np.arange(25) != k
        a, b = matrix[rest], target[rest]
        found = np.linalg.solve(a.T @ a + np.diag(held), a.T @ b)
        errors.append((target[k] - matrix[k] @ found) ** 2)
    found = module._left_out_error(matrix, target, held)
    assert found == pytest.approx(np.mean(errors), rel=1e-9)


def test_noise_asks_for_a_stronger_ridge():
    generator = np.random.default_rng(3)
    clean, noisy = (
        SlidingBlock(
            [
                example(values, 2 * (values[0] + noise * generator.normal()))
                for values in generator.normal(size=(40, 6))
            ]
        )
        for noise in (0.0, 5.0)
    )
    assert clean.ridge < noisy.ridge


def test_no_guess_goes_beyond_the_wall():
    class Far:
        name = "far"

        def guess(self, view, template):
            return 1e6

    for mirror, side, near in ((False, "right", 16), (False, "left", 20), (True, "left", 16)):
        facts, start = dam(mirror=mirror)
        assert guess_runout(Far(), start, facts, side) == pytest.approx(near, abs=0.6)
        opened = replace(facts, numbers={**facts.numbers, "walls_open": 1.0})
        assert wall_distance(start, opened, side) == math.inf
        assert guess_runout(Far(), start, opened, side) > 1e6


# --- on packed data ---


def test_training_runs_know_themselves(packed):
    windows = Windows(packed, "train")
    known = examples(windows)
    assert len(known) == 2 * len(windows.runs)
    own = judge(NearestRun(known), windows)
    assert [one.run for one in own] == windows.runs.tolist()
    assert max(abs(one.error_m) for one in own) < 1e-9
    farther = [replace(one, runout=one.runout + 0.5) for one in known]
    for guess in judge(NearestRun(farther), windows):
        assert guess.error_m == pytest.approx(0.5, abs=1e-6), "guessed minus simulated"


def test_all_baselines_judge_all_held_out_runs(packed):
    found = baselines(Windows(packed, "train"))
    assert len({one.name for one in found}) == 3
    for one in found:
        guesses = judge(one, Windows(packed, "valid"))
        assert len(guesses) == len(Windows(packed, "valid").runs)
        assert all(math.isfinite(guess.error_m) for guess in guesses)


def test_summary_of_guesses():
    errors = [(-1.0, 10.0), (2.0, 10.0), (3.0, 0.5), (-8.0, 20.0)]
    found = summary([Guess(k, "a", travel, error, 2.0) for k, (error, travel) in enumerate(errors)])
    assert found["runs"] == 4
    assert found["runout, m"] == 2.5 and found["runout, d"] == 1.25
    assert found["90 %, d"] == pytest.approx((3 + 0.7 * 5) / 2)
    assert found["runout, % of travel"] == 20.0, "not of a travel of half a spacing"


def test_the_command(packed, capsys):
    main(["baselines", str(packed)])
    text = capsys.readouterr().out
    for word in ("nearest training run", "nearest 3 training runs", "sliding-block regression"):
        assert word in text
    with pytest.raises(InputError, match="and not both"):
        main(["baselines", str(packed), "--scale", "coarse"])
    with pytest.raises(InputError, match="and not both"):
        main(["baselines"])
