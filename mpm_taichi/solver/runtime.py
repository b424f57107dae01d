"""Taichi started, and the arrays of the scenes in flight on its device.

A slot is a fixed stretch of every array and holds one scene; empty slots cost nothing. On the CPU
the arrays are numpy's own memory, on a GPU they live there and are copied when a scene comes or a
chunk of frames is done.
"""

from __future__ import annotations

import io
import os
import sys
import textwrap
from contextlib import redirect_stdout
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
import taichi as ti
from taichi.lang import kernel_impl
from taichi.lang.ast import ast_transformer_utils
from taichi.lang.util import to_numpy_type

from mpm_taichi import layout
from mpm_taichi.solver import kernels
from pipeline.cli import InputError, WorkFailed

if TYPE_CHECKING:
    from mpm_taichi.solver.initial_state import PreparedScene

OPTIONS = {"fast_math": False, "cfg_optimization": False, "log_level": ti.ERROR}
"""How Taichi compiles. Sums stay in the order in which they are written: then bits do not depend on
what else is in a kernel nor on the kind of processor, and points side by side keep the same form,
which is what makes vector instructions of them. The analysis of stores and loads takes three
quarters of the compilation, and LLVM does it again."""


def _read_kernels_fast() -> None:
    """Spare Taichi what it does again each time a function is inlined while it reads a kernel.

    It looks up and tidies the source of the function, and makes of every expression the text that
    an error would show, code and arrows: half of the time. Sources are kept; that text is made
    where there is an error, and is else a line's number.
    """
    whole_text = ast_transformer_utils.ASTTransformerContext.get_pos_info

    def position(context: Any, node: Any) -> str:
        if sys.exc_info()[0] is not None:
            return whole_text(context, node)
        line = node.lineno + context.lineno_offset
        return f'File "{context.file}", line {line}, in {context.func.func.__name__}:\n'

    ast_transformer_utils.ASTTransformerContext.get_pos_info = position
    for name in ("getsourcefile", "getsourcelines"):
        setattr(kernel_impl, name, cache(getattr(kernel_impl, name)))
    tidy = {name: staticmethod(cache(getattr(textwrap, name))) for name in ("fill", "dedent")}
    kernel_impl.textwrap = type("Remembering", (), tidy)


_read_kernels_fast()

_started: tuple[str, int] | None = None


def start(device: str, threads: int | None) -> int:
    """Start Taichi on "cpu" or "cuda"; returns the number of CPU threads.

    Raises:
        InputError: another device name.
        WorkFailed: no CUDA device answers.
    """
    global _started
    if device not in ("cpu", "cuda"):
        raise InputError(f"device {device!r} is unknown: allowed are cpu, cuda")
    count = threads or len(os.sched_getaffinity(0))
    if count < 1:
        raise InputError(f"threads {count}: at least 1")
    if _started == (device, count):
        return count
    arch = ti.cpu if device == "cpu" else ti.cuda
    try:
        with redirect_stdout(io.StringIO()):  # of what it says: on which device it starts
            ti.init(arch=arch, cpu_max_num_threads=count, default_fp=ti.f32, **OPTIONS)
    except Exception as error:
        raise WorkFailed(f"device {device}: Taichi did not start: {error}") from error
    if ti.lang.impl.current_cfg().arch != arch:
        _started = None
        raise WorkFailed("device cuda: no CUDA device answers; use --device cpu")
    _started = (device, count)
    kernels.build_kernels.cache_clear()
    return count


