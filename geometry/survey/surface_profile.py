"""`surface_profile`: the surface after the slide, a polyline in a file of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, overload

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.columns import column_height, connected, kernel_length
from geometry.survey.marks import Line, Mark
from geometry.survey.measured import Along, Datum, Deposit, Length, exponential_correlation
from geometry.survey.profiles import WHOLE, Profile, load_profile
from geometry.survey.site import NOT_MADE, Site, check_in_domain, places_within
from pipeline.cli import InputError

#: Places along the surface that are proposed.
PLACES = 10


class SurfaceProfile(Length):
    """The surface after the slide: a polyline in a file of its own, its vertices are the values."""

    history: ClassVar[None] = None
    as_one: ClassVar[bool] = True

    type: Literal["surface_profile"]
    file: str = Field(min_length=1, description="CSV next to this document: x_m, y_m, part")
    part: str | None = Field(
        None, description="the part of the profile this entry is about; null: all of it"
    )
    correlation_length_m: float | None = Field(
        None, gt=0, description="of the errors along the profile [m]; null: independent"
    )
    held_out_x_m: tuple[float, float] | None = Field(
        None, description="(from, to): the points between are held out [m]"
    )

    _whole: Profile | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _block_has_width(self) -> SurfaceProfile:
        if self.held_out_x_m is not None:
            first, last = self.held_out_x_m
            if last <= first:
                raise ValueError(f"held_out_x_m runs from {first:g} to {last:g}; it must ascend")
            if self.held_out:
                raise ValueError("held_out: true holds out all of it; leave held_out_x_m out")
        return self

    @property
    def files(self) -> list[str]:
        """The CSV file."""
        return [self.file]

    def read_files(self, folder: Path, where: str) -> None:
        """Read the profile and check that the entry finds in it what it names."""
        file = folder / self.file
        if not file.is_file():
            raise InputError(f"{where}: file: {file}: no such file")
        profile = load_profile(file)
        if self.part is not None and self.part not in profile.part:
            known = ", ".join(dict.fromkeys(profile.part))
            raise InputError(f"{where}: part: {self.part!r} is not in {file}; it has {known}")
        self.attach(profile)
        if self.held_out_x_m is not None:
            held = self.held_out_values
            if held.all() or not held.any():
                first, last = self.held_out_x_m
                found = "every point" if held.all() else "no point"
                raise InputError(
                    f"{where}: held_out_x_m: {found} of {file} lies between {first:g} and "
                    f"{last:g} m"
                )

    def attach(self, profile: Profile) -> None:
        """Give the entry what was read from its file."""
        self._whole = profile

    @property
    def whole(self) -> Profile:
        """All that the file holds, other parts included; for drawing."""
        if self._whole is None:
            raise RuntimeError(f"{self.name}: {self.file} has not been read; see load_measurements")
        return self._whole

    @property
    def profile(self) -> Profile:
        """The vertices this entry is about."""
        return self.whole.only(self.part)

    @property
    def values(self) -> np.ndarray:
        """Elevations of the vertices, (m,) [m]."""
        return self.profile.y

    def with_values(self, values: np.ndarray) -> SurfaceProfile:
        """The same vertices at other elevations, (m,) [m]; other parts are left out."""
        copy, profile = self.model_copy(), self.profile
        copy.attach(Profile(profile.x, np.asarray(values, dtype=float), profile.part))
        return copy

    @property
    def parts(self) -> list[str]:
        """Where each vertex lies."""
        return [f"at x {x:g} m" for x in self.profile.x]

    @property
    def held_out_values(self) -> np.ndarray:
        """The vertices within `held_out_x_m`, or all or none of them, (m,) bool."""
        if self.held_out_x_m is None:
            return super().held_out_values
        first, last = self.held_out_x_m
        return (self.profile.x >= first) & (self.profile.x <= last)

    def without_hold_out(self) -> SurfaceProfile:
        """The same entry without `held_out` and `held_out_x_m`."""
        return self.model_copy(update={"held_out": False, "held_out_x_m": None})

    def correlation(self) -> np.ndarray:
        """Correlation of the errors along the profile, (m, m)."""
        return exponential_correlation(self.profile.x, self.correlation_length_m)

    @property
    def along(self) -> Along:
        """The vertices' places."""
        x = self.profile.x.astype(float)
        return Along("x_m", x, series=len(x) > 1)

    @property
    def datum(self) -> Datum:
        """The levelled line itself."""
        x = self.profile.x.astype(float)
        return Datum(np.ones(len(x)), x, line=True)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Elevation of the surface at the vertices [m]."""
        if deposit.ground is None:
            raise ValueError(f"{self.name}: a surface profile needs the ground of the deposit")
        return surface_profile(
            deposit.position,
            deposit.volume,
            self.profile.x,
            spacing=deposit.spacing,
            ground=deposit.ground,
            derivative=derivative,
        )

    def soil_at(self, feet: Mapping[Side, float]) -> list[float]:
        """The vertices' places [m]."""
        return self.profile.x.tolist()

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """All of the file within the domain and above the ground."""
        where = f"{where}: {self.file}"
        for x, y in zip(self.whole.x, self.whole.y, strict=True):
            check_in_domain(x, scene, f"{where}: x_m")
            base = float(scene.ground.height(x))
            if not base - scene.spacing <= y <= scene.domain.y_max:
                raise InputError(
                    f"{where}: ({x:g}, {y:g}) lies outside the domain, from the ground at "
                    f"y {base:g} to y_max {scene.domain.y_max:g} m"
                )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[SurfaceProfile]:
        """The surface at single places along the reach of the slide, away from those surveyed."""
        surveyed = [x for entry in site.made_of(cls) for x in entry.profile.x]
        std, found = site.std(cls, 0.01, 0.1), []
        for x in places_within(*site.reach, PLACES):
            if site.apart(x, surveyed):
                entry = cls(
                    type="surface_profile", name="surface", file="none", std_m=std, **NOT_MADE
                )
                entry.attach(Profile(np.array([x]), np.array([0.0]), [WHOLE]))
                found.append(entry)
        return found

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """The line, part by part; a part that the slide left unchanged was not constructed."""
        return [
            Line(
                x,
                y,
                f"profile after the slide: {part}",
                constructed=self.constructed and part != "unchanged",
            )
            for part, x, y in self.whole.pieces()
        ]


