"""What the solver must reproduce: closed forms, experiments, convergence.

A module with a `TITLE` and a `run(folder, quick=False)` is a case: `run` returns its `Row`s and
draws `<folder>/<case>.png` (no picture where `folder` is None); its docstring explains it in
`docs/records/verification.md`. The other modules are what the cases share, and the command.
"""
