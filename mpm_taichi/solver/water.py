"""Water in and on the soil: the head over a section, and the force of still water at the nodes.

The force follows from the head h alone: below it the pore pressure is u = rho_w g (h - y), and soil
feels - grad u per volume, in open water as in its pores. Where the soil moves, the head moves with
it (`MovingFace`); otherwise it is the phreatic line of the section.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from geometry.sides import Side
    from pipeline.config import SimulationSettings

WATER_DENSITY = 1000.0
"""Density of fresh water [kg/m3]."""

FACE_PLACES = 4
"""The jump of the head at the face is spread over this many half cells inside, full of soil."""

FACE_DEPTH = 3
"""It begins this many half cells inside the face: nearer to it nodes have little soil, and what
thrust falls on them is lost (a fifth of it without this)."""

SMOOTHED_PLACES = 9
"""The head of groundwater is a mean over this many half cells: the top of soil is jagged."""

LEVEL_WITH_POOL = 0.01
"""Head that is lower than the pool's by less than this is the pool's [m]."""


def head_places(x: np.ndarray, cell: float) -> np.ndarray:
    """Where the force needs the head (2n + 1,): at the nodes x (n,) and half a cell either side.

    Odd entries are the nodes.
    """
    return np.append(np.stack([x - 0.5 * cell, x], axis=1), x[-1] + 0.5 * cell)


def level_and_fall(head: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Elevation of the water level at the nodes [m] and its fall along x there, both (n, 1).

    `head` (2n + 1,) [m] is that at the `head_places` of the nodes.
    """
    return head[1::2, None], (head[:-1:2, None] - head[2::2, None]) / cell


