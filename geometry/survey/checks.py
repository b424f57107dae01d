"""Places that a survey may name: within the domain, or within the section before the slide."""

from __future__ import annotations

from geometry.scenes.scene import Scene
from pipeline.cli import InputError


def check_in_domain(x: float, scene: Scene, where: str) -> None:
    """Refuse a place outside the domain.

    Raises:
        InputError: beginning with `where`; one line.
    """
    domain = scene.domain
    if not domain.x_min <= x <= domain.x_max:
        raise InputError(
            f"{where}: {x:g} lies outside the domain, x {domain.x_min:g} to {domain.x_max:g} m"
        )


def check_in_section(x: float, scene: Scene, where: str) -> None:
    """Refuse a place where there was no section before the slide.

    Raises:
        InputError: beginning with `where`; one line.
    """
    left, right = scene.foot("left"), scene.foot("right")
    if not left <= x <= right:
        raise InputError(f"{where} {x:g} lies outside the section, x {left:g} to {right:g} m")
