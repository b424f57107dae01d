"""The material laws there are, and which of them a scene names.

A new law of the library is one file in this folder and its `MaterialLaw` in `library`. A user's
laws come from a file of their own (`--effects FILE`): it is code, and is run only when it is named.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.materials.law import MaterialLaw

users: dict[str, MaterialLaw] = {}
"""Laws that were loaded from files, by name."""


def library() -> dict[str, MaterialLaw]:
    """Name -> law of the library; the first is that of a scene that names none."""
    from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB

    return {law.name: law for law in (MOHR_COULOMB,)}


def law_of(scene: Scene) -> MaterialLaw:
    """The material law that a scene names.

    Raises:
        InputError: there is none of this name; one line.
    """
    known = {**users, **library()}
    if scene.law not in known:
        raise InputError(
            f"{scene.name}: law: no material law {scene.law!r}; there are {', '.join(known)}; your "
            "own needs --effects FILE"
        )
    return known[scene.law]


def key_of_law(scene: Scene) -> dict[str, Any]:
    """Part of a run's key for the law, in addition to its name; empty for one of the library."""
    version = law_of(scene).version
    return {"law": version} if version else {}


def laws_in(module: object) -> list[MaterialLaw]:
    """Every `MaterialLaw` that a module defines at its top level, without those of the library."""
    from mpm_taichi.materials.law import MaterialLaw

    found = [value for value in vars(module).values() if isinstance(value, MaterialLaw)]
    return [law for law in dict.fromkeys(found) if law not in library().values()]
