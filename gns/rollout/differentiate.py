"""Derivatives of whatever is read from a rollout with respect to what the scene is made of.

In: a simulator with frozen weights, a scene as a function of p parameters (strengths, friction,
density, water level: all that a `ScaledScene` carries), a first window, and a reading of the frames
with its derivative with respect to the positions (those of `geometry.survey` have one).
Two exact ways through the steps:

- reverse mode, `gradient` and `reverse_jacobian`: of one number, or one after the other, with
  respect to any number of parameters. The rollout keeps only the positions of each frame; the
  backward pass takes one step after the other from the end, each recomputed from the positions
  before it. Memory: that of one step; a frame more costs 8 N bytes in single precision.
- forward mode, `jacobian`: of any number of readings with respect to p parameters; changes travel
  with the rollout. Memory: one step with p directions; a frame more costs (1 + p) 8 N bytes.

A pass in reverse mode costs about REVERSE_COST steps, one in forward mode 1 + p; `gradient` takes
the cheaper. Which edges there are is decided by the positions and has no derivative: both ways
differentiate with the neighbour lists of the rollout itself (`Trace.graphs` records them).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from gns.network.features import edge_features, fading_of
from gns.network.graph import Graph
from gns.network.simulator import Simulator
from gns.network.tangents import Moving, along, network_with_tangents
from gns.network.units import MIRROR, ScaledScene
from gns.rollout.traced_rollout import Trace, Until, finite_step, trace
from pipeline.cli import WorkFailed

SceneOf = Callable[[Tensor], ScaledScene]
"""The scene as a function of its parameters (p,)."""

Slopes = Mapping[int, np.ndarray]
"""Derivative of a reading by number of frame: (..., N, 2) [unit of the reading / m]."""

Loss = Callable[[np.ndarray], tuple[float, Slopes]]
"""Frames (T, N, 2) [m] -> a number and its derivative, (N, 2) for each frame it depends on."""

Readings = Callable[[np.ndarray], tuple[np.ndarray, Slopes]]
"""Frames (T, N, 2) [m] -> m numbers and their derivatives, (m, N, 2) for each frame."""

REVERSE_COST = 4
"""Steps that a step of the reverse mode costs: the rollout itself, the step again with its latents
kept, the edges' layers again, and the gradients (weights, being frozen, have none)."""

DIFFERENTIABLE = ("friction", "cohesion", "density", "phreatic_line")
"""Fields of a scene through which parameters act."""


def gradient(
    simulator: Simulator,
    scene_of: SceneOf,
    parameters: np.ndarray,
    window: np.ndarray,
    frames: int,
    loss: Loss,
    *,
    mode: Literal["cheaper", "reverse", "forward"] = "cheaper",
    graphs: Sequence[Graph] | None = None,
) -> tuple[float, np.ndarray, np.ndarray]:
    """A number read from a rollout, and its gradient.

    Args:
        simulator: the model; its weights are taken as fixed.
        scene_of: the scene as a function of the parameters.
        parameters: (p,).
        window: (history, N, 2) [m], the last at t = 0.
        frames: T, t = 0 among them.
        loss: the reading.
        mode: the cheaper of both, or one of them.
        graphs: edges to be used instead of those found, one for each step.

    Returns:
        the number; its gradient (p,); the frames (T, N, 2) [m].

    Raises:
        WorkFailed: the rollout, the reading or its gradient is not finite.
    """
    forward = mode == "forward" or (mode == "cheaper" and 1 + len(parameters) <= REVERSE_COST)
    with frozen(simulator):
        if forward:
            value, slope, seen = jacobian(
                simulator, scene_of, parameters, window, frames, _as_readings(loss), graphs=graphs
            )
            return float(value[0]), slope[0], seen
        value, slope, seen = reverse_jacobian(
            simulator, scene_of, parameters, window, frames, _as_readings(loss), graphs=graphs
        )
    return float(value[0]), slope[0], seen


