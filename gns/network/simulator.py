"""The learned simulator: from the last positions of the points to the next (paper, Diff-GNS).

In: a window of positions and the facts of a scene. Out: where the points are one frame later. The
network gives the normalised acceleration; positions follow by

    x(t + 1) = 2 x(t) - x(t - 1) + a interval^2          (lengths d, time sqrt(d / g))

Kinematic points stay, soil stays out of ground and walls: in training, in a rollout and in a
back-analysis alike, as they all go through `Simulator.advance`. A model knows the ranges of the
features it was trained on, and `Simulator.outside` says what of a scene lies beyond them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from pydantic import Field, ValidationError
from torch import Tensor, nn

from gns.data.distance import KnownScenes
from gns.data.metadata import Metadata
from gns.data.ranges import MEANINGS, scene_ranges
from gns.data.scene_facts import CONTACTS, SceneFacts
from gns.network.features import (
    StrengthFeature,
    edge_features,
    fading_of,
    height_on_line,
    point_feature_names,
    point_features,
)
from gns.network.graph import Graph, joined, radius_graph
from gns.network.network import Network
from gns.network.units import MIRROR, ScaledScene, scaled
from pipeline.cli import InputError
from pipeline.config import SimulationSettings, describe_error
from pipeline.documents import StrictDocument
from pipeline.files import atomic_path

FORMAT_VERSION = 1
SINKING = 0.975
"""How far below ground that is not level a point may be, in cells: the deepest in 300 runs of
`coarse`, all of them blocks thrown onto uneven ground. On level ground none was below it."""
SAME_INTERVAL = 1e-3
"""Relative difference of two frame intervals that are taken for the same."""


class SimulatorConfig(StrictDocument):
    """Definition of a simulator, in addition to its weights; kept with them."""

    width: int = Field(128, ge=1, description="of latents and hidden layers")
    message_passing_steps: int = Field(10, ge=1)
    radius: float = Field(3.0, gt=0, description="connectivity radius [d]: 1.5 cells of 2 points")
    history: int = Field(6, ge=2, description="positions the model sees; 6: five velocities")
    cutoff: Literal["sharp", "smooth"] = Field(
        "sharp", description="messages end at the radius abruptly (paper), or fade before it"
    )
    strength: StrengthFeature = Field("log", description="how cohesion is given to the network")
    overburden: bool = Field(False, description="points know what lies above them")
    thrust: bool = Field(
        False, description="points feel the horizontal force of the water; from the data"
    )
    density: bool = Field(False, description="points know their density; from the data")
    stiffness: bool = Field(False, description="points know Young's modulus; from the data")
    grid_cell: float = Field(
        0.0, ge=0, description="cell of a coarse grid in addition to the edges [d]; 0: none (paper)"
    )
    grid_rounds: int = Field(3, ge=1, description="rounds of convolutions on that grid")
    grid_everywhere: bool = Field(
        False, description="such a grid between all message-passing steps, not halfway alone"
    )
    symmetric: bool = Field(
        False, description="a step is the mean of the answers for a scene and for its mirror image"
    )
    frame_interval: float = Field(0.4, gt=0, description="time of a step [sqrt(d / g)]")
    velocity_mean: tuple[float, float] = Field((0.0, 0.0), description="[sqrt(g d)]")
    velocity_std: tuple[float, float] = Field((1.0, 1.0), description="[sqrt(g d)]")
    acceleration_mean: tuple[float, float] = Field((0.0, 0.0), description="[g]")
    acceleration_std: tuple[float, float] = Field((1.0, 1.0), description="[g]")
    ranges: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="dimensionless ranges of the training, gns.data.ranges"
    )
    contacts: list[str] = Field(
        default_factory=list, description="kinds of ground in the training; empty: not known"
    )


class Simulator(nn.Module):
    """A network with its units, normalisation and ranges.

    Args:
        config: everything but the weights, which start at random.
    """

    def __init__(self, config: SimulatorConfig) -> None:
        super().__init__()
        self.config = config
        self.known: KnownScenes | None = None  # what it has learned from; None: it does not say
        self.network = Network(
            point_features=len(feature_names(config)),
            width=config.width,
            message_passing_steps=config.message_passing_steps,
            grid_cell=config.grid_cell,
            grid_rounds=config.grid_rounds,
            grid_everywhere=config.grid_everywhere,
        )
        for name in ("velocity_mean", "velocity_std", "acceleration_mean", "acceleration_std"):
            self.register_buffer(name, torch.tensor(getattr(config, name)), persistent=False)

    # -- one step ------------------------------------------------------------------------------

    def graph(self, positions: Tensor) -> Graph:
        """The edges between points at (N, 2) [spacings]."""
        return radius_graph(positions, self.config.radius)

    def forward(
        self,
        windows: Sequence[Tensor],
        scenes: Sequence[ScaledScene],
        graphs: Sequence[Graph] | None = None,
    ) -> Tensor:
        """Normalised accelerations of all points of several scenes, one after the other.

        Args:
            windows: of each scene, (history, N, 2) [spacings].
            scenes: the scenes.
            graphs: their edges; None: found.

        Returns:
            (sum of N, 2).
        """
        points, edges = [], []
        if graphs is None:
            graphs = [self.graph(window[-1]) for window in windows]
        for window, scene, graph in zip(windows, scenes, graphs, strict=True):
            points.append(self.point_features(window, scene.at(window[-1])))
            edges.append(edge_features(window[-1], graph, self.config.radius))
        features = torch.cat(edges)
        fading = fading_of(features) if self.config.cutoff == "smooth" else None
        places = [window[-1] for window in windows]
        return self.network(
            torch.cat(points), features, joined(graphs), fading=fading, places=places
        )

    def point_features(self, window: Tensor, scene: ScaledScene) -> Tensor:
        """Input features of the points of a scene whose water is `at` them, (N, features)."""
        return point_features(
            window,
            scene,
            radius=self.config.radius,
            velocity_mean=self.velocity_mean,
            velocity_std=self.velocity_std,
            strength=self.config.strength,
            overburden=self.config.overburden,
            thrust=self.config.thrust,
            density=self.config.density,
            stiffness=self.config.stiffness,
        )

    def advance(self, window: Tensor, scene: ScaledScene, graph: Graph | None = None) -> Tensor:
        """The positions one frame after a window, in spacings.

        Args:
            window: (history, N, 2) [spacings].
            scene: the scene.
            graph: the edges; None: found. Given where a gradient is to see the same edges again.

        Returns:
            (N, 2) [spacings].
        """
        output = self.output(window, scene, self.graph(window[-1]) if graph is None else graph)
        return self.next_positions(output, window[-2], window[-1], scene)

    def output(self, window: Tensor, scene: ScaledScene, graph: Graph) -> Tensor:
        """Normalised accelerations (N, 2) of one scene: what a rollout goes by.

        A symmetric model answers for the scene and for its mirror image, and this is the mean of
        the two: the errors that they do not share cancel in part. It learns from one of them at a
        time.
        """
        if not self.config.symmetric:
            return self([window], [scene], [graph])
        over = window.new_tensor(MIRROR)
        own, turned = self(
            [window, window * over], [scene, scene.mirrored()], [graph, graph]
        ).chunk(2)
        return 0.5 * (own + turned * over)

    def next_positions(
        self, normalised: Tensor, before: Tensor, now: Tensor, scene: ScaledScene
    ) -> Tensor:
        """Positions (N, 2) from the network's output and the last two positions [spacings]."""
        acceleration = normalised * self.acceleration_std + self.acceleration_mean
        moved = 2.0 * now - before + acceleration * scene.frame_interval**2
        return torch.where(scene.kinematic[:, None], now, kept_inside(moved, scene))

    def target(self, before: Tensor, now: Tensor, after: Tensor, scene: ScaledScene) -> Tensor:
        """The output that leads from two positions to a third: `next_positions` solved for it."""
        acceleration = (after - 2.0 * now + before) / scene.frame_interval**2
        return (acceleration - self.acceleration_mean) / self.acceleration_std

    def step(self, window: np.ndarray, facts: SceneFacts) -> np.ndarray:
        """The positions one frame after a window, in metres.

        Args:
            window: (..., history, N, 2) [m]; any number of windows of the same points.
            facts: of their scene.

        Returns:
            (..., N, 2) float64 [m].
        """
        scene = self.scaled(facts)
        scaled_window = scene.to_spacings(window)
        with torch.no_grad():
            flat = scaled_window.reshape(-1, *scaled_window.shape[-3:])
            after = torch.stack([self.advance(one, scene) for one in flat])
        return scene.to_metres(after).reshape(*window.shape[:-3], *window.shape[-2:])

    # -- scenes it may be asked about ------------------------------------------------------------

    def scaled(self, facts: SceneFacts) -> ScaledScene:
        """The facts of a scene in the model's units, type of number and device.

        Raises:
            InputError: its frames are another time apart than those of the training, or its water
                pushes sideways and the model does not know it.
        """
        if facts.numbers["thrust"] and not self.config.thrust:
            raise InputError(
                "simulation.water: pore_pressure with a phreatic line that is not level; this "
                "model knows water as reduced weight: allowed is buoyant"
            )
        own, asked = self.config.frame_interval, facts.frame_interval
        if abs(asked - own) > SAME_INTERVAL * own:
            raise InputError(
                f"simulation.frame_interval: {asked:g}; this model steps by {own:g} sqrt(d / g), "
                "as its training data: no other is allowed"
            )
        parameter = next(self.parameters())
        return scaled(facts, dtype=parameter.dtype, device=parameter.device)

    def settings(self, settings: SimulationSettings) -> SimulationSettings:
        """Settings of a simulation whose frames are as far apart as the model steps."""
        return settings.model_copy(update={"frame_interval": self.config.frame_interval})

    def stride_in(self, metadata: Metadata) -> int:
        """How many frames of packed data the model goes in one step.

        Raises:
            InputError: its step is not a whole number of them.
        """
        ratio = self.config.frame_interval / metadata.frame_interval
        stride = max(round(ratio), 1)
        if abs(ratio - stride) > SAME_INTERVAL * stride:
            raise InputError(
                f"this model steps by {self.config.frame_interval:g} sqrt(d / g); the frames of "
                f"these data are {metadata.frame_interval:g} apart: no whole number of them"
            )
        return stride

    def outside(self, positions: np.ndarray, facts: SceneFacts) -> list[str]:
        """Properties of a scene outside the ranges of the training, one sentence each.

        Args:
            positions: at t = 0, (N, 2) [m].
            facts: of the scene.
        """
        warnings = []
        for name, extremes in scene_ranges(positions, facts).items():
            if name not in self.config.ranges:
                continue
            low, high = self.config.ranges[name]
            slack = 1e-3 * max(abs(low), abs(high))
            warnings += [
                f"{MEANINGS[name]}: {value:.3g} is outside the training's range, "
                f"{low:.3g} to {high:.3g}"
                for value in dict.fromkeys(extremes)
                if not low - slack <= value <= high + slack
            ]
        contact = CONTACTS[int(facts.numbers["ground_contact"])]
        if self.config.contacts and contact not in self.config.contacts:
            known = ", ".join(self.config.contacts)
            warnings.append(f"ground contact {contact}: the training had {known} alone")
        if facts.numbers["walls_bonded"]:
            warnings.append("walls that hold the soil: the training had smooth ones")
        return warnings

    def distance(self, positions: np.ndarray, facts: SceneFacts) -> float | None:
        """Of a scene to those learned from, `KnownScenes.distance`; None: the model has no list.

        Args:
            positions: at t = 0, (N, 2) [m].
            facts: of the scene.
        """
        return None if self.known is None else self.known.distance(positions, facts)

    # -- files ---------------------------------------------------------------------------------

    def save(self, path: str | Path, **more: Any) -> None:
        """Write configuration and weights; `more` are further plain values or tensors."""
        document = {
            "format_version": FORMAT_VERSION,
            "config": self.config.model_dump_json(),
            "weights": self.state_dict(),
            **more,
        }
        if self.known is not None:
            document["known"] = {
                "features": torch.as_tensor(self.known.features, dtype=torch.float32),
                "spread": torch.as_tensor(self.known.spread, dtype=torch.float32),
                "unit": self.known.unit,
            }
        with atomic_path(path) as temporary:
            torch.save(document, temporary)

    @classmethod
    def load(cls, path: str | Path, device: torch.device | str = "cpu") -> Simulator:
        """Read what `save` wrote; nothing in the file is executed.

        Raises:
            InputError: no such file, damaged, or of another format.
        """
        return cls.from_document(read_document(path, device), str(path)).to(device)

    @classmethod
    def from_document(cls, document: Mapping[str, Any], source: str) -> Simulator:
        """The simulator in a file that `read_document` has read."""
        try:
            config = SimulatorConfig.model_validate(json.loads(document["config"]))
            simulator = cls(config)
            _check_weights(document["weights"], source)
            simulator.load_state_dict(document["weights"])
            simulator.known = _known(document.get("known"))
        except ValidationError as error:
            raise InputError(f"{source}: {describe_error(error, SimulatorConfig)}") from None
        except InputError:
            raise
        except (KeyError, RuntimeError, ValueError, TypeError) as error:
            raise InputError(f"{source}: is not a model of this program: {error}") from None
        return simulator


