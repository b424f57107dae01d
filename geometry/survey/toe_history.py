"""`toe_history`: runout of the toe at given times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.frames import check_end, frames_around, frames_of
from geometry.survey.marks import Mark
from geometry.survey.measured import Along, Deposit, Length, exponential_correlation
from geometry.survey.site import NOT_MADE, Site
from geometry.survey.toe_runout import check_has_toe, runout_of

#: Times that are proposed, in falls from the section's height.
TIMES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)


class ToeHistory(Length):
    """Runout of the toe at given times after the start of the slide, outward positive."""

    history: ClassVar[tuple[str, ...]] = ("side", "times_s")
    datum: ClassVar[None] = None

    type: Literal["toe_history"]
    side: Side = Field(description="left or right of the section")
    times_s: list[float] = Field(min_length=1, description="times, ascending [s]")
    values_m: list[float] = Field(min_length=1, description="runout at these times [m]")
    correlation_time_s: float | None = Field(
        None, gt=0, description="of the errors along the history [s]; null: independent"
    )

    @model_validator(mode="after")
    def _times_ascend(self) -> ToeHistory:
        if len(self.times_s) != len(self.values_m):
            raise ValueError(
                f"times_s has {len(self.times_s)} numbers and values_m {len(self.values_m)}; "
                "they go in pairs"
            )
        if self.times_s[0] < 0:
            raise ValueError(f"times_s begins at {self.times_s[0]:g}; times count from the start")
        for before, after in zip(self.times_s, self.times_s[1:], strict=False):
            if after <= before:
                raise ValueError(f"times_s: {after:g} follows {before:g}; times must ascend")
        return self

    @property
    def values(self) -> np.ndarray:
        """Runout at the times, (m,) [m]."""
        return np.array(self.values_m)

    def with_values(self, values: np.ndarray) -> ToeHistory:
        """The same with other runouts, (m,) [m]."""
        return self.model_copy(update={"values_m": [float(value) for value in values]})

    @property
    def parts(self) -> list[str]:
        """When each value was read."""
        return [f"at {time:g} s" for time in self.times_s]

    @property
    def slid_to(self) -> Side:
        """The side of the toe."""
        return self.side

    def correlation(self) -> np.ndarray:
        """Correlation of the errors along the history, (m, m)."""
        return exponential_correlation(np.array(self.times_s), self.correlation_time_s)

    @property
    def along(self) -> Along:
        """The times."""
        return Along("time_s", np.array(self.times_s, dtype=float), series=len(self.times_s) > 1)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Runout at the times [m], interpolated between frames; derivative by the two frames."""
        positions, time = frames_of(deposit, self.name)
        check_end(deposit, self.name, self.times_s[-1])
        # At rest the toe stays where it is.
        frames, shares = frames_around(time, np.minimum(self.times_s, time[-1]))
        values, known = np.zeros(len(frames)), np.unique(frames)
        if not derivative:
            toes = {
                frame: runout_of(deposit, self.side, position=positions[frame]) for frame in known
            }
            for k, j in np.ndindex(frames.shape):
                values[k] += shares[k, j] * toes[frames[k, j]]
            return values
        sloped = {
            frame: runout_of(deposit, self.side, position=positions[frame], derivative=True)
            for frame in known
        }
        changes = np.zeros((len(frames), 2, *positions.shape[1:]))
        for k, j in np.ndindex(frames.shape):
            runout, slope = sloped[frames[k, j]]
            values[k] += shares[k, j] * runout
            changes[k, j] = shares[k, j] * slope
        return values, frames, changes

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A history has no place on the section, but a side that must have a toe."""
        check_has_toe(scene, self.side, where)

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[ToeHistory]:
        """The toe at some times, on the sides to which the slide ran and that were not filmed."""
        filmed = {entry.side for entry in site.made_of(cls)}
        std = site.std(cls, 0.02, 0.5)
        return [
            cls(
                type="toe_history",
                name=f"{side} toe",
                side=side,
                values_m=[0.0],
                times_s=[round(share * site.fall, 1)],
                std_m=std,
                **NOT_MADE,
            )
            for side in site.sides
            if side not in filmed
            for share in TIMES
        ]

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []
