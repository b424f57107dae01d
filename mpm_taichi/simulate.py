"""Scenes in, runs out: slots on the device, frames, early stop, guards, audit.

A fixed number of slots is in flight; a slot whose scene has ended takes the next scene, so that all
threads stay busy. A scene's numbers do not depend on its slot, its neighbours or the thread count.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi import layout
from mpm_taichi.effects.framework.base import Effect
from mpm_taichi.effects.framework.registry import effects_on, kernel_effects
from mpm_taichi.materials.law import MaterialLaw
from mpm_taichi.materials.registry import law_of
from mpm_taichi.solver.boundary import MARGIN
from mpm_taichi.solver.initial_state import PreparedScene, prepare
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.runtime import DeviceSlots, Slots, start
from mpm_taichi.trajectory import Run
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

CHUNK = 8
"""Frames computed between two looks at the results."""

WATER_CHUNK = 2
"""The same where water follows the soil."""

SLOTS = {"cpu": 8, "cuda": 256}
"""Scenes in flight; on the CPU `PER_THREAD` for each thread where that is more."""

PER_THREAD = 2

SCHEDULES = {"cpu": "scene", "cuda": "point"}
"""How scenes are run on a device, see `solver`."""

OnFinished = Callable[[int, Run], None]
OnFrame = Callable[[int, float, float], None]


def simulate(
    scenes: Sequence[Scene],
    settings: SimulationSettings,
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_frame: OnFrame | None = None,
    on_finished: OnFinished | None = None,
) -> list[Run]:
    """Simulate scenes and return their runs in the order of the scenes.

    Args:
        scenes: any number of scenes, of any sizes.
        settings: one set of settings for all of them.
        device: "cpu" (bit-identical for any threads and company) or "cuda".
        threads: CPU threads; None: all this process may use.
        on_frame: called with (place in `scenes`, time [s], kinetic energy [J/m]) per chunk.
        on_finished: called with (place in `scenes`, run) as soon as a run is done.

    Raises:
        InputError: a law or an effect that does not exist, an effect that the law does not know, a
            moving kinematic zone, an unknown device.
    """
    runs: list[Run | None] = [None] * len(scenes)
    for place, run in simulate_each(
        scenes, settings, device=device, threads=threads, on_frame=on_frame
    ):
        runs[place] = run
        if on_finished is not None:
            on_finished(place, run)
    return [run for run in runs if run is not None]


def simulate_each(
    scenes: Sequence[Scene],
    settings: SimulationSettings,
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_frame: OnFrame | None = None,
) -> Iterator[tuple[int, Run]]:
    """Yield (place in `scenes`, run) as runs end; holds only the runs in flight. See `simulate`.

    Scenes that need the same kernels are run together: those of a law without effects, with effects
    of the library whichever they are, and with the same effects of a user.
    """
    groups: dict[tuple[MaterialLaw, tuple[Effect, ...]], list[tuple[int, Scene]]] = {}
    for place, scene in enumerate(scenes):
        law = law_of(scene)
        check_scene(scene, law)
        groups.setdefault((law, kernel_effects(scene)), []).append((place, scene))
    threads = start(device, threads)
    in_flight = max(SLOTS[device], PER_THREAD * threads if device == "cpu" else 0)
    for (law, effects), members in groups.items():
        kernels = build_kernels(
            affine=settings.transfer in ("affine_flip", "apic"),
            averaged=settings.volumetric_averaging,
            corrected=settings.volume_correction,
            effects=effects,
            law=law,
        )
        yield from _simulate_group(members, settings, device, kernels, in_flight, on_frame)


def _compile(slots: Slots) -> None:
    """Have the kernels compiled; where a user's effect or law cannot be, say so in one line."""
    table, law = slots.kernels.table, slots.kernels.law
    users = [repr(one.name) for one in (table.effects if table else ()) if one.version]
    users = [f"effect {', '.join(users)}"] if users else []
    users += [f"law {law.name!r}"] if law.version else []
    try:
        slots.compile()
    except Exception as error:
        if not users:
            raise
        # The end of Taichi's message says what is wrong, the rest where in its own pieces.
        words = " ".join(word for word in str(error).split() if set(word) - set("^~"))
        raise InputError(f"{' or '.join(users)}: does not compile: ... {words[-300:]}") from error


