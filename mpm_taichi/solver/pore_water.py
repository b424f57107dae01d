"""Excess pore pressure that flows: Darcy's law on the cells of the grid, between chunks of a run.

Each point carries the excess pressure u of its water, over still water. The stress that the kernels
carry is that of soil and excess water together, so that s - u is the effective mean stress in the
plane. Over a chunk of time the water of a saturated point does three things:

1. undrained: u takes a change of s (B = 1), and what the soil would contract by in shear or, where
   it is liquefied, under its own weight: S du = S ds + d(contraction). Soil that does not liquefy
   dilates in shear instead, until its water cavitates (at an absolute pressure of 0, so deeper
   water can fall further) or it has reached its critical state;
2. Darcy: S du/dt = div(k / gamma_w grad u), an implicit step (backward Euler) on square cells; u is
   0 at free faces, in dry soil and in the pool, and nothing flows through the base, far boundaries,
   fixed bodies and soil without a permeability;
3. it sets the strength of the chunk that follows: see `effects.pore_water`.

S = 1/M + n/K_w is the storage: confined compression of the skeleton and of the water in its pores.
Total stress does not change with the flow (Terzaghi and Rendulic), and the volume of the points
neither: the settlement is read from the water that has left.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.sides import SIDES, outward_of
from mpm_taichi.effects.framework.between import RENEWED
from mpm_taichi.effects.framework.free_water import SUCTION
from mpm_taichi.layout import XX, XY, YY
from mpm_taichi.solver.water import WATER_DENSITY

if TYPE_CHECKING:
    from collections.abc import Callable

    from geometry.scenes.scene import Material, Scene
    from mpm_taichi.effects.framework.between import PointsNow, SettledPoints

WATER_BULK_MODULUS = 2.2e9
"""Of water [Pa]."""
POROSITY = 0.4
"""n of the soils; the water in it is a hundredth of the storage or less."""
FLUID = 1e-3
"""Effective stress below this share of the mean stress at the start: the grains hang in water."""
TOLERANCE = 1e-10
"""Of the implicit step: largest error of a pressure over the largest pressure."""
ENOUGH = 1e-5
"""The same where `MOST_TURNS` did not reach `TOLERANCE`; beyond it the run is given up."""
MOST_TURNS = 2000
"""Of conjugate gradients."""
MOST_SWITCHES = 20
"""Solutions of one step in which cells are held at their pressure or let go."""
SOFTER, SOFTENED = 0.05, 0.01
"""Water has work left while more than the second share of the soil will yet lack strength, by more
than the first share of its mean stress."""
LOOKS = 12
"""Steps, each twice as long as the one before, in which it is looked what water will yet do."""
OWN_FRICTION, NO_PART = 2.0, -1.0
"""Instead of a sine: the soil's own friction; a point whose water does not flow."""


@dataclass(frozen=True)
class PorousSoil:
    """What the P moving points are to the water.

    Attributes:
        volume: (P,) [m2].
        storage: (P,) S [1/Pa].
        permeability: (P,) k [m/s]; 0: no water flows through it.
        wet: (P,) bool, saturated.
        contraction: (P,) volumetric strain that a soil loses as it reconsolidates from liquefaction
            [-]; of soil that does not liquefy that up to its critical state, negative: it dilates.
        per_shear: (P,) the same of plastic shear strain, as long as any of it is left.
        loose: (P,) bool, it liquefies.
        ratio: (P,) r_u at t = 0, excess pressure over mean stress [-].
        sine: (P,) sin(phi') of soil that liquefies, sin(phi) of the others.
        least: (P,) strength without effective stress [Pa]: S_r, or c cos(phi).
    """

    volume: np.ndarray
    storage: np.ndarray
    permeability: np.ndarray
    wet: np.ndarray
    contraction: np.ndarray
    per_shear: np.ndarray
    loose: np.ndarray
    ratio: np.ndarray
    sine: np.ndarray
    least: np.ndarray

    @property
    def takes_part(self) -> np.ndarray:
        """Points whose water flows, (P,) bool."""
        return self.wet & (self.permeability > 0.0)

    def strength(self, effective: np.ndarray) -> np.ndarray:
        """Largest shear stress (P,) [Pa] under an effective mean stress (P,) [Pa]."""
        frictional = effective * self.sine
        return np.where(self.loose, np.maximum(self.least, frictional), self.least + frictional)