@overload
def surface_profile(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    spacing: float,
    ground: np.ndarray | float = ...,
    derivative: Literal[False] = ...,
) -> np.ndarray: ...


@overload
def surface_profile(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    spacing: float,
    ground: np.ndarray | float = ...,
    derivative: Literal[True],
) -> tuple[np.ndarray, np.ndarray]: ...


@overload
def surface_profile(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    spacing: float,
    ground: np.ndarray | float = ...,
    derivative: bool,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]: ...


def surface_profile(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    spacing: float,
    ground: np.ndarray | float = 0.0,
    derivative: bool = False,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    """Elevation of the deposit's surface: the ground plus the smoothed column height.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        x: (M,) or one number [m].
        spacing: distance between material points [m].
        ground: elevation of a level base, or its polyline (P, 2) [m].
        derivative: return also the derivative.

    Returns:
        (M,) [m], or with `derivative` ((M,), (M, N, 2)).
    """
    member = connected(position, volume, spacing)
    weight = np.where(member, volume, 0.0)
    base, length = ground_elevation(ground, x), kernel_length(spacing)
    if derivative:
        height, slope = column_height(position, weight, x, length=length, derivative=True)
        return base + height, slope
    return base + column_height(position, weight, x, length=length)


def ground_elevation(ground: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Elevation [m] at `x` of a level base (a number) or of a polyline (P, 2), level beyond it."""
    line = np.asarray(ground, dtype=float)
    if line.ndim == 0:
        return np.full(np.shape(x), float(line))
    return np.interp(x, line[:, 0], line[:, 1])