def _simulate_group(
    scenes: Sequence[tuple[int, Scene]], settings: SimulationSettings, device: str, kernels: object,
    in_flight: int, on_frame: OnFrame | None,
) -> Iterator[tuple[int, Run]]:  # fmt: skip
    """`simulate_each` for (place, scene) pairs that share their kernels."""
    number = min(in_flight, len(scenes))
    waiting = list(scenes)[::-1]
    flying: dict[int, Flight] = {}
    slots: Slots | None = None
    while waiting or flying:
        arrivals = {}
        for slot in range(number):
            if slot not in flying and waiting:
                place, scene = waiting.pop()
                arrivals[slot] = Flight(place, prepare(scene, settings, kernels.law))
        slots = _make_room(slots, flying, arrivals, number, device, kernels)
        if arrivals:
            slots.fetch()
        for slot, flight in arrivals.items():
            slots.admit(slot, flight.prepared)
        flying.update(arrivals)
        for slot, flight in flying.items():
            flight.make_way(slot, slots)
            flight.move_water(slot, slots)
            slots.set_frames(slot, flight.frames_wanted())
        began = time.perf_counter()
        slots.run()
        share = (time.perf_counter() - began) / len(flying)
        for slot, flight in list(flying.items()):
            flight.wall_time += share
            flight.collect(slot, slots)
            if on_frame is not None and flight.energies:
                on_frame(flight.place, len(flight.energies) * flight.prepared.frame_time,
                         float(flight.energies[-1][layout.KINETIC]))  # fmt: skip
            if flight.ended:
                slots.fetch()
                yield flight.place, flight.finish(slot, slots)
                slots.integers[slot, layout.PHASE] = layout.IDLE
                del flying[slot]


def check_scene(scene: Scene, law: MaterialLaw) -> None:
    """Refuse what a scene may say but the solver cannot do; one line for a person."""
    for one in effects_on(scene):
        if one.effect.strength is not None and law.strength_constants is None:
            raise InputError(
                f"{scene.name}: effects: {one.effect.name}: changes the strength, which the "
                f"material law {law.name!r} does not provide for"
            )
    saturated = sum(one.saturated_density is not None for one in scene.materials.values())
    if len(scene.materials) + saturated > layout.MAX_ROWS:
        raise InputError(
            f"{scene.name}: materials: {len(scene.materials)}, {saturated} of them with a "
            f"saturated_density: together at most {layout.MAX_ROWS}"
        )
    for zone in scene.zones:
        if zone.kinematic and zone.initial_velocity != (0.0, 0.0):
            raise InputError(
                f"{scene.name}: zones: {zone.name!r} is kinematic with initial_velocity "
                f"{zone.initial_velocity}; kinematic zones are held fixed: allowed is (0, 0)"
            )


