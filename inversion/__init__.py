"""Back-analysis: which strength lets a simulated slide run as far as the real one did?

In: a case folder (`scene.yaml`, `measurements.yaml`, and `inversion.yaml`, the question) and a
forward engine. Out: `result.json` with values, standard deviations, what the data do not determine,
and what every other assumption does to the answer; `history.csv`, `sections.npz`, the trajectory of
the answer (paper, sections on the framework and on the two dams).

Nothing heavy is imported here: a forward engine starts only when `inversion.engines.mpm_engine` is
used.
"""

from __future__ import annotations

PHYSICS_VERSION = 8
"""Raised whenever the same question and the same simulations give another answer."""
