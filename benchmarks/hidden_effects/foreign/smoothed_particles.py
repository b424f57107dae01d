"""Smoothed particle hydrodynamics of soil: a method of our own that the judge does not use.

After Bui et al. (2008): elastic, perfectly plastic soil with the cone of Drucker and Prager,
matched to Mohr-Coulomb in plane strain without dilation (sin(phi), c cos(phi); Davis 1968), the
rate of Jaumann, artificial viscosity, artificial stress against tension. Other than there:

- velocity gradients are exact for linear fields (Bonet and Lok 1999), and forces are the work that
  the stress does on them, so that momentum and energy are kept;
- artificial viscosity acts on what is left of the velocity difference of two particles after its
  linear part is taken off: in shear it would add a strength of several kPa;
- particles of soil that is drawn out move to where there is room (after Lind et al. 2012);
- stress that alternates from particle to particle is smoothed, less its linear part;
- soil that opens at the apex of the cone must close before it carries pressure again;
- the ground and walls are planes of symmetry, in place of dummy particles; along the ground acts
  the soil's own strength, a share of it, or a coefficient, as the scene has it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import redirect_stdout

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from benchmarks.hidden_effects.foreign.hidden import THINGS, Hidden
from benchmarks.hidden_effects.foreign.loading import Loading, Moment
from benchmarks.hidden_effects.foreign.slide import LEAST_AREA, Slide
from geometry.scenes.scene import Material, Scene
from pipeline.cli import WorkFailed

HIDES = tuple(THINGS)
#: Places of particles are disturbed by up to this many spacings; more is noise of pressure.
JITTER = 0.05
#: Radius of the kernel, in spacings.
SUPPORT = 2.8
#: Of the artificial viscosity, and share of the tension that artificial stress opposes.
ALPHA, AGAINST_TENSION = 0.3, 0.3
#: Of the way to where there is room that strain makes particles go; 0 loses 23 % of the area of a
#: dry column three times as high as wide, 1 loses 13, 4 loses 3.
SPREADING = 4.0
#: Rate at which stress is smoothed, per time in which a wave goes from a particle to the next.
SMOOTHING = 0.4
#: Step in time, in the time that a wave of compression takes from a particle to the next.
COURANT = 0.4
#: Further neighbours that are listed, in spacings, so that a list lasts for some steps.
SKIN = 0.4
#: Steps after which strength and forces are asked for again.
ASKED = 5
SETTLING_STEPS, SETTLING_KEEPS = 1200, 0.97
#: Columns of ground beyond the feet, in heights of the section.
GROUND = 30.0
#: At rest: kinetic energy as a share of its peak, for a time, and no earlier than this [s].
REST_ENERGY, REST_FOR_S, REST_AFTER_S = 1e-3, 1.0, 16.0


class Body:
    """Particles of a scene, their state and the ground under them. N particles.

    Attributes:
        position: (N, 2) [m]; velocity: (N, 2) [m/s]; mass: (N,) [kg/m]; density: (N,) [kg/m3].
        stress: xx, yy, zz, xy, tension positive, (N, 4) [Pa]; opened: volume strain of soil that
            has opened at the tension it bears, (N,).
        strain: plastic shear strain, (N,); rate: of shear, (N,) [1/s].
        cohesion: c cos(phi), (N,) [Pa]; friction: sin(phi), (N,); cap: tension borne, (N,) [Pa].
        body: force per mass, (N, 2) [m/s2].
        wave_time: in which a wave of compression goes from a particle to the next [s].
    """

    def __init__(self, loading: Loading) -> None:
        scene, points = loading.scene, loading.points
        self.scene, self.spacing = scene, scene.spacing
        self.base_share = loading.base_share
        self.position, self.velocity = points.position.copy(), points.velocity.copy()
        n = len(points)
        self.density = loading.density.copy()
        self.mass = loading.density * scene.spacing**2
        modulus, ratio = loading.youngs_modulus, loading.poisson_ratio
        self.bulk = modulus / (3.0 * (1.0 - 2.0 * ratio))
        self.shear = 0.5 * modulus / (1.0 + ratio)
        self.friction = np.sin(loading.friction)
        self._cos = np.cos(loading.friction)
        self.cohesion = np.zeros(n)
        self.cap = np.array([_tension_cap(soil) for soil in scene.materials.values()])
        self.cap = self.cap[points.material]
        self.stress, self.body = np.zeros((n, 4)), np.zeros((n, 2))
        self.opened, self.strain, self.rate = np.zeros(n), np.zeros(n), np.zeros(n)
        speed = np.sqrt((self.bulk + 4.0 / 3.0 * self.shear) / self.density)
        self.wave_time = float(self.spacing / speed.max())
        self._listed: np.ndarray | None = None
        self._work = [np.zeros((n, 2, 2)) for _ in range(3)] + [np.zeros((n, 2)), np.zeros((n, 2))]
        self._smoothing = [np.zeros((n, 4)) for _ in range(3)]
        self._lay_ground()

    def _lay_ground(self) -> None:
        scene = self.scene
        reach = GROUND * (scene.extent[1] - scene.ground.lowest)
        before = int(np.ceil(reach / self.spacing))
        self._x0 = scene.domain.x_min + (0.5 - before) * self.spacing
        columns = int((scene.domain.x_max - scene.domain.x_min) / self.spacing) + 2 * before
        x = self._x0 + self.spacing * np.arange(columns)
        self._ground = scene.ground.height(x)
        slope = np.gradient(self._ground, self.spacing)
        size = np.sqrt(1.0 + slope**2)
        self._normal = np.column_stack([-slope / size, 1.0 / size])
        self._on_columns = np.zeros((2, columns))
        closed = scene.domain.walls == "closed"
        self._walls = (scene.domain.x_min, scene.domain.x_max) if closed else (-1e9, 1e9)
        self._bonded = scene.ground.contact == "no_slip"
        self._coefficient = scene.ground.friction_coefficient
        if self._coefficient is None:
            self._coefficient = -1.0

    def load(self, loading: Loading, moment: Moment) -> None:
        """Apply the strength and the forces of a moment."""
        if moment is loading.still or loading.changes:
            self.cohesion = loading.cohesion(moment) * self._cos
        self.body = loading.acceleration(moment)
        self.body[:, 1] -= loading.gravity

    def settle(self, overburden: np.ndarray) -> None:
        """Find the stress under the body force, elastic, on particles that do not move.

        Args:
            overburden: vertical effective stress to begin with, (N,) [Pa].
        """
        ratio = (3.0 * self.bulk - 2.0 * self.shear) / (6.0 * self.bulk + 2.0 * self.shear)
        at_rest = ratio / (1.0 - ratio)
        self.stress[:, :3] = -overburden[:, None] * np.column_stack([at_rest, at_rest**0, at_rest])
        self.advance(SETTLING_STEPS, COURANT * self.wave_time, keep=SETTLING_KEEPS, settling=True)
        self.velocity[:] = 0.0

    def advance(self, steps: int, dt: float, *, keep: float = 1.0, settling: bool = False) -> None:
        """Go through steps of `dt` [s]; `keep` of the velocity is left by each."""
        from benchmarks.hidden_effects.foreign import particle_step

        while steps > 0:
            room = self._list_neighbours()
            fastest = float(np.linalg.norm(self.velocity, axis=1).max())
            # Acceleration within a call is at most a few times that of gravity.
            some = min(steps, ASKED, max(1, int(room / ((fastest + 0.1) * dt))))
            particle_step.advance(
                some, dt, self.spacing, SUPPORT * self.spacing, ALPHA, AGAINST_TENSION, keep,
                int(settling), int(settling or self._bonded), *self._walls,
                self.base_share, self._coefficient, self._x0,
                self.position, self.velocity, self.stress, self.density, self.opened,
                self.strain, self.rate, self.mass, self.bulk, self.shear, self.friction,
                self.cohesion, self.cap, self.body, self._start, self._neighbour, self._ground,
                self._normal, *self._on_columns, *self._work, SPREADING,
            )  # fmt: skip
            share = 1.0 - np.exp(-SMOOTHING * some * dt / self.wave_time)
            particle_step.smooth(
                share, self.spacing, SUPPORT * self.spacing, *self._walls, self._x0,
                self.position, self.stress, self.density, self.mass, self._start,
                self._neighbour, self._ground, self._normal, *self._smoothing,
            )  # fmt: skip
            steps -= some

    def _list_neighbours(self) -> float:
        """See that the list holds for a while; the way [m] that particles may go with it."""
        skin = SKIN * self.spacing
        if self._listed is not None:
            moved = np.linalg.norm(self.position - self._listed, axis=1).max()
            if moved < 0.4 * skin:
                return 0.5 * skin - float(moved)
        self._listed = self.position.copy()
        tree = cKDTree(self.position)
        pairs = tree.query_pairs(SUPPORT * self.spacing + skin, output_type="ndarray")
        i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
        own = np.arange(len(self.position))  # a particle sees its own image
        i, j = np.append(i, own), np.append(j, own)
        listed = csr_matrix((np.ones(len(i), bool), (i, j)), shape=(len(own), len(own)))
        listed.sort_indices()
        self._start = listed.indptr.astype(np.int32)
        self._neighbour = listed.indices.astype(np.int32)
        return 0.5 * skin

    @property
    def kinetic_energy(self) -> float:
        """[J/m]."""
        return float(0.5 * self.mass @ (self.velocity**2).sum(axis=1))

    @property
    def elastic_energy(self) -> float:
        """Stored in the stress [J/m]."""
        s = self.stress
        mean = s[:, :3].mean(axis=1)
        shear = 0.5 * ((s[:, :3] - mean[:, None]) ** 2).sum(axis=1) + s[:, 3] ** 2
        stored = 0.5 * mean**2 / self.bulk + 0.5 * shear / self.shear
        return float(self.mass / self.density @ stored)


def _tension_cap(soil: Material) -> float:
    if soil.tension_cap_pa is not None:
        return soil.tension_cap_pa
    return soil.cohesion_pa / np.tan(soil.friction_rad) if soil.friction_deg else 1e30


def start() -> None:
    """Start Taichi, unless it runs."""
    # Taichi reports its start on the standard output, where results alone belong.
    with redirect_stdout(sys.stderr):
        from benchmarks.hidden_effects.foreign import particle_step

        particle_step.start()


def simulate(
    scene: Scene, hidden: Sequence[Hidden], *, duration_s: float, frames: int, seed: int,
    threads: int | None = None,
) -> Slide:  # fmt: skip
    """See `slide.Simulate`; a single thread works whatever `threads` says."""
    start()
    loading = Loading.of(scene, hidden, seed=seed, jitter=JITTER)
    body = Body(loading)
    body.load(loading, loading.still)
    if loading.settled:
        body.settle(loading.overburden)
    interval = duration_s / frames
    steps = int(np.ceil(interval / (COURANT * body.wave_time)))
    positions, peak, still_since = [body.position.copy()], 0.0, 0.0
    for frame in range(1, frames + 1):
        for step in range(0, steps, ASKED):
            time = (frame - 1 + step / steps) * interval
            moment = Moment(time, body.position, body.velocity, body.strain, body.rate)
            body.load(loading, moment)
            body.advance(min(ASKED, steps - step), interval / steps)
        if not np.isfinite(body.position).all():
            raise WorkFailed(f"smoothed_particles: {frame * interval:g} s: not a number")
        positions.append(body.position.copy())
        energy = body.kinetic_energy
        peak = max(peak, energy)
        if energy > REST_ENERGY * peak:
            still_since = frame * interval
        if frame * interval > max(REST_AFTER_S, still_since + REST_FOR_S):
            break
    slide = Slide(
        loading.scene, loading.points.zone, np.array(positions),
        interval * np.arange(len(positions)), len(positions) <= frames,
    )  # fmt: skip
    if slide.area_kept < LEAST_AREA:
        raise WorkFailed(f"smoothed_particles: {slide.area_kept:.3f} of the area is left")
    return slide
