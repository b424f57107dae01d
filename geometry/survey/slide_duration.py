"""`slide_duration`: the time in which the soil does the middle part of its way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.frames import frames_of
from geometry.survey.marks import Mark
from geometry.survey.measured import Deposit, Single
from geometry.survey.site import NOT_MADE, Site
from pipeline.cli import InputError

#: Standard deviation of a duration that has not been measured, in falls from the section's height.
USUAL_STD = 0.3


class SlideDuration(Single):
    """How long the slide took: the time in which the soil does the middle part of its way.

    The way is the mean distance of all soil from where it was. A slow start and a slow end, which
    no witness and no instrument distinguishes from rest, do not count.
    """

    unit: ClassVar[str] = "s"
    history: ClassVar[tuple[str, ...]] = ("between",)
    along: ClassVar[None] = None
    datum: ClassVar[None] = None

    type: Literal["slide_duration"]
    value_s: float = Field(ge=0, description="the measured value [s]")
    std_s: float = Field(gt=0, description="standard deviation of the measurement [s]")
    model_std_s: float = Field(
        0.0, ge=0, description="granted to the model in addition to the measurement's error [s]"
    )
    between: tuple[float, float] = Field(
        (0.05, 0.95), description="shares of the way between which the time counts"
    )

    @model_validator(mode="after")
    def _shares_ascend(self) -> SlideDuration:
        first, last = self.between
        if not 0.0 < first < last < 1.0:
            raise ValueError(
                f"between {first:g} and {last:g}: shares of the way must ascend within 0 and 1"
            )
        return self

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Duration [s], 0 where nothing moved; derivative by the frames it depends on [s/m].

        It runs from the first moment at which the way is `between[0]` of the last one to the first
        at which it is `between[1]`. Less than a thousandth of the spacing does not count as motion.
        """
        positions, time = frames_of(deposit, self.name)
        if not deposit.at_rest:
            raise InputError(
                f"{self.name}: the run was stopped in motion at {time[-1]:g} s; give it a longer "
                "duration_s"
            )
        if len(time) < 2:
            raise ValueError(f"a duration needs at least two frames, but there are {len(time)}")
        share = np.broadcast_to(np.asarray(deposit.volume, dtype=float), positions.shape[1])
        share = share / share.sum()
        moved = positions.astype(float) - deposit.initial_position
        distance = np.hypot(moved[..., 0], moved[..., 1])
        way = distance @ share
        last = len(time) - 1
        if way[last] < 1e-3 * deposit.spacing:
            nothing = (np.full(5, last), np.zeros((5, *positions.shape[1:])))
            return (0.0, *nothing) if derivative else 0.0
        moments, frames, slopes = [], [], []
        for part in self.between:
            level = part * way[last]
            after = max(int(np.argmax(way >= level)), 1)
            before = after - 1
            rise, interval = way[after] - way[before], time[after] - time[before]
            passed = (level - way[before]) / rise
            moments.append(time[before] + passed * interval)
            frames += [before, after]
            # By the way before, the way after, and the last way through the level.
            slopes.append(np.array([passed - 1.0, -passed, part]) * interval / rise)
        duration = float(moments[1] - moments[0])
        if not derivative:
            return duration
        (first, second), numbers = slopes, np.array([*frames, last])
        weights = np.array([-first[0], -first[1], second[0], second[1], second[2] - first[2]])
        with np.errstate(invalid="ignore", divide="ignore"):
            direction = np.nan_to_num(moved[numbers] / distance[numbers][..., None])
        return duration, numbers, weights[:, None, None] * share[None, :, None] * direction

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A duration has no place on the section."""

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[SlideDuration]:
        """The duration, where it is not known."""
        if site.made_of(cls):
            return []
        return [
            cls(
                type="slide_duration",
                name="duration of the slide",
                value_s=0.0,
                std_s=round(USUAL_STD * site.fall, 2),
                **NOT_MADE,
            )
        ]

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []
