"""A plane section in Genesis (`genesis-world`), in a process and, if need be, a Python of its own.

It is run as a script and imports nothing of this project: `genesis_mpm` sends it pickles on the
standard input and reads as many from the standard output. First a section (see `Section`), then
orders `(steps, strength, acceleration, keep)`, each answered by the particles after those steps.

Genesis is three-dimensional: the section is one layer of particles between nodes that do not move
out of the plane, so that the equations are those of plane strain. Its materials have one strength
each; `Soil` reads it from the particle, where Genesis keeps the volume that sand has lost.
"""

import os
import pickle
import sys
from typing import Any

import numpy as np

#: Cells that Genesis keeps clear at every end of its grid, and how many are left out of the plane.
CLEAR, ACROSS = 3, 2


def main() -> None:
    """Answer orders until there are no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # Genesis reports on the standard output
    section = pickle.load(sys.stdin.buffer)
    body = _body(section)
    while (order := pickle.load(sys.stdin.buffer)) is not None:
        pickle.dump(body.advance(*order), answers)
        answers.flush()


def _body(section: dict[str, Any]) -> Any:
    import genesis as gs
    import quadrants as qd
    from genesis.engine.boundaries.boundaries import CubeBoundary
    from genesis.engine.materials.MPM.base import Base

    gs.init(backend=gs.cpu, precision="64", logging_level="error", seed=0)

    @qd.data_oriented
    class Soil(Base):
        """Elastic, perfectly plastic: Mohr-Coulomb in plane strain without dilation."""

        sine: float = 0.0

        def model_post_init(self, context: Any) -> None:
            super().model_post_init(context)
            self.update_F_S_Jp = self._yields
            self.update_stress = self._hencky

        @qd.func
        def _yields(self, J, F_tmp, U, S, V, Jp):
            strain = qd.Vector.zero(gs.qd_float, 3)
            for d in qd.static(range(3)):
                strain[d] = qd.log(qd.max(S[d, d], 0.05))
            volume = strain.sum()
            shape = strain - volume / 3.0
            bulk = self.lam + 2.0 / 3.0 * self.mu
            strength = Jp
            if qd.static(self.sine > 0.0):
                # Tension beyond the apex of the cone is not borne.
                volume = qd.min(volume, Jp / (bulk * self.sine))
                strength = Jp - bulk * volume * self.sine
            size = shape.norm(gs.EPS)
            most = strength / (1.4142135623730951 * self.mu)
            shape *= qd.min(1.0, most / size)
            S_new = qd.Matrix.zero(gs.qd_float, 3, 3)
            for d in qd.static(range(3)):
                S_new[d, d] = qd.exp(shape[d] + volume / 3.0)
            return U @ S_new @ V.transpose(), S_new, Jp

        @qd.func
        def _hencky(self, U, S, V, F_tmp, F_new, J, Jp, actu, m_dir):
            stress = qd.Matrix.zero(gs.qd_float, 3, 3)
            volume = qd.log(S[0, 0]) + qd.log(S[1, 1]) + qd.log(S[2, 2])
            for d in qd.static(range(3)):
                stress[d, d] = 2.0 * self.mu * qd.log(S[d, d]) + self.lam * volume
            return U @ stress @ U.transpose()

    @qd.data_oriented
    class Ground(CubeBoundary):
        """Ground that carries the strength it is given, smooth walls, and a plane that is kept.

        Genesis asks for the velocity of nodes, and again for that of particles.
        """

        def __init__(self, solver: Any) -> None:
            super().__init__(solver.boundary.lower, solver.boundary.upper)
            self.solver, self.cell = solver, float(solver.dx)
            self.first = int(round(float(section["low"][0]) / self.cell))
            self.bottom = int(round(float(section["low"][1]) / self.cell))
            self.heights = qd.field(gs.qd_float, shape=len(section["ground"]))
            self.heights.from_numpy(np.asarray(section["ground"], dtype=gs.np_float))
            self.strength = qd.field(gs.qd_float, shape=len(section["ground"]))
            self.walls = qd.Vector(section["walls"], dt=gs.qd_float)
            self.bonded = bool(section["bonded"])
            # The area of a column in the units of Genesis' masses, times the step.
            area = self.cell * float(section["spacing"]) * solver._particle_volume_scale
            self.impulse = area * float(section["step"])

        @qd.func
        def impose_pos_vel(self, pos, vel):
            place = pos[0] / self.cell - self.first
            k = qd.max(0, qd.min(qd.cast(qd.floor(place), qd.i32), self.heights.shape[0] - 2))
            share = place - k
            ground = (1.0 - share) * self.heights[k] + share * self.heights[k + 1]
            node = qd.round(pos / self.cell)
            if (pos / self.cell - node).norm() < 1e-6:
                i = qd.cast(node[0], qd.i32) - self.first
                j = qd.cast(node[1], qd.i32) - self.bottom
                layer = qd.cast(node[2], qd.i32)
                above = (pos[1] - ground) / self.cell
                if qd.static(self.bonded):
                    if above < 1e-6:
                        vel = qd.Vector.zero(gs.qd_float, 3)
                else:
                    low, high = qd.max(i - 1, 0), qd.min(i + 1, self.heights.shape[0] - 1)
                    slope = (self.heights[high] - self.heights[low]) / (self.cell * (high - low))
                    size = qd.sqrt(1.0 + slope**2)
                    along = (vel[0] + slope * vel[1]) / size
                    away = (vel[1] - slope * vel[0]) / size
                    if above < 1e-6:
                        away = qd.max(away, 0.0)
                    far = qd.abs(above)
                    part = 0.0  # of the ground's area that a node carries: its spline on the line
                    if far < 0.5:
                        part = 0.75 - far**2
                    elif far < 1.5:
                        part = 0.5 * (1.5 - far) ** 2
                    mass = self.solver.grid[0, i, j, layer + CLEAR + ACROSS, 0].mass
                    across = 0.75 if layer == 0 else 0.125
                    if part > 0.0 and mass > 0.0:
                        most = self.strength[i] * self.impulse * size * part * across / mass
                        along -= qd.math.sign(along) * qd.min(qd.abs(along), most)
                    vel[0] = (along - slope * away) / size
                    vel[1] = (away + slope * along) / size
            else:
                pos[1] = qd.max(pos[1], ground)
            if (pos[0] <= self.walls[0] and vel[0] < 0.0) or (
                pos[0] >= self.walls[1] and vel[0] > 0.0
            ):
                vel[0] = 0.0
            pos[0] = qd.max(qd.min(pos[0], self.walls[1]), self.walls[0])
            vel[2] = 0.0
            return pos, vel

    @qd.data_oriented
    class Body:
        """Particles of the section, in the order in which they came."""

        def __init__(self) -> None:
            cell = section["cell"]
            self.step = section["step"]
            low = [*section["low"], -(CLEAR + ACROSS) * cell]
            high = [*section["high"], (CLEAR + ACROSS) * cell]
            self.scene = gs.Scene(
                sim_options=gs.options.SimOptions(
                    dt=self.step, substeps=1, gravity=(0.0, -section["gravity"], 0.0)
                ),
                mpm_options=gs.options.MPMOptions(
                    particle_size=section["spacing"], grid_density=1.0 / cell,
                    lower_bound=tuple(low), upper_bound=tuple(high),
                ),
                show_viewer=False,
            )  # fmt: skip
            soil = np.asarray(section["soil"])
            self.order = np.argsort(soil, kind="stable")
            for number, (modulus, ratio, sine) in enumerate(section["soils"]):
                count = int((soil == number).sum())
                if count:
                    # Materials that are equal would be one: their density tells them apart.
                    material = Soil(E=modulus, nu=ratio, sine=sine, rho=1000.0 + number)
                    self.scene.add_entity(
                        material=material, morph=gs.morphs.Nowhere(n_particles=count)
                    )
            self.solver = self.scene.sim.mpm_solver
            self.solver.boundary = self.ground = Ground(self.solver)
            self.scene.build()
            place = np.zeros((len(soil), 3), dtype=gs.np_float)
            place[:, :2] = np.asarray(section["position"])[self.order]
            mass = np.asarray(section["density"])[self.order] * self.solver._particle_volume
            self._lay(self.frame, place, mass.astype(gs.np_float))

        @property
        def frame(self) -> int:
            return self.scene.sim.cur_substep_local

        def advance(
            self, steps: int, strength: np.ndarray, base: np.ndarray, push: np.ndarray, keep: float
        ) -> tuple[np.ndarray, ...]:
            """Position, velocity, rate of shear after steps; `keep` of the velocity is left."""
            self.ground.strength.from_numpy(base.astype(gs.np_float))
            push = (steps * self.step) * push[self.order]
            self._load(
                self.frame, strength[self.order].astype(gs.np_float),
                push.astype(gs.np_float), float(keep),
            )  # fmt: skip
            for _ in range(steps):
                self.scene.step()
            found = []
            for name in ("pos", "vel", "C"):
                own = getattr(self.solver.particles, name).to_numpy()[self.frame, :, 0]
                back = np.empty_like(own)
                back[self.order] = own
                found.append(back)
            position, velocity, grad = found
            rate = np.hypot(grad[:, 0, 0] - grad[:, 1, 1], grad[:, 0, 1] + grad[:, 1, 0])
            return position[:, :2], velocity[:, :2], rate

        @qd.kernel
        def _lay(self, f: qd.i32, place: qd.types.ndarray(), mass: qd.types.ndarray()):
            for i in range(place.shape[0]):
                self.solver.particles_ng[f, i, 0].active = qd.cast(1, gs.qd_bool)
                self.solver.particles_info[i].mass = mass[i]
                for d in qd.static(range(3)):
                    self.solver.particles[f, i, 0].pos[d] = place[i, d]

        @qd.kernel
        def _load(
            self, f: qd.i32, strength: qd.types.ndarray(), push: qd.types.ndarray(), keep: qd.f64
        ):
            for i in range(strength.shape[0]):
                self.solver.particles[f, i, 0].Jp = strength[i]
                for d in qd.static(range(2)):
                    self.solver.particles[f, i, 0].vel[d] = (
                        keep * self.solver.particles[f, i, 0].vel[d] + push[i, d]
                    )

    return Body()


if __name__ == "__main__":
    main()