def aligned(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Zeros that begin on a 64-byte line, so that a node's row never straddles two lines."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    raw = np.zeros(size + 64, np.uint8)
    offset = -raw.ctypes.data % 64
    return raw[offset : offset + size].view(dtype).reshape(shape)


class Slots:
    """Arrays for `number` scenes of up to `points` points and `nodes` nodes each.

    Every array of `layout.ARRAYS` is an attribute, in numpy; a last axis holds its columns.
    """

    def __init__(
        self, number: int, points: int, nodes: int, frames: int, *, device: str, kernels: Any
    ) -> None:
        points = -(-points // layout.TILE) * layout.TILE  # whole tiles
        self.number, self.points, self.nodes, self.frames = number, points, nodes, frames
        self.device, self.kernels = device, kernels
        for name, shape in self._shapes().items():
            scalar = getattr(layout.ARRAYS[name].dtype, "dtype", layout.ARRAYS[name].dtype)
            setattr(self, name, aligned(shape, to_numpy_type(scalar)))

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each array; one row of what the kernels never look at."""
        rows = {
            layout.SlotState: (self.number,),
            layout.PointState: (self.number * self.points,),
            layout.NodeState: (self.number * self.nodes,),
            layout.MaterialTable: (self.number * layout.MAX_ROWS,),
            layout.FrameState: (self.number, self.frames),
        }
        shapes = {name: rows[kind] for kind in rows for name in kind._fields}
        shapes["positions"] += (self.points,)
        table, law = self.kernels.table, self.kernels.law
        if not table:
            shapes |= {"facts": (1,), "own_strength": (1,), "resistance": (1,)}
        if not law.variables:
            shapes["variables"] = (1,)
        columns = {
            "integers": layout.INTEGERS,
            "numbers": layout.NUMBERS,
            "sums": layout.SUMS,
            "effect_numbers": table.width if table else 1,
            "facts": table.facts if table else 1,
            "variables": max(law.variables, 1),
        }
        for name, kind in layout.ARRAYS.items():
            width = columns.get(name) or getattr(kind.dtype, "n", 0)
            shapes[name] += (width,) if width else ()
        return shapes

    def point_range(self, slot: int) -> slice:
        """Where the points of a slot lie in the arrays."""
        first = self.integers[slot, layout.FIRST_POINT]
        return slice(first, self.integers[slot, layout.LAST_POINT])

    def admit(self, slot: int, scene: PreparedScene) -> None:
        """Put a prepared scene into a slot."""
        count = len(scene.order)
        point, row = slot * self.points, slot * layout.MAX_ROWS
        where = slice(point, point + count)
        self.motion[where] = scene.motion
        self.stress[where] = self.initial_stress[where] = scene.stress
        self.gradient[where] = self.history[where] = 0.0
        self.row[where] = scene.row + row
        self.volume[where] = scene.volume
        rows = slice(row, row + len(scene.elastic))
        for name in layout.MaterialTable._fields:
            getattr(self, name)[rows] = getattr(scene, name)
        if self.kernels.law.variables:
            self.variables[where] = scene.variables[scene.row]
        settings = scene.settings
        integers, numbers = self.integers[slot], self.numbers[slot]
        integers[:] = 0
        integers[layout.FIRST_POINT : layout.LAST_SETTLED + 1] = (
            point,
            point + count,
            point + scene.settled,
        )
        integers[layout.PHASE] = layout.SETTLING
        integers[layout.FRAME_COUNT] = self.frames
        numbers[:] = 0.0
        numbers[layout.CELL] = scene.grid.cell
        numbers[layout.FRAME_TIME] = scene.frame_time
        full = settings.transfer in ("apic", "pic")
        numbers[layout.PIC_RATE] = 1e30 if full else settings.pic_rate_per_s
        numbers[layout.GRAVITY] = settings.gravity_m_per_s2
        numbers[layout.COURANT] = settings.courant
        numbers[layout.WAVE_SPEED] = scene.wave_speed
        numbers[layout.SPEED] = np.sqrt(np.max(np.sum(scene.motion[:, 2:] ** 2, axis=1)))
        numbers[layout.FIXED_STEP] = settings.time_step_s or 0.0
        numbers[layout.DAMPING] = settings.local_damping
        relaxation = settings.pressure_relaxation * scene.wave_speed / scene.grid.cell
        numbers[layout.RELIEF] = relaxation
        numbers[layout.SMOOTHING] = settings.pressure_smoothing
        self.home[where] = scene.home + slot * self.nodes
        self._lay_nodes(slot, scene)
        if self.kernels.table:
            self._admit_effects(slot, scene, where)

    def _admit_effects(self, slot: int, scene: PreparedScene, where: slice) -> None:
        """The active effects, their numbers, and the strength and the facts of every point."""
        table, integers, numbers = self.kernels.table, self.integers[slot], self.numbers[slot]
        integers[layout.EFFECTS_ON] = table.bits(scene.effects)
        numbers[layout.ORIGIN_X], numbers[layout.ORIGIN_Y] = scene.grid.origin
        self.effect_numbers[slot] = table.numbers(scene.effects, scene.scene)
        position = scene.points.position[scene.order]
        soil = scene.soil[scene.row]
        self.facts[where] = table.point_facts(scene.effects, scene.scene, position, soil)
        self.own_strength[where] = scene.strength[scene.row]

    def lay_grid(self, slot: int, scene: PreparedScene, left: int) -> None:
        """Give a slot the enlarged grid of its scene, with `left` more columns on the left."""
        self.home[self.point_range(slot)] += left * scene.grid.shape[1]
        self.integers[slot, layout.GROWN] += left
        self._lay_nodes(slot, scene, keep=left)

    def _lay_nodes(self, slot: int, scene: PreparedScene, keep: int | None = None) -> None:
        """Nodes of a slot; the divergences still to be used move along where `keep` says."""
        node, nodes = slot * self.nodes, scene.grid.nodes
        integers = self.integers[slot]
        old = self.cell_mean[integers[layout.FIRST_NODE] : integers[layout.LAST_NODE]].copy()
        integers[layout.FIRST_NODE], integers[layout.LAST_NODE] = node, node + nodes
        integers[layout.COLUMNS] = scene.grid.shape[1]
        where = slice(node, node + nodes)
        self.kind[where], self.surroundings[where] = scene.kind, scene.surroundings
        self.load[where] = self.velocity[where] = self.cell_mean[where] = 0.0
        if self.kernels.table:
            self.resistance[where] = 0.0
        if keep is not None:
            first = node + keep * scene.grid.shape[1]
            self.cell_mean[first : first + len(old)] = old

    def lay_water(self, slot: int, force: tuple[np.ndarray, np.ndarray]) -> None:
        """Give the nodes of a slot another force of water [N/m3]."""
        where = slice(self.integers[slot, layout.FIRST_NODE], self.integers[slot, layout.LAST_NODE])
        for column, values in zip((layout.WATER_X, layout.WATER_Y), force, strict=True):
            self.surroundings[where, column] = values.ravel()

    def take_over(self, slot: int, other: Slots, scene: PreparedScene) -> None:
        """Copy a scene in flight from smaller arrays."""
        self.integers[slot], self.numbers[slot] = other.integers[slot], other.numbers[slot]
        count = len(scene.order)
        mine, theirs = slot * self.points, slot * other.points
        unused = set() if self.kernels.law.variables else {"variables"}
        if not self.kernels.table:
            unused |= {"facts", "own_strength", "resistance"}
        for name in set(layout.PointState._fields) - unused:
            getattr(self, name)[mine : mine + count] = getattr(other, name)[theirs : theirs + count]
        self.effect_numbers[slot] = other.effect_numbers[slot]
        home = other.home[theirs : theirs + count] - slot * other.nodes
        self.home[mine : mine + count] = home + slot * self.nodes
        for name in layout.MaterialTable._fields:
            rows = slice(slot * layout.MAX_ROWS, (slot + 1) * layout.MAX_ROWS)
            getattr(self, name)[rows] = getattr(other, name)[rows]
        nodes = other.integers[slot, layout.LAST_NODE] - other.integers[slot, layout.FIRST_NODE]
        for name in set(layout.NodeState._fields) - unused:
            first, from_ = slot * self.nodes, slot * other.nodes
            getattr(self, name)[first : first + nodes] = getattr(other, name)[from_ : from_ + nodes]
        shift = mine - theirs
        columns = slice(layout.FIRST_POINT, layout.LAST_SETTLED + 1)
        self.integers[slot, columns] += shift
        self.integers[slot, [layout.FIRST_NODE, layout.LAST_NODE]] += slot * (
            self.nodes - other.nodes
        )

    def set_frames(self, slot: int, number: int) -> None:
        """Have a slot advance by this many frames in the coming chunk."""
        self.integers[slot, layout.FRAME_COUNT] = number

    def run(self) -> None:
        """Advance every slot by one chunk of frames (settling first where a scene is new)."""
        self._run(self.number)

    def compile(self) -> None:
        """Have the kernels compiled, so that no run's wall time counts it."""
        self._run(0)

    def _run(self, number: int) -> None:
        self.kernels.run_scenes(number, *(getattr(self, name) for name in layout.ARRAYS))

    def fetch(self) -> None:
        """Bring everything to the host; nothing to do where the arrays are numpy's own."""


class DeviceSlots(Slots):
    """Slots whose arrays live on the device and run by the point schedule.

    The numpy arrays of `Slots` are the host's copy. Tables and frames come back after every chunk,
    the rest when `fetch` is called, which must be done before the host's copy is changed.
    """

    SETTLE_CHECK = 20
    """Settling steps between two looks at the unbalanced force."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._device: dict[str, Any] = {}
        self._host_is_new, self._water_is_new = True, False
        for name, kind in layout.ARRAYS.items():
            shape = getattr(self, name).shape
            columns = 1 if hasattr(kind.dtype, "n") else 0
            self._device[name] = ti.ndarray(kind.dtype, shape[: len(shape) - columns])

    def _pull(self, *names: str) -> None:
        for name in names:
            getattr(self, name)[...] = self._device[name].to_numpy()

    def compile(self) -> None:
        """Nothing to do: kernels of the point schedule compile one by one in the first run."""

    def set_frames(self, slot: int, number: int) -> None:
        """Have a slot advance by this many frames in the coming chunk."""
        if self.integers[slot, layout.FRAME_COUNT] == number:
            return
        super().set_frames(slot, number)
        if not self._host_is_new:  # one number: not worth bringing everything here and back
            self._device["integers"][slot, layout.FRAME_COUNT] = number

    def lay_water(self, slot: int, force: tuple[np.ndarray, np.ndarray]) -> None:
        """Give the nodes of a slot another force of water [N/m3]."""
        super().lay_water(slot, force)
        self._water_is_new = True

    def fetch(self) -> None:
        """Bring everything to the host, whose copy then counts."""
        if not self._host_is_new:  # nothing on the device changes the surroundings
            kept = {"surroundings", *layout.MaterialTable._fields}
            self._pull(*(set(layout.ARRAYS) - kept))
            self._host_is_new = True

    def run(self) -> None:
        """Advance every slot by one chunk of frames (settling first where a scene is new)."""
        if self._host_is_new:
            for name in layout.ARRAYS:
                self._device[name].from_numpy(getattr(self, name))
            self._host_is_new = False
        elif self._water_is_new:
            self._device["surroundings"].from_numpy(self.surroundings)
        self._water_is_new = False
        if (self.integers[:, layout.PHASE] == layout.SETTLING).any():
            self._settle()
        kernels, arrays = self.kernels.point, self._device.values()
        for frame in range(self.frames):
            kernels.begin_frame(self.number, frame, *arrays)
            turns = self._device["integers"].to_numpy()[:, layout.SUBSTEPS].max()
            for turn in range(int(turns)):
                kernels.step(turn, frame, self.number, self.points, self.nodes, *arrays)
            kernels.end_frame(frame, self.number, self.points, *arrays)
        self._pull("integers", "numbers", "sums", "positions")

    def _settle(self) -> None:
        """Settle all new scenes; each stops when its own forces balance."""
        device, kernels, arrays = self._device, self.kernels.point, self._device.values()
        waiting = self.integers[:, layout.PHASE] == layout.SETTLING
        first, last = layout.FIRST_POINT, layout.LAST_SETTLED
        at_rest = self.integers[:, last] > self.integers[:, first]
        active = waiting & at_rest
        steps = 0
        while active.any() and steps < layout.SETTLE_LIMIT:
            for _ in range(self.SETTLE_CHECK):
                kernels.settle_step(self.number, self.points, self.nodes, *arrays)
            steps += self.SETTLE_CHECK
            sums = device["sums"].to_numpy()[:, 0]
            ratio = sums[:, 0] / np.maximum(sums[:, 1], 1e-30)
            self.numbers[active, layout.UNBALANCED] = ratio[active]
            self.integers[active, layout.SETTLE_STEPS] = steps
            settled = active & (ratio <= layout.SETTLE_TOLERANCE)
            active &= ~settled
            self.integers[settled, layout.PHASE] = layout.IDLE
            device["integers"].from_numpy(self.integers)
        self.integers[waiting, layout.PHASE] = layout.SETTLING
        device["integers"].from_numpy(self.integers)
        device["numbers"].from_numpy(self.numbers)
        kernels.start_moving(self.number, self.points, *arrays)
