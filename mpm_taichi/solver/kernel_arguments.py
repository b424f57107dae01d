"""Kernels over the whole state: their argument lists are written from the table in `layout`.

Taichi passes arrays to a kernel one by one and groups of them only between its functions. So the
body of a kernel is a Taichi function of `SolverState`, and the kernel around it is generated.
"""

from __future__ import annotations

import linecache
from collections.abc import Callable
from itertools import count
from types import ModuleType
from typing import Any

import taichi as ti

from mpm_taichi import layout

_numbers = count()


def state_kernel(body: Callable, *, table: ModuleType = layout, **arguments: Any) -> Callable:
    """The kernel that calls the Taichi function `body(*arguments, state)`.

    Args:
        body: its loops at the outermost level run in parallel, as in any kernel.
        table: module with the arrays and their groups: `ARRAYS`, `GROUPS`, `SolverState`.
        arguments: name -> Taichi type of what it takes before the state.

    Returns:
        a kernel of these arguments and then all arrays in the order of `table.ARRAYS`.
    """
    name = body.__name__
    kinds = {**arguments, **table.ARRAYS}
    head = ", ".join(f"{one}: kinds[{one!r}]" for one in kinds)
    groups = [
        f"{group}=layout.{kind.__name__}({', '.join(kind._fields)})"
        for group, kind in table.GROUPS.items()
    ]
    call = ", ".join([*arguments, f"ti.static(layout.SolverState({', '.join(groups)}))"])
    source = f"def {name}({head}):\n    body({call})\n"
    # Taichi compiles source text, which it looks up by the name of the file.
    file = f"<kernel {name} {next(_numbers)}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    space = {"ti": ti, "layout": table, "body": body, "kinds": kinds}
    exec(compile(source, file, "exec", dont_inherit=True), space)
    return ti.kernel(space[name])
