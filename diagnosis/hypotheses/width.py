"""The width of the slide on trial: plane strain, or a section between flanks that hold it back.

`side_shear` and `side_friction` of the library are guesses at what flanks do, by one force over the
whole section. This is what they stand for: runs in three dimensions between flanks with the soil's
own strength, read on the middle section (`inversion.engines.finite_width`).
"""

from __future__ import annotations

from dataclasses import replace

from diagnosis.hypotheses.assumption import Assumption, Found, Sensitivities
from diagnosis.hypotheses.model import Candidate
from inversion.engines.finite_width import RATIOS, refused
from inversion.estimation.forward import SectionSetup

WIDTH = "finite_width"


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """The slide is three-dimensional."""
    if reason := refused(setup):
        return [], {WIDTH: reason}
    candidate = Candidate(
        name=WIDTH,
        family="dimension",
        words="the slide is three-dimensional: flanks hold it back, by their own strength",
        unit="",
        low=0.0,
        high=RATIOS[-1],
        ladder=RATIOS[:3],
        screened=True,
    )

    def change(setup: SectionSetup, ratio: float) -> SectionSetup:
        return replace(setup, height_over_width=ratio)

    return [Assumption(candidate, change)], {}
