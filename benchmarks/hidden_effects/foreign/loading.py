"""What a code of particles has to apply: soil, strength, forces and ground at a moment.

In: a scene and what is hidden in it. Out: a `Loading`, of arrays over the particles, from which
every code makes the same slide. Compression is positive, forces are per mass, y is upward.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.hidden_effects.foreign.hidden import THINGS, Hidden, Thing, check
from geometry.scenes.fill import MaterialPoints, fill
from geometry.scenes.overburden import WATER_DENSITY, vertical_effective_stress
from geometry.scenes.scene import Scene

#: Points are moved by up to half of this many spacings before the slide, in x and in y.
JITTER = 0.5


@dataclass(frozen=True)
class Moment:
    """Particles at one moment of the slide.

    Attributes:
        time: since the liquefaction [s].
        position: (N, 2) [m]; velocity: (N, 2) [m/s].
        strain: plastic shear strain since then, (N,), as the largest less the least principal one.
        rate: of shear, the same of the rates of strain, (N,) [1/s].
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    strain: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class Loading:
    """A scene with what is hidden in it, for particles. N particles.

    Attributes:
        scene: with all that is hidden in its geometry, soils and water.
        hidden: all of it.
        seed: of the places of the points.
    """

    scene: Scene
    hidden: Sequence[Hidden]
    seed: int
    gravity: float = 9.81

    @classmethod
    def of(
        cls, scene: Scene, hidden: Sequence[Hidden], *, seed: int, jitter: float = JITTER
    ) -> Loading:
        """Put what is hidden into a scene.

        Raises:
            InputError: something cannot be hidden in this scene; one line.
        """
        true = scene.changed(effects={}, jitter=jitter, seed=seed)
        for one in hidden:
            check(one, scene)
            true = THINGS[one.name].scene(true, one)
        return cls(true, tuple(hidden), seed)

    @cached_property
    def points(self) -> MaterialPoints:
        """Particles before the slide."""
        return fill(self.scene)

    @cached_property
    def wet(self) -> np.ndarray:
        """Particles below the phreatic line before the slide, (N,) bool."""
        x, y = self.points.position.T
        return y < self.scene.phreatic_level(x)

    @cached_property
    def density(self) -> np.ndarray:
        """Of the soil with its water, (N,) [kg/m3]; it goes with the particle."""
        dry = self._soil("density")
        soils = self.scene.materials.values()
        soaked = [s.density if s.saturated_density is None else s.saturated_density for s in soils]
        return np.where(self.wet, np.array(soaked)[self.points.material], dry)

    @cached_property
    def friction(self) -> np.ndarray:
        """Angle of friction, (N,) [rad]."""
        return self._soil("friction_rad")

    @cached_property
    def youngs_modulus(self) -> np.ndarray:
        """(N,) [Pa]."""
        return self._soil("youngs_modulus_pa")

    @cached_property
    def poisson_ratio(self) -> np.ndarray:
        """(N,)."""
        return self._soil("poisson_ratio")

    @cached_property
    def liquefied(self) -> np.ndarray:
        """(N,) bool."""
        return self._soil("liquefied").astype(bool)

    @cached_property
    def overburden(self) -> np.ndarray:
        """Vertical effective stress before the slide, (N,) [Pa]."""
        volume = np.full(len(self.points), self.scene.spacing**2)
        mass, position = self.density * volume, self.points.position
        return vertical_effective_stress(self.scene, position, volume, mass, self.gravity)

    @cached_property
    def still(self) -> Moment:
        """The moment of the liquefaction."""
        n = len(self.points)
        return Moment(0.0, self.points.position, np.zeros((n, 2)), np.zeros(n), np.zeros(n))

    @property
    def settled(self) -> bool:
        """The section has come to rest under its weight before the liquefaction."""
        return all(thing.settled for thing in self._things)

    @property
    def base_share(self) -> float:
        """Strength of the contact with the ground, over that of the soil on it."""
        return float(np.prod([THINGS[one.name].base_share(one) for one in self.hidden]))

    @cached_property
    def changes(self) -> bool:
        """Strength changes with time, strain or rate: it is to be asked for at every step."""
        return any(thing.changes for thing in self._things)

    def cohesion(self, moment: Moment) -> np.ndarray:
        """Cohesion now, S_r where the soil has liquefied, (N,) [Pa]."""
        found = self._soil("cohesion_pa")
        for one in self.hidden:
            found = THINGS[one.name].cohesion(one, self, moment, found)
        return found

    def acceleration(self, moment: Moment) -> np.ndarray:
        """Force per mass on the particles in addition to gravity, (N, 2) [m/s2]."""
        found = self.buoyancy(moment)
        for one in self.hidden:
            found = found + THINGS[one.name].acceleration(one, self, moment)
        return found

    def buoyancy(self, moment: Moment) -> np.ndarray:
        """Of still water as high as the phreatic line, (N, 2) [m/s2]; it sets in over a cell."""
        x, y = moment.position.T
        cell = self.scene.cell_size
        level = self.scene.phreatic_level(x)
        upward = self.gravity * WATER_DENSITY / self.density
        share = np.clip((level - y) / cell + 0.5, 0.0, 1.0)
        return np.column_stack([np.zeros_like(x), upward * share])

    @property
    def _things(self) -> list[Thing]:
        return [THINGS[one.name] for one in self.hidden]

    def _soil(self, name: str) -> np.ndarray:
        """A property of its material at each particle, (N,)."""
        values = [getattr(soil, name) for soil in self.scene.materials.values()]
        return np.array(values, dtype=float)[self.points.material]