def jacobian(
    simulator: Simulator,
    scene_of: SceneOf,
    parameters: np.ndarray,
    window: np.ndarray,
    frames: int,
    readings: Readings,
    *,
    graphs: Sequence[Graph] | None = None,
    until: Until | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers read from a rollout, and their derivatives, by forward mode.

    Args:
        simulator: the model; its weights are taken as fixed.
        scene_of: the scene as a function of the parameters.
        parameters: (p,).
        window: (history, N, 2) [m], the last at t = 0.
        frames: T, t = 0 among them.
        readings: the readings.
        graphs: edges to be used instead of those found, one for each step.
        until: ends the rollout before its last frame; None: never.

    Returns:
        the numbers (m,); their derivatives (m, p); the frames (T, N, 2) [m].

    Raises:
        WorkFailed: the rollout, a reading or a derivative is not finite.
    """
    history = simulator.config.history
    theta = _theta(simulator, parameters)
    with frozen(simulator):
        scene = scene_of(theta)
        directions = _scene_directions(scene_of, theta)
        first = scene.to_spacings(window)
        positions = first.new_empty(history - 1 + frames, *first.shape[1:])
        changes = first.new_zeros(len(theta), *positions.shape)
        positions[:history] = first
        for frame in range(frames - 1):
            stretch = slice(frame, frame + history)
            graph = simulator.graph(positions[frame + history - 1])
            if graphs is not None:
                graph = graphs[frame]
            after = _step_with_tangents(
                simulator,
                Moving(positions[stretch], changes[:, stretch]),
                scene,
                directions,
                graph,
            )
            positions[frame + history] = finite_step(after.value, frame + 1)
            changes[:, frame + history] = after.change
            if until is not None and until(after.value, positions[frame + history - 1]):
                positions = positions[: frame + history + 1]
                break
    seen = Trace(positions, scene, history).frames
    values, slopes = readings(seen)
    result = np.zeros((len(values), len(theta)))
    for frame, slope in slopes.items():
        moved = changes[:, history - 1 + frame].cpu().double().numpy() * scene.spacing
        result += np.einsum("mnk,pnk->mp", slope, moved)
    return np.asarray(values, float), _finite(result), seen


def reverse_jacobian(
    simulator: Simulator,
    scene_of: SceneOf,
    parameters: np.ndarray,
    window: np.ndarray,
    frames: int,
    readings: Readings,
    *,
    graphs: Sequence[Graph] | None = None,
    until: Until | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same as `jacobian` by reverse mode: one rollout, and a way back for each number.

    A number costs REVERSE_COST - 1 steps a frame, whatever the number of parameters. Arguments,
    results and errors are those of `jacobian`.
    """
    with frozen(simulator):
        theta = _theta(simulator, parameters).requires_grad_()
        scene = scene_of(theta)
        rolled = trace(simulator, _detached(scene), window, frames, graphs=graphs, until=until)
        seen = rolled.frames
        values, slopes = readings(seen)
        rows = []
        for number in range(len(values)):
            own = {frame: slope[number] for frame, slope in slopes.items()}
            pulled = _pull_back(simulator, rolled, own, graphs)
            rows.append(_to_parameters(scene, theta, pulled).detach().cpu().double().numpy())
    return np.asarray(values, float), _finite(np.reshape(rows, (len(values), len(theta)))), seen


@contextmanager
def frozen(simulator: Simulator) -> Iterator[None]:
    """While inside, no weight asks for a gradient."""
    asking = [parameter for parameter in simulator.parameters() if parameter.requires_grad]
    for parameter in asking:
        parameter.requires_grad_(False)
    try:
        yield
    finally:
        for parameter in asking:
            parameter.requires_grad_(True)


# -- reverse mode ---------------------------------------------------------------------------------


def _pull_back(
    simulator: Simulator, rolled: Trace, slopes: Slopes, graphs: Sequence[Graph] | None
) -> dict[str, Tensor]:
    """Gradient with respect to the fields of the scene, from the last step to the first."""
    scene, history = rolled.scene, rolled.history
    positions = rolled.positions
    waiting = {  # gradient with respect to frames that steps have still to be taken back from
        frame: torch.as_tensor(slope * scene.spacing).to(positions)
        for frame, slope in slopes.items()
    }
    totals: dict[str, Tensor] = {}
    for frame in range(len(positions) - history, 0, -1):
        arriving = waiting.pop(frame, None)
        if arriving is None:
            continue
        window = rolled.window(frame - 1).detach().requires_grad_()
        fields = {
            name: getattr(scene, name).detach().requires_grad_()
            for name in DIFFERENTIABLE
            if getattr(scene, name).numel()
        }
        graph = None if graphs is None else graphs[frame - 1]
        with torch.enable_grad():
            after = simulator.advance(window, replace(scene, **fields), graph)
        to_window, *to_fields = torch.autograd.grad(
            after, [window, *fields.values()], arriving, allow_unused=True
        )
        for place in range(history):
            earlier = frame - history + place
            if earlier >= 1:  # frames up to t = 0 are given
                held = waiting.get(earlier)
                part = to_window[place]
                waiting[earlier] = part.clone() if held is None else held + part
        for name, value in zip(fields, to_fields, strict=True):
            if value is not None:
                totals[name] = totals[name] + value if name in totals else value
    return totals


def _to_parameters(scene: ScaledScene, theta: Tensor, totals: dict[str, Tensor]) -> Tensor:
    """From the scene's fields to the parameters."""
    outputs = [(getattr(scene, name), value) for name, value in totals.items()]
    outputs = [(output, value) for output, value in outputs if output.requires_grad]
    if not outputs:
        return torch.zeros_like(theta)
    fields, values = zip(*outputs, strict=True)
    (result,) = torch.autograd.grad(fields, theta, values, allow_unused=True, retain_graph=True)
    return torch.zeros_like(theta) if result is None else result


def _detached(scene: ScaledScene) -> ScaledScene:
    return replace(scene, **{name: getattr(scene, name).detach() for name in DIFFERENTIABLE})


# -- forward mode ---------------------------------------------------------------------------------


def _scene_directions(scene_of: SceneOf, theta: Tensor) -> list[tuple[Tensor, ...]]:
    """Change of the scene's fields with each parameter, p tuples in the order DIFFERENTIABLE."""

    def fields(values: Tensor) -> tuple[Tensor, ...]:
        scene = scene_of(values)
        return tuple(getattr(scene, name) for name in DIFFERENTIABLE)

    units = torch.eye(len(theta), dtype=theta.dtype, device=theta.device)
    return [torch.func.jvp(fields, (theta,), (unit,))[1] for unit in units]


def _step_with_tangents(
    simulator: Simulator,
    window: Moving,
    scene: ScaledScene,
    directions: list[tuple[Tensor, ...]],
    graph: Graph,
) -> Moving:
    """The next positions (N, 2) and their changes (p, N, 2)."""

    def moved(output: Tensor, positions: Tensor) -> Tensor:
        return simulator.next_positions(output, positions[-2], positions[-1], scene)

    output = _output(simulator, window, scene, directions, graph)
    if simulator.config.symmetric:
        over = window.value.new_tensor(MIRROR)
        mirror = Moving(window.value * over, window.change * over)
        turned = _output(simulator, mirror, scene, directions, graph, turned=True)
        output = Moving(
            0.5 * (output.value + turned.value * over), 0.5 * (output.change + turned.change * over)
        )
    return along(
        moved,
        (output.value, window.value),
        list(zip(output.change, window.change, strict=True)),
    )


def _output(
    simulator: Simulator,
    window: Moving,
    scene: ScaledScene,
    directions: list[tuple[Tensor, ...]],
    graph: Graph,
    *,
    turned: bool = False,
) -> Moving:
    """Outputs of the network (N, 2) and their changes (p, N, 2).

    Args:
        simulator: the model.
        window: of the scene, or of its mirror image.
        scene: the scene itself.
        directions: changes of its fields.
        graph: the edges, the same in the mirror.
        turned: the window is that of the mirror image.
    """
    radius = simulator.config.radius
    fields = tuple(getattr(scene, name) for name in DIFFERENTIABLE)
    # What the pool has followed of the soil's motion counts as fixed.
    water = (scene.mirrored() if turned else scene).at(window.value[-1]).head_change

    def points(positions: Tensor, *changed: Tensor) -> Tensor:
        there = replace(scene, **dict(zip(DIFFERENTIABLE, changed, strict=True)))
        there = there.mirrored() if turned else there
        return simulator.point_features(positions, replace(there, head_change=water))

    def edges(positions: Tensor) -> Tensor:
        return edge_features(positions[-1], graph, radius)

    with_fields = [(change, *rest) for change, rest in zip(window.change, directions, strict=True)]
    of_points = along(points, (window.value, *fields), with_fields)
    of_edges = along(edges, (window.value,), [(change,) for change in window.change])
    fading = None
    if simulator.config.cutoff == "smooth":
        fading = along(fading_of, (of_edges.value,), [(change,) for change in of_edges.change])
    places = Moving(window.value[-1], window.change[:, -1])
    return network_with_tangents(simulator.network, of_points, of_edges, graph, fading, places)


# -- both -----------------------------------------------------------------------------------------


def _theta(simulator: Simulator, parameters: np.ndarray) -> Tensor:
    parameter = next(simulator.parameters())
    return torch.as_tensor(np.asarray(parameters, float)).to(parameter)


def _as_readings(loss: Loss) -> Readings:
    def readings(frames: np.ndarray) -> tuple[np.ndarray, Slopes]:
        value, slopes = loss(frames)
        return np.array([value]), {frame: slope[None] for frame, slope in slopes.items()}

    return readings


def _finite(values: np.ndarray) -> np.ndarray:
    if not np.isfinite(values).all():
        raise WorkFailed("a derivative of the rollout is not a finite number")
    return values
