"""Steps in time of smoothed particles: strain, stress, forces, contact with the ground. Taichi.

One thread takes all particles through all steps of a call, so that the bits of a result do not
depend on the load of the machine. All numbers are float64; stress is positive in tension.

Beyond the ground and smooth walls the soil continues as its own mirror image, so that nothing goes
through them and no shear acts on them; friction along the ground is a force of its own
(`on_ground`).
"""

import taichi as ti

real = ti.f64
vec, vec4 = ti.types.vector(2, ti.f64), ti.types.vector(4, ti.f64)
mat = ti.types.matrix(2, 2, ti.f64)
Scalars = ti.types.ndarray(dtype=ti.f64, ndim=1)
Vectors = ti.types.ndarray(dtype=vec, ndim=1)
Stresses = ti.types.ndarray(dtype=vec4, ndim=1)
Matrices = ti.types.ndarray(dtype=mat, ndim=1)
Integers = ti.types.ndarray(dtype=ti.i32, ndim=1)
#: An array of a kernel, handed on to a function.
Array = ti.template()

PI = (245850922, 78256779)
"""As a ratio of whole numbers. A decimal takes the precision with which Taichi was started, which
may be that of the judge's solver; so all others here are exact in both."""
IMAGES = 4
"""A neighbour itself (0), behind a wall (1), below the ground (2), and both (3)."""
TOUCH = 1.25
"""Distance from the ground, in spacings, within which it holds particles."""


def start() -> None:
    """Start Taichi on the CPU, unless it runs already."""
    if ti.lang.impl.get_runtime().prog is None:
        ti.init(
            arch=ti.cpu, cpu_max_num_threads=1, default_fp=ti.f64, fast_math=False,
            log_level=ti.ERROR,
        )  # fmt: skip


@ti.func
def kernel(r: vec, support: real) -> real:
    """Wendland's C2 kernel that ends at `support`, in the plane."""
    q = ti.min(r.norm() / support, 1.0)
    return 7.0 / (PI[0] * support**2) * PI[1] * (1.0 - q) ** 4 * (1.0 + 4.0 * q)


@ti.func
def slope_of_kernel(r: vec, support: real) -> vec:
    """Gradient of `kernel` at r."""
    rest = ti.max(1.0 - r.norm() / support, 0.0)
    return -140.0 / (PI[0] * support**4) * PI[1] * rest * rest * rest * r


@ti.func
def level_and_normal(x: vec, spacing: real, ground_x0: real, ground_y: Array, normal: Array):
    """Distance from the ground, and its normal at the particle's place."""
    at = (x[0] - ground_x0) / spacing
    k = ti.max(0, ti.min(ground_y.shape[0] - 2, ti.cast(ti.floor(at), ti.i32)))
    part = ti.max(0.0, ti.min(1.0, at - k))
    n = ((1.0 - part) * normal[k] + part * normal[k + 1]).normalized()
    level = (1.0 - part) * ground_y[k] + part * ground_y[k + 1]
    return (x[1] - level) * n[1], n


@ti.func
def near_wall(x: vec, support: real, left: real, right: real):
    """Whether a wall is within the support, and where it is."""
    wall = left
    if right - x[0] < x[0] - left:
        wall = right
    return ti.abs(x[0] - wall) < support, wall


@ti.func
def image(kind: ti.template(), other: vec, x: vec, wall: real, distance: real, n: vec):
    """Place of a neighbour's image, and the reflection of its vectors."""
    place, turn = other, ti.Matrix.identity(ti.f64, 2)
    if ti.static(kind >= 2):
        place -= 2.0 * (distance + (other - x).dot(n)) * n
        turn -= 2.0 * n.outer_product(n)
    if ti.static(kind % 2 == 1):
        place = vec(2.0 * wall - place[0], place[1])
        turn = mat([[-1.0, 0.0], [0.0, 1.0]]) @ turn
    return place, turn


@ti.func
def reflected(s: vec4, turn: mat) -> vec4:
    """A stress of an image."""
    found = turn @ mat([[s[0], s[3]], [s[3], s[1]]]) @ turn.transpose()
    return vec4(found[0, 0], found[1, 1], s[2], found[0, 1])


