"""Transfer between points and grid: what the splines, the scatter and the gather keep exactly."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache

import numpy as np
import pytest
import taichi as ti

from mpm_taichi.layout import VEC4, VOLUMETRIC, A, StepNumbers, vec2, vec4
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, ground_strength, material_constants
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.nodes import node_update
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver.splines import (
    BASE_EDGE,
    LEAST_SHARE,
    LEFT_EDGE,
    RIGHT_EDGE,
    edge_slopes,
    edge_weights,
    mass_offset,
    spline_weights,
    weights_of_points,
)
from mpm_taichi.solver.stress import stress_functions
from mpm_taichi.solver.transfer import gather, mass_weights, move, scatter, scatter_volume
from tests.mpm_taichi.arrays import arrays

VEC2 = ti.types.ndarray(dtype=vec2, ndim=1)
INTEGERS = ti.types.ndarray(dtype=ti.i32, ndim=1)
NUMBERS = ti.types.ndarray(dtype=ti.f32, ndim=1)

update_node = node_update()

CELL, ROWS, COLUMNS = 2.0, 12, 10
KINDS = [0, BASE_EDGE | LEFT_EDGE, BASE_EDGE | RIGHT_EDGE]
SPIN, SHIFT = np.array([[0.3, -1.2], [0.8, -0.1]]), np.array([2.0, -3.0])


@pytest.fixture(scope="module", autouse=True)
def taichi():
    start("cpu", 1)


@ti.kernel
def weights_of(offset: NUMBERS, weights: VEC4):
    for p in offset:
        w = spline_weights(offset[p])
        weights[p] = vec4(w[0], w[1], w[2], 0.0)


@ti.kernel
def gather_all(
    flow: VEC4, home: INTEGERS, kind: ti.i32, motion: VEC4, mean: VEC4, gradient: VEC4,
    columns: ti.i32, cell: ti.f32,
):  # fmt: skip
    ti.loop_config(serialize=True)
    for p in home:
        m, g = gather(flow, home[p], columns, kind, motion[p], cell)
        mean[p] = m
        gradient[p] = g


@cache
def scatter_all(affine: bool):
    """Kernel that scatters all points, with their volumes and strengths."""

    @ti.func
    def scatter_points(cell: A, columns: A, state: A):
        points, materials = ti.static((state.points, state.materials))
        load = ti.static(state.nodes.load)
        for _ in range(1):
            per_cell = 1.0 / cell
            step = ti.static(
                StepNumbers(
                    slot=0, first_node=0, columns=columns, cell=cell, per_cell=per_cell,
                    dt=0.0,
                )
            )  # fmt: skip
            for p in range(points.home.shape[0]):
                kind = state.nodes.kind[points.home[p]]
                mass = materials.density[p] * points.volume[p]
                scatter(p, step, points, load, kind, mass, affine, False)
                x, y = mass_weights(points.motion[p], kind)
                friction, adhesion = ground_strength(materials.strength[p])
                scatter_volume(
                    load, points.home[p], columns, x, y, points.volume[p], friction, adhesion,
                    False,
                )  # fmt: skip

    return state_kernel(scatter_points, cell=ti.f32, columns=ti.i32)


@ti.kernel
def move_all(
    motion: VEC4, home: INTEGERS, mean: VEC4, alarm: INTEGERS, columns: ti.i32, blend: ti.f32,
    dt: ti.f32, cell: ti.f32,
):  # fmt: skip
    for p in home:
        new, shift, raised = move(motion[p], columns, mean[p], blend, dt, 1.0 / cell)
        motion[p] = new
        home[p] += shift
        alarm[p] = raised


@ti.func
def update_nodes(dt: A, gravity: A, damping: A, work: A, state: A):
    for n in range(state.nodes.load.shape[0]):
        step = ti.static(
            StepNumbers(
                slot=0, first_node=0, columns=1, cell=1.0, per_cell=1.0, dt=dt,
                gravity=gravity, damping=damping,
            )
        )  # fmt: skip
        done = update_node(n, step, state.nodes, state.slots)
        work[n] = vec2(done[0], done[1])


node_of = state_kernel(update_nodes, dt=ti.f32, gravity=ti.f32, damping=ti.f32, work=VEC2)


@cache
def stress_of(averaged: bool, corrected: bool):
    """Kernel that takes a point's stress through a step."""
    functions = stress_functions(MOHR_COULOMB, averaged=averaged, corrected=corrected)

    @ti.func
    def step_stress(dt: A, share: A, state: A):
        points, materials = ti.static((state.points, state.materials))
        for p in range(points.stress.shape[0]):
            step = ti.static(
                StepNumbers(
                    slot=0, first_node=0, columns=1, cell=1.0, per_cell=1.0, dt=dt,
                    share=share,
                )
            )  # fmt: skip
            stress, history, _ = functions.advance(
                p, step, points, state.nodes.cell_mean[p], materials.elastic[points.row[p]],
                materials.strength[points.row[p]], 0,
            )  # fmt: skip
            points.stress[p] = stress
            points.history[p] = history

    return state_kernel(step_stress, dt=ti.f32, share=ti.f32)


