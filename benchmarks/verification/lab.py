"""A scene driven step by step: strengths, masses and forces changed while it moves.

`simulate` runs a scene unchanged from start to end. Limit loads and slow processes need changes
during the run: a strength lowered step by step, a footing pressed down, gravity tilted. `Lab` holds
one scene in the solver's own arrays and changes nothing in the physics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from geometry.scenes.scene import Scene, scene_from_mapping
from mpm_taichi import layout
from mpm_taichi.effects import kernel_effects
from mpm_taichi.flight import WATER_CHUNK
from mpm_taichi.materials.mohr_coulomb import material_constants
from mpm_taichi.solver import runtime
from mpm_taichi.solver.boundary import LEFT, NEAR, RIGHT
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernels import build_kernels
from pipeline.config import SimulationSettings

if TYPE_CHECKING:
    from collections.abc import Mapping

CHUNK = 8
"""Most frames advanced by one call of the solver."""


class Lab:
    """One scene in the solver, P moving points; every array is in the solver's order of points.

    Args:
        scene: the scene, or a mapping that is one. The grid does not grow: give it a closed domain.
        settings: how it is simulated; early stop, guards and duration have no effect here.
        options: fields of the settings to replace.

    The start settles as in `simulate`, within the first call of `run` (`run(0)` settles alone).
    """

    def __init__(
        self,
        scene: Scene | Mapping[str, object],
        settings: SimulationSettings | None = None,
        **options: object,
    ) -> None:
        self.scene = scene if isinstance(scene, Scene) else scene_from_mapping(scene)
        chosen = (settings or SimulationSettings()).model_dump() | options
        self.settings = SimulationSettings(**chosen)
        runtime.start("cpu", 1)
        kernels = build_kernels(
            affine=self.settings.transfer in ("affine_flip", "apic"),
            averaged=self.settings.volumetric_averaging,
            corrected=self.settings.volume_correction,
            effects=kernel_effects(self.scene),
        )
        self.prepared = prepare(self.scene, self.settings)
        if any(one.effect.between is not None for one in self.prepared.effects):
            raise ValueError(f"{self.scene.name}: a laboratory has no effects on the host")
        self.count = len(self.prepared.order)
        self.slots = runtime.Slots(
            1, self.count, self.prepared.grid.nodes, CHUNK, device="cpu", kernels=kernels
        )
        self.slots.admit(0, self.prepared)
        order = self.prepared.order
        self.material = self.prepared.points.material[order]
        """(P,) number of the material in `scene.material_names`."""
        self.zone = self.prepared.points.zone[order]
        """(P,) number of the zone."""
        self.start = self.prepared.points.position[order]
        """(P, 2) positions at t = 0 [m]."""
        self.frame_time = self.prepared.frame_time
        """Time of a frame [s]."""
        self.time = 0.0
        """Time since the start [s]."""

    # -- advancing ------------------------------------------------------------------------------

    def run(self, frames: int = 1) -> None:
        """Advance by this many frames; 0 settles the initial stress and moves nothing.

        Raises:
            RuntimeError: a point moved more than a cell in a step.
        """
        left = frames
        while True:
            part = min(left, CHUNK)
            if self.prepared.face is not None:
                part = min(left, WATER_CHUNK)
                if self.time > 0.0:
                    self.slots.lay_water(0, self.prepared.water_now(self.position))
            self.slots.integers[0, layout.FRAME_COUNT] = part
            self.slots.run()
            left -= part
            self.time += part * self.frame_time
            if self.slots.integers[0, layout.ALARM]:
                raise RuntimeError(f"{self.scene.name}: unstable at t = {self.time:.3g} s")
            if left == 0:
                return

    def set_frame_time(self, seconds: float) -> None:
        """Change the time of a frame [s]; a frame is one or more time steps."""
        self.frame_time = seconds
        self.slots.numbers[0, layout.FRAME_TIME] = seconds

    # -- changing the experiment ----------------------------------------------------------------

    def rows(self, material: str) -> np.ndarray:
        """Rows of the solver's material table that belong to a material (dry, saturated)."""
        return np.unique(self.prepared.row[self.of(material)])

    def of(self, material: str) -> np.ndarray:
        """Which points are of a material, (P,) bool."""
        return self.material == self.scene.material_names.index(material)

    def set_strength(
        self,
        material: str,
        *,
        friction_deg: float = 0.0,
        cohesion_kpa: float = 0.0,
        tension_cap_kpa: float | None = None,
    ) -> None:
        """Give a material another strength from now on; the cap as in `scenes.scene.Material`."""
        strength = material_constants(
            friction_angle=np.radians(friction_deg),
            cohesion=1e3 * cohesion_kpa,
            tension_cap=None if tension_cap_kpa is None else 1e3 * tension_cap_kpa,
        )
        for row in self.rows(material):
            self.slots.strength[row] = strength

    def reduce_strength(self, material: str, factor: float) -> None:
        """Strength of the scene divided by `factor`: c / F and tan(phi) / F."""
        soil = self.scene.materials[material]
        self.set_strength(
            material,
            friction_deg=float(np.degrees(np.arctan(np.tan(soil.friction_rad) / factor))),
            cohesion_kpa=soil.cohesion_kpa / factor,
            tension_cap_kpa=soil.tension_cap_kpa,
        )

    def set_gravity(self, gravity: float, *, tilt_deg: float = 0.0) -> None:
        """Set gravity [m/s2], turned by `tilt_deg` so that it pulls towards +x.

        The solver's gravity is vertical; the pull along x is a force per volume, laid where the
        solver keeps the force of water. It supposes one density everywhere (in a dry scene).
        """
        densities = {material.density for material in self.scene.materials.values()}
        if tilt_deg and (len(densities) > 1 or self.scene.has_water):
            raise ValueError("tilted gravity needs a dry scene of one density")
        angle = np.radians(tilt_deg)
        self.slots.numbers[0, layout.GRAVITY] = gravity * np.cos(angle)
        self.slots.surroundings[:, layout.WATER_X] = min(densities) * gravity * np.sin(angle)
        self.slots.kind |= NEAR  # every node is to be given the volume around it

    def hold_walls(self) -> None:
        """Let smooth walls hold the soil, as a plane of symmetry does; they let it go otherwise."""
        kind = self.slots.kind
        kind[(kind & (LEFT | RIGHT)) > 0] |= LEFT | RIGHT

    # -- reading --------------------------------------------------------------------------------

    @property
    def mass(self) -> np.ndarray:
        """Masses of the points, (P,) [kg/m]."""
        return self.prepared.mass

    @property
    def position(self) -> np.ndarray:
        """Positions, (P, 2) [m]."""
        grid = self.prepared.grid
        home = self.slots.home[: self.count]
        node = np.stack([home // grid.shape[1], home % grid.shape[1]], axis=1)
        return np.asarray(grid.origin) + grid.cell * (
            node + self.slots.motion[: self.count, : layout.VELOCITY_X]
        )

    @property
    def velocity(self) -> np.ndarray:
        """Velocities, (P, 2) [m/s]; writing into the array moves the points."""
        return self.slots.motion[: self.count, layout.VELOCITY_X :]

    @property
    def stress(self) -> np.ndarray:
        """Stress (xx, yy, zz, xy), (P, 4) [Pa], tension positive."""
        return self.slots.stress[: self.count].astype(float)

    @property
    def volume(self) -> np.ndarray:
        """Volumes of the points, (P,) [m2 per m]."""
        swelling = self.slots.history[: self.count, layout.VOLUMETRIC].astype(float)
        return self.prepared.volume * (1.0 + swelling)

    @property
    def plastic_shear_strain(self) -> np.ndarray:
        """Accumulated plastic shear strain, (P,)."""
        return self.slots.history[: self.count, layout.SHEAR].astype(float)

    @property
    def displacement(self) -> np.ndarray:
        """Displacements since t = 0, (P, 2) [m]."""
        return self.position - self.start

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy of all points [J/m]."""
        return 0.5 * float(self.mass @ np.sum(self.velocity.astype(float) ** 2, axis=1))

    @property
    def potential_energy(self) -> float:
        """Potential energy of all points in the vertical gravity [J/m], zero at y = 0."""
        gravity = float(self.slots.numbers[0, layout.GRAVITY])
        return gravity * float(self.mass @ self.position[:, 1])

    @property
    def steps(self) -> int:
        """Time steps done so far."""
        return int(self.slots.integers[0, layout.STEPS])
