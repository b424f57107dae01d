"""Facts of a scene that the learned simulator sees, in addition to the point positions.

In: a scene and the settings of its simulation, or a run of packed data. Out: `SceneFacts`, plain
arrays in SI units. Packing, training, rollout and back-analysis all go through this one type, so a
model sees at inference what it saw in training.

Shapes: N material points, P vertices of the ground, L of the phreatic line.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.scenes.fill import MaterialPoints, fill
from geometry.scenes.scene import MOHR_COULOMB
from geometry.sides import SIDES
from mpm_taichi.effects import effects_on
from mpm_taichi.solver.water import MovingFace, moving_face, water_force
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.fill import MaterialPoints
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

SOIL, KINEMATIC = 0, 1
"""Types of points: moved by the simulator; prescribed motion."""

PROPERTIES = ("tan_friction", "cohesion", "density", "body_force_x", "body_force_y", "head")
"""Columns of `SceneFacts.properties`: -, Pa, kg/m3, g, g, m (the last three at t = 0)."""

HEAD_MARGIN = 4
"""Half cells to either side of the soil for which the head is found."""

CONTACTS = ("rough", "no_slip", "coulomb")
"""Meaning of the number `ground_contact`: the place in this list."""

NUMBERS = (
    "spacing",  # between material points [m]
    "cell",  # of the simulation's grid [m]
    "frame_time",  # between two frames [s]
    "gravity",  # [m/s2]
    "x_min",  # left wall [m]
    "x_max",  # right wall [m]
    "y_max",  # top of the domain [m]
    "walls_open",  # 1: the domain grows, there are no walls
    "walls_bonded",  # 1: soil sticks to the side walls
    "ground_contact",  # place in CONTACTS
    "ground_friction",  # Coulomb coefficient; 0 for other contacts
    "youngs_modulus",  # mean over the soil points [Pa]
    "poisson_ratio",  # mean over the soil points
    "thrust",  # 1: where the phreatic line falls, the water pushes sideways as well
    "moving_face",  # 1: the pool follows the soil (`mpm_taichi.solver.water.MovingFace`)
    "pool_level",  # [m]; 0 without water
)
"""Names of `SceneFacts.numbers`, in the order in which they are stored."""


@dataclass(frozen=True)
class SceneFacts:
    """All that is known of a scene before it moves.

    Attributes:
        type: (N,) int8, SOIL or KINEMATIC.
        properties: (N, 6) float32, columns as in PROPERTIES.
        initial_velocity: (N, 2) float32 [m/s]; kinematic points keep theirs.
        zone: (N,) int16, place in the scene's zones; of no use to the simulator.
        ground: (P, 2) float64 [m], level beyond its ends.
        phreatic_line: (L, 2) float64 [m], level beyond its ends; (0, 2) without water.
        numbers: by the names of NUMBERS.
    """

    type: np.ndarray
    properties: np.ndarray
    initial_velocity: np.ndarray
    zone: np.ndarray
    ground: np.ndarray
    phreatic_line: np.ndarray
    numbers: Mapping[str, float]

    @property
    def points(self) -> int:
        """Number of material points N."""
        return len(self.type)

    @property
    def spacing(self) -> float:
        """Distance between material points d [m]: the unit of length."""
        return self.numbers["spacing"]

    @property
    def gravity(self) -> float:
        """Gravity g [m/s2]."""
        return self.numbers["gravity"]

    @property
    def frame_time(self) -> float:
        """Time between two frames [s]."""
        return self.numbers["frame_time"]

    @property
    def time_unit(self) -> float:
        """The unit of time sqrt(d / g) [s]."""
        return float(np.sqrt(self.spacing / self.gravity))

    @property
    def frame_interval(self) -> float:
        """Time between two frames in units of sqrt(d / g)."""
        return self.frame_time / self.time_unit

    @property
    def has_water(self) -> bool:
        """True where there is a pool or groundwater."""
        return len(self.phreatic_line) > 0

    def moving_face(self) -> MovingFace | None:
        """The face that the pool follows [m]; None where the water stays in place."""
        if not self.numbers["moving_face"]:
            return None
        head = self.properties[:, 5].astype(np.float64)
        return MovingFace(self.phreatic_line, self.numbers["pool_level"], head, self.spacing)

    def ground_height(self, x: np.ndarray) -> np.ndarray:
        """Elevation of the base [m] at `x` [m], any shape."""
        return np.interp(x, self.ground[:, 0], self.ground[:, 1])

    def body_force(self, positions: np.ndarray) -> np.ndarray:
        """Weight and force of the water per mass, over g: (0, -1) where there is no water.

        The water's part is that of the solver (`mpm_taichi.solver.water.water_force`) at the
        points: its lift and, with thrust, the push of a head that falls along x.

        Args:
            positions: of all points, (..., N, 2) [m].

        Returns:
            (..., N, 2).
        """
        force = np.zeros(positions.shape)
        force[..., 1] = -1.0
        if self.has_water:
            face = self.moving_face()
            frames = positions.reshape(-1, *positions.shape[-2:])
            water = np.stack([self._force_of_water(frame, face) for frame in frames])
            force += water.reshape(force.shape)
        return force

    def _force_of_water(self, positions: np.ndarray, face: MovingFace | None) -> np.ndarray:
        """Its force per mass at (N, 2) [m], over g, (N, 2)."""
        line, cell = self.phreatic_line, self.numbers["cell"]
        if face is not None:
            line = head_line(face, positions, cell)
        x, fall = positions[:, 0], 0.0

        def level(x: np.ndarray) -> np.ndarray:
            return np.interp(x, line[:, 0], line[:, 1])

        if self.numbers["thrust"]:
            fall = (level(x - 0.5 * cell) - level(x + 0.5 * cell)) / cell
        push = water_force(level(x), fall, positions[:, 1], cell, 1.0)
        return np.stack(push, axis=-1) / self.properties[:, 2, None]

    def stored_numbers(self) -> np.ndarray:
        """`numbers` as (len(NUMBERS),) float64."""
        return np.array([self.numbers[name] for name in NUMBERS], dtype=np.float64)


def head_line(face: MovingFace, positions: np.ndarray, cell: float) -> np.ndarray:
    """The head over points that have moved, as a line (k, 2) [m] with a vertex each half cell.

    Args:
        face: of their scene.
        positions: of all points now, (N, 2) [m].
        cell: of the simulation's grid [m].
    """
    if not np.isfinite(positions).all():  # of a rollout that has failed
        return face.line
    half = 0.5 * cell
    low, high = np.floor(positions[:, 0].min() / half), np.ceil(positions[:, 0].max() / half)
    places = half * np.arange(low - HEAD_MARGIN, high + HEAD_MARGIN + 1.0)
    return np.stack([places, face.head(places, positions.astype(np.float64))], axis=1)


def start_of(
    scene: Scene, settings: SimulationSettings, points: MaterialPoints | None = None
) -> tuple[SceneFacts, np.ndarray]:
    """Facts of a scene, and where its points are before it moves.

    Args:
        scene: the scene.
        settings: of its simulation: gravity, frame interval, walls, water.
        points: that fill it; None: it is filled here.

    Returns:
        the facts; positions (N, 2) float64 [m].

    Raises:
        InputError: the scene holds what no learned simulator of ours has been shown.
    """
    check_base_physics(scene, "the learned simulator")
    points = fill(scene) if points is None else points
    materials = list(scene.materials.values())
    number = points.material
    soaked = points.position[:, 1] < scene.phreatic_level(points.position[:, 0])
    density = np.where(
        soaked,
        np.array([m.saturated_density or m.density for m in materials])[number],
        np.array([m.density for m in materials])[number],
    )
    head = np.zeros(len(points))
    if scene.has_water:
        head = scene.phreatic_level(points.position[:, 0])
    properties = np.column_stack(
        [
            np.array([np.tan(m.friction_rad) for m in materials])[number],
            np.array([m.cohesion_pa for m in materials])[number],
            density,
            np.zeros((len(points), 2)),
            head,
        ]
    ).astype(np.float32)
    facts = SceneFacts(
        type=np.where(points.kinematic, KINEMATIC, SOIL).astype(np.int8),
        properties=properties,
        initial_velocity=points.velocity.astype(np.float32),
        zone=points.zone.astype(np.int16),
        ground=np.array(scene.ground.points, dtype=np.float64),
        phreatic_line=_phreatic_line(scene),
        numbers=_numbers(scene, settings, points),
    )
    properties[:, 3:5] = facts.body_force(points.position)
    return facts, points.position


def before(
    positions: np.ndarray, initial_velocity: np.ndarray, frame_time: float, frames: int
) -> np.ndarray:
    """Frames before t = 0: equal ones at rest, else the initial velocity extrapolated backwards.

    Args:
        positions: at t = 0, (N, 2) [m].
        initial_velocity: (N, 2) [m/s].
        frame_time: between two frames [s].
        frames: how many.

    Returns:
        (frames, N, 2) float32 [m], the last of them one frame before t = 0.
    """
    back = np.arange(frames, 0, -1)[:, None, None]
    return (positions - back * frame_time * initial_velocity).astype(np.float32)


def first_window(positions: np.ndarray, facts: SceneFacts, history: int = 6) -> np.ndarray:
    """The window from which a rollout starts: `before` t = 0 and t = 0 itself.

    Args:
        positions: at t = 0, (N, 2) [m].
        facts: of the scene.
        history: frames of the window, 6 in the paper (5 velocities).

    Returns:
        (history, N, 2) float32 [m], the last at t = 0.
    """
    earlier = before(positions, facts.initial_velocity, facts.frame_time, history - 1)
    return np.concatenate([earlier, np.asarray(positions, np.float32)[None]])


def with_known_water(
    scene: Scene, settings: SimulationSettings, *, thrust: bool
) -> tuple[SimulationSettings, str]:
    """Settings whose water a model knows, and in words what that leaves out, or "".

    Args:
        scene: the scene.
        settings: of its simulation.
        thrust: whether the model knows the thrust of water (`SimulatorConfig.thrust`).
    """
    if thrust or not _thrusts(scene, settings):
        return settings, ""
    return settings.model_copy(update={"water": "buoyant"}), (
        "this learned simulator knows water as reduced weight alone: its answers leave out the "
        "thrust of the pool, as do the runs of the material point method they are compared with"
    )


def _thrusts(scene: Scene, settings: SimulationSettings) -> bool:
    """Whether the water pushes sideways."""
    return scene.head_falls and settings.water == "pore_pressure"


def check_base_physics(scene: Scene, model: str, *, known: Collection[str] = ()) -> None:
    """Refuse effects, strength ratios, other laws and far boundaries: no learned model knows them.

    Args:
        scene: the section.
        model: words for what would answer.
        known: effects that it knows all the same.

    Raises:
        InputError: one line.
    """
    if on := [one.effect.name for one in effects_on(scene) if one.effect.name not in known]:
        raise InputError(
            f"{scene.name}: effects: {on[0]} is on; {model} knows the base physics alone"
        )
    if any(soil.strength_ratio is not None for soil in scene.materials.values()):
        raise InputError(
            f"{scene.name}: materials: strength_ratio: {model} has never seen strength that grows "
            "with depth; take the material point method (engine mpm)"
        )
    if scene.law != MOHR_COULOMB:
        raise InputError(f"{scene.name}: law: {scene.law}; {model} knows {MOHR_COULOMB} alone")
    if far := [side for side in SIDES if scene.domain.goes_on(side)]:
        raise InputError(
            f"{scene.name}: the ground goes on to the {far[0]}; {model} knows sections that end in "
            "a foot; take the material point method (engine mpm)"
        )


def _phreatic_line(scene: Scene) -> np.ndarray:
    if not scene.has_water:
        return np.zeros((0, 2))
    line = scene.phreatic_line
    if line is None:
        ends = (scene.domain.x_min, scene.domain.x_max)
        line = [(x, scene.water_level) for x in ends]
    return np.array(line, dtype=np.float64)


def _numbers(
    scene: Scene, settings: SimulationSettings, points: MaterialPoints
) -> dict[str, float]:
    gravity = settings.gravity_m_per_s2
    materials = list(scene.materials.values())
    material, kinematic = points.material, points.kinematic
    soil = material if kinematic.all() else material[~kinematic]
    numbers = {
        "spacing": scene.spacing,
        "cell": scene.cell_size,
        "frame_time": settings.frame_interval * np.sqrt(scene.spacing / gravity),
        "gravity": gravity,
        "x_min": scene.domain.x_min,
        "x_max": scene.domain.x_max,
        "y_max": scene.domain.y_max,
        "walls_open": scene.domain.walls == "open",
        "walls_bonded": settings.wall_contact == "no_slip",
        "ground_contact": CONTACTS.index(scene.ground.contact),
        "ground_friction": scene.ground.friction_coefficient or 0.0,
        "youngs_modulus": np.mean(np.array([m.youngs_modulus_pa for m in materials])[soil]),
        "poisson_ratio": np.mean(np.array([m.poisson_ratio for m in materials])[soil]),
        "thrust": _thrusts(scene, settings),
        "moving_face": moving_face(scene, settings, points.position) is not None,
        "pool_level": scene.water_level or 0.0,
    }
    return {name: float(numbers[name]) for name in NUMBERS}
