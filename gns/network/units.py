"""A scene in the model's own units: everything the network sees is a plain number.

Lengths in point spacings d, time in sqrt(d / g), strength in rho g d, density in that of water: the
physics has no other scale (elastic stiffness apart), so one model serves any spacing. In: the facts
of a scene in SI units (`scene_facts`). Out: a `ScaledScene` of tensors, whose material properties
may carry gradients, and the way between metres and spacings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from gns.data.scene_facts import KINEMATIC, SceneFacts, head_line
from mpm_taichi.solver.water import WATER_DENSITY, MovingFace

MIRROR = (-1.0, 1.0)
"""What x and y are multiplied by in a mirror."""


@dataclass(frozen=True)
class ScaledScene:
    """A scene in the model's units: N points, P vertices of ground, L of the phreatic line.

    Attributes:
        spacing: d [m].
        gravity: g [m/s2].
        frame_interval: time between two frames [sqrt(d / g)].
        origin: (2,) float64 [m], the place that is (0, 0) in spacings: near the soil, so that
            single precision resolves its motion.
        kinematic: (N,) bool, points that stay where they are.
        friction: (N,) tangent of the friction angle.
        cohesion: (N,) c / (rho g d).
        density: (N,) rho / rho of water.
        ground: (P, 2) vertices, level beyond the ends.
        phreatic_line: (L, 2) vertices, level beyond the ends; (0, 2) without water.
        cell: edge of a cell of the simulation, over which the water's force sets in.
        thrust: whether the water pushes sideways where the line falls.
        stiffness: Young's modulus (mean of the soil) / (rho g d).
        low: (2,) lower left corner of the box of side walls and lid; infinite where it is open. Its
            floor is the ground.
        high: (2,) upper right corner.
        face: the pool's, in metres, where it follows the soil; `at` finds the head behind it.
        head_change: (k, 2) x and what the head there has risen above the phreatic line, level
            beyond its ends; None: it is the line.
    """

    spacing: float
    gravity: float
    frame_interval: float
    origin: np.ndarray
    kinematic: Tensor
    friction: Tensor
    cohesion: Tensor
    density: Tensor
    ground: Tensor
    phreatic_line: Tensor
    cell: float
    thrust: bool
    stiffness: float
    low: Tensor
    high: Tensor
    face: MovingFace | None = None
    head_change: Tensor | None = None

    @property
    def points(self) -> int:
        """Number of material points N."""
        return len(self.kinematic)

    def to_spacings(self, positions: np.ndarray) -> Tensor:
        """(..., 2) [m] -> spacings from the origin; subtracted in double precision."""
        scaled = (np.asarray(positions, np.float64) - self.origin) / self.spacing
        return torch.from_numpy(scaled).to(self.friction)

    def to_metres(self, positions: Tensor) -> np.ndarray:
        """The reverse of `to_spacings`, (..., 2) float64 [m]."""
        return positions.detach().cpu().double().numpy() * self.spacing + self.origin

    def at(self, positions: Tensor) -> ScaledScene:
        """The same with the head over points that are now at (N, 2) [spacings].

        The head follows the soil without a derivative; that of the phreatic line stays.
        """
        if self.face is None:
            return self
        line = head_line(self.face, self.to_metres(positions), self.cell * self.spacing)
        line[:, 1] -= np.interp(line[:, 0], self.face.line[:, 0], self.face.line[:, 1])
        line[:, 0] -= self.origin[0]
        return replace(self, head_change=torch.from_numpy(line / self.spacing).to(self.friction))

    def with_strength(
        self,
        points: Tensor,
        *,
        cohesion_pa: Tensor | float | None = None,
        tan_friction: Tensor | float | None = None,
    ) -> ScaledScene:
        """Other strengths of some points; what is given may carry a gradient.

        Args:
            points: (N,) bool.
            cohesion_pa: [Pa], a number or (N,); None: as it is.
            tan_friction: a number or (N,); None: as it is.
        """
        changed = self
        if cohesion_pa is not None:
            scaled = self._number(cohesion_pa) / self._strength_unit()
            changed = replace(changed, cohesion=torch.where(points, scaled, self.cohesion))
        if tan_friction is not None:
            given = self._number(tan_friction)
            changed = replace(changed, friction=torch.where(points, given, self.friction))
        return changed

    def with_density(self, points: Tensor, density: Tensor | float) -> ScaledScene:
        """Another density [kg/m3] of some points; their cohesion in Pa stays what it was."""
        new = torch.where(points, self._number(density) / WATER_DENSITY, self.density)
        return replace(self, density=new, cohesion=self.cohesion * self.density / new)

    def with_water_raised(self, rise_m: Tensor | float) -> ScaledScene:
        """The phreatic line moved up as a whole [m]; the change may carry a gradient."""
        rise = self._number(rise_m) / self.spacing
        upward = self.phreatic_line.new_tensor([0.0, 1.0])
        return replace(self, phreatic_line=self.phreatic_line + rise * upward)

    def to(self, *, dtype: torch.dtype | None = None, device: torch.device | str | None = None):
        """The same with tensors of another type or on another device."""
        moved = {
            name: value.to(device=device, dtype=dtype if value.is_floating_point() else None)
            for name, value in vars(self).items()
            if isinstance(value, Tensor)
        }
        return replace(self, **moved)

    def mirrored(self) -> ScaledScene:
        """The scene with left and right exchanged: x becomes -x."""
        over = self.ground.new_tensor(MIRROR)
        low, high = self.low.clone(), self.high.clone()
        low[0], high[0] = -self.high[0], -self.low[0]
        face = self.face
        if face is not None:
            line = face.line[::-1] * MIRROR + [2.0 * self.origin[0], 0.0]
            face = MovingFace(line, face.level, face.own_head, self.spacing)
        return replace(
            self,
            face=face,
            head_change=None,
            ground=self.ground.flip(0) * over,
            phreatic_line=self.phreatic_line.flip(0) * over,
            low=low,
            high=high,
        )

    def _number(self, value: Tensor | float) -> Tensor:
        return torch.as_tensor(value, dtype=self.friction.dtype, device=self.friction.device)

    def _strength_unit(self) -> Tensor:
        """Density x gravity x spacing of each point, (N,) [Pa]."""
        return self.density * (WATER_DENSITY * self.gravity * self.spacing)


def scaled(
    facts: SceneFacts,
    *,
    dtype: torch.dtype = torch.float32,
    device: torch.device | str = "cpu",
) -> ScaledScene:
    """The facts of a scene in the model's units."""
    spacing, gravity, numbers = facts.spacing, facts.gravity, facts.numbers
    origin = np.array([0.5 * (numbers["x_min"] + numbers["x_max"]), facts.ground[:, 1].min()])
    tangent, cohesion, density = facts.properties[:, :3].astype(np.float64).T
    soil = facts.type != KINEMATIC
    soil = soil if soil.any() else ~soil
    box = np.full((2, 2), np.inf)
    if not numbers["walls_open"]:
        box[1] = (np.array([numbers["x_max"], numbers["y_max"]]) - origin) / spacing
        box[0] = (numbers["x_min"] - origin[0]) / spacing, -np.inf
    else:
        box[0] = -np.inf

    def tensor(values: np.ndarray) -> Tensor:
        return torch.as_tensor(np.ascontiguousarray(values), dtype=dtype, device=device)

    return ScaledScene(
        spacing=spacing,
        gravity=gravity,
        frame_interval=facts.frame_interval,
        origin=origin,
        kinematic=torch.from_numpy(facts.type == KINEMATIC).to(device),
        friction=tensor(tangent),
        cohesion=tensor(cohesion / (density * gravity * spacing)),
        density=tensor(density / WATER_DENSITY),
        ground=tensor((facts.ground - origin) / spacing),
        phreatic_line=tensor((facts.phreatic_line - origin) / spacing),
        cell=numbers["cell"] / spacing,
        thrust=bool(numbers["thrust"]),
        stiffness=numbers["youngs_modulus"] / (density[soil].mean() * gravity * spacing),
        low=tensor(box[0]),
        high=tensor(box[1]),
        face=facts.moving_face(),
    )
