"""Measurements in plan that are one number: runout, area, volume."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal, Self

from pydantic import Field, model_validator

from geometry.survey3d.measured import MapLength, MapNumber
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes3d.scene3d import Scene3d


class PathRunout(MapNumber, MapLength):
    """How far the end of the soil moved along a path of the scene (`runout_<path>_m`)."""

    type: Literal["path_runout"]
    path: str = Field("middle", description="of the scene's `paths`; middle where it has none")
    value_m: float = Field(ge=0, description="the measured value [m]")
    low_m: float | None = Field(None, description="lower end of the stated range [m]")
    high_m: float | None = Field(None, description="upper end of the stated range [m]")

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        ends = (self.low_m, self.high_m)
        if (ends[0] is None) != (ends[1] is None):
            raise ValueError("low_m and high_m: give both or neither")
        if self.stated_range is not None:
            low, high = self.stated_range
            if not low <= self.value_m <= high:
                raise ValueError(f"value_m {self.value_m:g} lies outside low_m to high_m")
        return self

    @property
    def stated_range(self) -> tuple[float, float] | None:
        """Lower and upper end of the stated range [m]."""
        return None if self.low_m is None or self.high_m is None else (self.low_m, self.high_m)

    @property
    def is_runout(self) -> bool:
        """It is."""
        return True

    @property
    def reading(self) -> str:
        """Of the path."""
        return f"runout_{self.path}_m"

    def check_in(self, scene: Scene3d, where: str) -> None:
        """The path is one of the scene's."""
        known = list(scene.document.paths) or ["middle"]
        if self.path not in known:
            raise InputError(
                f"{where}: path: no path {self.path!r}; the scene has {', '.join(known)}"
            )


class InundatedArea(MapNumber):
    """Ground with a deposit after the slide and without one before it."""

    unit: ClassVar[str] = "m2"

    type: Literal["inundated_area"]
    value_m2: float = Field(ge=0, description="the measured value [m2]")
    std_m2: float = Field(gt=0, description="standard deviation of the survey [m2]")
    model_std_m2: float = Field(0.0, ge=0, description="granted to the model in addition [m2]")

    @property
    def reading(self) -> str:
        """The area."""
        return "inundated_area_m2"

    def check_in(self, scene: Scene3d, where: str) -> None:
        """Any ground has one."""


class CrossedVolume(MapNumber):
    """Soil that crossed a line of the scene to its right (`volume_across_<line>_m3`)."""

    unit: ClassVar[str] = "m3"

    type: Literal["crossed_volume"]
    line: str = Field(description="of the scene's `lines`")
    value_m3: float = Field(description="the measured value [m3]")
    std_m3: float = Field(gt=0, description="standard deviation of the survey [m3]")
    model_std_m3: float = Field(0.0, ge=0, description="granted to the model in addition [m3]")

    @property
    def reading(self) -> str:
        """Of the line."""
        return f"volume_across_{self.line}_m3"

    def check_in(self, scene: Scene3d, where: str) -> None:
        """The line is one of the scene's."""
        known = list(scene.document.lines)
        if self.line not in known:
            raise InputError(
                f"{where}: line: no line {self.line!r}; the scene has {', '.join(known) or 'none'}"
            )