@ti.func
def is_there(kind: ti.template(), by_wall: int, by_ground: int) -> int:
    """Whether a particle can see images of a kind."""
    found = 1
    if ti.static(kind % 2 == 1):
        found = found and by_wall
    if ti.static(kind >= 2):
        found = found and by_ground
    return found


@ti.func
def inverse_or_one(moment: mat) -> mat:
    """Inverse of the matrix of moments; 1 where a particle has too few neighbours for it."""
    found = ti.Matrix.identity(ti.f64, 2)
    if moment.determinant() > 0.125:
        found = moment.inverse()
    return found


@ti.func
def returned(
    trial: vec4, bulk: real, shear: real, friction: real, cohesion: real, cap: real, opened: real
):
    """Return a trial stress to the cone of Drucker and Prager, without dilation.

    sqrt(J2) <= cohesion + friction p and p >= -cap. Soil that has opened at the cap carries no
    pressure before it has closed again.

    Returns:
        stress, opened strain, plastic shear strain of this step.
    """
    one = vec4(1.0, 1.0, 1.0, 0.0)
    pressure = -(trial[0] + trial[1] + trial[2]) / 3.0
    dev = trial + pressure * one
    gap = opened
    if pressure < -cap:
        gap += (-cap - pressure) / bulk
        pressure = -cap
    elif gap > 0.0:
        closing = ti.min(gap, (pressure + cap) / bulk)
        gap -= closing
        pressure -= closing * bulk
    size = ti.sqrt(0.5 * (dev[0] ** 2 + dev[1] ** 2 + dev[2] ** 2) + dev[3] ** 2)
    limit = ti.max(cohesion + friction * pressure, 0.0)
    plastic = ti.cast(0.0, ti.f64)
    if size > limit:
        plastic = (size - limit) / shear
        dev *= limit / size
    return dev - pressure * one, gap, plastic


@ti.func
def artificial(stress: vec4, share: real) -> mat:
    """A share of the tension along each principal axis, as a pressure (Gray et al. 2001)."""
    mean, half = 0.5 * (stress[0] + stress[1]), 0.5 * (stress[0] - stress[1])
    radius = ti.sqrt(half * half + stress[3] * stress[3])
    high, low = ti.max(mean + radius, 0.0), ti.max(mean - radius, 0.0)
    middle, spread = 0.5 * (high + low), 0.5 * (high - low)
    c, s = ti.cast(1.0, ti.f64), ti.cast(0.0, ti.f64)
    if radius > 0.0:
        c, s = half / radius, stress[3] / radius
    return -share * mat([[middle + spread * c, spread * s], [spread * s, middle - spread * c]])


@ti.func
def touch(distance: real, along: real, spacing: real) -> real:
    """Weight with which a column of the ground acts on a particle."""
    return ti.max(0.0, TOUCH - distance / spacing) * ti.max(0.0, 1.0 - along)


