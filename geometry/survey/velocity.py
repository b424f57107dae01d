"""`velocity`: mean horizontal velocity of the column at one place and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.survey.checks import check_in_domain
from geometry.survey.columns import connected, kernel, kernel_length, kernel_slope
from geometry.survey.frames import check_end, frames_around, frames_of
from geometry.survey.marks import Mark
from geometry.survey.measured import Along, Deposit, Measured
from geometry.survey.site import Site
from geometry.survey.toe import Side


class Velocity(Measured):
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
    def values(self) -> np.ndarray:
        """The measured velocity, (1,) [m/s]."""
        return np.array([self.value_m_per_s])

    def with_values(self, values: np.ndarray) -> Velocity:
        """The same with another velocity, (1,) [m/s]."""
        return self.model_copy(update={"value_m_per_s": float(values[0])})

    @property
    def std(self) -> float:
        """Standard deviation of the survey [m/s]."""
        return self.std_m_per_s

    @property
    def model_std(self) -> float:
        """What the user grants the model in addition to the survey's error [m/s]."""
        return self.model_std_m_per_s

    @property
    def along(self) -> Along:
        """The time."""
        return Along("time_s", np.array([self.at_s]), series=False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Velocity [m/s]; its derivative is by the frames before and after [1/s]."""
        positions, time = frames_of(deposit, self.name)
        check_end(deposit, self.name, self.at_s)
        still = (0.0, (-1, -1), np.zeros((2, *positions.shape[1:]))) if derivative else 0.0
        if self.at_s > time[-1]:
            return still
        try:
            return column_velocity(
                positions,
                time,
                deposit.volume,
                spacing=deposit.spacing,
                x=self.x_m,
                at=self.at_s,
                derivative=derivative,
            )
        except NoSoilError:
            return still

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


class NoSoilError(ValueError):
    """There is no soil where a velocity is asked for."""


def column_velocity(
    positions: np.ndarray,
    time: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    x: float,
    at: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray, np.ndarray]:
    """Mean horizontal velocity of the column at `x` at the time `at`, weighted by mass.

    Args:
        positions: (T, N, 2) [m].
        time: (T,) ascending [s].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        x: place [m].
        at: time [s].
        derivative: return also the derivative.

    Returns:
        Velocity [m/s]; with `derivative` also the numbers of the frames before and after, (2,), and
        the derivative with respect to the positions in them, (2, N, 2) [1/s].

    Raises:
        NoSoilError: there is no soil at `x` then.
    """
    pair = frames_around(time, np.asarray([at]))[0][0]
    interval = float(time[pair[1]] - time[pair[0]])
    before, after = positions[pair[0]].astype(float), positions[pair[1]].astype(float)
    middle = 0.5 * (before + after)
    member = connected(middle, volume, spacing)
    length = kernel_length(spacing)
    offset = x - middle[:, 0]
    weight = np.where(member, volume, 0.0)
    share = weight * kernel(offset, length)
    if share.sum() == 0.0:
        raise NoSoilError(f"no soil at x = {x:g} m at t = {at:g} s")
    speed = (after[:, 0] - before[:, 0]) / interval
    mean = float(share @ speed / share.sum())
    if not derivative:
        return mean
    drift = -0.5 * weight * kernel_slope(offset, length) * (speed - mean)
    change = np.zeros((2, *before.shape))
    change[0, :, 0] = (drift - share / interval) / share.sum()
    change[1, :, 0] = (drift + share / interval) / share.sum()
    return mean, pair, change