@ti.kernel
def edge_weights_of(offset: NUMBERS, low: ti.i32, high: ti.i32, weights: VEC4, slopes: VEC4):
    for p in offset:
        w = edge_weights(offset[p], low, high)
        s = edge_slopes(offset[p], low, high)
        weights[p] = vec4(w[0], w[1], w[2], mass_offset(offset[p], low, high))
        slopes[p] = vec4(s[0], s[1], s[2], 0.0)


class Cloud:
    """P points anywhere among the nodes of a grid, with masses and stresses drawn at random.

    With bits of `splines` in `kind`, each point's home is a node of that kind.
    """

    def __init__(self, kind=0, count=200, seed=0):
        random = np.random.default_rng(seed)
        self.kind = kind
        self.position = CELL * random.uniform(2.0, [ROWS - 3, COLUMNS - 3], (count, 2))
        if kind:
            offset = random.uniform(LEAST_SHARE, 0.499, (count, 2))
            offset[:, 0] *= -1.0 if kind & RIGHT_EDGE else 1.0
            self.position = CELL * (np.floor(self.position / CELL + 0.5) + offset)
        centre = np.floor(self.position / CELL + 0.5).astype(int)
        self.home = (centre[:, 0] * COLUMNS + centre[:, 1]).astype(np.int32)
        self.motion = np.zeros((count, 4), np.float32)
        self.motion[:, :2] = self.position / CELL - centre
        self.mass = random.uniform(1e3, 3e3, count).astype(np.float32)
        self.stress = random.normal(-5e4, 3e4, (count, 4)).astype(np.float32)
        self.strain = random.uniform(-0.1, 0.1, count).astype(np.float32)
        self.strength = random.uniform(0.1, 1.0, (count, 4)).astype(np.float32)
        self.gradient = np.zeros((count, 4), np.float32)
        self.volume = random.uniform(0.5, 2.0, count).astype(np.float32)

    def with_linear_velocity(self):
        self.motion[:, 2:] = linear_velocity(self.position)
        self.gradient[:] = SPIN.T.ravel()  # dvx/dx, dvy/dx, dvx/dy, dvy/dy
        return self

    def scattered(self, affine=True) -> np.ndarray:
        count, number = len(self.home), ROWS * COLUMNS
        history = np.zeros((count, 4))
        history[:, VOLUMETRIC] = self.strain
        strength = np.zeros((count, 8))
        strength[:, :4] = self.strength
        state = arrays(
            count, number, count, home=self.home, kind=np.full(number, self.kind),
            motion=self.motion, gradient=self.gradient, stress=self.stress, history=history,
            volume=self.volume, density=self.mass / self.volume, strength=strength,
        )  # fmt: skip
        scatter_all(affine)(CELL, COLUMNS, *state.values())
        return state["load"].astype(float)


def linear_velocity(position):
    return position @ SPIN.T + SHIFT


def nodes() -> np.ndarray:
    i, j = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    return CELL * np.stack([i, j], axis=1)


def gathered(cloud, flow):
    mean, gradient = np.zeros((2, *cloud.motion.shape), np.float32)
    gather_all(
        flow.astype(np.float32), cloud.home, cloud.kind, cloud.motion, mean, gradient, COLUMNS, CELL
    )
    return mean.astype(float), gradient.astype(float)


def test_spline_weights_keep_constants_lines_and_the_second_moment():
    offset = np.linspace(-0.5, 0.5, 41, dtype=np.float32)
    weights = np.zeros((41, 4), np.float32)
    weights_of(offset, weights)
    weights, place = weights[:, :3].astype(float), np.array([-1.0, 0.0, 1.0])
    assert (weights >= 0).all()
    assert np.abs(weights.sum(axis=1) - 1.0).max() < 1e-6
    assert np.abs(weights @ place - offset).max() < 1e-6
    distance = place[None] - offset[:, None].astype(float)
    assert np.abs((weights * distance**2).sum(axis=1) - 0.25).max() < 1e-6


@pytest.mark.parametrize(("low", "high"), [(1, 0), (0, 1)])
def test_weights_next_to_a_boundary_are_linear_and_join_those_inside(low, high):
    sign = 1.0 if low else -1.0
    offset = (sign * np.linspace(0.0, 0.5, 21)).astype(np.float32)
    weights, slopes = np.zeros((2, 21, 4), np.float32)
    edge_weights_of(offset, low, high, weights, slopes)
    place, exact = np.array([-1.0, 0.0, 1.0]), offset.astype(float)
    assert np.abs(weights[:, :3].sum(axis=1) - 1.0).max() < 1e-6
    assert np.abs(weights[:, :3].astype(float) @ place - exact).max() < 1e-6
    assert (weights[:, 0 if low else 2] == 0.0).all(), "nothing behind the boundary"
    assert np.abs(slopes[:, :3].sum(axis=1)).max() == 0.0
    assert np.abs(slopes[:, :3].astype(float) @ place - 1.0).max() < 1e-6
    inside = sign * np.maximum(sign * offset, np.float32(LEAST_SHARE))
    assert (weights[:, 3] == inside).all()
    # At half a cell the neighbour takes over: its spline at -0.5 has the same weights and slopes.
    other, across = np.zeros((2, 1, 4), np.float32)
    edge_weights_of(np.array([-0.5 * sign], np.float32), 0, 0, other, across)
    nodes = (slice(1, 3), slice(0, 2)) if low else (slice(0, 2), slice(1, 3))
    assert weights[-1, nodes[0]] == pytest.approx(other[0, nodes[1]], abs=1e-6)
    assert slopes[-1, nodes[0]] == pytest.approx(across[0, nodes[1]], abs=1e-6)
    where = np.full(21, low > 0), np.full(21, high > 0)
    copy = weights_of_points(exact, *where)
    assert np.abs(np.stack(copy, axis=1) - weights[:, :3]).max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_gather_of_a_linear_velocity_field_is_exact(kind):
    cloud = Cloud(kind)
    flow = np.concatenate([linear_velocity(nodes()), 0.5 * linear_velocity(nodes())], axis=1)
    mean, gradient = gathered(cloud, flow)
    speed = np.abs(linear_velocity(cloud.position)).max()
    assert np.abs(mean[:, :2] - linear_velocity(cloud.position)).max() < 1e-6 * speed
    assert np.abs(mean[:, 2:] - 0.5 * linear_velocity(cloud.position)).max() < 1e-6 * speed
    assert np.abs(gradient - SPIN.T.ravel()).max() < 1e-5 * speed


