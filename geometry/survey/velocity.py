"""`velocity`: mean horizontal velocity of the column at one place and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.columns import connected, kernel, kernel_length, kernel_slope
from geometry.survey.frames import check_end, frames_around, frames_of
from geometry.survey.marks import Mark
from geometry.survey.measured import Along, Deposit, Single
from geometry.survey.site import Site, check_in_domain


class Velocity(Single):
    """Mean horizontal velocity of the column at one place and time, to the right positive.

    Where no soil is at that time, and once all is at rest, the reading is 0: nothing moves there.
    """

    unit: ClassVar[str] = "m/s"
    history: ClassVar[tuple[str, ...]] = ("x_m", "at_s")
    datum: ClassVar[None] = None

    type: Literal["velocity"]
    x_m: float = Field(description="place [m]")
    at_s: float = Field(ge=0, description="time after the start of the slide [s]")
    value_m_per_s: float = Field(description="the measured value, to the right positive [m/s]")
    std_m_per_s: float = Field(gt=0, description="standard deviation of the survey [m/s]")
    model_std_m_per_s: float = Field(
        0.0, ge=0, description="granted to the model in addition to the survey's error [m/s]"
    )

    @property
    def along(self) -> Along:
        """The time."""
        return Along("time_s", np.array([self.at_s]), series=False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Mean over the column [m/s], weighted by mass; derivative by the two frames [1/s]."""
        positions, time = frames_of(deposit, self.name)
        check_end(deposit, self.name, self.at_s)
        still = (0.0, (-1, -1), np.zeros((2, *positions.shape[1:]))) if derivative else 0.0
        if self.at_s > time[-1]:
            return still
        (pair,), _ = frames_around(time, np.array([self.at_s]))
        interval = float(time[pair[1]] - time[pair[0]])
        before, after = positions[pair[0]].astype(float), positions[pair[1]].astype(float)
        middle = 0.5 * (before + after)
        weight = np.where(connected(middle, deposit.volume, deposit.spacing), deposit.volume, 0.0)
        length = kernel_length(deposit.spacing)
        offset = self.x_m - middle[:, 0]
        share = weight * kernel(offset, length)
        if share.sum() == 0.0:
            return still
        speed = (after[:, 0] - before[:, 0]) / interval
        mean = float(share @ speed / share.sum())
        if not derivative:
            return mean
        drift = -0.5 * weight * kernel_slope(offset, length) * (speed - mean)
        change = np.zeros((2, *before.shape))
        change[0, :, 0] = (drift - share / interval) / share.sum()
        change[1, :, 0] = (drift + share / interval) / share.sum()
        return mean, pair, change

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A place within the domain."""
        check_in_domain(self.x_m, scene, f"{where}: x_m")

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[Velocity]:
        """None: the toe at some times says more and is easier to get."""
        return []

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []
