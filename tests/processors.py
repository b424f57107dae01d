"""Other processors, stood in for by their kernels: `python -m tests.processors` runs the tests.

OpenBLAS and numpy choose their kernels by the processor, and so round otherwise on each. The fast
tests of the back-analysis and the diagnosis are run under those that this machine can run, in an
order drawn anew (`--randomly-seed` repeats it).
"""

from __future__ import annotations

import os
import subprocess
import sys

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


def main() -> int:
    """Run the tests under each; the exit code of the first that fails."""
    command = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadfile", "-p", "randomly"]
    for kernel, environment in PROCESSORS.items():
        print(f"as a {kernel} computes: {environment}", flush=True)
        own = {**os.environ, "OPENBLAS_CORETYPE": kernel, **environment}
        done = subprocess.run([*command, "-rfE", *TESTS], env=own, check=False)
        if done.returncode:
            return done.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