@ti.func
def strain_of(
    i, dt, spacing, support, against_tension, elastic, left, right, ground_x0, position: Array,
    velocity: Array, stress: Array, density: Array, opened: Array, strain: Array, rate: Array,
    mass: Array, bulk: Array, shear: Array, friction: Array, cohesion: Array, cap: Array,
    start_of: Array, neighbour: Array, ground_y: Array, normal: Array, carried: Array,
    gradient: Array, flux: Array, tension: Array, shift: Array, spreading: real,
):  # fmt: skip
    """Velocity gradient, exact for linear fields; stress and strain after the step."""
    x, v = position[i], velocity[i]
    distance, n = level_and_normal(x, spacing, ground_x0, ground_y, normal)
    by_wall, wall = near_wall(x, support, left, right)
    moment, change = ti.Matrix.zero(ti.f64, 2, 2), ti.Matrix.zero(ti.f64, 2, 2)
    crowded = vec(0.0, 0.0)
    for at in range(start_of[i], start_of[i + 1]):
        j = neighbour[at]
        room = mass[j] / density[j]
        for kind in ti.static(range(IMAGES)):
            if is_there(kind, by_wall, distance < support):
                place, turn = image(kind, position[j], x, wall, distance, n)
                slope = room * slope_of_kernel(x - place, support)
                moment += (place - x).outer_product(slope)
                change += (turn @ velocity[j] - v).outer_product(slope)
                crowded += slope
    if distance < TOUCH * spacing:
        middle = ti.cast(ti.round((x[0] - ground_x0) / spacing), ti.i32)
        for k in range(middle - 1, middle + 2):
            along = ti.abs(x[0] - ground_x0 - k * spacing) / spacing
            carried[ti.max(0, ti.min(ground_y.shape[0] - 1, k))] += touch(distance, along, spacing)
    inverse = inverse_or_one(moment)
    g = change @ inverse
    gradient[i] = g
    one = vec4(1.0, 1.0, 1.0, 0.0)
    e = dt * vec4(g[0, 0], g[1, 1], 0.0, 0.5 * (g[0, 1] + g[1, 0]))
    volume = e[0] + e[1]
    s = stress[i]
    s += 0.5 * dt * (g[0, 1] - g[1, 0]) * vec4(2.0 * s[3], -2.0 * s[3], 0.0, s[1] - s[0])
    s += bulk[i] * volume * one + 2.0 * shear[i] * (e - volume / 3.0 * one)
    if not elastic:
        s, gap, plastic = returned(
            s, bulk[i], shear[i], friction[i], cohesion[i], cap[i], opened[i]
        )
        opened[i] = gap
        strain[i] += plastic
    stress[i] = s
    rate[i] = ti.sqrt((g[0, 0] - g[1, 1]) ** 2 + (g[0, 1] + g[1, 0]) ** 2)
    # Particles of soil that is drawn out would gather in chains: they move to where there is room,
    # inside the soil, in proportion to its strain (after Lind et al. 2012).
    inside = ti.max(0.0, ti.min(1.0, 4.0 * moment.determinant() - 2.5))
    shift[i] = -spreading * inside * dt * rate[i] * 0.25 * support * support * crowded
    flux[i] = mat([[s[0], s[3]], [s[3], s[1]]]) @ inverse.transpose()
    tension[i] = artificial(s, against_tension)


@ti.func
def force_of(
    i, spacing, support, alpha, left, right, ground_x0, position: Array, velocity: Array,
    density: Array, mass: Array, bulk: Array, shear: Array, start_of: Array, neighbour: Array,
    ground_y: Array, normal: Array, pressed: Array, gradient: Array, flux: Array, tension: Array,
):  # fmt: skip
    """Force per mass of the neighbours: the work of the stress on the strain.

    The artificial viscosity acts on the part of velocities that is not linear in space, so it does
    not resist even shear.
    """
    x, v, g = position[i], velocity[i], gradient[i]
    distance, n = level_and_normal(x, spacing, ground_x0, ground_y, normal)
    by_wall, wall = near_wall(x, support, left, right)
    speed = ti.sqrt((bulk[i] + 4.0 * shear[i] / 3.0) / density[i])
    usual = kernel(vec(spacing, 0.0), support)
    total, of_ground = vec(0.0, 0.0), vec(0.0, 0.0)
    for at in range(start_of[i], start_of[i + 1]):
        j = neighbour[at]
        both = speed + ti.sqrt((bulk[j] + 4.0 * shear[j] / 3.0) / density[j])
        damping = 0.125 * alpha * support * both * (density[i] + density[j])
        for kind in ti.static(range(IMAGES)):
            if is_there(kind, by_wall, distance < support):
                place, turn = image(kind, position[j], x, wall, distance, n)
                way = x - place
                slope = mass[j] / density[j] * slope_of_kernel(way, support)
                back = turn.transpose()
                pull = tension[i] + turn @ tension[j] @ back
                near = kernel(way, support) / usual
                bent = v - turn @ velocity[j] - 0.5 * (g + turn @ gradient[j] @ back) @ way
                square = way.dot(way) + 0.0078125 * spacing * spacing
                force = (flux[i] + turn @ flux[j] @ back + near**4 * pull) @ slope
                force += damping * bent.dot(way) / square * slope
                total += force
                if ti.static(kind >= 2):
                    of_ground += force
    if distance < support:
        place = (x[0] - ground_x0) / spacing
        first = ti.max(0, ti.min(ground_y.shape[0] - 2, ti.cast(ti.floor(place), ti.i32)))
        size = mass[i] / density[i] * of_ground.dot(n)
        pressed[first] += (first + 1 - place) * size
        pressed[first + 1] += (place - first) * size
    return total / density[i]