def constrained_modulus(soil: Material) -> float:
    """M = lambda + 2 G [Pa]."""
    nu = soil.poisson_ratio
    return soil.youngs_modulus_pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))


@dataclass(frozen=True)
class Volumes:
    """What soil loses or gains of its volume; the numbers are those of `effects.pore_water`."""

    contraction: float
    contractancy: float
    dilation: float
    dilatancy: float


def porous_soil(
    scene: Scene, settled: SettledPoints, factor: float, ratio: float, volumes: Volumes
) -> PorousSoil:
    """The soil of a scene: permeabilities times a factor, r_u of what liquefies, and volumes."""
    soils = settled.soils
    own = np.array([factor * (soil.permeability_m_per_s or 0.0) for soil in soils])
    storage = np.array(
        [1.0 / constrained_modulus(s) + POROSITY / WATER_BULK_MODULUS for s in soils]
    )
    loose = np.array([soil.liquefied for soil in soils])
    friction = np.array([_drained_friction(soil) for soil in soils])
    least = np.array([s.cohesion_pa for s in soils]) * np.where(loose, 1.0, np.cos(friction))
    x, y = settled.position.T
    row = settled.row
    return PorousSoil(
        volume=settled.volume,
        storage=storage[row],
        permeability=own[row],
        wet=y < scene.phreatic_level(x),
        contraction=np.where(loose, volumes.contraction, -volumes.dilation)[row],
        per_shear=np.where(loose, volumes.contractancy, -volumes.dilatancy)[row],
        loose=loose[row],
        ratio=np.array([_initial_ratio(soil, ratio) for soil in soils])[row],
        sine=np.sin(friction)[row],
        least=least[row],
    )


def _initial_ratio(soil: Material, liquefied: float) -> float:
    """r_u at t = 0; `liquefied` where soil that liquefies does not state its own."""
    if soil.excess_pressure_ratio is not None:
        return soil.excess_pressure_ratio
    return liquefied if soil.liquefied else 0.0


def _drained_friction(soil: Material) -> float:
    """Drained friction angle [rad]; 0 of soil that liquefies and is stated no strength before."""
    if not soil.liquefied:
        return soil.friction_rad
    return soil.pre_failure.friction_rad if soil.pre_failure else 0.0


class FlowStep(NamedTuple):
    """A step of the flow through n x m cells.

    Attributes:
        pressure: after the step (n, m) [Pa].
        used: supply that was used (n, m) [m2].
        expelled: water that has left through drained faces [m2].
        solved: False where `MOST_TURNS` or `MOST_SWITCHES` were not enough for `ENOUGH`.
    """

    pressure: np.ndarray
    used: np.ndarray
    expelled: float
    solved: bool