def water_force(
    level: np.ndarray, fall: np.ndarray | float, y: np.ndarray, cell: float, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Force of still water on soil per unit volume, - grad u: its x and y parts [N/m3].

    The vertical part carries the submerged weight, the horizontal one is the thrust of a pool and
    the force of seepage; without `fall` (0) it is left out. The force sets in over one cell, so
    that it depends smoothly on the level.

    Args:
        level: elevation of the water level [m], of a shape that broadcasts with y.
        fall: - dh/dx of that level [-], the same.
        y: elevation of the places [m].
        cell: [m].
        gravity: [m/s2].
    """
    upward = WATER_DENSITY * gravity * np.clip((level - y) / cell + 0.5, 0.0, 1.0)
    return upward * fall, upward


class MovingFace:
    """The head over a section whose soil moves, for a pool on one side of it.

    The remnant is the soil that stands above the pool's level, seen from the dry side. Up to its
    face the head is the pool's: water fills what the slide has left and surrounds what slid. In the
    remnant the soil keeps the head it had, wherever it has moved to, for the slide is too fast for
    pore water to flow; so the pressure of the pool acts on the face, where the head jumps. The head
    never rises away from the pool. If nothing stands above the pool, the highest soil that holds
    back water is the remnant: overtopping is not modelled.
    """

    def __init__(
        self, line: np.ndarray, level: float | None, own_head: np.ndarray, spacing: float
    ) -> None:
        """`at_start` makes one for a scene; `holds_back` says whether there is anything to do.

        Args:
            line: phreatic line of the section, (L, 2) [m], level beyond its ends.
            level: of the pool [m]; None: there is no water.
            own_head: head of each point at the start, (P,) [m].
            spacing: between the points [m].
        """
        self.line, self.level, self.own_head = line, level, own_head
        self.half = 0.5 * spacing  # of a point's height
        self.holds_back = False
        if level is not None:
            high = line[:, 1] >= level - LEVEL_WITH_POOL
            self.holds_back = bool(high[0] != high[-1])
            self.from_left = bool(high[0])

    @classmethod
    def at_start(cls, scene: Scene, position: np.ndarray) -> MovingFace:
        """Of a scene whose points are at (P, 2) [m]."""
        line = np.asarray(scene.phreatic_line or [(0.0, scene.water_level or 0.0)], dtype=float)
        return cls(line, scene.water_level, scene.phreatic_level(position[:, 0]), scene.spacing)

    def head(self, places: np.ndarray, position: np.ndarray) -> np.ndarray:
        """The head now [m], (k,).

        Args:
            places: (k,) x [m], evenly spaced and ascending.
            position: (P, 2) the points now [m], in the order of those of the start.
        """
        column, top = self._columns(places, position)
        head = self._carried(places, position, column)
        if not self.from_left:
            head, top = head[::-1], top[::-1]
        face = self._face(head, top)
        inside = (np.arange(len(head)) - face - FACE_DEPTH) / FACE_PLACES
        head = self.level + np.clip(inside, 0.0, 1.0) * (head - self.level)
        head = np.minimum.accumulate(np.minimum(head, self.level))
        return head if self.from_left else head[::-1]

    def _columns(self, places: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place of each point (P,), and the top of the soil at each place (k,) [m]; -inf: none."""
        step = places[1] - places[0]
        column = np.floor((position[:, 0] - places[0]) / step + 0.5).astype(np.int64)
        column = np.clip(column, 0, len(places) - 1)
        top = np.full(len(places), -np.inf)
        np.maximum.at(top, column, position[:, 1] + self.half)
        padded = np.pad(top, 1, mode="edge")  # a gap between two points is no gap in the soil
        return column, np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])

    def _carried(self, places: np.ndarray, position: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Head that the soil below the pool's level has brought along to each place (k,) [m]."""
        fixed = self._fixed(position[:, 0])
        wet = position[:, 1] < self.level
        brought = np.bincount(
            column[wet], weights=(self.own_head - fixed)[wet], minlength=len(places)
        )
        count = np.bincount(column[wet], minlength=len(places))
        head = self._fixed(places) + brought / np.maximum(count, 1)
        return np.clip(head, self.own_head.min(), self.level)

    def _fixed(self, x: np.ndarray) -> np.ndarray:
        """Phreatic line of the section [m]."""
        return np.interp(x, self.line[:, 0], self.line[:, 1])

    def _face(self, head: np.ndarray, top: np.ndarray) -> int:
        """Number of the first place of the remnant, counted from the pool."""
        dry = head < self.level - LEVEL_WITH_POOL
        stands = np.flatnonzero(top >= self.level)
        if stands.size:
            below = np.flatnonzero(top[: stands[-1]] < self.level)
            return int(below[-1]) + 1 if below.size else 0
        return int(np.argmax(np.where(dry, top, -np.inf))) if dry.any() else len(head)


class Groundwater(MovingFace):
    """The head where the high end of the water table is groundwater: no pool fills what sinks.

    The slide is too fast for pore water to flow, so soil keeps the head it had, wherever it has
    moved to, but where that would be above the soil: what has sunk or run out is then full of water
    to its surface.
    """

    def head(self, places: np.ndarray, position: np.ndarray) -> np.ndarray:
        """As `MovingFace.head`."""
        column, top = self._columns(places, position)
        lowest = position[:, 1].min() - self.half
        kept = np.minimum(self._carried(places, position, column), np.maximum(top, lowest))
        wide = np.pad(kept, SMOOTHED_PLACES // 2, mode="edge")
        return np.convolve(wide, np.full(SMOOTHED_PLACES, 1.0 / SMOOTHED_PLACES), mode="valid")


def moving_face(
    scene: Scene, settings: SimulationSettings, position: np.ndarray
) -> MovingFace | None:
    """The face that the water of a run follows, None where it stays where it is.

    Args:
        scene: of the run.
        settings: of its simulation.
        position: (P, 2) points of the soil at the start [m].
    """
    if settings.water != "pore_pressure" or settings.water_face != "moving":
        return None
    face = MovingFace.at_start(scene, position)
    if not face.holds_back:
        return None
    side: Side = "left" if face.from_left else "right"
    is_pool = not scene.domain.goes_on(side) or scene.surface(scene.end(side)) < face.level
    return face if is_pool else Groundwater.at_start(scene, position)
