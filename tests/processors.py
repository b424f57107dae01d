"""Other processors, stood in for by their kernels: `python -m tests.processors` runs the tests.

OpenBLAS and numpy choose their kernels by the processor, and so round otherwise on each. The fast
tests of the back-analysis and the diagnosis are run under those that this machine can run and does
not choose by itself (`make test` has run those), in an order drawn anew (`--randomly-seed` repeats
it).
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

FOUND = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
"""Kernels of numpy that this processor has beyond the plain ones."""
PLAIN = {"NPY_DISABLE_CPU_FEATURES": " ".join(FOUND)}
PROCESSORS = {
    "Prescott": {**PLAIN, "OMP_NUM_THREADS": "1"},
    **({"Haswell": {"OMP_NUM_THREADS": "2"}} if {"X86_V3", "AVX2"} & set(FOUND) else {}),
    **({"SkylakeX": {"OMP_NUM_THREADS": "1"}} if {"X86_V4", "AVX512_SKX"} & set(FOUND) else {}),
}
"""OPENBLAS_CORETYPE, and what else is set."""
TESTS = ("tests/inversion", "tests/diagnosis")


def own_kernel() -> str:
    """The kernel that numpy's OpenBLAS takes here; "" where it does not say."""
    for library in (Path(np.__file__).parents[1] / "numpy.libs").glob("*openblas*"):
        asked = getattr(ctypes.CDLL(str(library)), "scipy_openblas_get_corename64_", None)
        if asked is not None:
            asked.restype = ctypes.c_char_p
            return asked().decode()
    return ""


def main() -> int:
    """Run the tests under each; the exit code of the first that fails."""
    command = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadfile", "-p", "randomly"]
    here = own_kernel()
    for kernel, environment in PROCESSORS.items():
        if kernel == here:
            continue
        print(f"as a {kernel} computes: {environment}", flush=True)
        own = {**os.environ, "OPENBLAS_CORETYPE": kernel, **environment}
        done = subprocess.run([*command, "-rfE", *TESTS], env=own, check=False)
        if done.returncode:
            return done.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