@dataclass(frozen=True)
class Cells:
    """Square cells around the soil, one ring beyond it, as water flows through them.

    Attributes:
        place: (T,) number of the cell of each point that takes part.
        storage: (n, m) [m2/Pa] of the water in a cell; 0 where none flows.
        across: (n - 1, m) flow to the right-hand neighbour per difference of pressure [m2/(Pa s)].
        upward: (n, m - 1) the same to the neighbour above.
        drained: (n, m) the same to where u = 0.
        evening: (n, m) rate at which a wave as long as a cell fades in it [1/s].
    """

    place: np.ndarray
    storage: np.ndarray
    across: np.ndarray
    upward: np.ndarray
    drained: np.ndarray
    evening: np.ndarray

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sums over the points of each cell, (n, m); `values` (T,) are of the points."""
        total = np.bincount(self.place, weights=values, minlength=self.storage.size)
        return total.reshape(self.storage.shape)

    def at_points(self, values: np.ndarray) -> np.ndarray:
        """Values (n, m) of the cells at the points that take part, (T,)."""
        return values.ravel()[self.place]

    def flow(self, pressure: np.ndarray) -> np.ndarray:
        """Water that leaves each cell [m2/s] under `pressure` (..., n, m) [Pa]."""
        right = self.across * (pressure[..., :-1, :] - pressure[..., 1:, :])
        up = self.upward * (pressure[..., :-1] - pressure[..., 1:])
        out = self.drained * pressure
        out[..., :-1, :] += right
        out[..., 1:, :] -= right
        out[..., :-1] += up
        out[..., 1:] -= up
        return out

    def advance(
        self, pressure: np.ndarray, dt: float, supply: np.ndarray | None = None
    ) -> FlowStep:
        """A step of backward Euler.

        Args:
            pressure: (n, m) [Pa]; 0 where no water flows.
            dt: [s].
            supply: (n, m) water [m2] by which a cell can make up for what it loses: its pressure
                falls once that is spent. None: no cell has any.

        What leaves one cell enters the next to rounding, whatever the error of the solution.
        """
        used = np.zeros_like(pressure)
        held = np.zeros(pressure.shape, bool) if supply is None else supply > 0.0
        solved, ends, switches = pressure, True, False
        for _ in range(MOST_SWITCHES):
            solved, ends = self._solved(pressure, used, held, dt, solved)
            if supply is None:
                break
            lost = dt * self.flow(solved)
            spent, fed = held & (lost > supply), held & (lost < 0.0)
            back = ~held & (used > 0.0) & (solved > pressure)
            used = np.where(spent, supply, np.where(back, 0.0, used))
            switched, held = spent | fed | back, (held & ~spent & ~fed) | back
            switches = bool(switched.any())
            if not switches:
                break
        lost = dt * self.flow(solved)
        used = np.where(held, lost, used)
        change = (used - lost) / np.where(self.storage > 0.0, self.storage, np.inf)
        expelled = float(dt * (self.drained * solved).sum())
        return FlowStep(pressure + change, used, expelled, ends and not switches)

    def _solved(
        self,
        pressure: np.ndarray,
        source: np.ndarray,
        held: np.ndarray,
        dt: float,
        start: np.ndarray,
    ) -> tuple[np.ndarray, bool]:
        """Solution of (C + dt L) x = C u + source but where u is held, and whether it was found.

        By conjugate gradients from `start`, with sums in a fixed order.
        """
        free = (self.storage > 0.0) & ~held
        diagonal = self.storage + dt * self.drained
        diagonal[:-1] += dt * self.across
        diagonal[1:] += dt * self.across
        diagonal[:, :-1] += dt * self.upward
        diagonal[:, 1:] += dt * self.upward
        inverse = np.where(free, 1.0 / np.where(free, diagonal, 1.0), 0.0)
        storage = np.where(free, self.storage, np.inf)
        limit = TOLERANCE * float(np.abs(pressure).max(initial=0.0))

        x = np.where(held, pressure, start)
        rest = free * (self.storage * (pressure - x) + source - dt * self.flow(x))
        way = inverse * rest
        strength = float((rest * way).sum())
        for _ in range(MOST_TURNS):
            if np.abs(rest / storage).max(initial=0.0) <= limit or strength <= 0.0:
                return x, True
            push = free * (self.storage * way + dt * self.flow(way))
            length = strength / float((way * push).sum())
            x = x + length * way
            rest = rest - length * push
            fall = inverse * rest
            new = float((rest * fall).sum())
            way = fall + (new / strength) * way
            strength = new
        return x, bool(np.abs(rest / storage).max(initial=0.0) * TOLERANCE <= limit * ENOUGH)


def lay_cells(
    soil: PorousSoil,
    position: np.ndarray,
    *,
    origin: tuple[float, float],
    cell: float,
    gravity: float,
    closed: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> Cells:
    """The cells around points that are at `position` (P, 2) [m].

    Args:
        soil: the points.
        position: where they are now.
        origin: a corner of cells [m].
        cell: their edge [m].
        gravity: [m/s2].
        closed: (x, y of the centres of cells, (n, m)) -> bool, no water flows there: ground, walls.
    """
    number = np.floor((position - np.asarray(origin)) / cell).astype(np.int64)
    low = number.min(axis=0) - 1
    n, m = number.max(axis=0) - low + 2
    place = (number[:, 0] - low[0]) * m + number[:, 1] - low[1]

    def sums(chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.bincount(place[chosen], weights=values[chosen], minlength=n * m).reshape(n, m)

    flows = soil.takes_part
    storage = sums(flows, soil.storage * soil.volume)
    active = storage > 0.0
    # In series, as across layers: a thin seal in a cell holds the water up.
    volume = sums(flows, soil.volume)
    resistance = sums(flows, soil.volume / np.where(flows, soil.permeability, 1.0))
    weight = WATER_DENSITY * gravity
    conductivity = np.where(active, volume / np.where(active, resistance * weight, 1.0), 0.0)
    x = origin[0] + cell * (low[0] + np.arange(n) + 0.5)
    y = origin[1] + cell * (low[1] + np.arange(m) + 0.5)
    filled = sums(np.ones(len(place), bool), soil.volume) > 0.0
    shut = closed(*np.meshgrid(x, y, indexing="ij"))
    dry = sums(~soil.wet & (soil.permeability > 0.0), soil.volume) > 0.0
    free = ~active & (dry | _outside(~filled & ~shut))
    across = _between(conductivity[:-1], conductivity[1:])
    upward = _between(conductivity[:, :-1], conductivity[:, 1:])
    faces = np.zeros((n, m))
    faces[:-1] += free[1:]
    faces[1:] += free[:-1]
    faces[:, :-1] += free[:, 1:]
    faces[:, 1:] += free[:, :-1]
    return Cells(
        place=place[flows],
        storage=storage,
        across=across,
        upward=upward,
        drained=2.0 * conductivity * faces,  # u = 0 half a cell from the centre
        evening=(2.0 * np.pi / cell) ** 2
        * np.where(active, conductivity * volume / np.where(active, storage, 1.0), 0.0),
    )


def _between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Harmonic means of conductivities; 0 next to a 0."""
    both = one + other
    return 2.0 * one * other / np.where(both > 0.0, both, 1.0)


