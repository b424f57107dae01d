"""A measurement of one's own: how far the centroid of the soil travelled.

The travel of the centroid is the measure of mobility behind the energy line (Heim, 1932). It is
found from two surveys of the surface, one before and one after the slide. Use it with

    flowslide invert FOLDER --measurements-code docs/examples/my_measurement.py ...

and in `measurements.yaml`

    - {name: centroid, type: centroid_travel, value_m: -9.5, std_m: 1.0, confidence: assumed,
       source: "surveys of 3 and 12 May"}
"""

from typing import ClassVar, Literal

import numpy as np

from geometry.survey.measured import SingleLength
from geometry.survey.site import NOT_MADE
from pipeline.cli import InputError


class CentroidTravel(SingleLength):
    """Horizontal travel of the centroid of all soil, to the right positive."""

    type: Literal["centroid_travel"]

    history: ClassVar[None] = None  # the last frame is enough
    along: ClassVar[None] = None  # a single number that has no place
    datum: ClassVar[None] = None  # horizontal: no levelling error enters it

    def read_points(self, deposit, *, derivative):
        """Mean displacement of the points, weighted by their volume [m]."""
        share = np.broadcast_to(deposit.volume, len(deposit.position))
        share = share / share.sum()
        travel = share @ (deposit.position - deposit.initial_position)[:, 0]
        if not derivative:
            return travel
        change = np.zeros(deposit.position.shape)
        change[:, 0] = share
        return travel, change

    def check_in(self, scene, feet, where):
        """Nothing travels farther than the domain is wide."""
        width = scene.domain.x_max - scene.domain.x_min
        if abs(self.value_m) > width:
            raise InputError(
                f"{where}: value_m {self.value_m:g}: the domain is only {width:g} m wide"
            )

    @classmethod
    def could_be_made(cls, site):
        """Once, to the accuracy of a good survey."""
        if site.made_of(cls):
            return []
        return [
            cls(
                type="centroid_travel",
                name="travel of the centroid",
                value_m=0.0,
                std_m=site.std(cls, share=0.02, least=0.3),
                **NOT_MADE,
            )
        ]

    def marks(self, feet):
        """Nothing in pictures."""
        return []
