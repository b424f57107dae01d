"""Run the verification cases: `python -m benchmarks.verification [case ...]`.

Prints the table; a full run also stores each case in `results.json` and updates the pictures and
the table of `docs/records/verification.md`. Ends with 1 if any row is outside its tolerance.
"""

from benchmarks.verification.study import Verification
from pipeline.cli import main_exit

if __name__ == "__main__":
    main_exit(Verification().main)
