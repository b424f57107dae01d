"""Description of a physical effect: its words, its numbers, and the hooks by which it acts.

An effect is one file with one `Effect`. Everything here is plain data, so that effects can be
listed, ranked and described without starting Taichi. The hooks that act on points and nodes are
plain functions written in Taichi's part of Python (`ti.exp`, `ti.min`, ...; no `import` inside);
the solver compiles them (`effects.hooks`). The hooks on the host are ordinary functions of a scene.
`docs/how-to/extend.md` shows how to write one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.between import Between, SettledPoints


class _LazyTaichi:
    """Taichi under the name `ti`, imported when a hook is compiled and not before."""

    def __getattr__(self, name: str) -> Any:
        import taichi

        return getattr(taichi, name)


ti = _LazyTaichi()
"""For hooks: `from mpm_taichi.effects import ti`."""

KPA = 1e3
"""Pa in a kPa: the factor `si` of a strength."""
DEGREE = math.pi / 180.0
"""Radians in a degree: the factor `si` of an angle."""
STANDARD_GRAVITY = 9.81
"""m/s2 in a g: the factor `si` of an acceleration."""


@dataclass(frozen=True)
class Amplitude:
    """How strong an effect is; 0 is off.

    Attributes:
        unit: as written in a scene; "" for a pure number.
        low: least value that is accepted; 0, or below it where the effect has two signs.
        high: greatest value that is accepted.
        ladder: three positive values in ascending order, small to large, at which an effect's
            signature in the measurements is taken.
        meaning: in words.
        two_signed: a negative amplitude means the opposite.
        decades: what counts is how many times as large it is: known to a factor, not to a share.
        si: factor from `unit` to SI; the hooks on points and nodes see SI.
    """

    unit: str
    low: float
    high: float
    ladder: tuple[float, float, float]
    meaning: str
    two_signed: bool = False
    decades: bool = False
    si: float = 1.0


@dataclass(frozen=True)
class Parameter:
    """A number of an effect in addition to its amplitude; a scene may set it.

    Attributes:
        name: the key in a scene, with its unit where it has one (`frequency_hz`).
        unit: "" for a pure number.
        default: where the scene says nothing.
        low: least value that is accepted.
        high: greatest value that is accepted.
        meaning: in words.
        si: factor from `unit` to SI.
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    meaning: str
    si: float = 1.0


Numbers = Mapping[str, float]
"""Parameters by name, in the units of the scene."""


def always(scene: Scene) -> str:
    """`Effect.applies` of an effect that can act in every scene."""
    return ""


