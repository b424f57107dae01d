"""Truth by Genesis 1.4 (`genesis-world`), a public code with an explicit material point method.

Its packages exclude this project's, so it runs in another Python, which an environment variable
names, and is told at every order what acts: `genesis_worker`, which also says what a plane section
is there. Genesis has the transfer (affine, quadratic splines), the step and the rotations; soil
yields by its own strength, particle by particle, on the cone of Mohr-Coulomb in plane strain. On
rough ground nodes of the ground carry at most the strength of the soil on them.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.hidden_effects.foreign.hidden import THINGS, Hidden
from benchmarks.hidden_effects.foreign.loading import Loading, Moment
from benchmarks.hidden_effects.foreign.slide import LEAST_AREA, Slide
from geometry.scenes.scene import Scene
from pipeline.cli import InputError, WorkFailed

HIDES = tuple(THINGS)
#: Names the Python that has the package, if this one has not.
PYTHON = "FLOWSLIDE_GENESIS_PYTHON"

#: Step in the time that a wave of compression takes through a cell; longest time of an order [s].
COURANT, ORDER = 0.6, 0.01
#: Of the spacing and of Young's modulus: affine transfer brakes, less in small cells and over fewer
#: steps. Where the judge's slide is 34.9 m long with 1.4 m between points and 37.3 m with 0.9 m,
#: this one is 28.7 and 33.0 m, and 27.2 m at 1.4 m with soil as stiff as it is and half the step.
FINER, SOFTER = 0.65, 0.25
#: Places of the points are random by so many spacings.
JITTER = 0.2
#: Before the liquefaction: strength that is never reached [Pa], orders, velocity left by each.
FIRM, SETTLING, KEEPS = 1e9, 400, 0.9
#: Share of the rate of the last order in the rate that viscous strength follows.
FOLLOWS = 0.3
#: At rest: kinetic energy below this share of its peak for this long [s].
QUIET, HOLD = 1e-3, 1.0
#: Cells of grid below the ground and above the section, and what the soil may reach, in heights.
BELOW, ABOVE, REACH = 6, 8, 12.0


def simulate(
    scene: Scene, hidden: Sequence[Hidden], *, duration_s: float, frames: int, seed: int,
    threads: int | None = None,
) -> Slide:  # fmt: skip
    """See `slide.Simulate`; Genesis uses one thread, and points `FINER` than the scene's."""
    scene = scene.changed(spacing=round(FINER * scene.spacing, 3))
    loading = Loading.of(scene, hidden, seed=seed, jitter=JITTER)
    with _Body(loading, duration_s / frames) as body:
        slide = body.run(frames)
    if not np.all(np.isfinite(slide.positions)):
        raise WorkFailed("genesis: positions are not finite")
    if slide.area_kept < LEAST_AREA:
        raise WorkFailed(f"genesis: the slide kept {slide.area_kept:.3f} of its area")
    return slide


