"""A three-dimensional problem in, its run out: frames, guards, checkpoints."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.layout import (
    OPENING,
    SETTLE_COURANT,
    SETTLE_LIMIT,
    SETTLE_TOLERANCE,
    SHEAR,
    VOLUMETRIC,
)
from mpm_taichi.rest import stands_still, still_frames
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver3d import layout
from mpm_taichi.solver3d.initial_state import Arrays3d
from mpm_taichi.solver3d.kernels import DRIFT, build_kernels
from mpm_taichi.solver3d.problem import Problem3d, refuse_flowing_water
from mpm_taichi.trajectory3d import Run3d
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.files import atomic_path

ENERGIES = ("kinetic", "elastic", "plastic", "contact_loss", "water_work", "potential")

SETTLE_LEAST, SETTLE_CHECK = 20, 10
"""Steps of settling before the forces are first compared, and between two comparisons."""

CHECKPOINT_S = 60.0
"""Time between two checkpoints of a run [s]."""

OnFrame = Callable[[float, float], None]


def simulate_3d(
    problem: Problem3d,
    settings: SimulationSettings,
    *,
    threads: int | None = None,
    checkpoint: Path | None = None,
    on_frame: OnFrame | None = None,
) -> Run3d:
    """Simulate a problem on the CPU; the bits do not depend on the number of threads.

    Args:
        problem: what is simulated.
        settings: as in two dimensions; `refuse_settings` says which have no effect here.
        threads: CPU threads; None: all this process may use.
        checkpoint: file that holds the state about once a minute while the run lasts; if it is
            there and of this very run, the run goes on from it, to the same bits.
        on_frame: called with (time [s], kinetic energy [J]) per frame.

    Raises:
        InputError: a setting that three dimensions do not have, or points outside the domain.
    """
    refuse_problem(problem, settings)
    start("cpu", threads)
    flight = Flight3d(problem, settings)
    if checkpoint is not None:
        flight.resume(checkpoint)
    flight.settle()
    saved = time.perf_counter()
    while not flight.ended:
        flight.frame()
        if on_frame is not None:
            on_frame(flight.now, flight.energies[-1][0])
        if checkpoint is not None and time.perf_counter() - saved > CHECKPOINT_S:
            flight.save(checkpoint)
            saved = time.perf_counter()
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return flight.run()


def refuse_problem(problem: Problem3d, settings: SimulationSettings) -> None:
    """Refuse what three dimensions do not have, or points outside the domain, in one line."""
    refuse_settings(settings)
    if settings.initial_stress == "gravity_on" and any(
        soil.strength_ratio is not None for soil in problem.materials
    ):
        raise InputError(
            f"{problem.name}: materials: strength_ratio: is of the stress before failure, which "
            "initial_stress 'gravity_on' leaves out; allowed are settled, k0"
        )
    refuse_flowing_water(problem)
    sloping = problem.water is not None and np.ptp(problem.water.values) > 0.0
    if sloping and settings.water == "pore_pressure" and settings.water_face == "moving":
        raise InputError(
            "water_face 'moving': in three dimensions a sloping water level is fixed; "
            "--set simulation.water_face=fixed"
        )
    _refuse_outside(problem)


def refuse_settings(settings: SimulationSettings) -> None:
    """Refuse a setting that three dimensions do not have, in one line."""
    if settings.transfer != "affine_flip":
        raise InputError(f"transfer {settings.transfer!r}: in three dimensions only affine_flip")
    if settings.local_damping > 0.0:
        raise InputError("local_damping: not in three dimensions; allowed is 0")
    if settings.wall_contact != "smooth":
        raise InputError("wall_contact: in three dimensions only smooth; flanks have their own")
    if not settings.volume_correction:
        raise InputError("volume_correction: in three dimensions always true")


def _refuse_outside(problem: Problem3d) -> None:
    x_min, x_max, y_min, y_max, z_max = problem.domain
    low = np.array([x_min, y_min, -np.inf])
    if not len(problem.position):
        raise InputError(f"{problem.name}: no points")
    if np.any(problem.position < low) or np.any(problem.position > [x_max, y_max, z_max]):
        raise InputError(f"{problem.name}: points outside the domain {problem.domain}")


class Flight3d:
    """A run under way: its arrays, and what has been collected of it so far."""

    def __init__(self, problem: Problem3d, settings: SimulationSettings) -> None:
        self.problem, self.settings = problem, settings
        self.state = Arrays3d(problem, settings)
        self.arrays = self.state.arrays()
        self.kernels = build_kernels(settings.volumetric_averaging)
        self.gravity = settings.gravity_m_per_s2
        self.frame_time = settings.frame_interval * float(np.sqrt(problem.spacing / self.gravity))
        self.mass = self.state.in_given_order(
            self.state.density[self.state.row].astype(np.float64) * self.state.volume
        )
        self.frames = [self.state.positions()]
        self.energies: list[list[float]] = []
        self.top_speed = np.zeros(len(problem.position), np.float32)
        self.speed = 0.0
        self.travelled = 0.0  # cells since blocks were formed, at most
        self.work = np.zeros(2)
        self.steps = self.settle_steps = 0
        self.unbalanced = 0.0
        self.quiet = 0.0
        height = float(np.ptp(problem.position[:, 2])) + problem.spacing
        self.still_frames = still_frames(height, self.gravity, self.frame_time)
        self.wall_time = 0.0
        self.ended, self.reason = False, ""
        self.initial_stress = np.zeros((len(problem.position), 6), np.float32)

    @property
    def now(self) -> float:
        """Time of the last frame [s]."""
        return (len(self.energies) - 1) * self.frame_time

    def _step(
        self, dt: float, *, blend: float = 0.0, share: float = 0.0, settling: bool = False
    ) -> None:
        state = self.state
        nx, ny, nz = state.grid.shape
        self.kernels.step(
            len(state.block_reach),
            nx * ny,
            ny,
            nz,
            int(settling),
            state.grid.cell,
            dt,
            blend,
            share,
            self.settings.pressure_smoothing,
            self.gravity,
            *self.arrays,
        )

    def settle(self) -> None:
        """Relax the stress elastically on points that do not move; nothing if the run goes on."""
        state = self.state
        if self.energies:
            return
        if state.settled:
            dt = SETTLE_COURANT * state.grid.cell / state.wave_speed
            while self.settle_steps < SETTLE_LIMIT:
                self._step(dt, settling=True)
                self.settle_steps += 1
                if self.settle_steps > SETTLE_LEAST and self.settle_steps % SETTLE_CHECK == 0:
                    force, weight = state.column_sums.sum(axis=0)
                    self.unbalanced = float(force / weight)
                    if self.unbalanced <= SETTLE_TOLERANCE:
                        break
        self.initial_stress = state.in_given_order(state.stress)
        self._lay_strength_ratios()
        for name in ("gradient", "history", "cell_sum", "cell_mean", "velocity", "column_sums"):
            getattr(state, name)[:] = 0.0
        self._note_sums()
        self.speed = float(np.sqrt(state.block_sums[:, 3].max()))
        self.peak = self.energies[0][0]

    def _lay_strength_ratios(self) -> None:
        """Strength of soil with a strength ratio, from the stress before failure."""
        self.state.lay_strength_ratios(-self.initial_stress[:, layout.ZZ])
        self.arrays = self.state.arrays()

    def _note_sums(self) -> None:
        state = self.state
        self.kernels.sums(len(state.block_reach), *self.arrays)
        total = state.block_sums[:, :3].sum(axis=0)
        potential = self.gravity * float(self.mass @ self.frames[-1][:, 2].astype(np.float64))
        self.energies.append([*map(float, total), *map(float, self.work), potential])

    def frame(self) -> None:
        """Take the run to its next frame, or end it."""
        state, settings = self.state, self.settings
        began = time.perf_counter()
        cell, wave = state.grid.cell, state.wave_speed
        longest = settings.time_step_s or settings.courant * cell / (wave + self.speed)
        count = max(int(np.ceil(self.frame_time / longest - 1e-4)), 1)
        dt = self.frame_time / count
        blend = min(settings.pic_rate_per_s * dt, 1.0)
        share = min(settings.pressure_relaxation * wave / cell * dt, 1.0)
        state.column_sums[:] = 0.0
        for _ in range(count):
            # A step moves a point by half a cell at most, or the run ends.
            if self.travelled > DRIFT - 1.0:
                state.form_blocks()
                self.travelled = 0.0
            self._step(dt, blend=blend, share=share)
            self.steps += 1
            reach = float(state.block_reach.max())
            if not np.isfinite(reach):
                self.reason = "a point moved more than half a cell in one time step"
                break
            self.travelled += reach * dt / cell
        self.wall_time += time.perf_counter() - began
        self.work += state.column_sums.sum(axis=0)
        self.frames.append(state.positions())
        self._note_sums()
        squared = float(state.block_sums[:, 3].max())
        self.speed = float(np.sqrt(squared))
        velocity = state.in_given_order(np.linalg.norm(state.motion[:, 3:6], axis=1))
        self.reason = self.reason or self._fault()
        if self.reason:
            self.frames.pop()
            self.energies.pop()
            self.ended = True
            return
        self.top_speed = np.maximum(self.top_speed, velocity)
        self._note_rest()

    def _fault(self) -> str:
        """Why the last frame cannot be right, or ""."""
        position = self.frames[-1]
        if not (np.isfinite(position).all() and np.isfinite(self.energies[-1]).all()):
            return "a position or an energy is not a number"
        x_min, x_max, y_min, y_max, _ = self.problem.domain
        slack = self.state.grid.cell
        for axis, low, high in ((0, x_min, x_max), (1, y_min, y_max)):
            if position[:, axis].min() < low - slack or position[:, axis].max() > high + slack:
                return "left the domain: a point behind a wall"
        surplus = self._surplus()
        if surplus > self.settings.energy_tolerance:
            return f"energy balance: {100 * surplus:.1f} % of the released energy out of nothing"
        return ""

    def _surplus(self) -> float:
        """Mechanical energy above what was there, as a share of the energy released so far."""
        first, last = self.energies[0], self.energies[-1]
        kinetic, elastic, plastic, _, water, potential = last
        fall = first[5] - potential + water
        excess = kinetic - first[0] + elastic - first[1] + plastic - fall
        lifted = float(self.mass.sum()) * self.gravity * self.problem.spacing
        return excess / max(first[0], abs(fall), lifted)

    def _note_rest(self) -> None:
        settings, kinetic = self.settings, self.energies[-1][0]
        self.peak = max(self.peak, kinetic)
        calm = kinetic <= settings.early_stop_energy_fraction * self.peak
        self.quiet = self.quiet + self.frame_time if calm else 0.0
        rested = settings.early_stop and (
            self.quiet >= settings.early_stop_hold_s
            or stands_still(self.frames, self.still_frames, self.problem.spacing)
        )
        self.ended = rested or self.now >= settings.duration_s - 0.5 * self.frame_time

    # -- checkpoint -----------------------------------------------------------------------------

    PLAIN = (
        "speed",
        "travelled",
        "steps",
        "settle_steps",
        "unbalanced",
        "quiet",
        "wall_time",
        "peak",
        "ended",
    )

    def _hash(self) -> str:
        """Hash of all that the bits of this run depend on, before its first step."""
        digest = hashlib.sha256(f"{PHYSICS_VERSION} {self.settings.model_dump_json()}".encode())
        for name in CARRIED + FIXED:
            digest.update(getattr(self.state, name))
        if self.state.ratios.any():
            digest.update(self.state.ratios)
        return digest.hexdigest()

    def save(self, path: Path) -> None:
        """Write the state to a file, whole or not at all."""
        state = self.state
        arrays = {name: getattr(state, name) for name in CARRIED}
        plain = {name: getattr(self, name) for name in self.PLAIN}
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                key=self.key,
                label=state.label,
                first=state.first,
                frames=np.stack(self.frames),
                energies=np.array(self.energies),
                work=self.work,
                top_speed=self.top_speed,
                initial_stress=self.initial_stress,
                plain=json.dumps(plain),
                **arrays,
            )

    def resume(self, path: Path) -> None:
        """Go on from a checkpoint of this very run; nothing if there is none."""
        state = self.state
        self.key = self._hash()
        if not path.is_file():
            return
        with np.load(path) as file:
            if str(file["key"]) != self.key:
                return
            for name in (*CARRIED, "first"):
                getattr(state, name)[:] = file[name]
            state.label = file["label"]
            self.frames = list(file["frames"])
            self.energies = file["energies"].tolist()
            self.work, self.top_speed = file["work"], file["top_speed"]
            self.initial_stress = file["initial_stress"]
            self._lay_strength_ratios()
            for name, value in json.loads(str(file["plain"])).items():
                setattr(self, name, value)

    def run(self) -> Run3d:
        """The run, in the order of the problem."""
        state, problem = self.state, self.problem
        back = state.in_given_order
        energies = np.array(self.energies)
        energy = {name: energies[:, place].copy() for place, name in enumerate(ENERGIES)}
        first, last = energies[0], energies[-1]
        released = first[5] - last[5] + last[4] + first[0]
        kept = last[0] + last[1] - first[1]
        numerical = released - kept - last[2] - last[3]
        share = 1.0 / released if released > 0 else 0.0
        audit: dict[str, float | int | str] = {
            "mass_kg": float(self.mass.sum()),
            "released_j": float(released),
            "plastic_share": float(last[2] * share),
            "contact_share": float(last[3] * share),
            "numerical_share": float(numerical * share),
            "volume_growth": float(np.mean(state.history[:, VOLUMETRIC])),
            "volume_opened": float(np.mean(state.history[:, OPENING])),
            "settle_steps": self.settle_steps,
            "settle_unbalanced": self.unbalanced,
            "peak_kinetic_j": float(self.peak),
        }
        return Run3d(
            name=problem.name,
            positions=np.stack(self.frames),
            time=self.frame_time * np.arange(len(self.frames)),
            material=np.asarray(problem.material, np.int32),
            zone=np.asarray(problem.zone, np.int32),
            top_speed=self.top_speed,
            velocity=back(state.motion[:, 3:6]),
            stress=back(state.stress),
            initial_stress=self.initial_stress,
            plastic_shear_strain=back(state.history[:, SHEAR]),
            volume=back(state.volume * (1.0 + state.history[:, VOLUMETRIC])),
            energy=energy,
            status="failed" if self.reason else "finished",
            reason=self.reason,
            steps=self.steps,
            wall_time_s=self.wall_time,
            audit=audit,
        )


FIXED = ("kind", "surroundings", "water", "elastic", "strength", "settle_strength", "density")
CARRIED = (*layout.Points._fields, "cell_mean", "velocity")
"""Arrays that a checkpoint holds, and those that follow from the problem."""
