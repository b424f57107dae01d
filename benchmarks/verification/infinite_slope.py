"""A slab of soil on a plane, long enough to be an infinite slope, and its factor of safety.

Formula (thickness z measured vertically, slope b, unit weight gamma):

    F = (c + gamma z cos^2 b tan phi) / (gamma z sin b cos b).                               (1)

Ends. The slab ends in free tapers, so no wall pushes or holds it. Sliding as a whole it
has F_whole, (1) with the whole base and the smaller weight, exactly. The uniform middle alone
needs F of (1) and can lean on the ends, so the answer lies between F and F_whole; the slab is made
so long that these differ by a few per cent.

Which strength does a slip plane have? (1) takes c + sigma tan(phi): the plane with the greatest
obliquity. Soil with psi = 0 that shears along a plane keeps its volume, so its strain has no
component normal to or along the plane; flow along the axes of stress then makes the plane the one
of the greatest shear stress, which is the radius of Mohr's circle: c cos(phi) + sigma sin(phi)
(Davis 1968). With both strengths divided by F, tan(phi_F) = tan(phi) / F, that gives

    F' = F cos(phi_F).                                                                       (2)

The stress out of the plane lies between the two others there and changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from benchmarks.verification.lab import Lab
from mpm_taichi.solver.water import WATER_DENSITY

DENSITY, GRAVITY = 2000.0, 9.81
LENGTH, THICKNESS = 60.0, 3.0
"""Of the base along the slope, and of the slab normal to it [m]."""
BACK_TAPER = 0.5
"""Length of the upper taper, in thicknesses."""
STEP = 0.02
"""F grows by this share from stage to stage. The result depends on it by a few per cent: each
loss of strength gives a push, and a slab that weakens slowly flattens and stands longer."""
LOOK_S, LOOKS = 2.0, 15
"""Time between two looks at a stage [s], and how many there are at most."""
AT_REST, GONE = 0.002, 0.4
"""Sliding between two looks that is rest, and in a stage that is failure, in thicknesses."""

SLIP = 0.1
"""Sliding in a stage that is a slip of the whole slab, in thicknesses."""


@dataclass(frozen=True)
class Slab:
    """A slab.

    `level`: drawn on level ground, with gravity tilted instead of the ground; `submerged`: under
    still water, which gamma is then the submerged unit weight of.
    """

    friction_deg: float
    cohesion_ratio: float  # c / (gamma z)
    contact: str
    level: bool
    spacing: float = 0.25  # m
    slope_deg: float = 20.0
    submerged: bool = False

    @property
    def slope(self) -> float:
        """Angle b [rad]."""
        return float(np.radians(self.slope_deg))

    @property
    def front_taper(self) -> float:
        """Length of the lower taper in thicknesses: gentle where friction must hold it."""
        return 3.0 if self.friction_deg else 0.5

    @property
    def formula(self) -> float:
        """F by (1)."""
        return self._factor(LENGTH * THICKNESS)

    @property
    def whole(self) -> float:
        """F_whole."""
        return self._factor(
            LENGTH * THICKNESS - 0.5 * (BACK_TAPER + self.front_taper) * THICKNESS**2
        )

    def dry(self) -> Slab:
        """The same slab without water, and the same F."""
        return replace(self, submerged=False)

    def _factor(self, area: float) -> float:
        """F of a slab of this area [m2] on the whole base."""
        cohesion = self.cohesion_ratio * THICKNESS / np.cos(self.slope) * LENGTH / area
        friction = np.cos(self.slope) * np.tan(np.radians(self.friction_deg))
        return float((cohesion + friction) / np.sin(self.slope))

    def without_dilation(self, factor: float) -> float:
        """F' by (2) of a factor by (1)."""
        tangent = np.tan(np.radians(self.friction_deg))
        return brentq(
            lambda f: f - factor * np.cos(np.arctan(tangent / f)), 0.1 * factor, factor + 1
        )

    def scene(self) -> dict:
        """The slab as a scene, falling to the right."""
        outline = np.array([
            [0, 0], [LENGTH, 0], [LENGTH - self.front_taper * THICKNESS, THICKNESS],
            [BACK_TAPER * THICKNESS, THICKNESS],
        ])  # fmt: skip
        b = 0.0 if self.level else self.slope
        room = 15.0
        foot = np.array([4.0, (LENGTH + room) * np.sin(b)])
        outline = foot + outline @ np.array([[np.cos(b), -np.sin(b)], [np.sin(b), np.cos(b)]])
        right = float(np.ceil(4.0 + (LENGTH + room) * np.cos(b)))
        ground = [[x, float(foot[1] - (x - foot[0]) * np.tan(b))] for x in (0.0, right)]
        height = THICKNESS / np.cos(self.slope)
        density = DENSITY - WATER_DENSITY * self.submerged
        surface = float(foot[1] + THICKNESS)
        return {
            "name": f"slab, phi {self.friction_deg:g}, {self.contact}",
            "domain": {"x_min": 0, "x_max": right, "y_max": surface + 3},
            "ground": {"points": ground, "contact": self.contact},
            "zones": [{"name": "slab", "polygon": outline.tolist(), "material": "soil"}],
            "materials": {
                "soil": {
                    "friction_deg": self.friction_deg,
                    "cohesion_kpa": self.cohesion_ratio * density * GRAVITY * height / 1e3,
                    "density": DENSITY,
                    "youngs_modulus_mpa": 30,
                    "poisson_ratio": 0.3,
                }
            },
            "water_level": surface + 2 if self.submerged else None,
            "spacing": self.spacing,
        }


