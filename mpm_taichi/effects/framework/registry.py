"""The effects there are, and which of them a scene has on.

A new effect of the library is one file in this folder and its name in `LIBRARY`. A user's effects,
and material laws, come from a file of their own (`--effects FILE`): it is code, and is run only
when it is named.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm_taichi.effects.framework.base import Active, Effect
from mpm_taichi.effects.framework.faults import faults
from mpm_taichi.materials import registry as laws
from pipeline.cli import InputError
from pipeline.user_code import load_user_code

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

LIBRARY = (
    "strain_softening",
    "rate_strengthening",
    "overburden_strength",
    "spatial_variability",
    "strength_contrast",
    "late_liquefaction",
    "spreading_liquefaction",
    "reconsolidation",
    "strength_curve",
    "apparent_cohesion",
    "remoulding",
    "bingham",
    "pore_pressure",
    "pore_water",
    "inertial_friction",
    "cracking",
    "dilatancy",
    "weak_base",
    "hydroplaning",
    "obstacles",
    "shaking",
    "water_drag",
    "side_shear",
    "side_friction",
    "radial_spreading",
    "pool_level",
)
"""Names of the library's effects, each a module of this package with an `EFFECT`. The order is that
in which several effects act on the same number."""

MOST_ON_DEVICE = 31
"""Effects with hooks on points or nodes that kernels can distinguish, the library's included."""

PORE_WATER = "pore_water"
"""Effect that a scene has on at amplitude 1 where a material has a permeability and there is water:
its pore water flows unless the scene says otherwise."""

BY_THE_CLOCK = (
    "late_liquefaction",
    "spreading_liquefaction",
    "reconsolidation",
    "pore_pressure",
)
"""Effects that state as functions of time what flowing pore water gives."""

_users: dict[str, Effect] = {}


@cache
def library() -> tuple[Effect, ...]:
    """All effects of the library, internal ones included, in the order in which they act."""
    return tuple(importlib.import_module(f"mpm_taichi.effects.{name}").EFFECT for name in LIBRARY)


def user_effects() -> tuple[Effect, ...]:
    """Effects that were loaded from files, by name."""
    return tuple(_users[name] for name in sorted(_users))


def effects() -> dict[str, Effect]:
    """Name -> effect, of the library and loaded from files, without the internal ones."""
    return {one.name: one for one in (*library(), *user_effects()) if not one.internal}


def effect(name: str) -> Effect:
    """The effect of a name, internal ones included.

    Raises:
        InputError: there is none.
    """
    for one in (*library(), *user_effects()):
        if one.name == name:
            return one
    raise InputError(f"effect {name!r} is unknown; known are: {', '.join(effects())}")


def effects_on(scene: Scene, source: str | None = None) -> tuple[Active, ...]:
    """The effects a scene has on, in the order in which they act; amplitude 0 is off.

    `PORE_WATER` is on, too, where a material's permeability says so.

    Args:
        scene: the scene.
        source: what messages begin with; None: the scene's name.

    Raises:
        InputError: one line: an unknown effect or parameter, a number out of its range, an effect
            that can do nothing in this scene.
    """
    found = _implied(scene)
    if not scene.effects and not found:
        return ()
    where = f"{source or scene.name}: effects: "
    for name, entry in scene.effects.items():
        try:
            one = effect(name)
        except InputError as error:
            raise InputError(f"{source or scene.name}: {error}") from None
        active = _read(one, entry, f"{where}{name}: ")
        if active.amplitude != 0.0:
            with one.blamed("applies"):
                reason = one.applies(scene)
            if reason:
                raise InputError(f"{where}{name}: can do nothing in this scene: {reason}")
            found[name] = active
    for name in BY_THE_CLOCK:
        if name in found and PORE_WATER in found:
            raise InputError(
                f"{where}{name}: states as a function of time what the pore water gives that flows "
                "in this scene; leave it out, or permeability_m_per_s"
            )
    return tuple(found[one.name] for one in (*library(), *user_effects()) if one.name in found)


def flowing_pore_water(scene: Scene) -> bool:
    """`PORE_WATER` is on."""
    return any(one.effect.name == PORE_WATER for one in effects_on(scene))


def has_permeability(scene: Scene) -> bool:
    """Water flows through some soil."""
    return any(soil.permeability_m_per_s is not None for soil in scene.materials.values())


def _implied(scene: Scene) -> dict[str, Active]:
    """Effects that are on though the scene does not name them."""
    if PORE_WATER in scene.effects or not has_permeability(scene):
        return {}
    one = effect(PORE_WATER)
    return {} if one.applies(scene) else {one.name: _read(one, 1.0, "")}


def _read(one: Effect, entry: float | Mapping[str, float], where: str) -> Active:
    """An entry of a scene: an amplitude, or a mapping with `amplitude` and parameters."""
    given = dict(entry) if isinstance(entry, Mapping) else {"amplitude": entry}
    if "amplitude" not in given:
        raise InputError(f"{where}amplitude is missing")
    amplitude = given.pop("amplitude")
    scale = one.amplitude
    if amplitude != 0.0:
        _check(amplitude, scale.low, scale.high, f"{where}amplitude", scale.unit)
    parameters = {}
    for parameter in one.parameters:
        value = given.pop(parameter.name, parameter.default)
        _check(value, parameter.low, parameter.high, f"{where}{parameter.name}", parameter.unit)
        parameters[parameter.name] = float(value)
    if given:
        known = ", ".join(("amplitude", *(p.name for p in one.parameters)))
        raise InputError(f"{where}{next(iter(given))!r} is unknown; known are: {known}")
    return Active(one, float(amplitude), parameters)