class _Body:
    """A section in the other process; `between` [s]: of its frames."""

    def __init__(self, loading: Loading, between: float) -> None:
        self.loading, self.between, scene = loading, between, loading.scene
        self.cell = 2.0 * scene.spacing
        self.position = loading.points.position.copy()
        self.velocity = np.zeros_like(self.position)
        self.strain = self.rate = np.zeros(len(self.position))
        self.time = 0.0
        modulus, ratio = SOFTER * loading.youngs_modulus, loading.poisson_ratio
        stiff = modulus * (1.0 - ratio) / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
        longest = COURANT * self.cell / float(np.sqrt((stiff / loading.density).max()))
        self.step = between / float(np.ceil(between / longest))
        command = [os.environ.get(PYTHON, sys.executable), str(_WORKER)]
        self._log = TemporaryFile()
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log
            )
        except OSError as error:
            raise InputError(f"{PYTHON}: {command[0]}: {error.strerror}") from None
        self._send(self._section())

    def __enter__(self) -> _Body:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.kill()
        self._process.communicate()
        self._log.close()

    def _section(self) -> dict[str, Any]:
        """What `genesis_worker` has to know; nodes lie at whole cells, the ground on a line."""
        own, scene, cell = self.loading, self.loading.scene, self.cell
        base = float(scene.ground.height(scene.foot("right")))
        corner = np.array([scene.domain.x_min, base])
        self.shift = np.ceil(corner / cell) * cell - corner
        first, last = self.position[:, 0].min(), self.position[:, 0].max()
        reach = REACH * (scene.extent[1] - scene.ground.lowest)
        low = np.array([first - reach, scene.ground.lowest]) + self.shift
        high = np.array([last + reach, scene.extent[1]]) + self.shift
        low = (np.floor(low / cell) - [BELOW, BELOW]) * cell
        high = (np.ceil(high / cell) + [BELOW, ABOVE]) * cell
        walls = (low[0] + BELOW * cell, high[0] - BELOW * cell)
        if scene.domain.walls == "closed":
            ends = np.array([scene.domain.x_min, scene.domain.x_max]) + self.shift[0]
            walls = (max(walls[0], ends[0]), min(walls[1], ends[1]))
        self.nodes = np.arange(round(low[0] / cell), round(high[0] / cell) + 1) * cell
        self.nodes = self.nodes - self.shift[0]
        soils = np.column_stack(
            [SOFTER * own.youngs_modulus, own.poisson_ratio, np.sin(own.friction)]
        )
        kinds, soil = np.unique(soils, axis=0, return_inverse=True)
        self.bonded = scene.ground.contact == "no_slip" and own.base_share == 1.0
        return {
            "position": self.position + self.shift, "density": own.density,
            "soil": soil.ravel(), "soils": kinds.tolist(), "spacing": scene.spacing,
            "cell": cell, "low": low, "high": high, "walls": [float(x) for x in walls],
            "ground": scene.ground.height(self.nodes) + self.shift[1],
            "gravity": own.gravity, "step": self.step, "bonded": self.bonded,
        }  # fmt: skip

    def run(self, frames: int) -> Slide:
        """Move until rest, at most for so many frames."""
        between = self.between
        if self.loading.settled:
            self._settle()
        positions, times, peak, quiet = [self.loading.points.position], [0.0], 0.0, 0.0
        for frame in range(1, frames + 1):
            self._advance(between)
            positions.append(self.position)
            times.append(frame * between)
            energy = float(np.mean(self.velocity**2))
            peak = max(peak, energy)
            quiet = quiet + between if energy < QUIET * peak else 0.0
            if quiet >= HOLD and self.time > 16.0:
                break
        return Slide(
            self.loading.scene, self.loading.points.zone, np.array(positions), np.array(times),
            quiet >= HOLD,
        )  # fmt: skip

    def _settle(self) -> None:
        """Take up the weight elastically; the places of the particles are those after it."""
        firm = np.full(len(self.position), FIRM)
        still = self.loading.acceleration(self.loading.still)
        steps = max(1, int(ORDER / self.step))
        for _ in range(SETTLING):
            self._order(steps, firm, np.full(len(self.nodes), FIRM), still, KEEPS)
        self._order(1, firm, np.full(len(self.nodes), FIRM), still, 0.0)
        self.velocity = np.zeros_like(self.velocity)

    def _advance(self, duration: float) -> None:
        """Go on by `duration` [s], asking anew what acts after every order."""
        left = round(duration / self.step)
        while left > 0:
            steps = min(left, max(1, int(ORDER / self.step)))
            moment = Moment(self.time, self.position, self.velocity, self.strain, self.rate)
            strength = self.loading.cohesion(moment) * np.cos(self.loading.friction)
            push = self.loading.acceleration(moment)
            rate = self._order(steps, strength, self._base(strength, push), push, 1.0)
            self.strain = self.strain + steps * self.step * rate
            self.rate = (1.0 - FOLLOWS) * self.rate + FOLLOWS * rate
            self.time += steps * self.step
            left -= steps

    def _base(self, strength: np.ndarray, push: np.ndarray) -> np.ndarray:
        """Traction that the ground bears under every column of nodes, (k,) [Pa]."""
        own, ground, position = self.loading, self.loading.scene.ground, self.position
        places = np.column_stack([self.nodes, ground.height(self.nodes)])
        _, near = cKDTree(position).query(places, k=4)
        weight = own.density * own.scene.spacing**2 * (own.gravity - push[:, 1])
        column = np.round((position[:, 0] - self.nodes[0]) / self.cell).astype(int)
        column = np.clip(column, 0, len(self.nodes) - 1)
        normal = np.bincount(column, weights=weight, minlength=len(self.nodes)) / self.cell
        normal = np.maximum(normal, 0.0)
        if ground.contact == "coulomb":
            return own.base_share * (ground.friction_coefficient or 0.0) * normal
        sine = np.sin(own.friction)[near].mean(axis=1)
        return own.base_share * (strength[near].mean(axis=1) + sine * normal)

    def _order(
        self, steps: int, strength: np.ndarray, base: np.ndarray, push: np.ndarray, keep: float
    ) -> np.ndarray:
        """Go on by some steps; the rate of shear, (N,) [1/s]."""
        self._send((steps, strength, base, push, keep))
        assert self._process.stdout is not None
        try:
            position, self.velocity, rate = pickle.load(self._process.stdout)
        except EOFError:
            raise WorkFailed(f"genesis: {self._last_words()}") from None
        self.position = position - self.shift
        return rate

    def _send(self, message: object) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(message, self._process.stdin)
            self._process.stdin.flush()
        except BrokenPipeError:
            raise WorkFailed(f"genesis: {self._last_words()}") from None

    def _last_words(self) -> str:
        """The last line that the other process has written."""
        self._process.wait()
        self._log.seek(0)
        words = self._log.read().decode(errors="replace").strip().splitlines()
        return (words or ["its process has ended"])[-1]


_WORKER = Path(__file__).with_name("genesis_worker.py")
