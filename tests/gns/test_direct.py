"""The direct models: sections as columns, network, training, calibration, those that ship."""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
import pytest
import torch

from flowslide.commands.gns import direct_train
from geometry.random_scenes.embankment_dam import draw_dam
from gns.direct import runs as runs_module
from gns.direct.arrivals import SHARES, arrivals_of
from gns.direct.effects import LEAST_RUNS, NAMES, learned_of
from gns.direct.judge import calibrated, card, judged, judged_run
from gns.direct.network import (
    OF_SECTION,
    Answer,
    DirectConfig,
    DirectModel,
    DirectNetwork,
    features,
    mirrored,
)
from gns.direct.predictor import MODEL_FILE, DirectPredictor, both_ways, described, unit_of
from gns.direct.runs import (
    DAMS_IN_TEN,
    SlideRun,
    random_section,
    random_slide,
    read_runs,
    simulate_parts,
)
from gns.direct.sections import COLUMN, COLUMNS, LAYERS, outcome_of, places, section_of
from gns.direct.train import SPLITS, TrainingPlan, inputs, loss_of, sample_of, split_of, train
from mpm_taichi.effects import effects_on
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import file_hash, read_yaml
from tests.conftest import ROOT

SMALL = DirectConfig(widths=(8, 8, 8, 8))
SHIPPED = sorted(path.parent for path in (ROOT / "models").glob(f"*/{MODEL_FILE}"))


def slid(number: int) -> SlideRun:
    """A random dam whose points have moved by a formula: outward with their height."""
    from geometry.scenes.fill import fill

    scene = draw_dam(0, number, 2.0)
    points = fill(scene)
    initial, volume = points.position.astype(np.float32), points.volume
    final = initial.copy()
    weak = np.log10(scene.materials["first_lower"].cohesion_kpa + 1.0)
    final[:, 0] += (initial[:, 0] - initial[:, 0].mean()) * 0.3 * (2.5 - weak)
    shares = np.linspace(0.0, 1.0, 40)[:, None, None]
    frames = initial + shares * (final - initial)  # evenly, all points alike
    time = np.linspace(0.0, 10.0 - 2.0 * weak, 40)
    arrivals = arrivals_of(frames, time, volume, scene.spacing)
    return SlideRun(number, scene, initial, final, volume, 0.1, True, arrivals)


@pytest.fixture(scope="module")
def samples():
    found = [sample_of(slid(number)) for number in (*range(0, 20), *range(80, 100))]
    return [one for one in found if one is not None]


@pytest.fixture(scope="module")
def section():
    return section_of(draw_dam(0, 3, 2.0))


def test_columns_hold_the_section():
    scene = draw_dam(0, 3, 2.0)
    section = section_of(scene)
    from shapely import Polygon

    area = sum(Polygon(zone.polygon).area for zone in scene.zones)
    assert section.thickness.sum() * COLUMN * section.height**2 == pytest.approx(area, rel=0.01)
    assert section.thickness.max() == pytest.approx(1.0, abs=0.15)
    soil = section.zone_share.sum(axis=(1, 2)) > 0
    assert np.allclose(section.zone_share[soil].sum(axis=2), 1.0)


def test_a_section_of_another_size_is_the_same():
    small, large = (section_of(draw_dam(0, 5, spacing)) for spacing in (1.0, 3.0))
    assert np.allclose(small.thickness, large.thickness, atol=1e-3)
    assert np.allclose(small.values, large.values, atol=2e-3)
    assert np.allclose(described(small), described(large), atol=0.02)


