"""Everything that a GPU has to tell, in eight minutes: `python -m benchmarks.gpu` (README.md)."""
