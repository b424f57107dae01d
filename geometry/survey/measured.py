"""What all measurements have in common: values, covariance, and a reading of points.

An entry of `measurements.yaml` is a vector of one or more values with a covariance, and `observe`
predicts the same vector from material points by the definitions of `geometry.survey.observables`:
one definition for field data, the material point method and learned simulators.

A new type is one class with `values` and `_read`, and its name in `geometry.survey.measurements`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Document

Confidence = Literal["published", "paper", "recalled", "assumed", "constructed"]


@dataclass(frozen=True)
class Deposit:
    """Points of one moment, with those before the slide and, where known, the way between.

    Attributes:
        position: (N, 2) [m].
        initial_position: the same points before the slide, (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        foot: where the section ended before the slide, x [m] by side.
        ground: rigid base, a level or a polyline (P, 2) [m]; None: unknown, so no profiles.
        positions: all frames (T, N, 2) [m]; None: only the last is known, so no histories.
        time: of the frames, (T,) ascending [s].
        at_rest: the soil stays where it is after the last frame.
        initial_volume: before the slide, where that is another than `volume`; None: the same.
    """

    position: np.ndarray
    initial_position: np.ndarray
    volume: np.ndarray | float
    spacing: float
    foot: Mapping[str, float]
    ground: np.ndarray | float | None = None
    positions: np.ndarray | None = None
    time: np.ndarray | None = None
    at_rest: bool = True
    initial_volume: np.ndarray | float | None = None


@dataclass(frozen=True)
class Observed:
    """A prediction and its derivative with respect to the positions of the frames it hangs on.

    Attributes:
        values: (m,) in the unit of the measurement.
        frames: numbers of the frames each value depends on, (m, K); -1: the deposit's position.
        change: derivative with respect to the positions in these frames, (m, K, N, 2).
    """

    values: np.ndarray
    frames: np.ndarray
    change: np.ndarray


class Measured(Document):
    """What every measurement says about itself."""

    unit: ClassVar[str] = "m"

    name: str = Field(min_length=1, description="unique in its set")
    std_is: Literal["published", "assumed"] = Field(
        "assumed", description="where the standard deviation comes from"
    )
    confidence: Confidence = Field(description="how far the value may be trusted")
    source: str = Field(min_length=1, description="where the value is written")
    held_out: bool = Field(False, description="true: never enters a fit; it checks the fit instead")

    @property
    def constructed(self) -> bool:
        """True for data drawn by hand: shown, but in no fit and no score unless asked."""
        return self.confidence == "constructed"

    @property
    def values(self) -> np.ndarray:
        """The measured values, (m,), in `unit`."""
        raise NotImplementedError

    @property
    def parts(self) -> list[str]:
        """What each of the values is, in a few words, m of them; empty where there is but one."""
        return [""]

    @property
    def std(self) -> float:
        """Standard deviation of the survey, in `unit`."""
        raise NotImplementedError

    @property
    def model_std(self) -> float:
        """What the user grants the model beside the survey's error, in `unit`."""
        raise NotImplementedError

    @property
    def held_out_values(self) -> np.ndarray:
        """Which of the values never enter a fit, (m,) bool."""
        return np.full(len(self.values), self.held_out)

    def covariance(self, *, model: bool = True) -> np.ndarray:
        """Covariance of the values, (m, m): std^2 exp(-|distance| / correlation length).

        Args:
            model: with the variance granted to the model; its errors hang together as the survey's.
        """
        variance = self.std**2 + (self.model_std**2 if model else 0.0)
        return variance * self._correlation()

    def observe(self, deposit: Deposit) -> np.ndarray:
        """What this measurement would read on a deposit, (m,), in `unit`.

        Raises:
            ValueError: the deposit lacks what this needs: the ground, or the frames before.
            InputError: the run was cut off in motion before the time measured.
        """
        return np.atleast_1d(self._read(deposit, derivative=False)).astype(float)

    def observe_with_derivative(self, deposit: Deposit) -> Observed:
        """The same with its derivative with respect to the positions."""
        values, change = self._read(deposit, derivative=True)
        values = np.atleast_1d(values).astype(float)
        change = np.reshape(change, (len(values), 1, *np.shape(deposit.position)))
        return Observed(values, np.full((len(values), 1), -1), change)

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Value(s), or with `derivative` (value(s), (N, 2) or (m, N, 2)), as `observables` has."""
        raise NotImplementedError

    def _correlation(self) -> np.ndarray:
        return np.eye(len(self.values))


class Length(Measured):
    """A measurement in metres."""

    std_m: float = Field(gt=0, description="standard deviation of the survey [m]")
    model_std_m: float = Field(
        0.0, ge=0, description="what the model is granted beside the survey's error [m]"
    )

    @property
    def std(self) -> float:
        """Standard deviation of the survey [m]."""
        return self.std_m

    @property
    def model_std(self) -> float:
        """What the user grants the model beside the survey's error [m]."""
        return self.model_std_m


def exponential_correlation(places: np.ndarray, length: float | None) -> np.ndarray:
    """exp(-|distance| / length) between places (m,) -> (m, m); None: independent errors."""
    if length is None:
        return np.eye(len(places))
    return np.exp(-np.abs(places[:, None] - places[None, :]) / length)
