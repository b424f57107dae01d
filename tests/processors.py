"""Other processors, stood in for by their kernels: `python -m tests.processors` runs the tests.

OpenBLAS and numpy choose their kernels by the processor, and so round otherwise on each. The fast
tests of the back-analysis and the diagnosis are run under those that this machine can run and does
not choose by itself (`make test` has run those), in an order drawn anew (`--randomly-seed` repeats
it). All kernels at once, each on its share of the cores: so each collects the tests but once.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
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
    here = own_kernel()
    kernels = [kernel for kernel in PROCESSORS if kernel != here]
    each = max(len(os.sched_getaffinity(0)) // len(kernels), 1) if kernels else 1
    command = [sys.executable, "-m", "pytest", "-p", "randomly", "-rfE", *TESTS]
    if each > 1:
        command += ["-n", str(each), "--dist", "loadfile"]
    running, codes = {}, []
    # A folder to each: one that clears old ones away would meet the other's.
    with tempfile.TemporaryDirectory() as scratch:
        for number, kernel in enumerate(kernels):
            own = {
                **os.environ,
                "OPENBLAS_CORETYPE": kernel,
                "CORES_SHARE": f"{number}/{len(kernels)}",
                **PROCESSORS[kernel],
            }
            mine = [*command, "--basetemp", str(Path(scratch) / kernel)]
            said = tempfile.TemporaryFile("w+")
            running[kernel] = subprocess.Popen(mine, env=own, stdout=said, stderr=said), said
        for kernel, (process, said) in running.items():
            codes.append(process.wait())
            said.seek(0)
            print(
                f"as a {kernel} computes: {PROCESSORS[kernel]}", said.read(), sep="\n", flush=True
            )
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
