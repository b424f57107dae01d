"""Speed and memory, each as a ratio within one run: `python -m benchmarks.performance NAME`."""

PROGRAM = "python -m benchmarks.performance"
