"""A scene on its way through the solver: its frames, its guards, its end, its audit."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from geometry.sides import SIDES, outward_of
from mpm_taichi import layout
from mpm_taichi.effects import relative_width
from mpm_taichi.effects.framework.between import PointsNow, SettledPoints
from mpm_taichi.rest import stands_still, still_frames
from mpm_taichi.solver.boundary import MARGIN
from mpm_taichi.trajectory import Run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from geometry.scenes.scene import Scene
    from geometry.sides import Side
    from mpm_taichi.effects import Effect
    from mpm_taichi.effects.framework.between import Between
    from mpm_taichi.solver.initial_state import PreparedScene
    from mpm_taichi.solver.runtime import Slots

CHUNK = 8
"""Frames computed between two looks at the results."""

WATER_CHUNK = 2
"""The same where water follows the soil, or an effect renews its numbers between chunks."""

LOOK_AGAIN_S = 5.0
"""Time [s] after which it is looked again whether effects on the host will yet move soil."""


@dataclass
class Flight:
    """A scene in flight: what has been collected of it so far."""

    place: int
    prepared: PreparedScene
    frames: list[np.ndarray] = field(default_factory=list)  # (P, 2) float32 [m]
    energies: list[np.ndarray] = field(default_factory=list)  # (SUMS,) per frame
    contact: dict[str, float | str] = field(default_factory=dict)
    reason: str = ""
    ended: bool = False
    failed_at: float = 0.0
    quiet: float = 0.0
    peak: float = 0.0
    wall_time: float = 0.0
    steps: int = 0
    hosted: dict[Effect, Between] = field(default_factory=dict)
    busy: float = 0.0  # time [s] until which they may yet set soil at rest in motion
    settled: bool = False
    renewed_at: int = 0  # frame

    def __post_init__(self) -> None:
        position = self.prepared.points.position[self.prepared.order].astype(np.float32)
        self.frames.append(position)
        speed = self.prepared.motion[:, 2:].astype(np.float64)
        kinetic = 0.5 * float(self.prepared.mass @ np.sum(speed**2, axis=1))
        first = np.zeros(layout.SUMS)
        first[layout.KINETIC] = kinetic
        first[layout.TOP_SPEED] = float(np.sqrt(np.max(np.sum(speed**2, axis=1), initial=0.0)))
        self.energies.append(first)
        self.peak = kinetic
        self._note_walls(position, 0.0)

    @cached_property
    def fronts(self) -> dict[Side, np.ndarray | None]:
        """Points (P,) whose arrival at a wall is told, by its side; None: all of them.

        At a far boundary the ground that goes on is no arrival.
        """
        scene, found = self.scene, {}
        for side in SIDES:
            if not scene.domain.is_open(side):
                zones = self.prepared.points.zone[self.prepared.order]
                is_far = scene.domain.goes_on(side)
                found[side] = np.isin(zones, scene.front_zones(side)) if is_far else None
        return found

    @cached_property
    def still_frames(self) -> int:
        """Frames over which a section that stands is watched."""
        low, high = self.scene.extent
        gravity = self.prepared.settings.gravity_m_per_s2
        return still_frames(high - low, gravity, self.prepared.frame_time)

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.prepared.scene

    # -- open domains ---------------------------------------------------------------------------

    def growth(self) -> tuple[int, int]:
        """Cells an open domain lacks on the left and right for the coming chunk of frames."""
        is_open = [self.scene.domain.is_open(side) for side in SIDES]
        if not any(is_open):
            return 0, 0
        grid, position = self.prepared.grid, self.frames[-1]
        speed = self.energies[-1][layout.TOP_SPEED] + 10.0
        reach = 2 * MARGIN + 2 + int(CHUNK * self.prepared.frame_time * speed / grid.cell)
        right_end = grid.origin[0] + (grid.shape[0] - 1) * grid.cell
        left = reach - int((position[:, 0].min() - grid.origin[0]) / grid.cell)
        right = reach - int((right_end - position[:, 0].max()) / grid.cell)
        # Each growth lays the whole grid again, so it goes far beyond what is needed.
        spare = grid.shape[0] // 8
        return tuple(
            lack + spare if lack > 0 and grows else 0
            for lack, grows in zip((left, right), is_open, strict=True)
        )

    def nodes_wanted(self) -> int:
        """Nodes of the grid after the coming growth."""
        return (self.prepared.grid.shape[0] + sum(self.growth())) * self.prepared.grid.shape[1]

    def make_way(self, slot: int, slots: Slots) -> None:
        """Enlarge an open domain so that nothing reaches its ends in the coming chunk."""
        left, right = self.growth()
        if left or right:
            slots.fetch()
            slots.lay_grid(slot, self.prepared.enlarge(left, right), left)

    def move_water(self, slot: int, slots: Slots) -> None:
        """Have the water follow the soil to where it is now."""
        if self.prepared.face is not None and len(self.frames) > 1:
            slots.lay_water(slot, self.prepared.water_now(self.frames[-1].astype(np.float64)))

    # -- effects with a part on the host --------------------------------------------------------

    @property
    def is_hosted(self) -> bool:
        """An effect renews its numbers between chunks."""
        return any(one.effect.between is not None for one in self.prepared.effects)

    def renew_fields(self, slot: int, slots: Slots) -> None:
        """Have effects on the host renew their numbers of the points for the coming chunk.

        Before the first there is a chunk without frames, in which the stress settles.
        """
        if not self.is_hosted or not self.settled:
            self.settled = True
            return
        slots.fetch()
        where, prepared = slots.point_range(slot), self.prepared
        if not self.hosted:
            start = SettledPoints(
                position=prepared.points.position[prepared.order],
                volume=prepared.volume / prepared.width,
                stress=slots.stress[where],
                row=prepared.row,
                soils=prepared.soils,
                fixed=prepared.points.position[prepared.points.kinematic],
                origin=prepared.grid.origin,
                cell=prepared.grid.cell,
                gravity=prepared.settings.gravity_m_per_s2,
            )
            self.hosted = {
                one.effect: one.between(prepared.scene, start)
                for one in prepared.effects
                if one.effect.between is not None
            }
        coming = self.frames_wanted() * prepared.frame_time
        for effect, numbers in self._renewed(slot, slots, coming):
            slots.facts[where, slots.kernels.table.renewed_columns(effect)] = numbers

    def _renewed(
        self, slot: int, slots: Slots, coming_s: float
    ) -> Iterator[tuple[Effect, np.ndarray]]:
        """The effects on the host, taken to the present, and the numbers for the coming chunk."""
        where, last = slots.point_range(slot), len(self.frames) - 1
        now = PointsNow(
            position=self.frames[-1].astype(np.float64),
            stress=slots.stress[where],
            shear=slots.history[where, layout.SHEAR].astype(np.float64),
            passed_s=(last - self.renewed_at) * self.prepared.frame_time,
            coming_s=coming_s,
        )
        self.renewed_at = last
        for effect, state in self.hosted.items():
            yield effect, state.renew(now)

    # -- results --------------------------------------------------------------------------------

    def frames_wanted(self) -> int:
        """Frames of the coming chunk: none past the last, whose state is that of the run."""
        known = len(self.frames) - 1
        if self.is_hosted and not self.hosted:
            return 0
        follows = self.prepared.face is not None or self.hosted
        chunk = WATER_CHUNK if follows else CHUNK
        return next((n for n in range(1, chunk) if self._is_last(known + n)), chunk)

    def _is_last(self, frame: int) -> bool:
        duration, frame_time = self.prepared.settings.duration_s, self.prepared.frame_time
        return frame * frame_time >= duration - 0.5 * frame_time

    def collect(self, slot: int, slots: Slots) -> None:
        """Take the frames of a chunk and decide whether the run goes on."""
        frame_time = self.prepared.frame_time
        count = len(self.prepared.order)
        origin = np.asarray(self.prepared.grid.origin, np.float32)
        alarm = int(slots.integers[slot, layout.ALARM])  # frame of this chunk, from 1; 0: none
        if len(self.frames) == 1:
            slots.fetch()
            self.energies[0][layout.ELASTIC] = self._elastic(
                slots.initial_stress[slots.point_range(slot)]
            )
        self.steps = int(slots.integers[slot, layout.STEPS])
        for frame in range(int(slots.integers[slot, layout.FRAME_COUNT])):
            if self.ended:
                return
            position = slots.positions[slot, frame, :count] + origin
            sums = slots.sums[slot, frame].copy()
            now = len(self.frames) * frame_time
            self.reason = self._fault(position, sums, alarm == frame + 1)
            if self.reason:
                self.ended, self.failed_at = True, now
                return
            for column in (layout.CONTACT_LOSS, layout.WATER_WORK, layout.EFFECT_WORK):
                sums[column] += self.energies[-1][column]
            self.frames.append(position)
            self.energies.append(sums)
            self._note_walls(position, now)
            self._note_rest(sums[layout.KINETIC])
            if self._is_last(len(self.frames) - 1):
                self.ended = True

    def _fault(self, position: np.ndarray, sums: np.ndarray, alarm: bool) -> str:
        """Why a frame cannot be right, or ""."""
        if not (np.isfinite(position).all() and np.isfinite(sums).all()):
            return "a position or an energy is not a number"
        domain = self.scene.domain
        top = float(position[:, 1].max())
        if domain.walls == "open" and top > domain.y_max - self.scene.spacing:  # at the lid
            return f"left the domain: a point at y = {top:.1f} m, domain.y_max {domain.y_max:g} m"
        for side in SIDES:
            beyond = outward_of(side) * (position[:, 0] - domain.wall(side))
            if not domain.is_open(side) and beyond.max() > self.prepared.grid.cell:
                return "left the domain: a point behind a side wall"
        surplus = self._surplus(position, sums)
        if surplus > self.prepared.settings.energy_tolerance:
            return f"energy balance: {100 * surplus:.1f} % of the released energy out of nothing"
        if alarm:
            return "a point moved more than a cell in one time step"
        return next((one.fault for one in self.hosted.values() if one.fault), "")

    def _surplus(self, position: np.ndarray, sums: np.ndarray) -> float:
        """Mechanical energy above what was there, as a share of the energy released so far."""
        start_energy = self.energies[0][layout.KINETIC]
        stored = sums[layout.ELASTIC] - self.energies[0][layout.ELASTIC]
        water = sums[layout.WATER_WORK] + self.energies[-1][layout.WATER_WORK]
        pushed = sums[layout.EFFECT_WORK] + self.energies[-1][layout.EFFECT_WORK]
        fall = self._potential(self.frames[0]) - self._potential(position) + water + pushed
        excess = sums[layout.KINETIC] - start_energy + stored + sums[layout.PLASTIC] - fall
        scale = max(start_energy, abs(fall), self._scale())
        return float(excess / scale)

    def _potential(self, position: np.ndarray) -> float:
        gravity = self.prepared.settings.gravity_m_per_s2
        return float(self.prepared.mass @ position[:, 1].astype(np.float64)) * gravity

    def _elastic(self, stress: np.ndarray) -> float:
        """Elastic energy of the points under `stress` (P, 4) [Pa], in J/m."""
        s = stress.astype(np.float64)
        moduli = self.prepared.elastic[self.prepared.row]
        pressure = s[:, :3].mean(axis=1)
        shear = np.sum((s[:, :3] - pressure[:, None]) ** 2, axis=1) + 2.0 * s[:, 3] ** 2
        stored = 0.5 * (
            pressure**2 * moduli[:, layout.BULK_COMPLIANCE]
            + shear * moduli[:, layout.SHEAR_COMPLIANCE]
        )
        return float(stored @ self.prepared.volume)

    def _scale(self) -> float:
        """Energy below which a surplus is not a concern: all points lifted by a spacing [J/m]."""
        gravity = self.prepared.settings.gravity_m_per_s2
        return float(self.prepared.mass.sum()) * gravity * self.scene.spacing

    def _note_walls(self, position: np.ndarray, now: float) -> None:
        domain, near = self.scene.domain, self.scene.spacing
        if domain.walls == "closed" and position[:, 1].max() > domain.y_max - near:
            self.contact.setdefault("top", now)
        for side, front in self.fronts.items():
            x = position[:, 0] if front is None else position[front, 0]
            if np.max(outward_of(side) * (x - domain.wall(side)), initial=-np.inf) > -near:
                self.contact.setdefault(side, now)

    def _note_rest(self, kinetic: float) -> None:
        settings = self.prepared.settings
        self.peak = max(self.peak, kinetic)
        calm = kinetic <= settings.early_stop_energy_fraction * self.peak
        self.quiet = self.quiet + self.prepared.frame_time if calm else 0.0
        frame_time, busy = self.prepared.frame_time, max(self.prepared.busy_until, self.busy)
        if not settings.early_stop:
            return
        now, count = len(self.frames) * frame_time, self.still_frames
        self.ended = now > busy and self.quiet >= settings.early_stop_hold_s
        if now > busy + count * frame_time and stands_still(self.frames, count, self.scene.spacing):
            self.ended = True
        if self.ended and self.hosted:
            # What is at rest at the end of the duration has come to rest before it.
            left = settings.duration_s - now - 2.0 * frame_time
            busy = max(one.busy_for(left) for one in self.hosted.values()) if left > 0.0 else 0.0
            self.busy, self.ended = now + min(busy, LOOK_AGAIN_S, left), busy <= 0.0

    def finish(self, slot: int, slots: Slots) -> Run:
        """The run, with kinematic points put back and the audit made up."""
        prepared = self.prepared
        points, order = prepared.points, prepared.order
        where = slots.point_range(slot)
        if not self.reason:
            list(self._renewed(slot, slots, prepared.frame_time))  # to the last frame
        total = len(points)

        def whole(values: np.ndarray) -> np.ndarray:
            out = np.zeros((total, *values.shape[1:]), np.float32)
            out[order] = values
            return out

        positions = np.repeat(points.position.astype(np.float32)[None], len(self.frames), axis=0)
        positions[:, order] = np.stack(self.frames)
        history = slots.history[where]
        volume = points.volume.astype(np.float32)
        initial_volume = volume.copy()
        area = prepared.volume * (1.0 + history[:, layout.VOLUMETRIC])
        last = self.frames[-1].astype(np.float64)
        volume[order] = area / relative_width(prepared.effects, prepared.scene, last)
        energies = np.stack(self.energies)
        potential = np.array([self._potential(frame) for frame in self.frames])
        names = {
            "kinetic": layout.KINETIC,
            "elastic": layout.ELASTIC,
            "plastic": layout.PLASTIC,
            "contact_loss": layout.CONTACT_LOSS,
            "water_work": layout.WATER_WORK,
        }
        energy = {name: energies[:, column].copy() for name, column in names.items()}
        energy["potential"] = potential
        if prepared.effects:
            energy["effect_work"] = energies[:, layout.EFFECT_WORK].copy()
        return Run(
            scene=prepared.given,
            settings=prepared.settings,
            positions=positions,
            time=prepared.frame_time * np.arange(len(self.frames)),
            material=points.material.astype(np.int32),
            zone=points.zone.astype(np.int32),
            kinematic=points.kinematic.copy(),
            velocity=whole(slots.motion[where, 2:]),
            stress=whole(slots.stress[where]),
            initial_stress=whole(slots.initial_stress[where]),
            plastic_shear_strain=whole(history[:, layout.SHEAR]),
            initial_volume=initial_volume,
            volume=volume,
            energy=energy,
            audit=self._audit(energy, history, slots, slot),
            status="failed" if self.reason else "finished",
            reason=self.reason,
            wall_contact=dict(self.contact),
            wall_time_s=self.wall_time,
            steps=self.steps,
            effect_fields={
                name: whole(values)
                for state in self.hosted.values()
                for name, values in state.fields().items()
            },
        )

    def _audit(
        self, energy: dict[str, np.ndarray], history: np.ndarray, slots: Slots, slot: int
    ) -> dict[str, float | int | str]:
        """Energy, mass and volume accounts of the whole run."""
        released = float(energy["potential"][0] - energy["potential"][-1])
        released += float(energy["water_work"][-1] + energy["kinetic"][0])
        if "effect_work" in energy:
            released += float(energy["effect_work"][-1])
        kept = float(energy["kinetic"][-1] + energy["elastic"][-1] - energy["elastic"][0])
        contact = float(energy["contact_loss"][-1])
        numerical = released - kept - float(energy["plastic"][-1]) - contact
        share = self.prepared.volume / self.prepared.volume.sum()
        audit: dict[str, float | int | str] = {
            "mass_kg_per_m": float(self.prepared.mass.sum()),
            "released_j_per_m": released,
            "plastic_share": float(energy["plastic"][-1]) / released if released > 0 else 0.0,
            "contact_share": contact / released if released > 0 else 0.0,
            "numerical_share": numerical / released if released > 0 else 0.0,
            "volume_growth": float(share @ history[:, layout.VOLUMETRIC]),
            "volume_opened": float(share @ history[:, layout.OPENING]),
            "volume_m2": float(self.prepared.volume.sum()),
            "settle_steps": int(slots.integers[slot, layout.SETTLE_STEPS]),
            "settle_unbalanced": float(slots.numbers[slot, layout.UNBALANCED]),
            "peak_kinetic_j_per_m": self.peak,
            "peak_speed_m_per_s": float(max(e[layout.TOP_SPEED] for e in self.energies)),
        }
        for state in self.hosted.values():
            audit |= state.audit()
        if self.reason:
            audit["failed_at_s"] = self.failed_at
        return audit
