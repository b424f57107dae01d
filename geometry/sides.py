"""The two sides of a section."""

from __future__ import annotations

from typing import Literal

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")


def outward_of(side: Side) -> int:
    """Direction away from the dam: -1 on the left, 1 on the right.

    Raises:
        ValueError: no such side.
    """
    if side not in SIDES:
        raise ValueError(f"side is {side!r}; allowed are 'left' and 'right'")
    return -1 if side == "left" else 1