@pytest.mark.parametrize("kind", KINDS)
def test_scatter_keeps_mass_momentum_and_angular_momentum(kind):
    cloud = Cloud(kind).with_linear_velocity()
    cloud.motion[:, 2:] += np.random.default_rng(1).normal(0, 1, (len(cloud.mass), 2))
    load, mass = cloud.scattered(), cloud.mass.astype(float)
    velocity = cloud.motion[:, 2:].astype(float)
    assert load[:, 4].sum() == pytest.approx(mass.sum(), rel=1e-6)
    assert load[:, :2].sum(axis=0) == pytest.approx(mass @ velocity, rel=1e-5)
    x, y = cloud.position.T
    # Each point also carries the angular momentum of its affine velocity: m h^2 x the second moment
    # of its weights x spin; 1/4 inside, xi (1 - xi) next to a boundary.
    own = mass @ (x * velocity[:, 1] - y * velocity[:, 0])
    xi = np.abs(cloud.motion[:, :2].astype(float))
    moment = xi * (1.0 - xi) if kind else np.full(xi.shape, 0.25)
    affine = CELL**2 * mass @ (moment @ [SPIN[1, 0], -SPIN[0, 1]])
    a, b = nodes().T
    assert (a * load[:, 1] - b * load[:, 0]).sum() == pytest.approx(own + affine, rel=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_scatter_of_a_linear_velocity_field_is_exact_wherever_the_points_lie(kind):
    load = Cloud(kind).with_linear_velocity().scattered()
    near = load[:, 4] > 1.0
    velocity = load[near, :2] / load[near, 4:5]
    expected = linear_velocity(nodes()[near])
    assert np.abs(velocity - expected).max() < 1e-4 * np.abs(expected).max()


def test_without_the_affine_part_only_the_velocity_travels():
    cloud = Cloud().with_linear_velocity()
    load = cloud.scattered(affine=False)
    assert load[:, :2].sum(axis=0) == pytest.approx(cloud.mass @ cloud.motion[:, 2:], rel=1e-5)
    a, b = nodes().T
    x, y = cloud.position.T
    own = cloud.mass @ (x * cloud.motion[:, 3] - y * cloud.motion[:, 2])
    assert (a * load[:, 1] - b * load[:, 0]).sum() == pytest.approx(own, rel=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_internal_force_has_no_sum_no_moment_and_the_power_of_the_stress(kind):
    cloud = Cloud(kind)
    load, stress = cloud.scattered(), cloud.stress.astype(float)
    force, place = load[:, 2:4], nodes()
    size = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-6 * size
    moment = place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0]
    assert abs(moment.sum()) < 1e-6 * np.abs(moment).sum()
    volume = cloud.volume * (1.0 + cloud.strain.astype(float))
    xx, yy, xy = stress[:, 0], stress[:, 1], stress[:, 3]
    power = xx * SPIN[0, 0] + yy * SPIN[1, 1] + xy * (SPIN[0, 1] + SPIN[1, 0])
    given = np.sum(force * linear_velocity(place))
    assert given == pytest.approx(-volume @ power, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_what_points_gain_is_what_nodes_gain(kind):
    # The same weights both ways: a change of velocity at the nodes adds its momentum to the points.
    cloud = Cloud(kind)
    load = cloud.scattered()
    flow = np.random.default_rng(3).normal(0, 1, (len(load), 4))
    mean, _ = gathered(cloud, flow)
    given = load[:, 4] @ flow[:, 2:]
    taken = cloud.mass.astype(float) @ mean[:, 2:]
    assert np.abs(taken - given).max() < 1e-5 * load[:, 4].sum()


@pytest.mark.parametrize("kind", KINDS)
def test_scattered_volume_and_strength(kind):
    cloud = Cloud(kind)
    load, strength = cloud.scattered(), cloud.strength.astype(float)
    volume = cloud.volume.astype(float)
    expected = [volume.sum(), 0.5 * volume @ strength[:, 1], volume @ strength[:, 0]]
    assert load[:, 5:].sum(axis=0) == pytest.approx(expected, rel=1e-5)


def moved(velocity, change=(0.0, 0.0), own=(0.0, 0.0), blend=0.0, dt=0.1, offset=(0.4, -0.4)):
    motion = np.array([[*offset, *own]], np.float32)
    home, alarm = np.array([35], np.int32), np.zeros(1, np.int32)
    mean = np.array([[*velocity, *change]], np.float32)
    move_all(motion, home, mean, alarm, COLUMNS, blend, dt, CELL)
    return motion[0].astype(float), int(home[0]), int(alarm[0])


def test_move_keeps_the_place_and_changes_the_home():
    motion, home, alarm = moved((4.0, -6.0))  # 0.2 and -0.3 cells
    assert home == 35 + COLUMNS - 1 and not alarm
    assert motion[:2] == pytest.approx([-0.4, 0.3])


def test_move_blends_flip_and_pic():
    flip, _, _ = moved((4.0, -6.0), change=(0.5, 0.25), own=(1.0, 2.0), blend=0.0)
    assert flip[2:] == pytest.approx([1.5, 2.25])
    pic, _, _ = moved((4.0, -6.0), change=(0.5, 0.25), own=(1.0, 2.0), blend=1.0)
    assert pic[2:] == pytest.approx([4.0, -6.0])
    half, _, _ = moved((4.0, -6.0), change=(0.5, 0.25), own=(1.0, 2.0), blend=0.5)
    assert half[2:] == pytest.approx([2.75, -1.875])


@pytest.mark.parametrize("velocity", [(60.0, 0.0), (0.0, -60.0), (np.nan, 0.0), (0.0, np.inf)])
def test_move_raises_the_alarm_and_stays(velocity):
    motion, home, alarm = moved(velocity)
    assert alarm == 1 and home == 35
    assert motion[:2] == pytest.approx([0.4, -0.4])


def updated(load, *, surroundings=(0.0,) * 8, kind=0, dt=0.01, gravity=0.0, damping=0.0):
    work = np.zeros((1, 2), np.float32)
    state = arrays(load=[load], surroundings=[surroundings], kind=[kind])
    node_of(dt, gravity, damping, work, *state.values())
    return state["velocity"][0].astype(float), work[0].astype(float)


def test_node_follows_newton():
    flow, work = updated([20.0, -10.0, 100.0, 50.0, 10.0, 0, 0, 0], gravity=9.81)
    assert flow[:2] == pytest.approx([2.1, -1.0 + 0.05 - 0.0981])
    assert flow[2:] == pytest.approx([0.1, 0.05 - 0.0981])
    assert (work == 0).all()


def test_local_damping_takes_a_share_of_the_force_against_the_motion():
    flow, _ = updated([20.0, -10.0, 100.0, 50.0, 10.0, 0, 0, 0], damping=0.2)
    assert flow[2:] == pytest.approx([0.08, 0.06])


def test_water_pushes_with_its_force_per_volume_and_its_work_is_counted():
    water = [0, 1, 0, 0, 300.0, 800.0, 0, 0]
    flow, work = updated([0, 0, 0, 0, 10.0, 2.0, 0, 0], surroundings=water)
    assert flow[:2] == pytest.approx([0.6, 1.6])
    assert work[1] == pytest.approx(0.5 * 0.01 * (600 * 0.6 + 1600 * 1.6))


def test_work_of_contact_is_the_kinetic_energy_it_takes():
    mass, dt = 10.0, 0.01
    load = [20.0, -10.0, 0.0, 0.0, mass, 0, 0, 0]
    flow, work = updated(load, surroundings=[0, 1, 0.3, 0, 0, 0, 0, 0], kind=2, dt=dt)
    before, after = np.array([2.0, -1.0]), flow[:2]
    assert work[0] == pytest.approx(0.5 * mass * (before @ before - after @ after), rel=1e-5)


def law(soil, stress, history, gradient, *, means=(0, 0, 0, 0), dt=1.0, share=0.0, averaged=False,
        corrected=False):  # fmt: skip
    """One call of the material law with everything around it; returns stress and history."""
    elastic = {name: soil[name] for name in ("youngs_modulus", "poisson_ratio")}
    strength = {name: soil[name] for name in ("friction_angle", "cohesion")}
    state = arrays(
        stress=[stress], history=[history], gradient=[gradient], cell_mean=[means],
        elastic=[elastic_constants(**elastic)], strength=[material_constants(**strength)],
    )  # fmt: skip
    stress_of(averaged, corrected)(dt, share, *state.values())
    return state["stress"][0].astype(float), state["history"][0].astype(float)


STRONG = {"friction_angle": 0.0, "cohesion": 1e9, "youngs_modulus": 30e6, "poisson_ratio": 0.25}
LOOSE = {"friction_angle": 0.5, "cohesion": 0.0, "youngs_modulus": 30e6, "poisson_ratio": 0.25}


def test_f_bar_takes_the_volume_from_the_cell_and_the_shape_from_the_point():
    gradient = (1e-3, 0.0, 0.0, -3e-3)
    change = -2e-3 - 3e-6  # with the second order, dx dy
    alone, _ = law(STRONG, (0,) * 4, (0,) * 4, gradient)
    shared, past = law(STRONG, (0,) * 4, (0,) * 4, gradient, means=(5e-4, 0, 0, 3), averaged=True)
    bulk = 30e6 / 1.5
    assert alone[:3].mean() == pytest.approx(bulk * change, rel=1e-5)
    assert shared[:3].mean() == pytest.approx(bulk * 5e-4, rel=1e-4)
    assert past[0] == pytest.approx(5e-4)
    assert shared[:3] - shared[:3].mean() == pytest.approx(alone[:3] - alone[:3].mean(), rel=1e-4)
    opened, _ = law(
        STRONG, (0,) * 4, (0, 1e-3, 0, 0), gradient, means=(5e-4, 0, 0, 3), averaged=True
    )
    assert opened == pytest.approx(alone), "opened soil goes by its own volume"


def test_pressure_relief_moves_the_mean_stress_towards_that_of_the_cell():
    stress, means = (-10e3, -20e3, -30e3, 5e3), (0.0, -12e3, -50e3, 4.0)
    new, _ = law(STRONG, stress, (0,) * 4, (0,) * 4, means=means, share=0.25, averaged=True)
    assert new == pytest.approx([-8e3, -18e3, -28e3, 5e3])
    opened, _ = law(
        STRONG, stress, (0, 1e-3, 0, 0), (0,) * 4, means=means, share=0.25, averaged=True
    )
    assert opened == pytest.approx(stress), "opened soil has no part in it"


def test_opened_soil_closes_before_it_resists():
    swell, press = (2e-3, 0, 0, 2e-3), (-1.5e-3, 0, 0, -1.5e-3)
    stress, history = law(LOOSE, (0,) * 4, (0,) * 4, swell, corrected=True)
    assert np.abs(stress).max() < 1.0 and history[1] == pytest.approx(4e-3 + 4e-6, rel=1e-4)
    assert history[0] == pytest.approx(0.0, abs=1e-8), "an opening is not a volume of soil"
    stress, history = law(LOOSE, stress, history, press, corrected=True)
    assert stress[:3].mean() == pytest.approx(0.0, abs=5.0)
    assert history[1] == pytest.approx(4e-3 + 4e-6 - 3e-3 + 2.25e-6, rel=1e-3)
    kept, _ = law(LOOSE, stress, history, press, corrected=True)
    assert kept[:3].mean() == pytest.approx(-30e6 / 1.5 * 2e-3, rel=0.02)


def test_plastic_work_is_summed_per_point():
    soil = {**STRONG, "cohesion": 1e3}
    _, history = law(soil, (0,) * 4, (0,) * 4, (0.01, 0.0, 0.0, -0.01))
    shear = 30e6 / 2.5
    elastic_strain = 2e3 / (2 * shear)  # hi - lo over 2 G
    assert history[2] == pytest.approx(0.02 - elastic_strain, rel=1e-4)
    assert history[3] == pytest.approx(1e3 * (0.02 - elastic_strain), rel=1e-3)
