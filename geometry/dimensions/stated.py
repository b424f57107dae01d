"""The file of a slide that is known by a few numbers: `dimensions.yaml`.

Each number is a value, a range or both, with how it was come by and its source. The ranges of the
keys catch slips: feet for metres, degrees for a slope. Lengths in m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from geometry.random_scenes.embankment_dam import FACE
from geometry.scenes.scene import Document, checked_document
from pipeline.files import file_or_within, read_yaml

FILE_NAME = "dimensions.yaml"
PAGE = "docs/how-to/add-a-slide.md"

How = Literal["read", "abstract", "secondary", "paper", "recalled"]
#: Standard deviation of a value that is given without one, over the value: assumed.
ASSUMED_SHARE: dict[str, float] = {
    "read": 0.05,
    "abstract": 0.1,
    "paper": 0.1,
    "secondary": 0.15,
    "recalled": 0.25,
}

#: Heights [m] and slopes [horizontal per vertical] beyond which a number is refused.
HEIGHT, SLOPE = (0.5, 400.0), (0.5, 12.0)
#: The same of what has slid.
FINAL_SLOPE = (1.0, 200.0)
#: Of what liquefied, in heights.
LIQUEFIED_SHARE = (0.02, 0.9)
#: Largest standard deviation of a dimension over its value: a lognormal with more spans a factor of
#: 20 and holds sections that nobody means.
MOST_STD = 0.5
#: What is hardly meant: higher slides than these [m] are rare, crests wider than these heights too,
#: runouts of more heights, slid soil as flat as this [horizontal per vertical], or hardly flatter
#: than its face: by this factor.
TALL_M, WIDE_CREST, FAR, FLAT, HARDLY = 120.0, 1.5, 20.0, 60.0, 1.3


LOOKS = "must look like 42, 42 +- 2 or {low: 40, high: 45}, in the unit of its key"


class StatedNumber(Document):
    """A number as somebody states it: `42`, `42 +- 2`, or a mapping."""

    value: float | None = Field(None, gt=0, description="most likely value")
    std: float | None = Field(None, gt=0, description="standard deviation; null: by `how`")
    low: float | None = Field(
        None, gt=0, description="lower end; without a value all in between is equally likely"
    )
    high: float | None = Field(
        None, gt=0, description="upper end; with a value two standard deviations above low"
    )
    how: How = Field(
        "recalled",
        description="read (in an opened source), abstract, paper, secondary (notes on the source) "
        "or recalled; decides the standard deviation of a value that has none",
    )
    source: str = Field("", description="where it is written")
    note: str = Field("", description="free text")

    @model_validator(mode="before")
    @classmethod
    def _from_short_form(cls, given: Any) -> Any:
        if isinstance(given, str):
            value, mark, std = given.replace("±", "+-").replace("+/-", "+-").partition("+-")
            try:
                return {"value": float(value), **({"std": float(std)} if mark else {})}
            except ValueError:
                raise ValueError(LOOKS) from None
        if isinstance(given, int | float) and not isinstance(given, bool):
            return {"value": given}
        if not isinstance(given, Mapping | StatedNumber):
            raise ValueError(LOOKS)
        return given

    @model_validator(mode="after")
    def _holds_together(self) -> StatedNumber:
        if (self.low is None) != (self.high is None):
            raise ValueError("low, high: give both or neither")
        if self.value is None and self.low is None:
            raise ValueError("give a value, or low and high")
        if self.std is not None and (self.value is None or self.low is not None):
            raise ValueError("std: belongs to a value without low and high")
        low, high, value = self.low, self.high, self.value
        if low is not None and high is not None:
            if not low < high:
                raise ValueError(f"low {low:g} must be less than high {high:g}")
            if value is not None and not low <= value <= high:
                raise ValueError(f"value {value:g} lies outside low {low:g} to high {high:g}")
        return self

    @property
    def middle(self) -> float:
        """The value, or the middle of the range."""
        if self.value is not None:
            return self.value
        assert self.low is not None and self.high is not None
        return 0.5 * (self.low + self.high)

    @property
    def deviation(self) -> float:
        """Standard deviation: stated, of the range, or assumed from how the value is known."""
        if self.std is not None:
            return self.std
        if self.low is not None and self.high is not None:
            # Ends about a value are two standard deviations off; all between ends alone is alike.
            return (self.high - self.low) / (4.0 if self.value is not None else 12.0**0.5)
        return ASSUMED_SHARE[self.how] * self.middle

    @property
    def std_is_stated(self) -> bool:
        """The source gives a standard deviation or a range."""
        return self.std is not None or self.low is not None

    @property
    def ends(self) -> tuple[float, float]:
        """What must lie within the range of its key: the ends, or the value twice."""
        low, high = self.low, self.high
        return (self.middle if low is None else low), (self.middle if high is None else high)


#: Keys of what was measured after the slide; all others are dimensions of the section.
MEASURED = ("runout_m", "duration_s", "final_slope_h_per_v")


class SlideDimensions(Document):
    """The whole of `dimensions.yaml`. What is left out is drawn from a prior."""

    slid_face: Literal["upstream", "downstream", "dry"] = Field(
        description="the face that slid: upstream (the pool stands before it), downstream (the "
        "pool stands behind the dam) or dry (no pool; liquefied soil is saturated all the same)"
    )
    height_m: StatedNumber = Field(description="of the crest above the foot")
    slope_h_per_v: StatedNumber | None = Field(
        None, description="of the face that slid, horizontal per vertical"
    )
    other_slope_h_per_v: StatedNumber | None = Field(None, description="of the other face")
    base_width_m: StatedNumber | None = Field(
        None,
        description="from foot to foot, in place of other_slope_h_per_v; without slope_h_per_v "
        "both faces have the same slope",
    )
    crest_width_m: StatedNumber | None = Field(None, description="width of the crest")
    liquefied_thickness_m: StatedNumber | None = Field(
        None, description="of the zone that liquefied, from the base up"
    )
    liquefied_share: StatedNumber | None = Field(
        None, description="the same over the height, in place of the thickness"
    )
    liquefied_reach: StatedNumber | None = Field(
        None,
        description="how far that zone goes in from the foot, over the distance from the foot to "
        "the middle of the crest: 1 = to below the crest, 2 or more = under the whole dam",
    )
    pool_m: StatedNumber | None = Field(None, description="depth of the pool above the foot")
    density: StatedNumber | None = Field(None, description="of all soil [kg/m3]")
    fill_friction_deg: StatedNumber | None = Field(
        None, description="friction angle of the soil that did not liquefy [degrees]"
    )
    runout_m: StatedNumber | None = Field(
        None, description="how far the toe ran beyond the foot; positive outward"
    )
    duration_s: StatedNumber | None = Field(None, description="time of 5 to 95 % of the soil's way")
    final_slope_h_per_v: StatedNumber | None = Field(
        None,
        description="how flat the slid soil lies, horizontal per vertical: from its toe to the "
        "surface where the crest's edge was",
    )
    note: str = Field("", description="free text")

    @model_validator(mode="after")
    def _within_ranges(self) -> SlideDimensions:
        _check("height_m", self.height_m, *HEIGHT, "m; is it in feet or mm?")
        slopes = ("slope_h_per_v", SLOPE), ("other_slope_h_per_v", SLOPE)
        for key, allowed in (*slopes, ("final_slope_h_per_v", FINAL_SLOPE)):
            words = "horizontal per vertical; is it vertical per horizontal, or in degrees?"
            _check(key, getattr(self, key), *allowed, words)
        _check("liquefied_share", self.liquefied_share, *LIQUEFIED_SHARE, "of the height")
        _check("liquefied_reach", self.liquefied_reach, 0.3, 10.0, "of the way to the crest")
        _check("density", self.density, 1000.0, 3500.0, "kg/m³; is it in t/m³ or kN/m³?")
        _check("fill_friction_deg", self.fill_friction_deg, 15.0, 50.0, "degrees")
        return self

    @model_validator(mode="after")
    def _are_known(self) -> SlideDimensions:
        for key in type(self).model_fields:
            stated = getattr(self, key)
            if not isinstance(stated, StatedNumber) or key in MEASURED or stated.value is None:
                continue
            if stated.deviation > MOST_STD * stated.value:
                raise ValueError(
                    f"{key}: {stated.value:g} ± {stated.deviation:g} says too little: allowed is a "
                    f"standard deviation up to {MOST_STD:g} of the value; give low and high instead"
                )
        return self

    @model_validator(mode="before")
    @classmethod
    def _has_moved(cls, given: Any) -> Any:
        if isinstance(given, Mapping) and given.get("runout_m") == 0:
            raise ValueError(
                "runout_m: 0: nothing ran; a slope that stood is drawn, and measured by no_flow"
            )
        return given

    @model_validator(mode="after")
    def _holds_together(self) -> SlideDimensions:
        height = self.height_m.middle
        if self.liquefied_thickness_m is not None and self.liquefied_share is not None:
            raise ValueError("liquefied_thickness_m, liquefied_share: give one of them")
        if self.base_width_m is not None and self.other_slope_h_per_v is not None:
            raise ValueError("base_width_m, other_slope_h_per_v: give one of them")
        pool, thick = self.pool_m, self.liquefied_thickness_m
        if pool is not None and not pool.ends[1] < self.height_m.ends[1]:
            raise ValueError(
                f"pool_m: {pool.ends[1]:g} m must be less than height_m {self.height_m.ends[1]:g}"
            )
        if thick is not None:
            words = f"m, {LIQUEFIED_SHARE[0]:g} to 1 of height_m {height:g}"
            _check("liquefied_thickness_m", thick, LIQUEFIED_SHARE[0] * height, height, words)
        self._check_final_slope()
        if self.slid_face == "dry" and self.pool_m is not None:
            raise ValueError("pool_m: there is none before or behind a dry face")
        self._check_base_width()
        if not any((self.runout_m, self.duration_s, self.final_slope_h_per_v)):
            raise ValueError(
                "give runout_m, duration_s or final_slope_h_per_v: S_r follows from what was "
                "measured"
            )
        return self

    def _check_final_slope(self) -> None:
        final, face = self.final_slope_h_per_v, self.slope_h_per_v
        if final is not None and face is not None and not final.ends[0] > face.middle:
            raise ValueError(
                f"final_slope_h_per_v: {final.ends[0]:g} is no flatter than the face was "
                f"(slope_h_per_v {face.middle:g}); is it in degrees?"
            )

    def _check_base_width(self) -> None:
        if self.base_width_m is None:
            return
        height, base = self.height_m.middle, self.base_width_m.ends[0]
        crest = 0.0 if self.crest_width_m is None else self.crest_width_m.middle
        slid = SLOPE[0] if self.slope_h_per_v is None else self.slope_h_per_v.middle
        least = crest + height * (slid + SLOPE[0])
        if base < least:
            raise ValueError(
                f"base_width_m: {base:g} m leaves no room for crest and faces, which take at least "
                f"{least:.3g} m"
            )

    @property
    def recalled(self) -> list[str]:
        """Keys of the numbers that are known from memory alone."""
        numbers = ((key, getattr(self, key)) for key in type(self).model_fields)
        return [k for k, one in numbers if isinstance(one, StatedNumber) and one.how == "recalled"]

    def doubts(self) -> Iterator[str]:
        """Lines on what is hardly meant."""
        height = self.height_m.middle
        if height > TALL_M:
            yield f"height_m {height:g}: is it in feet? Then it is {0.3048 * height:.3g} m"
        crest, runout, final = self.crest_width_m, self.runout_m, self.final_slope_h_per_v
        if crest is not None and crest.middle > WIDE_CREST * height:
            yield f"crest_width_m {crest.middle:g} is {crest.middle / height:.2g} heights"
        if runout is not None and runout.middle > FAR * height:
            yield (
                f"runout_m {runout.middle:g} is {runout.middle / height:.0f} heights; is its unit "
                "right, and is the base level?"
            )
        face = FACE[1] if self.slope_h_per_v is None else HARDLY * self.slope_h_per_v.middle
        if final is not None and final.middle <= face:
            yield (
                f"final_slope_h_per_v {final.middle:g} is hardly flatter than faces are; is it in "
                f"degrees? Then it is {1.0 / math.tan(math.radians(final.middle)):.3g}"
            )
        for key in ("slope_h_per_v", "other_slope_h_per_v"):
            slope: StatedNumber | None = getattr(self, key)
            if slope is not None and slope.middle < 1.0:
                yield (
                    f"{key} {slope.middle:g} is steeper than 45 degrees; is it vertical per "
                    f"horizontal? Then it is {1.0 / slope.middle:.3g}"
                )
        if final is not None and final.middle > FLAT:
            yield (
                f"final_slope_h_per_v {final.middle:g} is {math.degrees(1 / final.middle):.2g} "
                "degrees; less strength than the prior has may be needed"
            )


def _check(key: str, stated: StatedNumber | None, low: float, high: float, words: str) -> None:
    if stated is None:
        return
    for end in stated.ends:
        if not low <= end <= high:
            raise ValueError(f"{key}: {end:g}: allowed are {low:g} to {high:g} {words}")


def load_dimensions(path: str | Path) -> SlideDimensions:
    """Read the file, or the one in a folder.

    Raises:
        InputError: no such file, no YAML, an unknown key or a number out of range; one line.
    """
    path = file_or_within(path, FILE_NAME)
    return checked_document(SlideDimensions, read_yaml(path), path, PAGE)