def _outside(empty: np.ndarray) -> np.ndarray:
    """Empty cells that air or the pool reaches, (n, m) bool: no hole that soil has closed off."""
    from scipy.ndimage import label

    number, _ = label(empty)
    edge = np.concatenate([number[0], number[-1], number[:, 0], number[:, -1]])
    return empty & np.isin(number, edge[edge > 0])


class PoreWater:
    """The pore water of a run; arrays in the solver's order of points.

    Attributes:
        excess: (P,) u [Pa]; 0 where no water flows.
        owed: (P,) volumetric strain by which soil will yet contract, or dilate: negative [-].
        expelled: water that has left through drained faces [m2].
        contracted: water that soil has set free as it contracted, less what it took as it dilated
            [m2].
        cavitated: the same where the water cavitated [m2].
        fault: why the flow cannot be right; else "".
    """

    def __init__(
        self,
        soil: PorousSoil,
        stress: np.ndarray,
        lay: Callable[[np.ndarray], Cells],
        still: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        """Pore water of soil that has settled.

        Args:
            soil: the points.
            stress: (P, 4) after settling [Pa], tension positive.
            lay: `lay_cells` for positions (P, 2).
            still: pressure of still water (P,) [Pa], over air, at positions (P, 2) [m].
        """
        self.soil, self.lay, self.still = soil, lay, still
        self.suction = np.full(len(stress), SUCTION)
        self.mean, self.radius = _mean(stress), _radius(stress)
        self.start = self.mean
        flows = soil.takes_part
        loose = flows & (soil.contraction > 0.0)
        self.excess = np.where(flows, soil.ratio * self.mean, 0.0)
        left = np.maximum(soil.contraction - soil.storage * self.excess, 0.0)
        self.owed = np.where(flows, np.where(loose, left, soil.contraction), 0.0)
        self.shear = np.zeros(len(stress))
        self.fluid = loose & (self.effective <= FLUID * self.start)
        self.expelled = self.contracted = self.cavitated = 0.0
        self.fault = ""
        self.cells: Cells

    @property
    def effective(self) -> np.ndarray:
        """Effective mean stress s - u in the plane (P,) [Pa], not below 0."""
        return np.maximum(self.mean - self.excess, 0.0)

    @property
    def content(self) -> float:
        """Water in the pores over that at no effective stress [m2]; what leaves, it loses."""
        flows = self.soil.takes_part
        held = self.soil.storage * self.soil.volume * (self.excess - self.mean)
        return float(held[flows].sum())

    def renew(self, now: PointsNow) -> np.ndarray:
        """Take the water through the time of a chunk.

        Args:
            now: the points at its end.

        Returns:
            (P, RENEWED) float32, for the coming chunk: see `effects.pore_water.strength`.
        """
        self.suction = SUCTION + self.still(now.position)
        self._undrained(_mean(now.stress), now.shear)
        self.radius = _radius(now.stress)
        self.cells = self.lay(now.position)
        if now.passed_s > 0.0:
            self._flow(self.cells, now.passed_s)
            self._settle_grains()
        return self._strengths(now.coming_s)

    def busy_for(self, left_s: float) -> float:
        """Time [s], at most `left_s`, until the water has softened soil that is now at rest.

        Soil is softened enough to move where its strength will be below its shear stress of now.
        """
        ahead, now = copy(self), self._lack()
        flows, volume = self.soil.takes_part, self.soil.volume
        step, time, until, most = left_s / (2**LOOKS - 1), 0.0, 0.0, 0.0
        for look in range(LOOKS):
            time += step * 2**look
            ahead._flow(self.cells, step * 2**look)
            ahead._settle_grains()
            lacks = np.maximum(ahead._lack() - now, 0.0)
            soft = volume[flows & (lacks > SOFTER * self.mean)].sum()
            lack = float((volume * lacks)[flows].sum())
            if lack > most and soft > SOFTENED * volume[flows].sum():
                most, until = lack, time
        return until

    def _lack(self) -> np.ndarray:
        """By how much the shear stress is above the strength, (P,) [Pa]."""
        return np.maximum(self.radius - self.soil.strength(self.effective), 0.0)

    def fields(self) -> dict[str, np.ndarray]:
        """Excess pressure, and strength in shear of the soil where water flows (else 0) [Pa]."""
        strength = np.where(self.soil.takes_part, self.soil.strength(self.effective), 0.0)
        return {"excess_pore_pressure_pa": self.excess, "strength_pa": strength}

    def audit(self) -> dict[str, float]:
        """Accounts of the water [m2] at the end of a run."""
        return {
            "water_expelled_m2": self.expelled,
            "water_contracted_m2": self.contracted,
            "water_cavitated_m2": self.cavitated,
        }

    def _undrained(self, mean: np.ndarray, shear: np.ndarray) -> None:
        """Excess pressure takes the change of mean stress, and what soil would contract by."""
        flows, soil = self.soil.takes_part, self.soil
        contracts = soil.per_shear * np.maximum(shear - self.shear, 0.0)
        most = np.minimum(np.maximum(self.owed, 0.0), soil.storage * self.effective)
        self._contract(np.where(flows, np.clip(contracts, np.minimum(self.owed, 0.0), most), 0.0))
        excess = np.where(flows, self.excess + (mean - self.mean), 0.0)
        self.excess = np.where(flows, np.maximum(excess, -self.suction), 0.0)
        self.cavitated += float(((self.excess - excess) * soil.storage * soil.volume).sum())
        self.mean, self.shear = mean, shear

    def _contract(self, strain: np.ndarray) -> None:
        """Soil gives a share (P,) of its volume to the water."""
        self.owed = self.owed - strain
        self.excess = self.excess + strain / self.soil.storage
        self.contracted += float((strain * self.soil.volume).sum())

    def _flow(self, cells: Cells, dt: float) -> None:
        """A step of Darcy flow; where grains hang in water they settle as water leaves."""
        flows, soil = self.soil.takes_part, self.soil
        held = (soil.storage * soil.volume)[flows]
        own, storage = self.excess[flows], np.where(cells.storage > 0.0, cells.storage, 1.0)
        before = cells.sums(held * own) / storage
        owed = (self.owed * soil.volume * self.fluid)[flows]
        supply = cells.sums(owed)
        mostly = cells.sums(held * self.fluid[flows]) > 0.5 * cells.storage
        after, used, expelled, solved = cells.advance(before, dt, np.where(mostly, supply, 0.0))
        self.expelled += expelled
        if not solved:
            self.fault = "the flow of the pore water could not be solved"
        self.contracted += float(used.sum())
        # What differs within a cell evens out as a wave of that length does, but where grains hang
        # in water, whose pressure follows the depth.
        fade = np.where(self.fluid[flows], 1.0, 1.0 + dt * cells.at_points(cells.evening))
        own = (own - cells.at_points(before)) / fade
        own = own - cells.at_points(cells.sums(held * own) / storage)
        excess, left = np.zeros(len(flows)), self.owed.copy()
        excess[flows] = cells.at_points(after) + own
        part = cells.at_points(used / np.where(supply > 0.0, supply, 1.0))
        left[flows] = self.owed[flows] * (1.0 - part * self.fluid[flows])
        self.excess, self.owed = excess, left

    def _settle_grains(self) -> None:
        """What a step has left of effective stress in soil whose grains hang in water is none."""
        lacks = np.maximum(self.mean - self.excess, 0.0) * self.soil.storage
        self._contract(np.where(self.fluid, np.minimum(lacks, self.owed), 0.0))
        loose = self.soil.takes_part & (self.soil.contraction > 0.0)
        self.fluid = loose & (self.effective <= FLUID * self.start)

    def _strengths(self, dt: float) -> np.ndarray:
        """The numbers of the points for a chunk of `dt` [s], (P, RENEWED) float32."""
        soil, flows, effective = self.soil, self.soil.takes_part, self.effective
        # The share of a load that would still be undrained after a step: 1 where water is shut in.
        left = self.cells.advance((self.cells.storage > 0.0).astype(float), dt).pressure
        undrained = np.ones(len(flows))
        undrained[flows] = np.clip(self.cells.at_points(left), 0.0, 1.0)
        drained = 1.0 - undrained
        held = effective - drained * self.mean
        short = held < 0.0
        drained = np.where(short, effective / np.maximum(self.mean, 1.0), drained)
        fall = np.where(self.owed != 0.0, soil.per_shear / soil.storage * undrained, 0.0)
        rows = np.zeros((len(flows), RENEWED), np.float32)
        rows[:, 0], rows[:, 2] = drained, fall
        rows[:, 1] = np.where(short, 0.0, held) + fall * self.shear
        rows[:, 3] = np.where(flows, np.where(soil.loose, soil.sine, OWN_FRICTION), NO_PART)
        rows[:, 4] = self.suction
        return rows


def _mean(stress: np.ndarray) -> np.ndarray:
    """Mean of the two normal stresses in the plane, compression positive, (P,) [Pa]."""
    return np.maximum(-0.5 * (stress[:, XX].astype(float) + stress[:, YY]), 0.0)


def _radius(stress: np.ndarray) -> np.ndarray:
    """Largest shear stress in the plane, (P,) [Pa]."""
    return np.hypot(0.5 * (stress[:, XX].astype(float) - stress[:, YY]), stress[:, XY])


def _cells_at(x: np.ndarray, y: np.ndarray, origin: tuple[float, float], cell: float) -> np.ndarray:
    """Cells at places [m] as complex numbers, column + i row."""
    return np.floor((x - origin[0]) / cell) + 1j * np.floor((y - origin[1]) / cell)


def pore_water(
    scene: Scene, settled: SettledPoints, factor: float, ratio: float, volumes: Volumes
) -> PoreWater:
    """The pore water of a scene; the numbers are those of `effects.pore_water`."""
    soil = porous_soil(scene, settled, factor, ratio, volumes)
    origin, cell = settled.origin, settled.cell
    bodies = _cells_at(*settled.fixed.T, origin, cell)

    def closed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        shut = (y < scene.ground.height(x)) | np.isin(_cells_at(x, y, origin, cell), bodies)
        for side in SIDES:
            if not scene.domain.is_open(side):
                shut |= outward_of(side) * (x - scene.domain.wall(side)) > 0.0
        return shut

    def lay(position: np.ndarray) -> Cells:
        return lay_cells(
            soil,
            position,
            origin=origin,
            cell=cell,
            gravity=settled.gravity,
            closed=closed,
        )

    def still(position: np.ndarray) -> np.ndarray:
        depth = scene.phreatic_level(position[:, 0]) - position[:, 1]
        return WATER_DENSITY * settled.gravity * np.maximum(depth, 0.0)

    return PoreWater(soil, settled.stress, lay, still)
