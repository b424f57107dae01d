"""Truth by newton 1.8, a public code with an implicit material point method (warp, CPU).

It shares nothing with the judge's solver: rigid-plastic soil, an implicit step of 0.05 s, a yield
surface solved at the cells, contact at the nodes of the ground, another transfer. A plane section
is a slab one voxel thick whose strain out of the plane is taken from the equations; the ground has
the strength of the soil on it, node by node. Both reach into private parts of newton, so its
version is pinned.

On bonded ground (`no_slip`) its slides agree with the judge's at the same spacing; both are short
of the limit of small cells, for a layer of a cell stays behind. On rough ground they are shorter
than on bonded ground, which no mechanics explains, so sets by newton have bonded ground; a weak
base then has the soil's strength times a share, at the nodes of the ground.

Mohr-Coulomb in plane strain without dilation is sqrt(J2) <= c cos(phi) + p sin(phi), which is
newton's yield_stress + friction (p + tensile_yield_ratio yield_pressure) with the tension cut-off
at c cot(phi). A contact carries mu (N + adhesion) on half a cell of soil, hence the factor 2.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from benchmarks.hidden_effects.foreign.hidden import THINGS, Hidden
from benchmarks.hidden_effects.foreign.loading import Loading, Moment
from benchmarks.hidden_effects.foreign.slide import LEAST_AREA, Slide
from geometry.scenes.scene import Scene
from pipeline.cli import InputError, WorkFailed

#: Rigid soil has no stress that could have settled before.
HIDES = tuple(name for name, thing in THINGS.items() if thing.settled)

#: Edge of a voxel in spacings: at fewer the soil loses area. Longest step [s].
VOXEL, STEP = 2.0, 0.05
#: Rigid bodies end this share of a voxel on the soil's side of a line of nodes.
RAISED = 0.02
#: Friction that stands for none: adhesion acts through friction.
LEAST_FRICTION = 1e-2
#: Compressive strength that is never reached, adhesion of bonded ground, Young's modulus [Pa].
NO_CAP, BOND, RIGID = 1e9, 1e8, 1e15
#: Places of the points are random by so many spacings: what is more irregular loses area.
JITTER = 0.2
#: Share of the rate of the last step in the rate that viscous strength follows.
FOLLOWS = 0.3
#: At rest: kinetic energy below this share of its peak for this long [s].
QUIET, HOLD = 1e-3, 1.0
TOLERANCE, ITERATIONS = 1e-5, 400
#: Thickness of rigid bodies [m].
THICK = 50.0


def simulate(
    scene: Scene, hidden: Sequence[Hidden], *, duration_s: float, frames: int, seed: int,
    threads: int | None = None,
) -> Slide:  # fmt: skip
    """See `slide.Simulate`; newton uses one thread on a CPU."""
    for one in hidden:
        if one.name not in HIDES:
            raise InputError(f"newton: cannot hide {one.name}; it can hide {', '.join(HIDES)}")
    loading = Loading.of(scene, hidden, seed=seed, jitter=JITTER)
    with redirect_stdout(sys.stderr):  # warp reports what it compiles
        slide = _Slab(loading).run(duration_s, frames)
    if not np.all(np.isfinite(slide.positions)):
        raise WorkFailed("newton: positions are not finite")
    if slide.area_kept < LEAST_AREA:
        raise WorkFailed(f"newton: the slide kept {slide.area_kept:.3f} of its area")
    return slide


class _Slab:
    """A plane section in newton: x and y are the section's, moved; z is out of the plane."""

    def __init__(self, loading: Loading) -> None:
        import newton
        import warp as wp

        wp.config.quiet = True
        self.loading = loading
        self.voxel = VOXEL * loading.scene.spacing
        self.shift = self._shift()
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -loading.gravity, 0.0))
        newton.solvers.SolverImplicitMPM.register_custom_attributes(builder)
        self._add_soil(builder)
        self._add_ground(builder)
        with wp.ScopedDevice("cpu"):
            self.model = builder.finalize()
            self._set_soil()
            self.now, self.next = self.model.state(), self.model.state()
            config = newton.solvers.SolverImplicitMPM.Config(
                voxel_size=self.voxel, tolerance=TOLERANCE, max_iterations=ITERATIONS,
                transfer_scheme="apic", collider_basis="S2", air_drag=1.0,
            )  # fmt: skip
            self.solver = _plane_solver()(self.model, config)
            self.solver.contact = self._contact
        self.strain = self.smooth_rate = np.zeros(len(loading.points))
        self.time = 0.0
        self._strengths(loading.cohesion(loading.still))

    def run(self, duration_s: float, frames: int) -> Slide:
        """Move until rest, at most `duration_s` [s], keeping `frames` equal steps of time."""
        between = duration_s / frames
        steps = int(np.ceil(between / STEP))
        positions, times = [self.loading.points.position], [0.0]
        peak = quiet = 0.0
        for frame in range(1, frames + 1):
            for _ in range(steps):
                moment = self.moment()
                if self.loading.changes:
                    self._strengths(self.loading.cohesion(moment))
                self._step(between / steps)
            positions.append(self.position)
            times.append(frame * between)
            energy = float(np.mean(self.velocity**2))
            peak = max(peak, energy)
            quiet = quiet + between if energy < QUIET * peak else 0.0
            if quiet >= HOLD and not self._still_to_come():
                break
        at_rest = quiet >= HOLD
        return Slide(
            self.loading.scene, self.loading.points.zone, np.array(positions), np.array(times),
            at_rest,
        )  # fmt: skip

    def moment(self) -> Moment:
        """Particles now; the rate of shear is smoothed, for strength must not swing with it."""
        return Moment(self.time, self.position, self.velocity, self.strain, self.smooth_rate)

    @property
    def position(self) -> np.ndarray:
        """(N, 2) [m]."""
        return self.now.particle_q.numpy()[:, :2].astype(float) - self.shift

    @property
    def velocity(self) -> np.ndarray:
        """(N, 2) [m/s]."""
        return self.now.particle_qd.numpy()[:, :2].astype(float)

    @property
    def rate(self) -> np.ndarray:
        """Rate of shear in the plane, largest less least principal, (N,) [1/s]."""
        grad = self.now.mpm.particle_qd_grad.numpy().astype(float)
        across = grad[:, 0, 1] + grad[:, 1, 0]
        return np.hypot(grad[:, 0, 0] - grad[:, 1, 1], across)

    # --- the model ---

    def _shift(self) -> np.ndarray:
        """By which the scene moves: the ground at the foot and a closed wall lie off the nodes."""
        scene = self.loading.scene
        base = float(scene.ground.height(scene.foot("right")))
        place = np.array([scene.domain.x_min, base])
        return (0.5 + RAISED - place / self.voxel % 1.0) * self.voxel  # nodes lie at k + 1/2

    def _in_slab(self, position: np.ndarray) -> np.ndarray:
        """Points of the section (N, 2) as places of the slab, (N, 3)."""
        return np.column_stack([position + self.shift, np.zeros(len(position))]).astype(np.float32)

    def _add_soil(self, builder: Any) -> None:
        points, spacing = self.loading.points, self.loading.scene.spacing
        volume = spacing**2 * self.voxel
        self.mass = self.loading.density * volume
        n = len(points)
        builder.add_particles(
            pos=self._in_slab(points.position).tolist(),
            vel=[(0.0, 0.0, 0.0)] * n,
            mass=self.mass.tolist(),
            radius=[0.5 * volume ** (1.0 / 3.0)] * n,
        )

    def _add_ground(self, builder: Any) -> None:
        """The ground as an extruded polyline, and closed walls; materials are set node by node."""
        import newton

        cfg = newton.ModelBuilder.ShapeConfig(mu=0.0)
        scene, wide = self.loading.scene, 1e3
        line = np.asarray(scene.ground.points, dtype=float)
        ends = [(line[0, 0] - wide, line[0, 1]), (line[-1, 0] + wide, line[-1, 1])]
        top = np.vstack([ends[0], line, ends[1]]) + self.shift
        adhesion = {"mpm:collider_adhesion": 1.0}
        mesh = _prism(top, float(top[:, 1].min()) - THICK, self.voxel)
        builder.add_shape_mesh(-1, mesh=mesh, cfg=cfg, custom_attributes=adhesion)
        if scene.domain.walls == "closed":
            for x, sign in ((scene.domain.x_min, -1.0), (scene.domain.x_max, 1.0)):
                centre = (x + self.shift[0] + sign * THICK, 0.0, 0.0)
                builder.add_shape_box(
                    -1, xform=(centre, (0.0, 0.0, 0.0, 1.0)), hx=THICK, hy=20 * THICK, hz=THICK,
                    cfg=cfg, custom_attributes=adhesion,
                )  # fmt: skip

    def _set_soil(self) -> None:
        own, soil = self.loading, self.model.mpm
        soil.young_modulus.fill_(RIGID)
        soil.friction.assign(np.sin(own.friction).astype(np.float32))
        soil.yield_pressure.fill_(NO_CAP)

    def _strengths(self, cohesion: np.ndarray) -> None:
        """Strength of the particles from now on, (N,) [Pa]."""
        self.cohesion = cohesion
        friction = self.loading.friction
        firm = np.tan(np.maximum(friction, 1e-6))
        # Without friction tension has no cut-off; with it the cut-off is at c cot(phi), and newton
        # counts its friction from there, so that nothing is left for the yield stress.
        cap = np.where(friction > 0.0, np.minimum(cohesion / firm, NO_CAP), NO_CAP)
        plain = np.where(friction > 0.0, 0.0, cohesion)
        self.model.mpm.tensile_yield_ratio.assign((cap / NO_CAP).astype(np.float32))
        self.model.mpm.yield_stress.assign(plain.astype(np.float32))

    def _contact(self, places: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction (k,) and adhesion (k,) [Pa] of nodes at places (k, 3) of the ground."""
        from scipy.spatial import cKDTree

        share, walls = self.loading.base_share, np.abs(normals[:, 0]) > 0.9
        position = self.now.particle_q.numpy()[:, :2]
        _, near = cKDTree(position).query(places[:, :2], k=min(4, len(position)))
        friction = self.loading.friction[near]
        ground = self.loading.scene.ground
        if ground.contact == "no_slip" and share == 1.0:
            mu, tau = np.full(len(places), 1.0), np.full(len(places), BOND)
        elif ground.contact == "coulomb":
            mu = np.full(len(places), share * (ground.friction_coefficient or 0.0))
            tau = np.zeros(len(places))
        else:
            mu = share * np.sin(friction).mean(axis=1)
            tau = share * (self.cohesion[near] * np.cos(friction)).mean(axis=1)
        mu, tau = np.where(walls, 0.0, mu), np.where(walls, 0.0, tau)
        raised = np.where(walls, mu, np.maximum(mu, LEAST_FRICTION))
        # What friction has been added is taken off the adhesion, by the weight of the soil above.
        left = tau - (raised - mu) * self._weight_above(places[:, 0])
        return raised, 2.0 * np.maximum(left, 0.0) / np.maximum(raised, 1e-9)

    def _weight_above(self, x: np.ndarray) -> np.ndarray:
        """Weight of the soil over its base at places (k,) of the slab [Pa]."""
        place = self.now.particle_q.numpy()[:, 0]
        column = np.round(place / self.voxel - 0.5).astype(int)  # of the nearest nodes
        first = column.min() - 1
        weight = np.bincount(
            column - first, weights=self.weight, minlength=column.max() - first + 2
        )
        nodes = (first + 0.5 + np.arange(len(weight))) * self.voxel
        return np.interp(x, nodes, weight) / self.voxel**2

    def _step(self, step: float) -> None:
        import warp as wp

        force = np.zeros((len(self.mass), 3), np.float32)
        force[:, :2] = self.loading.acceleration(self.moment()) * self.mass[:, None]
        self.weight = self.mass * self.loading.gravity - force[:, 1]
        with wp.ScopedDevice("cpu"):
            self.now.particle_f.assign(force)
            self.solver.step(self.now, self.next, None, None, step)
            self.solver.project_outside(self.next, self.next, step)
        self.now, self.next = self.next, self.now
        self._flatten()
        self.time += step
        rate = self.rate
        self.strain = self.strain + step * rate
        self.smooth_rate = (1.0 - FOLLOWS) * self.smooth_rate + FOLLOWS * rate

    def _flatten(self) -> None:
        """Take off what rounding has moved out of the plane: nothing there holds it back."""
        self.now.particle_q.numpy()[:, 2] = 0.0  # views: the device is a CPU
        self.now.particle_qd.numpy()[:, 2] = 0.0
        grad = self.now.mpm.particle_qd_grad.numpy()
        grad[:, 2, :] = grad[:, :, 2] = 0.0

    def _still_to_come(self) -> bool:
        """Something that is hidden begins or ends later."""
        now = self.moment()
        force, own = self.loading.acceleration(now), self.loading.cohesion(now)
        for ahead in (2.0, 5.0, 10.0):
            then = replace(now, time=self.time + ahead)
            if not np.allclose(self.loading.acceleration(then), force):
                return True
            if np.any(self.loading.cohesion(then) < 0.99 * own):
                return True
        return False


def _prism(top: np.ndarray, bottom: float, thick: float) -> Any:
    """A mesh of all that lies below a polyline (P, 2), from z -thick to thick."""
    import newton

    n = len(top)
    rows = []
    for z in (-thick, thick):
        rows.append(np.column_stack([top, np.full(n, z)]))
        rows.append(np.column_stack([top[:, 0], np.full(n, bottom), np.full(n, z)]))
    vertices = np.concatenate(rows).astype(np.float32)
    triangles = []
    for k in range(n - 1):
        upper, lower, far_upper, far_lower = (k + n * row for row in range(4))
        # Seen from outside, counter-clockwise: top, bottom, near and far face.
        for a, b, c, d in (
            (upper, far_upper, far_upper + 1, upper + 1),
            (lower, lower + 1, far_lower + 1, far_lower),
            (upper, upper + 1, lower + 1, lower),
            (far_upper, far_lower, far_lower + 1, far_upper + 1),
        ):
            triangles += [(a, b, c), (a, c, d)]
    for k in (0, n - 1):
        upper, lower, far_upper, far_lower = (k + n * row for row in range(4))
        quad = (upper, lower, far_lower, far_upper)
        a, b, c, d = quad if k == 0 else quad[::-1]
        triangles += [(a, b, c), (a, c, d)]
    return newton.Mesh(vertices, np.array(triangles, np.int32).ravel(), compute_inertia=False)


@cache
def _plane_solver() -> type:
    """Newton's solver without strain out of the plane, with strength of the ground by node."""
    import newton

    class Plane(newton.solvers.SolverImplicitMPM):
        """`contact`: places (k, 3) and normals (k, 3) of nodes -> friction, adhesion, both (k,)."""

        contact: Any = None

        def _build_plasticity_system(
            self, state_in: Any, dt: float, pic: Any, scratch: Any, inv_cell_volume: float
        ) -> None:
            super()._build_plasticity_system(state_in, dt, pic, scratch, inv_cell_volume)
            # Rows hold the gradient of a node's shape function.
            scratch.strain_matrix.values.numpy()[..., 2] = 0.0

        def _rasterize_colliders(
            self,
            state_in: Any,
            dt: float,
            last_step_data: Any,
            scratch: Any,
            inv_cell_volume: float,
        ) -> None:
            super()._rasterize_colliders(state_in, dt, last_step_data, scratch, inv_cell_volume)
            friction = scratch.collider_friction.numpy()  # views: the device is a CPU
            active = np.flatnonzero(friction >= 0.0)
            if self.contact is None or not len(active):
                return
            places = scratch.collider_position_field.dof_values.numpy()[active]
            normals = scratch.collider_normal_field.dof_values.numpy()[active]
            mu, adhesion = self.contact(places, normals)
            friction[active] = mu
            scratch.collider_adhesion.numpy()[active] *= adhesion

    return Plane
