"""Survey after a hidden slide, with its errors: the same for every case.

Sets of measurements, each with all of the one before: `profile` (the toe and the surface),
`markers` (and displacements of places on the section), `history` (and the toe at some times).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from benchmarks.hidden_effects.making.sections import Section
from geometry.survey.measured import Deposit, Measured
from geometry.survey.profiles import WHOLE, Profile
from geometry.survey.registry import measurement_of
from geometry.survey.toe_runout import toe_runout

SURVEYS = ("profile", "markers", "history")

#: Standard deviations of the surveys [m].
PROFILE_STD, TOE_STD, MARKER_STD, HISTORY_STD = 0.5, 1.0, 0.3, 1.0
#: The profile begins this share of its length inside the toe.
INSIDE = 0.05
#: Distance in spacings that places keep from the ends of the section's domain.
MARGIN = 3.0
PROFILE_FILE = "profile.csv"


def toe_of(section: Section, deposit: Deposit) -> float:
    """Place of the deposit's toe [m]."""
    side = section.survey.side
    foot = deposit.foot[side]
    way = toe_runout(
        deposit.position,
        deposit.volume,
        spacing=deposit.spacing,
        side=side,
        initial_toe=foot,
    )
    return foot - way if side == "left" else foot + way


def profile_places(section: Section, toe_x: float) -> np.ndarray:
    """Places of the profile (n,) [m], ascending, for a deposit that ends at `toe_x` [m].

    A slide that leaves the section's domain is surveyed within it.
    """
    plan, domain = section.survey.profile, section.scene.domain
    margin = MARGIN * section.scene.spacing
    first = toe_x + INSIDE * (plan.to_x_m - toe_x)
    first = min(max(first, domain.x_min + margin), domain.x_max - margin)
    return np.round(np.sort(np.linspace(first, plan.to_x_m, plan.points)), 2)


def entries_of(section: Section, survey: str, toe_x: float) -> list[Measured]:
    """The measurements of a survey, without their values (zeros stand for them)."""
    return with_values(section, survey, profile_places(section, toe_x), None)


def with_values(
    section: Section, survey: str, places: np.ndarray, values: Sequence[float] | None
) -> list[Measured]:
    """The measurements of a survey with their values.

    Args:
        section: the section.
        survey: one of `SURVEYS`.
        places: of the profile, (n,) [m].
        values: of all measurements in their order, (m,) [m]; None: zeros.
    """
    profile, *rest = (measurement_of(entry) for entry in documents(section, survey, values, places))
    y = np.zeros(len(places)) if values is None else np.asarray(values[: len(places)])
    profile.attach(Profile(places, y, [WHOLE] * len(places)))
    return [profile, *rest]


def documents(
    section: Section, survey: str, values: Sequence[float] | None, places: np.ndarray
) -> list[dict[str, Any]]:
    """The entries of `measurements.yaml`; the values of the profile stand in its own file."""
    plan = section.survey
    numbers = iter(np.zeros(1000) if values is None else np.round(values, 4)[len(places) :])
    common = {"std_is": "published", "confidence": "published", "source": "survey of the benchmark"}

    def number() -> float:
        return float(next(numbers))

    found: list[dict[str, Any]] = [
        {"name": "surface", "type": "surface_profile", "file": PROFILE_FILE, "std_m": PROFILE_STD,
         "correlation_length_m": plan.profile.correlation_length_m, **common},
        {"name": "toe", "type": "toe_runout", "side": plan.side, "value_m": number(),
         "std_m": TOE_STD, **common},
    ]  # fmt: skip
    if survey in ("markers", "history"):
        found += [
            {"name": f"marker {k}", "type": "marker_displacement", "x_m": x, "y_m": y,
             "dx_m": number(), "dy_m": number(), "std_m": MARKER_STD, **common}
            for k, (x, y) in enumerate(plan.markers_m, start=1)
        ]  # fmt: skip
    if survey == "history":
        found.append({
            "name": "toe in time", "type": "toe_history", "side": plan.side,
            "times_s": list(plan.history_times_s),
            "values_m": [number() for _ in plan.history_times_s], "std_m": HISTORY_STD, **common,
        })  # fmt: skip
    return found


def reading(entries: Sequence[Measured], deposit: Deposit) -> np.ndarray:
    """All measurements as they would read on a deposit, (m,) [m].

    Raises:
        ValueError: one cannot be read on it.
    """
    return np.concatenate([entry.observe(deposit) for entry in entries])


def covariance_of(entries: Sequence[Measured]) -> np.ndarray:
    """Covariance of the survey's errors, (m, m) [m2]."""
    return block_diag(*[entry.covariance() for entry in entries])
