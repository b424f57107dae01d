"""Where the kernels find the numbers of effects: columns of the tables of slots and points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import Active, Effect
from mpm_taichi.effects.framework.between import RENEWED

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

# Columns of the facts of every point. The last four are its material's own strength; COHESION of a
# soil with a strength ratio is the least that it has, until the overburden is known.
START_X, START_Y, OVERBURDEN, LIQUEFIED, TANGENT, COHESION, CAP, RATIO = range(8)
FACTS = 8
"""Columns before those of single effects."""


class EffectTable:
    """The columns for a tuple of effects.

    Attributes:
        effects: those with hooks on points or nodes; the place of one is its bit in a slot's mask.
        first: first column of each in the table of slots (amplitude, parameters, constants).
        width: columns of the table of slots.
        field: effect's place -> column of its fixed number in the table of points.
        memory: effect's place -> column of the number that points carry.
        stretch: effect's place -> column of the strain across the section that it has caused; the
            next one is that of the last step.
        renewed: effect's place -> first column of its `RENEWED` numbers.
        facts: columns of the table of points.
    """

    def __init__(self, effects: Sequence[Effect]) -> None:
        self.effects = tuple(one for one in effects if one.on_device)
        widths = [len(one.columns) for one in self.effects]
        self.first = [sum(widths[:place]) for place in range(len(widths))]
        self.width = max(sum(widths), 1)
        self.field: dict[int, int] = {}
        self.memory: dict[int, int] = {}
        self.stretch: dict[int, int] = {}
        column = FACTS
        of_points = ((self.field, "field"), (self.memory, "memory"), (self.stretch, "width"))
        for columns, hook in of_points:
            for place, one in enumerate(self.effects):
                if getattr(one, hook) is not None:
                    columns[place] = column
                    column += 2 if hook == "width" else 1
        self.renewed: dict[int, int] = {}
        for place in self.places("between"):
            self.renewed[place] = column
            column += RENEWED
        self.facts = column

    def renewed_columns(self, one: Effect) -> slice:
        """Columns of the numbers that an effect's hook `between` renews."""
        first = self.renewed[self.effects.index(one)]
        return slice(first, first + RENEWED)

    def places(self, hook: str) -> tuple[int, ...]:
        """Places of the effects that have a hook."""
        return tuple(
            place for place, one in enumerate(self.effects) if getattr(one, hook) is not None
        )

    def mask(self, *hooks: str) -> int:
        """Bits of the effects that have one of the hooks."""
        return sum(1 << place for place in {p for hook in hooks for p in self.places(hook)})

    def bits(self, active: Sequence[Active]) -> int:
        """The mask of a slot whose scene has `active` on."""
        on = {id(one.effect) for one in active}
        return sum(1 << place for place, one in enumerate(self.effects) if id(one) in on)

    def numbers(self, active: Sequence[Active], scene: Scene) -> np.ndarray:
        """The row of a slot, (width,) float32: SI numbers of what is on, zero elsewhere."""
        row = np.zeros(self.width, np.float32)
        for one in active:
            if one.effect.on_device:
                first = self.first[self.effects.index(one.effect)]
                values = one.numbers(scene)
                row[first : first + len(values)] = values
        return row

    def point_facts(
        self,
        active: Sequence[Active],
        scene: Scene,
        position: np.ndarray,
        soil: np.ndarray,
    ) -> np.ndarray:
        """Rows of points before anything moves; the overburden is filled in after settling.

        Args:
            active: the effects that are on.
            scene: the scene.
            position: (P, 2) [m].
            soil: (P, 5): liquefied (1 or 0), tan(phi), cohesion [Pa], tension cap [Pa], strength
                ratio (0 without one).

        Returns:
            (P, facts) float32.
        """
        facts = np.zeros((len(position), self.facts), np.float32)
        facts[:, [START_X, START_Y]] = position
        facts[:, LIQUEFIED : RATIO + 1] = soil
        for one in active:
            if one.effect.field is not None and one.effect.on_device:
                column = self.field[self.effects.index(one.effect)]
                facts[:, column] = one.field_of(scene, position)
        return facts
