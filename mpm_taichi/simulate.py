"""Scenes in, runs out: slots on the device, and who is in them.

A fixed number of slots is in flight; a slot whose scene has ended takes the next scene, so that all
threads stay busy. A scene's numbers do not depend on its slot, its neighbours or the thread count.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from mpm_taichi import layout
from mpm_taichi.effects.framework.registry import (
    effects_on,
    has_strength_ratio,
    kernel_effects,
)
from mpm_taichi.flight import CHUNK, Flight
from mpm_taichi.materials.registry import law_of
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.runtime import DeviceSlots, Slots, start
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.materials.law import MaterialLaw
    from mpm_taichi.trajectory import Run
    from pipeline.config import SimulationSettings

SLOTS = {"cpu": 8, "cuda": 256}
"""Scenes in flight; on the CPU `PER_THREAD` for each thread where that is more."""

PER_THREAD = 2

SCHEDULES = {"cpu": "scene", "cuda": "point"}
"""How scenes are run on a device, see `solver`."""

Wanted = tuple["Scene", "SimulationSettings"]
"""A scene and the settings to simulate it with."""

OnFinished = Callable[[int, "Run"], None]
OnFrame = Callable[[int, float, float], None]


def simulate(
    scenes: Sequence[Scene],
    settings: SimulationSettings,
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_frame: OnFrame | None = None,
    on_finished: OnFinished | None = None,
) -> list[Run]:
    """Simulate scenes and return their runs in the order of the scenes.

    Args:
        scenes: any number of scenes, of any sizes.
        settings: one set of settings for all of them.
        device: "cpu" (bit-identical for any threads and company) or "cuda".
        threads: CPU threads; None: all this process may use.
        on_frame: called with (place in `scenes`, time [s], kinetic energy [J/m]) per chunk.
        on_finished: called with (place in `scenes`, run) as soon as a run is done.

    Raises:
        InputError: a law or an effect that does not exist, an effect that the law does not know, a
            moving kinematic zone, an unknown device.
    """
    runs: list[Run | None] = [None] * len(scenes)
    for place, run in simulate_each(
        [(scene, settings) for scene in scenes], device=device, threads=threads, on_frame=on_frame
    ):
        runs[place] = run
        if on_finished is not None:
            on_finished(place, run)
    return [run for run in runs if run is not None]


def simulate_each(
    wanted: Sequence[Wanted],
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_frame: OnFrame | None = None,
) -> Iterator[tuple[int, Run]]:
    """Yield (place in `wanted`, run) of scenes with their settings, as runs end; see `simulate`.

    Holds only the runs in flight. Scenes that need the same kernels are run together: those of a
    law without effects, with effects of the library whichever they are, and with the same effects
    of a user.
    """
    groups: dict[tuple, list[tuple[int, Wanted]]] = {}
    for place, (scene, settings) in enumerate(wanted):
        law = law_of(scene)
        check_scene(scene, law, settings)
        needed = (
            settings.transfer in ("affine_flip", "apic"),
            settings.volumetric_averaging,
            settings.volume_correction,
            kernel_effects(scene),
            law,
        )
        groups.setdefault(needed, []).append((place, (scene, settings)))
    threads = start(device, threads)
    in_flight = max(SLOTS[device], PER_THREAD * threads if device == "cpu" else 0)
    for (affine, averaged, corrected, effects, law), members in groups.items():
        kernels = build_kernels(
            affine=affine, averaged=averaged, corrected=corrected, effects=effects, law=law
        )
        yield from _simulate_group(members, device, kernels, in_flight, on_frame)


def _compile(slots: Slots) -> None:
    """Have the kernels compiled; where a user's effect or law cannot be, say so in one line."""
    table, law = slots.kernels.table, slots.kernels.law
    users = [repr(one.name) for one in (table.effects if table else ()) if one.version]
    users = [f"effect {', '.join(users)}"] if users else []
    users += [f"law {law.name!r}"] if law.version else []
    try:
        slots.compile()
    except Exception as error:
        if not users:
            raise
        # The end of Taichi's message says what is wrong, the rest where in its own pieces.
        words = " ".join(word for word in str(error).split() if set(word) - set("^~"))
        raise InputError(f"{' or '.join(users)}: does not compile: ... {words[-300:]}") from error


