"""Derivatives of a rollout: both ways against central differences in double precision."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import torch

import gns.network.edge_chunks
from gns.data.scene_facts import first_window
from gns.network.tangents import Moving, network_with_tangents
from gns.rollout.differentiate import REVERSE_COST, gradient, jacobian, reverse_jacobian
from gns.rollout.traced_rollout import trace
from pipeline.cli import WorkFailed
from tests.gns.scenes import simulator, start

FRAMES = 6
THETA = np.array([18.7, 1.0, 0.6, 0.2, 1.85])
"""Cohesion of the liquefied soil and of the shell [kPa]; of the shell the tangent of the friction
angle; rise of the water [m]; density of the shell [t/m3]."""


@pytest.fixture(scope="module")
def case():
    """Model, scene as a function of THETA, first window, a reading of several frames."""
    facts, positions = start()
    model = simulator(torch.float64, seed=3, width=8, acceleration_std=(0.4, 0.4))
    base = model.scaled(facts)
    liquefied = torch.from_numpy((facts.properties[:, 0] == 0) & (facts.type == 0))
    shell = torch.from_numpy((facts.properties[:, 0] > 0) & (facts.type == 0))

    def scene_of(theta):
        scene = base.with_density(shell, 1e3 * theta[4])
        scene = scene.with_strength(liquefied, cohesion_pa=1e3 * theta[0])
        scene = scene.with_strength(shell, cohesion_pa=1e3 * theta[1], tan_friction=theta[2])
        return scene.with_water_raised(theta[3])

    rng = np.random.default_rng(0)
    weights = rng.normal(size=(3, len(positions), 2))

    def loss(frames):
        """A number that depends on the last, a middle, and (to no effect) the first frame."""
        value = np.sum(weights[0] * frames[-1] ** 2) + np.sum(weights[1] * np.sin(frames[3]))
        value += np.sum(weights[2] * frames[0])
        slopes = {
            FRAMES - 1: 2 * weights[0] * frames[-1],
            3: weights[1] * np.cos(frames[3]),
            0: weights[2],
        }
        return float(value), slopes

    return model, scene_of, first_window(positions, facts), loss


def central_differences(model, scene_of, window, loss, graphs, step=1e-6):
    found = []
    for place in range(len(THETA)):
        values = []
        for sign in (1.0, -1.0):
            theta = torch.tensor(THETA, dtype=torch.float64)
            theta[place] += sign * step
            rolled = trace(model, scene_of(theta), window, FRAMES, graphs=graphs)
            values.append(loss(rolled.frames)[0])
        found.append((values[0] - values[1]) / (2 * step))
    return np.array(found)


@pytest.mark.parametrize("cutoff", ["sharp", "smooth"])
@pytest.mark.parametrize("mode", ["reverse", "forward"])
@pytest.mark.slow
def test_gradient_is_that_of_finite_differences(case, mode, cutoff, monkeypatch):
    monkeypatch.setattr(gns.network.edge_chunks, "CHUNK_BYTES", 8 * 8 * 200)
    model, scene_of, window, loss = case
    model.config = model.config.model_copy(update={"cutoff": cutoff})
    theta = torch.tensor(THETA)
    rolled = trace(model, scene_of(theta), window, FRAMES, record=True)
    expected = central_differences(model, scene_of, window, loss, rolled.graphs)
    assert np.all(np.abs(expected) > 1e-4)  # every parameter matters
    value, found, frames = gradient(
        model, scene_of, THETA, window, FRAMES, loss, mode=mode, graphs=rolled.graphs
    )
    assert value == pytest.approx(loss(rolled.frames)[0], rel=1e-12)
    assert np.allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    assert np.allclose(frames, rolled.frames, atol=1e-12)
    # With the edges found on the way, which are the same.
    again = gradient(model, scene_of, THETA, window, FRAMES, loss, mode=mode)[1]
    assert np.allclose(again, found, rtol=1e-10)


@pytest.mark.slow
def test_jacobian_of_many_readings(case):
    """Rows are the gradients of the readings one by one, by reverse mode."""
    model, scene_of, window, _ = case
    rng = np.random.default_rng(1)
    weights = rng.normal(size=(4, window.shape[1], 2))

    def readings(frames):
        values = np.einsum("mnk,nk->m", weights, frames[-1])
        values[0] += np.sum(frames[2])
        slopes = {FRAMES - 1: weights, 2: np.zeros_like(weights)}
        slopes[2][0] = 1.0
        return values, slopes

    values, found, _ = jacobian(model, scene_of, THETA, window, FRAMES, readings)
    for row in range(4):

        def one(frames, row=row):
            value, slopes = readings(frames)
            return float(value[row]), {frame: slope[row] for frame, slope in slopes.items()}

        value, expected, _ = gradient(model, scene_of, THETA, window, FRAMES, one, mode="reverse")
        assert value == pytest.approx(values[row])
        assert np.allclose(found[row], expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())
    again, backward, _ = reverse_jacobian(model, scene_of, THETA, window, FRAMES, readings)
    assert np.allclose(again, values)
    assert np.allclose(backward, found, rtol=1e-8, atol=1e-10 * np.abs(found).max())


@pytest.mark.parametrize("way", [jacobian, reverse_jacobian])
def test_a_rollout_that_ends_early_is_as_one_that_was_to_be_so_short(case, way):
    model, scene_of, window, _ = case

    def readings(frames):
        value, slopes = _last_x(frames)
        return np.array([value]), {frame: slope[None] for frame, slope in slopes.items()}

    short = way(model, scene_of, THETA, window, 4, readings)
    steps = []
    ended = way(
        model, scene_of, THETA, window, 40, readings,
        until=lambda after, now: steps.append((after - now).abs().max() > 0) or len(steps) == 3,
    )  # fmt: skip
    assert all(steps) and len(ended[2]) == 4
    for one, other in zip(short, ended, strict=True):
        assert np.array_equal(one, other)


def test_the_cheaper_way_is_taken(case, monkeypatch):
    model, scene_of, window, loss = case
    taken = []
    monkeypatch.setattr(
        "gns.rollout.differentiate.jacobian", lambda *a, **k: taken.append("forward") or (1 / 0)
    )

    def short(theta):
        return scene_of(torch.cat([theta, torch.tensor(THETA[len(theta) :])]))

    with pytest.raises(ZeroDivisionError):
        gradient(model, short, THETA[: REVERSE_COST - 1], window, 2, _last_x)
    assert taken == ["forward"]
    gradient(model, short, THETA[:REVERSE_COST], window, 2, _last_x)
    assert taken == ["forward"]


def _last_x(frames):
    slope = np.zeros_like(frames[-1])
    slope[:, 0] = 1.0
    return float(frames[-1, :, 0].sum()), {len(frames) - 1: slope}


def test_weights_are_frozen_and_left_as_they_were(case):
    model, scene_of, window, loss = case
    asking = [parameter.requires_grad for parameter in model.parameters()]
    gradient(model, scene_of, THETA, window, FRAMES, loss, mode="reverse")
    assert all(parameter.grad is None for parameter in model.parameters())
    assert [parameter.requires_grad for parameter in model.parameters()] == asking


def test_what_does_not_matter_has_no_gradient(case):
    model, scene_of, window, _ = case

    def first(frames):
        return float(frames[0].sum()), {0: np.ones_like(frames[0])}

    for mode in ("reverse", "forward"):
        _, found, _ = gradient(model, scene_of, THETA, window, FRAMES, first, mode=mode)
        assert np.array_equal(found, np.zeros(len(THETA)))


def test_a_rollout_or_reading_that_is_not_finite_is_reported(case):
    model, scene_of, window, _ = case

    def endless(frames):
        return 0.0, {FRAMES - 1: np.full_like(frames[-1], np.inf)}

    for mode in ("reverse", "forward"):
        with pytest.raises(WorkFailed, match="derivative"):
            gradient(model, scene_of, THETA, window, FRAMES, endless, mode=mode)
        with pytest.raises(WorkFailed, match="frame 1"):
            gradient(model, scene_of, THETA * np.nan, window, FRAMES, endless, mode=mode)


@pytest.mark.parametrize("faded", [False, True])
def test_tangents_of_the_network_are_those_of_torch(faded, monkeypatch):
    monkeypatch.setattr(gns.network.edge_chunks, "CHUNK_BYTES", 8 * 8 * 60)
    network = simulator(torch.float64, width=8).network.requires_grad_(False)
    torch.manual_seed(1)
    graph = gns.network.graph.radius_graph(torch.rand(25, 2) * 9, 3.0)
    shapes = [(25, network.point_encoder.first.in_features), (graph.edges, 3)]
    shapes += [(graph.edges, 1)] if faded else []
    values = [torch.randn(shape, dtype=torch.float64) for shape in shapes]
    changes = [torch.randn(2, *shape, dtype=torch.float64) for shape in shapes]

    def apply(points, edges, *fading):
        return network(points, edges, graph, fading=fading[0] if fading else None)

    moving = [Moving(*pair) for pair in zip(values, changes, strict=True)]
    found = network_with_tangents(network, moving[0], moving[1], graph, *moving[2:])
    assert torch.allclose(found.value, apply(*values), rtol=1e-12)
    given = [value.clone().requires_grad_() for value in values]
    output = apply(*given)
    for direction in range(2):
        # <w, J t> = <J' w, t>
        for _ in range(3):
            weights = torch.randn_like(output)
            pulled = torch.autograd.grad(output, given, weights, retain_graph=True)
            expected = sum(
                (part * change[direction]).sum()
                for part, change in zip(pulled, changes, strict=True)
            )
            assert torch.allclose((weights * found.change[direction]).sum(), expected, rtol=1e-9)


MEMORY = r"""
import re
import numpy as np, torch
torch.set_num_threads(1)
from gns.rollout.differentiate import gradient
from gns.data.scene_facts import first_window
from tests.gns.scenes import simulator, start
from tests.gns.test_differentiate import _last_x
facts, positions = start(walls="open")
model = simulator(width=64, message_passing_steps=6)
base = model.scaled(facts)
soil = ~base.kinematic
window = first_window(positions, facts)
for mode in ("forward", "reverse"):
    for frames in (4, 8, 24):
        # What the highest resident size (VmHWM) of the process is, in MiB, after each.
        gradient(model, lambda theta: base.with_strength(soil, cohesion_pa=1e3 * theta[0]),
                 np.array([5.0]), window, frames, _last_x, mode=mode)
        print(int(re.search("VmHWM:\s*(\d+)", open("/proc/self/status").read())[1]) / 1024)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_steps(root):
    """In MiB; if the latents of the 16 steps between were kept, they alone would take 140."""
    done = subprocess.run(
        [sys.executable, "-c", MEMORY], cwd=root, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    used = np.array(done.stdout.split(), float).reshape(2, 3)
    assert np.all(used[:, 2] - used[:, 1] < 15.0), used
