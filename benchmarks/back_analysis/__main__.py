"""Measure what the back-analysis must show: `python -m benchmarks.back_analysis [part ...]`.

Prints the table; without --quick also stores it in `results.json` and updates the figures and
tables of `docs/records/validation.md`. Exits with 1 if a part fails or misses a target.
Simulations are cached by content in results/benchmarks/back_analysis, so a killed run resumes.
"""

from benchmarks.back_analysis.study import Validation
from pipeline.cli import main_exit

if __name__ == "__main__":
    main_exit(Validation().main)
