"""The solver's arrays in numpy, for tests that drive single functions of the kernels."""

import numpy as np

from mpm_taichi import layout
from mpm_taichi.solver.runtime import aligned

COLUMNS = {"integers": layout.INTEGERS, "numbers": layout.NUMBERS, "sums": layout.SUMS}


def arrays(points: int = 1, nodes: int = 1, rows: int = 1, **given: np.ndarray) -> dict:
    """Name -> array of every array of the solver, for one slot; not `given`: 0, and volumes 1."""
    numbers = {
        layout.SlotState: (1,),
        layout.PointState: (points,),
        layout.NodeState: (nodes,),
        layout.MaterialTable: (rows,),
        layout.FrameState: (1, 1),
    }
    result = {}
    for kind, shape in numbers.items():
        for name in kind._fields:
            annotation = layout.ARRAYS[name]
            width = getattr(annotation.dtype, "n", 0)
            if not width and annotation.ndim > len(shape):
                width = COLUMNS.get(name, 1)
            scalar = getattr(annotation.dtype, "dtype", annotation.dtype).to_string()
            kinds = {"i32": np.int32, "f32": np.float32, "f64": np.float64}
            shape_here = (*shape, 1) if name == "positions" else shape
            result[name] = aligned(shape_here + ((width,) if width else ()), kinds[scalar])
    result["volume"][...] = 1.0
    for name, values in given.items():
        if result[name].shape == np.shape(values):
            result[name][...] = values
        else:
            result[name] = np.asarray(values, result[name].dtype)
    return {name: result[name] for name in layout.ARRAYS}
