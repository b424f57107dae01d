"""Diagnosis: where a model disagrees with the measurements, and which physical effect it lacks.

In: a `Model` (parameters, measurements, candidate effects, and forward runs of any state). Out: a
`Verdict`: adequate, suspect, identified, ambiguous or unknown effect, always among the effects
tested, with every number behind it. The paper has no counterpart; it ends where its model and the
survey disagree.

The statistics know nothing of the material point method: `diagnosis.hypotheses.model` is all they
see. Nothing heavy is imported here.
"""

PHYSICS_VERSION = 11
"""Raised whenever the same runs and the same measurements give another verdict."""