def _make_room(
    slots: Slots | None, flying: dict[int, Flight], arrivals: dict[int, Flight], number: int,
    device: str, kernels: object,
) -> Slots:  # fmt: skip
    """Slots large enough for all scenes in flight and arriving; those in flight move over."""
    everyone = [flight.prepared for flight in (*flying.values(), *arrivals.values())]
    points = max(len(prepared.order) for prepared in everyone)
    nodes = max(flight.nodes_wanted() for flight in (*flying.values(), *arrivals.values()))
    if slots is not None and points <= slots.points and nodes <= slots.nodes:
        return slots
    kind = DeviceSlots if SCHEDULES[device] == "point" else Slots
    larger = kind(number, points + points // 8, nodes + nodes // 4, CHUNK,
                   device=device, kernels=kernels)  # fmt: skip
    if slots is None:
        _compile(larger)
    else:
        slots.fetch()
    for slot in flying:
        larger.take_over(slot, slots, flying[slot].prepared)
    return larger


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

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.prepared.scene

    # -- open domains ---------------------------------------------------------------------------

    def growth(self) -> tuple[int, int]:
        """Cells an open domain lacks on the left and right for the coming chunk of frames."""
        if self.scene.domain.walls != "open":
            return 0, 0
        grid, position = self.prepared.grid, self.frames[-1]
        speed = self.energies[-1][layout.TOP_SPEED] + 10.0
        reach = 2 * MARGIN + 2 + int(CHUNK * self.prepared.frame_time * speed / grid.cell)
        right_end = grid.origin[0] + (grid.shape[0] - 1) * grid.cell
        left = reach - int((position[:, 0].min() - grid.origin[0]) / grid.cell)
        right = reach - int((right_end - position[:, 0].max()) / grid.cell)
        # Each growth lays the whole grid again, so it goes far beyond what is needed.
        spare = grid.shape[0] // 8
        return tuple(lack + spare if lack > 0 else 0 for lack in (left, right))

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

    # -- results --------------------------------------------------------------------------------

    def frames_wanted(self) -> int:
        """Frames of the coming chunk: none past the last, whose state is that of the run."""
        known = len(self.frames) - 1
        chunk = CHUNK if self.prepared.face is None else WATER_CHUNK
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
        if domain.walls == "closed":
            slack = self.prepared.grid.cell
            if position[:, 0].min() < domain.x_min - slack or (
                position[:, 0].max() > domain.x_max + slack
            ):
                return "left the domain: a point behind a side wall"
        surplus = self._surplus(position, sums)
        if surplus > self.prepared.settings.energy_tolerance:
            return f"energy balance: {100 * surplus:.1f} % of the released energy out of nothing"
        if alarm:
            return "a point moved more than a cell in one time step"
        return ""

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
        return float(stored.sum()) * self.prepared.points.volume

    def _scale(self) -> float:
        """Energy below which a surplus is not a concern: all points lifted by a spacing [J/m]."""
        gravity = self.prepared.settings.gravity_m_per_s2
        return float(self.prepared.mass.sum()) * gravity * self.scene.spacing

    def _note_walls(self, position: np.ndarray, now: float) -> None:
        domain, near = self.scene.domain, self.scene.spacing
        if domain.walls == "open":
            return
        if position[:, 1].max() > domain.y_max - near:
            self.contact.setdefault("top", now)
        if position[:, 0].min() < domain.x_min + near:
            self.contact.setdefault("left", now)
        if position[:, 0].max() > domain.x_max - near:
            self.contact.setdefault("right", now)

    def _note_rest(self, kinetic: float) -> None:
        settings = self.prepared.settings
        self.peak = max(self.peak, kinetic)
        calm = kinetic <= settings.early_stop_energy_fraction * self.peak
        self.quiet = self.quiet + self.prepared.frame_time if calm else 0.0
        over = len(self.frames) * self.prepared.frame_time > self.prepared.busy_until
        if settings.early_stop and over and self.quiet >= settings.early_stop_hold_s:
            self.ended = True

    def finish(self, slot: int, slots: Slots) -> Run:
        """The run, with kinematic points put back and the audit made up."""
        prepared = self.prepared
        points, order = prepared.points, prepared.order
        where = slots.point_range(slot)
        total = len(points)

        def whole(values: np.ndarray) -> np.ndarray:
            out = np.zeros((total, *values.shape[1:]), np.float32)
            out[order] = values
            return out

        positions = np.repeat(points.position.astype(np.float32)[None], len(self.frames), axis=0)
        positions[:, order] = np.stack(self.frames)
        history = slots.history[where]
        volume = np.full(total, points.volume, np.float32)
        volume[order] = points.volume * (1.0 + history[:, layout.VOLUMETRIC])
        energies = np.stack(self.energies)
        potential = np.array([self._potential(frame) for frame in self.frames])
        names = {
            "kinetic": layout.KINETIC, "elastic": layout.ELASTIC, "plastic": layout.PLASTIC,
            "contact_loss": layout.CONTACT_LOSS, "water_work": layout.WATER_WORK,
        }  # fmt: skip
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
            volume=volume,
            energy=energy,
            audit=self._audit(energy, history, slots, slot),
            status="failed" if self.reason else "finished",
            reason=self.reason,
            wall_contact=dict(self.contact),
            wall_time_s=self.wall_time,
            steps=self.steps,
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
        volume = self.prepared.points.volume
        audit: dict[str, float | int | str] = {
            "mass_kg_per_m": float(self.prepared.mass.sum()),
            "released_j_per_m": released,
            "plastic_share": float(energy["plastic"][-1]) / released if released > 0 else 0.0,
            "contact_share": contact / released if released > 0 else 0.0,
            "numerical_share": numerical / released if released > 0 else 0.0,
            "volume_growth": float(np.mean(history[:, layout.VOLUMETRIC])),
            "volume_opened": float(np.mean(history[:, layout.OPENING])),
            "volume_m2": volume * len(history),
            "settle_steps": int(slots.integers[slot, layout.SETTLE_STEPS]),
            "settle_unbalanced": float(slots.numbers[slot, layout.UNBALANCED]),
            "peak_kinetic_j_per_m": self.peak,
            "peak_speed_m_per_s": float(max(e[layout.TOP_SPEED] for e in self.energies)),
        }
        if self.reason:
            audit["failed_at_s"] = self.failed_at
        return audit