def _check(value: float, low: float, high: float, where: str, unit: str) -> None:
    if not low <= value <= high:
        words = f" {unit}" if unit else ""
        raise InputError(f"{where} {value:g}: allowed are {low:g} to {high:g}{words}")


def kernel_effects(scene: Scene) -> tuple[Effect, ...]:
    """The effects that the kernels of a scene know: none, or the library's and its own user's.

    Kernels depend only on this, so a scene's numbers do not depend on what other files a process
    has loaded. A strength ratio needs points with a strength of their own, as effects do.
    """
    active = [one.effect for one in effects_on(scene)]
    if not any(one.on_device for one in active) and not has_strength_ratio(scene):
        return ()
    own = [one for one in active if one.on_device and one not in library()]
    return (*(one for one in library() if one.on_device), *own)


def has_strength_ratio(scene: Scene) -> bool:
    """Some soil has a strength in proportion to its stress before failure."""
    return any(soil.strength_ratio is not None for soil in scene.materials.values())


def acting_scene(scene: Scene, active: tuple[Active, ...]) -> Scene:
    """The scene that is simulated: as changed by the effects that act on it before the run."""
    for one in active:
        scene = one.acting_scene(scene)
    return scene


def relative_width(active: Iterable[Active], scene: Scene, position: np.ndarray) -> np.ndarray:
    """Width of the slide at places (N, 2) [m] as effects have it, 1 without one, (N,)."""
    found = np.ones(len(position))
    for one in active:
        if one.effect.width is not None:
            found = found * one.field_of(scene, position)
    return found


def changes_volume(scene: Scene) -> bool:
    """True where an effect that is on lets soil change its area in the section as it flows.

    An effect that is not known here, such as a user's whose file was not loaded, counts as none.
    """
    changing = {
        one.name
        for one in (*library(), *user_effects())
        if one.dilation is not None or one.width is not None
    }
    return any(
        name in changing and (entry["amplitude"] if isinstance(entry, Mapping) else entry) != 0.0
        for name, entry in scene.effects.items()
    )


def key_of_effects(scene: Scene) -> dict[str, Any]:
    """Part of a run's key for the effects that are on; empty where none is.

    However a scene writes the same numbers, the key is the same.
    """
    from mpm_taichi.effects import PHYSICS_VERSION

    active = effects_on(scene)
    if not active:
        return {}
    numbers = {
        one.effect.name: {
            "amplitude": one.amplitude,
            **one.parameters,
            "version": one.effect.version,
        }
        for one in active
    }
    return {"effects": numbers, "library": PHYSICS_VERSION}


# --- files of users ---


def load_effects_file(path: str | Path) -> list[Effect]:
    """Run a Python file and register every `Effect` and `MaterialLaw` of its top level.

    Their version is the hash of the file. Loading the same file again changes nothing; a changed
    file replaces what it defines.

    Returns:
        the effects of the file, in the order in which it defines them.

    Raises:
        InputError: no such file, an error in it, neither effect nor law in it, a name that is taken
            or no name, fields of the wrong kind, numbers that do not fit together; one line.
    """
    module, version = load_user_code(path, "flowslide_effects")
    found = [value for value in vars(module).values() if isinstance(value, Effect)]
    mine = {id(one) for one in library()}
    own = [one for one in dict.fromkeys(found) if id(one) not in mine]
    own_laws = laws.laws_in(module)
    if not own and not own_laws:
        raise InputError(f"{path}: defines no Effect and no MaterialLaw; see docs/how-to/extend.md")
    taken, names = [one.name for one in library()], [one.name for one in own]
    for one in own:
        reason = faults(one)
        if one.name in taken:
            reason = "the library has an effect of this name"
        elif names.count(one.name) > 1:
            reason = "the file has two effects of this name"
        elif one.internal is True:
            reason = "internal is for the library alone"
        if reason:
            raise InputError(f"{path}: effect {one.name!r}: {reason}")
        object.__setattr__(one, "version", version)
    for law in own_laws:
        if law.name in laws.library():
            raise InputError(f"{path}: law {law.name!r}: the library has a law of this name")
        object.__setattr__(law, "version", version)
    before = dict(_users)
    _users.update({one.name: one for one in own})
    if sum(one.on_device for one in (*library(), *_users.values())) > MOST_ON_DEVICE:
        _users.clear()
        _users.update(before)
        raise InputError(
            f"{path}: more than {MOST_ON_DEVICE} effects with hooks on points or nodes"
        )
    laws.users.update({law.name: law for law in own_laws})
    return own


def has_own_code() -> bool:
    """Effects or laws of a user's are loaded, which another process would not have."""
    return bool(_users or laws.users)


@contextmanager
def given_effects(paths: Iterable[str | Path]) -> Iterator[None]:
    """Load files of effects for the length of a `with` block; see `load_effects_file`."""
    before = [(known, dict(known)) for known in (_users, laws.users)]
    try:
        for path in paths:
            load_effects_file(path)
        yield
    finally:
        for known, kept in before:
            known.clear()
            known.update(kept)