@dataclass
class Stages:
    """A slab whose strength fell in stages; K stages."""

    slab: Slab
    factor: np.ndarray  # (K,) F of each stage; the slab failed in the last
    slid: np.ndarray  # (K,) sliding in each stage, in thicknesses
    on_plane: tuple[float, float]
    """Shear stress in the sliding soil next to the base over its strength on the plane: by
    c + sigma tan(phi), and by c cos(phi) + sigma sin(phi)."""
    position: np.ndarray  # (P, 2) at the end [m]
    displacement: np.ndarray  # (P, 2) at the end [m]

    @property
    def found(self) -> float:
        """F halfway between the last stage that came to rest and the one that failed."""
        return float(self.factor[-1] / np.sqrt(1.0 + STEP))

    @property
    def slips(self) -> float:
        """F at which a stage first slides by `SLIP`, between stages by the logarithm of sliding.

        Smooth where `found` jumps by a stage when a slab stops just short of `GONE`: for comparing
        two slabs.
        """
        last = int(np.argmax(self.slid > SLIP))
        pair = slice(last - 1, last + 1)
        return float(np.interp(np.log(SLIP), np.log(self.slid[pair]), self.factor[pair]))


def lower_in_stages(slab: Slab, start: float) -> Stages:
    """Lower the strength from `start` x (2) stage by stage until the slab slides away.

    A slab may slip a little and come to rest again, so a first slip does not show failure. A stage
    is watched until the slab rests or is gone; one that still creeps after `LOOKS` looks has
    failed.

    Raises:
        RuntimeError: the slab still stands at 1.4 x (2).
    """
    lab = Lab(slab.scene())
    if slab.level:
        lab.set_gravity(GRAVITY, tilt_deg=slab.slope_deg)
    lab.run(0)
    middle = np.abs(lab.start[:, 0] - lab.start[:, 0].mean()) < THICKNESS
    expected = slab.without_dilation(slab.formula)
    factors, slid = [start * expected], []
    while factors[-1] < 1.4 * expected:
        lab.reduce_strength("soil", factors[-1])
        rests, way = watch(lab, middle)
        slid.append(way)
        if not rests:
            return Stages(
                slab=slab,
                factor=np.array(factors),
                slid=np.array(slid),
                on_plane=stress_on_plane(lab, slab, factors[-1]),
                position=lab.position,
                displacement=lab.displacement,
            )
        factors.append(factors[-1] * (1.0 + STEP))
    raise RuntimeError(f"{lab.scene.name}: stands at F = {factors[-1]:.3g}")


def watch(lab: Lab, middle: np.ndarray) -> tuple[bool, float]:
    """Wait until the slab rests or is gone; returns (it rests, how far it slid, thicknesses)."""
    frames = round(LOOK_S / lab.frame_time)
    begin = place = lab.position[middle].mean(axis=0)
    for _ in range(LOOKS):
        lab.run(frames)
        last, place = place, lab.position[middle].mean(axis=0)
        way = float(np.hypot(*(place - begin))) / THICKNESS
        if np.hypot(*(place - last)) < AT_REST * THICKNESS:
            return True, way
        if way > GONE:
            break
    return False, way


def stress_on_plane(lab: Lab, slab: Slab, factor: float) -> tuple[float, float]:
    """Shear stress over strength on planes along the base, in the lowest cell of the middle."""
    b = 0.0 if slab.level else slab.slope
    ground = lab.scene.ground.height(lab.position[:, 0])
    above = (lab.position[:, 1] - ground) * np.cos(b)
    near = np.abs(lab.start[:, 0] - lab.start[:, 0].mean()) < 2.0 * THICKNESS
    xx, yy, _, xy = lab.stress[near & (above < lab.scene.cell_size)].mean(axis=0)
    normal = -(xx * np.sin(b) ** 2 + yy * np.cos(b) ** 2 + 2.0 * xy * np.sin(b) * np.cos(b))
    shear = (xx - yy) * np.sin(b) * np.cos(b) + xy * (np.cos(b) ** 2 - np.sin(b) ** 2)
    soil = lab.scene.materials["soil"]
    friction, cohesion = np.arctan(np.tan(soil.friction_rad) / factor), soil.cohesion_pa / factor
    coulomb = cohesion + normal * np.tan(friction)
    return abs(shear) / coulomb, abs(shear) / (coulomb * np.cos(friction))
