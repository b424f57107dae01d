"""What the solver must reproduce: closed forms, experiments, convergence.

Every module but `rows`, `lab` and `__main__` is one case: `TITLE`, and `run(folder, quick=False)`,
which returns its `Row`s and draws `<folder>/<case>.png` (no picture where `folder` is None).
"""