def feature_names(config: SimulatorConfig) -> list[str]:
    """Names of the input features of the points, in their order."""
    return point_feature_names(
        config.history,
        overburden=config.overburden,
        thrust=config.thrust,
        density=config.density,
        stiffness=config.stiffness,
    )


def _known(stored: Mapping[str, Any] | None) -> KnownScenes | None:
    """The scenes of a file's training; files of earlier versions have none."""
    if stored is None:
        return None
    features, spread = (stored[name].cpu().numpy().astype(float) for name in ("features", "spread"))
    return KnownScenes(features, spread, float(stored["unit"]))


def _check_weights(weights: Any, source: str) -> None:
    """Refuse values that are not weights or not finite: a rollout would end at once."""
    if not isinstance(weights, Mapping):
        raise InputError(f"{source}: weights: is {type(weights).__name__}, not names with tensors")
    for name, values in weights.items():
        if not isinstance(values, Tensor):
            raise InputError(f"{source}: weights: {name} is {type(values).__name__}, not a tensor")
        if not bool(torch.isfinite(values).all()):
            raise InputError(f"{source}: weights: {name} holds a value that is not finite")


def read_document(path: str | Path, device: torch.device | str = "cpu") -> dict[str, Any]:
    """Read a file of weights with `weights_only=True`.

    Raises:
        InputError: no such file, damaged, or of another format.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file")
    try:
        document = torch.load(path, map_location=device, weights_only=True)
    except Exception as error:  # pickle, zip and torch each have errors of their own
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is damaged or not a model: {first}") from None
    if not isinstance(document, dict) or document.get("format_version") != FORMAT_VERSION:
        raise InputError(f"{path}: is not a model of format {FORMAT_VERSION}")
    return document


def kept_inside(positions: Tensor, scene: ScaledScene) -> Tensor:
    """Positions (N, 2) [spacings] moved back out of the ground, side walls and lid.

    Ground that is not level is stepped in the simulation, and points sink into it a little.
    """
    boxed = torch.minimum(torch.maximum(positions, scene.low), scene.high)
    level = bool((scene.ground[:, 1] == scene.ground[0, 1]).all())
    floor = height_on_line(boxed[:, 0], scene.ground) - (0.0 if level else SINKING * scene.cell)
    return torch.stack([boxed[:, 0], torch.maximum(boxed[:, 1], floor)], dim=1)