@ti.func
def on_ground(
    i, v: vec, dt, spacing, bonded, base_share, base_friction, ground_x0, position: Array,
    mass: Array, friction: Array, cohesion: Array, ground_y: Array, normal: Array, carried: Array,
    pressed: Array,
) -> vec:  # fmt: skip
    """Velocity after the contact: no way into the ground, friction along it.

    A column of the ground shares out its traction over the particles that it touches, with the
    weights of `touch`; a traction that would turn the motion round only stops it.
    """
    distance, n = level_and_normal(position[i], spacing, ground_x0, ground_y, normal)
    found = v
    if distance < TOUCH * spacing:
        coefficient, adhesion = friction[i], cohesion[i]
        if base_friction >= 0.0:
            coefficient, adhesion = base_friction, ti.cast(0.0, ti.f64)
        held, most = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
        middle = ti.cast(ti.round((position[i][0] - ground_x0) / spacing), ti.i32)
        for k in range(middle - 1, middle + 2):
            column = ti.max(0, ti.min(ground_y.shape[0] - 1, k))
            along = ti.abs(position[i][0] - ground_x0 - k * spacing) / spacing
            part = touch(distance, along, spacing) / ti.max(carried[column], 0.125)
            held += part
            length = spacing / normal[column][1]
            most += part * ti.max(adhesion * length + coefficient * pressed[column], 0.0)
        along_ground = vec(n[1], -n[0])
        slip, into = v.dot(along_ground), v.dot(n)
        most *= base_share * dt / mass[i]
        if bonded and held > 0.0:
            most = ti.abs(slip)
        slip -= ti.max(-most, ti.min(most, slip))
        if distance < 0.125 * spacing:
            into = ti.max(into, 0.0)
        found = slip * along_ground + into * n
    return found


@ti.kernel
def advance(
    steps: int, dt: real, spacing: real, support: real, alpha: real, against_tension: real,
    keep: real, settling: int, bonded: int, left: real, right: real, base_share: real,
    base_friction: real, ground_x0: real,
    position: Vectors, velocity: Vectors, stress: Stresses, density: Scalars, opened: Scalars,
    strain: Scalars, rate: Scalars, mass: Scalars, bulk: Scalars, shear: Scalars,
    friction: Scalars, cohesion: Scalars, cap: Scalars, body: Vectors,
    start_of: Integers, neighbour: Integers, ground_y: Scalars, normal: Vectors,
    carried: Scalars, pressed: Scalars, gradient: Matrices, flux: Matrices, tension: Matrices,
    force: Vectors, shift: Vectors, spreading: real,
):  # fmt: skip
    """Take particles through `steps` steps. N particles.

    `alpha` is the artificial viscosity, `against_tension` the share of tension that is opposed, and
    `keep` the share of the velocity that a step leaves. `settling`: stress alone changes, without
    yield; `bonded`: the ground holds what touches it; `left`, `right`: smooth walls [m].
    `base_share` is the strength of the contact with the ground over that of the soil on it,
    `base_friction` its coefficient; negative: the soil's own strength. The ground is given at
    columns a spacing apart from `ground_x0` on, with `carried`, the weights of the particles on
    each, and `pressed`, its force on them. `body` is force per mass, `start_of` the first neighbour
    of each particle, (N + 1,); `gradient` to `shift` are work space; `spreading` is how far strain
    makes particles go to where there is room.
    """
    ti.loop_config(serialize=True)
    for _step in range(steps):
        for k in range(carried.shape[0]):
            carried[k], pressed[k] = 0.0, 0.0
        for i in range(position.shape[0]):
            strain_of(
                i, dt, spacing, support, against_tension, settling, left, right, ground_x0,
                position, velocity, stress, density, opened, strain, rate, mass, bulk, shear,
                friction, cohesion, cap, start_of, neighbour, ground_y, normal, carried,
                gradient, flux, tension, shift, spreading,
            )  # fmt: skip
        for i in range(position.shape[0]):
            force[i] = body[i] + force_of(
                i, spacing, support, alpha, left, right, ground_x0, position, velocity, density,
                mass, bulk, shear, start_of, neighbour, ground_y, normal, pressed, gradient, flux,
                tension,
            )  # fmt: skip
        for i in range(position.shape[0]):
            v = keep * (velocity[i] + dt * force[i])
            v = on_ground(
                i, v, dt, spacing, bonded, base_share, base_friction, ground_x0, position,
                mass, friction, cohesion, ground_y, normal, carried, pressed,
            )  # fmt: skip
            velocity[i] = v
            if not settling:
                x = position[i] + dt * v + shift[i]
                position[i] = vec(ti.max(left, ti.min(right, x[0])), x[1])