@dataclass(frozen=True, eq=False)
class Effect:
    """A physical effect that a scene can switch on.

    Hooks on points and nodes. Their first argument `effect` has `amplitude`, every parameter and
    every constant by name, in SI. `here` and `node` are described in `effects.hooks`:

    - `strength(effect, soil, here) -> soil`: changes `soil.friction` (tan phi), `soil.cohesion`
      [Pa] and `soil.cap` (tension cut-off [Pa]) of a point. Effects act one after another.
    - `dilation(effect, here) -> sine`: of the angle of dilation; negative where soil contracts.
      Plastic shear then changes the mean stress by -K sine x shear, and the dissipation with it.
    - `acceleration(effect, node) -> vector of 2`: [m/s2], acts on all mass at a node.
    - `resistance(effect, here) -> number`: [N/m3], force per volume of a point against the motion
      of its nodes; it slows them and never moves what rests.
    - `ground(effect, base, node) -> base`: changes `base.friction` (tangential over normal) and
      `base.adhesion` [Pa] of the ground at a node.
    - `width(effect, place) -> vector of 2`: width of the slide at a place of a node's kind, over
      that at a chosen one, and its slope along x [1/m]. Soil that gets to where the slide is wider
      is stretched across the section. Needs `field`, the same width at the start.
    - `memory(effect, here) -> number`: new value of a number that each point carries, 0 at t = 0;
      the effect's other hooks find it as `here.memory`.

    Hooks on the host, with amplitude and parameters in the units of the scene:

    - `scene(scene, amplitude, parameters) -> scene`: the scene that is simulated instead.
    - `constants(scene, amplitude, parameters) -> {name: SI number}`: what `constant_names` lists.
    - `field(scene, position, amplitude, parameters) -> (N,)`: a fixed number for each point at
      `position` (N, 2) [m], found as `here.field`.
    - `between(scene, settled, amplitude, parameters) -> Between`: a state on the host that renews
      five numbers of each point after every chunk of the run, found as `here.renewed`; see
      `effects.framework.between`.
    - `until(scene, amplitude, parameters) -> s`: time before which a run at rest may not be ended,
      because the effect will still change.
    - `applies(scene) -> str`: why it can do nothing in this scene, or "".

    Attributes:
        name: its key in a scene.
        words: a sentence that can follow "because", "the liquefied soil loses strength as ...".
        equation: the law, in one line.
        source: where the law is from.
        looks_like: what it does to measurements.
        amplitude: how strong, and the values to try.
        parameters: further numbers.
        version: of a user's effect, the hash of its file, set where that is loaded; of the
            library's, nothing: they share `mpm_taichi.effects.PHYSICS_VERSION`.
        internal: part of the tool, no candidate.
        realisation: of a random effect, the parameter that says which of its patterns is meant.
        place: of an effect on a part of the soil, the parameters that bound the part; where a
            diagnosis knows none of them, it does not try the effect.
        family: of the assumptions that a diagnosis puts on trial: physics, or what it doubts
            (water, strength, ground, dimension).
    """

    name: str
    words: str
    equation: str
    source: str
    looks_like: str
    amplitude: Amplitude
    parameters: tuple[Parameter, ...] = ()
    version: str = ""
    internal: bool = False
    realisation: str = ""
    place: tuple[str, ...] = ()
    family: str = "physics"
    strength: Callable | None = None
    dilation: Callable | None = None
    acceleration: Callable | None = None
    resistance: Callable | None = None
    ground: Callable | None = None
    width: Callable | None = None
    memory: Callable | None = None
    scene: Callable[[Scene, float, Numbers], Scene] | None = None
    constant_names: tuple[str, ...] = ()
    constants: Callable[[Scene, float, Numbers], dict[str, float]] | None = None
    field: Callable[[Scene, np.ndarray, float, Numbers], np.ndarray] | None = None
    between: Callable[[Scene, SettledPoints, float, Numbers], Between] | None = None
    until: Callable[[Scene, float, Numbers], float] | None = None
    applies: Callable[[Scene], str] = always

    HOOK_ARGUMENTS = {
        "strength": ("effect", "soil", "here"),
        "dilation": ("effect", "here"),
        "acceleration": ("effect", "node"),
        "resistance": ("effect", "here"),
        "ground": ("effect", "base", "node"),
        "width": ("effect", "place"),
        "memory": ("effect", "here"),
    }
    """Hooks on points and nodes, and what each is given."""
    DEVICE_HOOKS = tuple(HOOK_ARGUMENTS)

    @contextmanager
    def blamed(self, hook: str) -> Iterator[None]:
        """Turn an error in a user's hook into an `InputError` that names the effect; one line."""
        try:
            yield
        except Exception as error:
            if isinstance(error, InputError) or not self.version:
                raise
            words = " ".join(str(error).split())
            raise InputError(
                f"effect {self.name!r}: {hook}: {type(error).__name__}: {words}"
            ) from error

    @property
    def on_device(self) -> bool:
        """True where the kernels must know the effect."""
        return any(getattr(self, hook) is not None for hook in self.DEVICE_HOOKS)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its numbers in the kernels, the amplitude first."""
        names = tuple(parameter.name for parameter in self.parameters)
        return ("amplitude", *names, *self.constant_names)


@dataclass(frozen=True)
class Active:
    """An effect that a scene has switched on, in the units of the scene."""

    effect: Effect
    amplitude: float
    parameters: dict[str, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Name and amplitude in words: `shaking 0.2 g`."""
        unit = f" {self.effect.amplitude.unit}" if self.effect.amplitude.unit else ""
        return f"{self.effect.name.replace('_', ' ')} {self.amplitude:g}{unit}"

    def numbers(self, scene: Scene) -> list[float]:
        """Its numbers in the order of `Effect.columns`, in SI."""
        effect = self.effect
        own = [self.amplitude * effect.amplitude.si]
        own += [self.parameters[p.name] * p.si for p in effect.parameters]
        if effect.constants is not None:
            with effect.blamed("constants"):
                derived = effect.constants(scene, self.amplitude, self.parameters)
                own += [float(derived[name]) for name in effect.constant_names]
                if not all(map(math.isfinite, own)):
                    raise ValueError("a constant is not a finite number")
        return own

    def field_of(self, scene: Scene, position: np.ndarray) -> np.ndarray:
        """Its fixed number for each point, (N,), at `position` (N, 2) [m]."""
        with self.effect.blamed("field"):
            values = np.asarray(
                self.effect.field(scene, position, self.amplitude, self.parameters), dtype=float
            )
            if values.shape != (len(position),) or not np.isfinite(values).all():
                raise ValueError(f"shape {values.shape}: {len(position)} finite numbers are needed")
        return values

    def between(self, scene: Scene, settled: SettledPoints) -> Between:
        """Its state on the host over a run, of an effect that has one."""
        with self.effect.blamed("between"):
            return self.effect.between(scene, settled, self.amplitude, self.parameters)

    def acting_scene(self, scene: Scene) -> Scene:
        """The scene that is simulated in place of `scene`."""
        if self.effect.scene is None:
            return scene
        with self.effect.blamed("scene"):
            return self.effect.scene(scene, self.amplitude, self.parameters)

    def until(self, scene: Scene) -> float:
        """Time before which a run may not be ended for resting [s]."""
        if self.effect.until is None:
            return 0.0
        with self.effect.blamed("until"):
            return float(self.effect.until(scene, self.amplitude, self.parameters))


def liquefied_zones(scene: Scene) -> list[str]:
    """Names of the zones whose material liquefied."""
    return [zone.name for zone in scene.zones if scene.materials[zone.material].liquefied]


def needs_liquefied_soil(scene: Scene) -> str:
    """`Effect.applies` of an effect on the strength of liquefied soil."""
    return "" if liquefied_zones(scene) else "no material is marked liquefied: true"


def needs_cohesion(scene: Scene) -> str:
    """`Effect.applies` of an effect on the cohesion of soil that has not liquefied."""
    for zone in scene.zones:
        material = scene.materials[zone.material]
        if material.cohesion_kpa > 0.0 and not material.liquefied:
            return ""
    return "no soil that has not liquefied has cohesion"