def parsed(command, given):
    """Arguments of a command."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return parser.parse_args(given)


def image_of(scene):
    """The mirror image of a scene."""

    def turned(points):
        return [(600.0 - x, y) for x, y in reversed(points)]

    return scene.changed(
        ground={"points": turned(scene.ground.points)},
        zones=[z.model_dump() | {"polygon": turned(z.polygon)} for z in scene.zones],
        phreatic_line=None if scene.phreatic_line is None else turned(scene.phreatic_line),
        domain=scene.domain.model_dump()
        | {"x_min": 600.0 - scene.domain.x_max, "x_max": 600.0 - scene.domain.x_min},
    )


def test_the_mirror_image_lies_as_far_from_the_training():
    dam = draw_dam(0, 4, 2.0)
    own, image = (described(section_of(one)) for one in (dam, image_of(dam)))
    assert both_ways(own[None])[1] == pytest.approx(image, abs=0.02)
    assert np.abs(own - image).max() > 0.1, "it is another section"
    known = np.stack([described(section_of(draw_dam(0, number, 2.0))) for number in range(6)])
    assert unit_of(known) == pytest.approx(unit_of(both_ways(known)[1::2]))
    predictor = DirectPredictor(DirectModel(SMALL), 1.0, 1.0, 1.0, known, unit_of(known))
    assert predictor.distance(section_of(image_of(dam))) < 0.1 < unit_of(known)


def test_the_mirror_image_has_mirrored_features():
    scene = draw_dam(0, 4, 2.0)
    image = image_of(scene)
    before = np.array([[-2.0, 2.5]])
    seen = []
    for one, toes in ((scene, before), (image, -before[:, ::-1])):
        own = section_of(one)
        seen.append(features([own], toes, torch.as_tensor(own.values)[None]))
    flipped = mirrored(seen[0])
    # The ground's height counts from that at the middle, and slopes are one-sided at the ends.
    assert torch.allclose(flipped, seen[1], atol=0.05)


def test_columns_know_what_pushes_and_what_holds_them(section):
    first, count, strength = 60, 70, 0.1
    inside = (np.arange(COLUMNS) >= first) & (np.arange(COLUMNS) < first + count)
    share = np.zeros((COLUMNS, LAYERS, 2))
    share[inside, 1:, 1] = share[inside, 0, 0] = 1.0  # a weak layer below a strong fill
    block = replace(
        section,
        thickness=inside.astype(float),
        water=np.full(COLUMNS, -2.0),
        zone_share=share,
        strength_share=share,
        values=np.array([[strength, 0.0, 1.0], [10.0 * strength, 0.0, 1.0]]),
        saturated=np.ones(2),
    )
    seen = features([block], np.array([[-4.5, 4.5]]), torch.as_tensor(block.values)[None])
    push, weakest, left, right, layer, over_left, over_right, spread = seen[0, 11:19].numpy()
    assert push[inside] == pytest.approx(0.5), "half the weight of a column of unit height"
    assert weakest[inside] == pytest.approx(np.log(strength + 3e-3) + 3.0, abs=1e-3)
    assert layer[inside] == pytest.approx(0.0, abs=1e-3) and not layer[~inside].any()
    held = strength * COLUMN * np.arange(1, count + 1)
    assert left[inside] == pytest.approx(held, rel=1e-3)
    assert right[inside] == pytest.approx(held[::-1], rel=1e-3)
    for quotient, held_there in ((over_left, held), (over_right, held[::-1])):
        assert quotient[inside] == pytest.approx(np.log(0.52 / (held_there + 0.02)), abs=1e-3)
    area = count * COLUMN
    assert spread == pytest.approx(np.log(area**2 / (strength + 3e-3)) / 3.0 - 1.0, abs=1e-3)


def test_a_seam_thinner_than_a_layer_is_as_weak_as_it_is(section):
    inside = section.thickness > 0.0
    share = np.zeros((COLUMNS, LAYERS, 2))
    share[inside] = [0.0, 1.0]
    share[inside, 2] = [0.25, 0.75]  # a quarter of the third layer
    seam = replace(
        section,
        zone_share=share,
        strength_share=share,
        water=np.full(COLUMNS, -2.0),
        values=np.array([[0.02, 0.0, 1.0], [0.3, 0.0, 1.0]]),
        saturated=np.ones(2),
    )
    seen = features([seam], np.array([section.feet]), torch.as_tensor(seam.values)[None])
    weakest, place = seen[0, 12].numpy()[inside], seen[0, 15].numpy()[inside]
    assert weakest == pytest.approx(np.log(0.02 + 3e-3) + 3.0, abs=0.01)
    assert place == pytest.approx(2.0 / LAYERS, abs=0.01)


@pytest.mark.slow
def test_the_answer_for_the_mirror_image_is_the_mirror_image(samples):
    torch.manual_seed(2)
    model = DirectModel(replace(SMALL, networks=2)).eval()
    for parameter in model.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    with torch.no_grad():
        seen = inputs(samples[:3])
        one, other = model(seen), model(mirrored(seen))
    assert torch.allclose(other.toes, -one.toes.flip(1), atol=1e-5)
    assert torch.allclose(other.toe_scale, one.toe_scale.flip(1), rtol=1e-4)
    assert torch.allclose(other.thickness, one.thickness.flip(1), atol=1e-5)
    assert torch.allclose(other.log_times[:, [1, 0, 2]], one.log_times, atol=1e-4)
    assert torch.allclose(other.time_scale[:, [1, 0, 2]], one.time_scale, rtol=1e-4)


def test_a_stronger_part_is_seen_where_it_lies():
    scene = draw_dam(0, 3, 2.0)
    zone = next(z for z in scene.zones if scene.materials[z.material].liquefied)
    left, right = (end(x for x, _ in zone.polygon) for end in (min, max))
    middle, half = 0.5 * (left + right), 0.25 * (right - left)
    entry = {"amplitude": 0.7, "x_m": middle, "half_width_m": half, "edge": 0.01}
    section = section_of(scene.changed(effects={"strength_contrast": entry}))
    plain = section_of(scene)
    assert np.array_equal(section.zone_share, plain.zone_share)
    number = scene.zones.index(zone)
    held = plain.zone_share[..., number] > 0.0
    factor = (section.strength_share / np.maximum(plain.zone_share, 1e-9))[..., number]
    away, width = np.abs(section.x - middle) / half, COLUMN * section.height / half
    inner, outer = held & (away < 1.0 - width)[:, None], held & (away > 1.0 + width)[:, None]
    assert inner.any() and np.allclose(factor[inner], np.exp(0.7), rtol=1e-3)
    assert outer.any() and np.allclose(factor[outer], 1.0)
    dry = [n for n, z in enumerate(scene.zones) if not scene.materials[z.material].liquefied]
    assert np.array_equal(section.strength_share[..., dry], plain.zone_share[..., dry])


@pytest.mark.parametrize("change", ["velocity", "law", "ground"])
def test_what_it_has_never_seen_is_refused(change):
    scene = draw_dam(0, 3, 2.0)
    if change == "velocity":
        zone = scene.zones[0].model_copy(update={"initial_velocity": (1.0, 0.0)})
        scene = scene.model_copy(update={"zones": [zone, *scene.zones[1:]]})
    elif change == "law":
        scene = scene.model_copy(update={"law": "other"})
    else:
        ground = scene.ground.model_copy(update={"contact": "no_slip"})
        scene = scene.model_copy(update={"ground": ground})
    with pytest.raises(InputError, match=r"the direct model knows .* alone"):
        section_of(scene)


def test_the_deposit_keeps_the_volume_and_the_answer_has_its_derivative(section):
    torch.manual_seed(0)
    model = DirectModel(SMALL)
    for parameter in model.parameters():  # some weights begin at zero
        torch.nn.init.normal_(parameter, std=0.1)
    predictor = DirectPredictor(model.eval(), 1.0, 1.0, 1.0, described(section)[None], 1.0)
    before = np.array([section.feet])[0]
    forecast = predictor.predict(section, before)
    volume = section.thickness.sum() * section.height
    assert forecast.thickness.sum() == pytest.approx(volume, rel=1e-5)
    tangent = np.zeros((2, *section.values.shape))
    tangent[0, 0, 0] = tangent[1, 1, 1] = 1.0
    slopes = predictor.derivative(section, before, tangent)
    units = (section.height, section.height, section.unit_s)
    double = replace(predictor, model=DirectModel(SMALL).double().eval())
    double.model.load_state_dict(model.state_dict())
    for place in (0, 1):
        ends = []
        for sign in (1.0, -1.0):
            values = torch.as_tensor(section.values + sign * 1e-5 * tangent[place])
            answer = double._answer(section, before, values, double.model)
            found = (answer.toes[0], answer.thickness[0], answer.log_times[0].exp())
            ends.append([one.detach().numpy() for one in found])
        for slope, unit, above, below in zip(slopes, units, *ends, strict=True):
            finite = unit * (above - below) / 2e-5
            assert np.abs(slope[place]).max() > 0
            assert slope[place] == pytest.approx(finite, rel=1e-4, abs=1e-6)


def test_arrival_times_are_those_of_the_motion():
    scene = draw_dam(0, 3, 2.0)
    from geometry.scenes.fill import fill

    points = fill(scene)
    start, volume = points.position, points.volume
    time = np.linspace(0.0, 8.0, 81)
    far = 40.0 * (1.0 - (1.0 - time / 8.0) ** 2)  # braked evenly: all of it goes 40 m to the right
    frames = start + np.stack([far, np.zeros_like(far)], axis=1)[:, None]
    found = arrivals_of(frames, time, volume, 2.0)
    exact = 8.0 * (1.0 - np.sqrt(1.0 - np.array(SHARES)))
    assert found.way == pytest.approx(exact, abs=0.02)
    assert found.toes[1] == pytest.approx(exact, abs=0.02)
    assert np.isnan(found.toes[0]).all()  # the left toe has gone inward
    still = arrivals_of(np.repeat(start[None], 5, axis=0), time[:5], volume, 2.0)
    assert np.isnan(still.toes).all() and np.isnan(still.way).all()


def test_a_killed_training_goes_on_where_it_stopped(samples, tmp_path):
    plan = TrainingPlan(steps=6, batch=4, save_every=2, restart_at=3)
    whole = train(samples, tmp_path / "whole", SMALL, plan, lambda line: None)

    class KilledError(Exception):
        pass

    def kill(line):
        if line.startswith("step 4"):
            raise KilledError

    with pytest.raises(KilledError):
        train(samples, tmp_path / "parts", SMALL, plan, kill)
    lines = []
    again = train(samples, tmp_path / "parts", SMALL, plan, lines.append)
    assert [line.split(":")[0] for line in lines] == ["step 6"]
    for one, other in zip(whole.parameters(), again.parameters(), strict=True):
        assert torch.equal(one, other)


def test_networks_that_were_trained_alone_are_those_of_the_model(samples, tmp_path):
    config, plan = replace(SMALL, networks=2), TrainingPlan(steps=4, batch=4, save_every=2)
    for number in (1, 0):
        train(samples, tmp_path / "apart", config, plan, lambda line: None, alone=number)
    lines = []
    joined = train(samples, tmp_path / "apart", config, plan, lines.append)
    assert lines == [], "both are there"
    assert sorted(one.name for one in (tmp_path / "apart").iterdir()) == [
        "network_1.pt",
        "network_2.pt",
    ]
    other = [replace(samples[0], times=samples[0].times + 0.1), *samples[1:]]
    train(other, tmp_path / "apart", config, plan, lines.append, alone=0)
    assert len(lines) == 2, "other runs of the same names are another training"
    train(samples, tmp_path / "apart", config, plan, lambda line: None, alone=0)
    whole = train(samples, tmp_path / "whole", config, plan, lambda line: None)
    first, second = (list(one.parameters()) for one in joined.networks)
    assert not any(map(torch.equal, first[:1], second[:1])), "each has its own beginning"
    for one, other in zip(whole.parameters(), joined.parameters(), strict=True):
        assert torch.equal(one, other)
    seen = inputs(samples[:3])
    with torch.no_grad():
        each = [network.both_ways(seen).toes for network in joined.networks]
        assert torch.allclose(joined(seen).toes, 0.5 * (each[0] + each[1]), atol=1e-6)


def test_a_toe_that_is_hard_to_tell_still_counts():
    toes = torch.zeros(2, 2, requires_grad=True)
    scale = torch.tensor([[0.1, 0.1], [0.4, 0.4]], requires_grad=True)
    flat, times = torch.ones(2, COLUMNS), torch.zeros(2, 3, len(SHARES))
    answer = Answer(toes, scale, flat, flat, times, times + 1.0)
    loss_of(answer, torch.ones(2, 2), flat, times + np.nan).backward()
    assert toes.grad[0] == pytest.approx(2.0 * toes.grad[1]), "a likelihood alone: four times"
    narrow, wide = scale.grad[:, 0]
    assert narrow < wide < 0.0, "both scales are smaller than the error"


@pytest.mark.slow
def test_training_calibration_and_card(samples, tmp_path):
    torch.set_num_threads(1)
    config = replace(SMALL, networks=2)
    model = train(samples, tmp_path, config, TrainingPlan(40, 8, warmup=5), lambda line: None)
    predictor = calibrated(model, samples)
    facts = card(predictor, samples, {"steps": 40})
    assert facts["runs"] == {n: sum(one.split == n for one in samples) for n in SPLITS}
    held = [one for one in samples if one.split == "calibration"]
    assert np.mean(judged(predictor, held).covered) >= 0.9  # that is what calibration is
    unseen = [one for one in samples if one.split == "test"]
    itself = judged_run(unseen, [one.outcome for one in unseen])
    assert not itself.runout.any() and itself.row()["runs"] == len(unseen)
    predictor.save(tmp_path / MODEL_FILE)
    kept = DirectPredictor.load(tmp_path / MODEL_FILE)
    one = unseen[0]
    ours, theirs = (p.predict(one.section, one.outcome.toes_before) for p in (predictor, kept))
    assert np.array_equal(ours.toes, theirs.toes)
    assert np.all(ours.toe_interval > 0)
    assert np.array_equal(ours.times, theirs.times) and np.all(np.diff(ours.times) > 0)
    assert np.all(ours.times_within > 1.0)
    (row,) = [row for name, row in judged(predictor, unseen).table().items() if name == "all"]
    assert row["half-way time, %"] > 0 and row["duration, %"] > 0
    assert "duration, %" not in itself.row()


def test_a_damaged_model_is_refused(tmp_path):
    (tmp_path / MODEL_FILE).write_bytes(b"no model")
    with pytest.raises(InputError, match="is not a direct model"):
        DirectPredictor.load(tmp_path / MODEL_FILE)
    with pytest.raises(InputError, match="direct-train leaves one"):
        DirectPredictor.load(tmp_path / "none.pt")


def test_a_run_that_leaves_the_columns_is_left_out(section):
    points = np.column_stack([np.arange(0.0, 2000.0, 2.0), np.ones(1000)])
    stack = np.concatenate([points + [0.0, 2.0 * row] for row in range(4)])
    assert outcome_of(section, stack, stack, np.full(len(stack), 4.0), 2.0) is None
    assert len(places()) == COLUMNS


def test_splits_hold_dams_and_templates_alike():
    found = {name: [n for n in range(1000) if split_of(n) == name] for name in SPLITS}
    assert [len(found[name]) for name in SPLITS] == [800, 100, 100]
    for numbers in found.values():
        assert np.mean([n % 10 < DAMS_IN_TEN for n in numbers]) == pytest.approx(0.7)


def test_of_ten_sections_seven_are_dams_and_three_of_these_of_hydraulic_fill():
    config = load_config(None)
    names = [random_section(config, number).name.split("_")[0] for number in range(20)]
    assert names.count("dam") == 8 and names.count("hydraulic") == 6


@pytest.mark.slow
def test_runs_are_made_in_parts_and_a_part_is_made_once(tmp_path, monkeypatch):
    config = load_config(None, ["simulation.duration_s=1.0"])
    monkeypatch.setattr(runs_module, "SPACING", 4.0)
    lines: list[str] = []
    simulate_parts(config, tmp_path, [0], threads=1, tell=lines.append, size=2)
    made = file_hash(tmp_path / "runs_0000.npz")
    simulate_parts(config, tmp_path, [0, 1], threads=1, tell=lines.append, size=2)
    assert len(lines) == 2 and file_hash(tmp_path / "runs_0000.npz") == made
    found = list(read_runs(tmp_path))
    assert [run.number for run in found] == [0, 1, 2, 3]
    assert found[0].scene.changed(effects={}) == draw_dam(config.geometry.seed, 0, 4.0)
    assert found[0].final.shape == found[0].initial.shape and found[0].seconds > 0.0
    other = load_config(None, ["simulation.duration_s=1.0", "geometry.seed=7"])
    with pytest.raises(InputError, match=r"runs_0000.npz: has runs of other settings"):
        simulate_parts(other, tmp_path, [0, 2], threads=1, tell=lines.append, size=2)


def test_a_network_that_the_model_has_not_is_refused(tmp_path):
    given = ["direct-train", "--data", str(tmp_path), "--out", str(tmp_path), "--networks", "2"]
    with pytest.raises(InputError, match=r"--network: 3; allowed are 1 to 2 \(--networks\)"):
        direct_train.run(parsed(direct_train, given[1:] + ["--network", "3"]))
    with pytest.raises(InputError, match="has no runs_PPPP.npz"):
        direct_train.run(parsed(direct_train, given[1:] + ["--network", "2"]))


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda folder: folder.name)
def test_a_shipped_model_belongs_to_its_card(folder):
    facts, predictor = read_yaml(folder / "card.yaml"), DirectPredictor.load(folder / MODEL_FILE)
    assert facts["weights_sha256"] == file_hash(folder / MODEL_FILE)
    assert facts["kind"] == folder.name == "direct"
    assert facts["parameters"] == sum(p.numel() for p in predictor.model.parameters())
    row = facts["accuracy"]["all"]
    assert row["runs"] >= 100 and row["far"] >= 0.4 * row["runs"]
    assert 85.0 <= row["covered, %"] <= 97.0


# --- effects as inputs ---


def with_channel(*effects: str) -> list[int]:
    """Channels of the features of `effects`."""
    return [OF_SECTION + NAMES.index(name) for name in effects]


def seen_of(scene, toes=None):
    section = section_of(scene)
    before = np.array([section.feet if toes is None else toes])
    return features([section], before, torch.as_tensor(section.values)[None])


def test_effects_are_seen_in_units_of_the_section():
    scene = draw_dam(0, 3, 2.0)
    section = section_of(scene)
    on = {"apparent_cohesion": 10.0, "late_liquefaction": 8.0, "weak_base": 0.1}
    seen = seen_of(scene.changed(effects=on))
    cohesion, late, base = (seen[0, place] for place in with_channel(*on))
    assert torch.allclose(cohesion, torch.tensor(10.0 / section.unit_kpa / 0.05).double())
    assert torch.allclose(late, torch.tensor(8.0 / section.unit_s / 20.0).double())
    assert torch.allclose(base, torch.tensor(0.5).double())
    plain = seen_of(scene)
    assert not plain[0, OF_SECTION:].any() and torch.equal(
        plain[:, :OF_SECTION], seen[:, :OF_SECTION]
    )
    with pytest.raises(InputError, match="weak_base: x_to_m: 9; the direct model knows 1e"):
        section_of(scene.changed(effects={"weak_base": {"amplitude": 0.1, "x_to_m": 9.0}}))
    for effects, words in (
        ({"dilatancy": 0.1}, "dilatancy is on; the direct model"),
        ({"side_shear": 3.0}, "side_shear: 3; the direct model knows up to 0.15"),
    ):
        with pytest.raises(InputError, match=words):
            section_of(scene.changed(effects=effects))
    with pytest.raises(InputError, match="weak_base: the direct model knows effects at a spacing"):
        section_of(draw_dam(0, 3, 1.5).changed(effects={"weak_base": 0.1}))


def test_a_pool_level_is_another_water():
    scene = next(one for n in range(20) if (one := draw_dam(0, n, 2.0)).water_level is not None)
    higher = section_of(scene.changed(effects={"pool_level": 1.0}))
    assert not higher.effects.any()
    risen = higher.height * (higher.water - section_of(scene).water)
    assert risen.max() == pytest.approx(1.0) and risen.min() >= -1e-9


def test_shaking_changes_its_sign_in_the_mirror_image():
    seen = seen_of(draw_dam(0, 3, 2.0).changed(effects={"shaking": 0.3, "weak_base": 0.1}))
    turned = mirrored(seen)
    shaken, base = with_channel("shaking", "weak_base")
    assert torch.equal(turned[:, shaken], -seen[:, shaken]) and seen[0, shaken, 0] == 0.5
    assert torch.equal(turned[:, base], seen[:, base])


def test_networks_begin_with_those_that_have_learned_fewer_effects():
    torch.manual_seed(0)
    few, all_of = replace(SMALL, effects=("weak_base",)), replace(SMALL, effects=NAMES)
    old, new = DirectNetwork(few), DirectNetwork(all_of)
    for parameter in old.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    new.begin_with(old)
    on = {"weak_base": 0.1, "shaking": 0.3}
    seen = seen_of(draw_dam(0, 3, 2.0).changed(effects=on)).float()
    old.eval(), new.eval()
    plain = seen_of(draw_dam(0, 3, 2.0)).float()
    assert not torch.allclose(old(seen).toes, old(plain).toes, atol=1e-4), "it sees the base"
    for one, other in zip(vars(old(seen)).values(), vars(new(seen)).values(), strict=True):
        assert torch.allclose(one, other, atol=1e-5), "what is new counts for nothing yet"
    DirectModel(all_of).check_begin(DirectModel(few))
    for own, begin in (
        (few, all_of),
        (replace(all_of, blocks=1), few),
        (all_of, replace(few, networks=2)),
    ):
        with pytest.raises(InputError, match="--begin-with: is of another size"):
            DirectModel(own).check_begin(DirectModel(begin))


def test_a_training_may_begin_with_a_model(samples, tmp_path):
    config, plan = replace(SMALL, effects=NAMES[:2]), TrainingPlan(steps=2, batch=4, save_every=1)
    torch.manual_seed(0)
    begin, lines = DirectModel(SMALL), []
    found = train(samples, tmp_path, config, plan, lines.append, begin=begin)
    assert len(lines) == 2 and found.config.effects == NAMES[:2]
    train(samples, tmp_path, config, plan, lines.append, begin=begin)
    assert len(lines) == 2, "it is there"
    train(samples, tmp_path, config, plan, lines.append)
    assert len(lines) == 4, "another beginning is another training"
    with pytest.raises(InputError, match="--begin-with: is of another size"):
        train(samples, tmp_path, replace(config, blocks=1), plan, lines.append, begin=begin)
    late = TrainingPlan(steps=30000).later
    assert late.rate == 1e-3 and late.first_cycle == 30000


def test_of_ten_slides_six_have_effects_that_can_act_in_them():
    config = load_config(None)
    slides = [random_slide(config, number) for number in range(30)]
    counts = [len(effects_on(one)) for one in slides]
    assert 0.3 < np.mean(np.array(counts) == 0) < 0.55 and max(counts) == 2
    assert len({one.effect.name for slide in slides for one in effects_on(slide)}) > 10
    for slide in slides:
        on = [name in slide.effects for name in NAMES]
        assert np.array_equal(section_of(slide).effects != 0.0, on)
    once = slides[0].changed(effects={"weak_base": 0.1, "pool_level": 1.0})
    assert learned_of([once] * LEAST_RUNS) == ("weak_base",)
    assert learned_of([once] * (LEAST_RUNS - 1)) == ()