def _simulate_group(
    members: Sequence[tuple[int, Wanted]],
    device: str,
    kernels: object,
    in_flight: int,
    on_frame: OnFrame | None,
) -> Iterator[tuple[int, Run]]:
    """`simulate_each` for scenes, with their places, that share their kernels."""
    number = min(in_flight, len(members))
    waiting = list(members)[::-1]
    flying: dict[int, Flight] = {}
    slots: Slots | None = None
    while waiting or flying:
        arrivals = {}
        for slot in range(number):
            if slot not in flying and waiting:
                place, (scene, settings) = waiting.pop()
                arrivals[slot] = Flight(place, prepare(scene, settings, kernels.law))
        slots = _make_room(slots, flying, arrivals, number, device, kernels)
        if arrivals:
            slots.fetch()
        for slot, flight in arrivals.items():
            slots.admit(slot, flight.prepared)
        flying.update(arrivals)
        for slot, flight in flying.items():
            flight.make_way(slot, slots)
            flight.move_water(slot, slots)
            flight.renew_fields(slot, slots)
            slots.set_frames(slot, flight.frames_wanted())
        began = time.perf_counter()
        slots.run()
        share = (time.perf_counter() - began) / len(flying)
        for slot, flight in list(flying.items()):
            flight.wall_time += share
            flight.collect(slot, slots)
            if on_frame is not None and flight.energies:
                on_frame(
                    flight.place,
                    len(flight.energies) * flight.prepared.frame_time,
                    float(flight.energies[-1][layout.KINETIC]),
                )
            if flight.ended:
                slots.fetch()
                yield flight.place, flight.finish(slot, slots)
                slots.integers[slot, layout.PHASE] = layout.IDLE
                del flying[slot]


def check_scene(scene: Scene, law: MaterialLaw, settings: SimulationSettings) -> None:
    """Refuse what a scene may say but the solver cannot do; one line for a person."""
    if has_strength_ratio(scene):
        if law.strength_constants is None:
            raise InputError(
                f"{scene.name}: materials: strength_ratio: changes the strength, which the "
                f"material law {law.name!r} does not provide for"
            )
        if settings.initial_stress == "gravity_on":
            raise InputError(
                f"{scene.name}: materials: strength_ratio: is of the stress before failure, which "
                "initial_stress 'gravity_on' leaves out; allowed are settled, k0"
            )
    for one in effects_on(scene):
        if one.effect.between is not None and settings.initial_stress == "gravity_on":
            raise InputError(
                f"{scene.name}: effects: {one.effect.name}: begins from the stress before failure, "
                "which initial_stress 'gravity_on' leaves out; allowed are settled, k0"
            )
        if one.effect.strength is not None and law.strength_constants is None:
            raise InputError(
                f"{scene.name}: effects: {one.effect.name}: changes the strength, which the "
                f"material law {law.name!r} does not provide for"
            )
    saturated = sum(one.saturated_density is not None for one in scene.materials.values())
    if len(scene.materials) + saturated > layout.MAX_ROWS:
        raise InputError(
            f"{scene.name}: materials: {len(scene.materials)}, {saturated} of them with a "
            f"saturated_density: together at most {layout.MAX_ROWS}"
        )
    for zone in scene.zones:
        if zone.kinematic and zone.initial_velocity != (0.0, 0.0):
            raise InputError(
                f"{scene.name}: zones: {zone.name!r} is kinematic with initial_velocity "
                f"{zone.initial_velocity}; kinematic zones are held fixed: allowed is (0, 0)"
            )


def _make_room(
    slots: Slots | None,
    flying: dict[int, Flight],
    arrivals: dict[int, Flight],
    number: int,
    device: str,
    kernels: object,
) -> Slots:
    """Slots large enough for all scenes in flight and arriving; those in flight move over."""
    everyone = [flight.prepared for flight in (*flying.values(), *arrivals.values())]
    points = max(len(prepared.order) for prepared in everyone)
    nodes = max(flight.nodes_wanted() for flight in (*flying.values(), *arrivals.values()))
    if slots is not None and points <= slots.points and nodes <= slots.nodes:
        return slots
    kind = DeviceSlots if SCHEDULES[device] == "point" else Slots
    larger = kind(
        number, points + points // 8, nodes + nodes // 4, CHUNK, device=device, kernels=kernels
    )
    if slots is None:
        _compile(larger)
    else:
        slots.fetch()
    for slot in flying:
        larger.take_over(slot, slots, flying[slot].prepared)
    return larger