@ti.kernel
def smooth(
    share: real, spacing: real, support: real, left: real, right: real, ground_x0: real,
    position: Vectors, stress: Stresses, density: Scalars, mass: Scalars, start_of: Integers,
    neighbour: Integers, ground_y: Scalars, normal: Vectors, along_x: Stresses,
    along_y: Stresses, smoothed: Stresses,
):  # fmt: skip
    """Take out of the stress a share of what is not linear in space between neighbours.

    Stress that alternates from particle to particle does no work and would stay for ever.
    """
    ti.loop_config(serialize=True)
    for _once in range(1):
        for i in range(position.shape[0]):
            x = position[i]
            by_wall, wall = near_wall(x, support, left, right)
            moment = ti.Matrix.zero(ti.f64, 2, 2)
            change = ti.Matrix.zero(ti.f64, 4, 2)
            for at in range(start_of[i], start_of[i + 1]):
                j = neighbour[at]
                for kind in ti.static(range(2)):  # the ground is no plane of symmetry of weight
                    if is_there(kind, by_wall, 0):
                        place, turn = image(kind, position[j], x, wall, 0.0, vec(0.0, 0.0))
                        slope = mass[j] / density[j] * slope_of_kernel(x - place, support)
                        moment += (place - x).outer_product(slope)
                        change += (reflected(stress[j], turn) - stress[i]).outer_product(slope)
            along_x[i], along_y[i] = vec4(0.0, 0.0, 0.0, 0.0), vec4(0.0, 0.0, 0.0, 0.0)
            if moment.determinant() > 0.0625:
                g = change @ moment.inverse()
                along_x[i] = vec4(g[0, 0], g[1, 0], g[2, 0], g[3, 0])
                along_y[i] = vec4(g[0, 1], g[1, 1], g[2, 1], g[3, 1])
        for i in range(position.shape[0]):
            x = position[i]
            by_wall, wall = near_wall(x, support, left, right)
            s = stress[i]
            for at in range(start_of[i], start_of[i + 1]):
                j = neighbour[at]
                for kind in ti.static(range(2)):
                    if is_there(kind, by_wall, 0):
                        place, turn = image(kind, position[j], x, wall, 0.0, vec(0.0, 0.0))
                        way = place - x
                        line = (along_x[i] + turn[0, 0] * reflected(along_x[j], turn)) * way[0]
                        line += (along_y[i] + reflected(along_y[j], turn)) * way[1]
                        weight = share * mass[j] / density[j] * kernel(way, support)
                        s += weight * (reflected(stress[j], turn) - stress[i] - 0.5 * line)
            smoothed[i] = s
        for i in range(position.shape[0]):
            stress[i] = smoothed[i]
