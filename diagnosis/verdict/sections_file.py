"""The section before and after the slide, for the pictures: `sections.npz` next to a verdict.

In: the points of three kept runs. Out: surfaces by the one definition of
`geometry.survey.surface_profile`. The page is whole without this file; its profile then lacks the
outline of the section.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.survey.surface_profile import ground_elevation, surface_profile
from inversion.engines.content_store import DAMAGE, write_arrays
from pipeline.cli import InputError

FILE_NAME = "sections.npz"
LEAST_HEIGHT = 0.05
"""Where less soil than this stands [m] no surface is drawn: by judgement, a film on the ground."""
PLACES = 400
"""At which a surface is drawn: by judgement, finer than a picture shows."""

Points = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Toe:
    """Where a runout is counted from.

    Attributes:
        foot: x of the initial toe [m].
        outward: -1 to the left, +1 to the right.
    """

    foot: float
    outward: float

    def place(self, runout: float) -> float:
        """X of the toe [m] after a runout [m]."""
        return self.foot + self.outward * runout


@dataclass(frozen=True)
class SlideSurfaces:
    """Surfaces along the section, at K places.

    Attributes:
        x: places (K,) [m].
        ground: elevation of the rigid base (K,) [m].
        initial: surface before the slide (K,) [m]; NaN where no soil is.
        base: after it, by the base model (K,) [m].
        final: after it, by the model of the answer (K,) [m].
        toes: measurement of a runout -> where it counts from.
    """

    x: np.ndarray
    ground: np.ndarray
    initial: np.ndarray
    base: np.ndarray
    final: np.ndarray
    toes: Mapping[str, Toe]


def save_sections(
    folder: str | Path,
    *,
    initial: Points,
    base: Points,
    final: Points,
    spacing: float,
    ground: np.ndarray,
    toes: Mapping[str, tuple[float, float]],
) -> Path:
    """Write `sections.npz`; the same points give the same bytes.

    Args:
        folder: of the diagnosis.
        initial: points before the slide: places (N, 2) [m] and volumes (N,) [m2 per m].
        base: after it, by the base model.
        final: after it, by the model of the answer; that of the base where it is.
        spacing: between material points [m].
        ground: rigid base, a polyline (P, 2) [m].
        toes: measurement of a runout -> (x of the initial toe [m], -1 left or +1 right).
    """
    path = Path(folder) / FILE_NAME
    write_arrays(
        path,
        {
            **{
                name: np.column_stack(points).astype(np.float32)
                for name, points in (("initial", initial), ("base", base), ("final", final))
            },
            "spacing": np.array(float(spacing)),
            "ground": np.asarray(ground, float),
            "toe_names": np.array(list(toes), dtype=np.str_),
            "toes": np.array(list(toes.values()), float).reshape(-1, 2),
        },
    )
    return path


def load_sections(folder: str | Path) -> SlideSurfaces | None:
    """Read the surfaces; None where the file is not there.

    Raises:
        InputError: the file is damaged; one line.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        return None
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            kept = {name: file[name] for name in file.files}
        spacing, ground = float(kept["spacing"]), kept["ground"]
        points = {name: kept[name].astype(float) for name in ("initial", "base", "final")}
        toes = {
            str(name): Toe(float(foot), float(outward))
            for name, (foot, outward) in zip(kept["toe_names"], kept["toes"], strict=True)
        }
    except DAMAGE as error:
        raise InputError(
            f"{path}: cannot be read ({error}); delete it and ask for the diagnosis again"
        ) from None
    everything = np.concatenate(list(points.values()))
    margin = 0.03 * np.ptp(everything[:, 0])
    x = np.linspace(everything[:, 0].min() - margin, everything[:, 0].max() + margin, PLACES)
    bottom = ground_elevation(ground, x)
    surfaces = {name: _surface(one, spacing, ground, x, bottom) for name, one in points.items()}
    return SlideSurfaces(x=x, ground=bottom, toes=toes, **surfaces)


def _surface(
    points: np.ndarray, spacing: float, ground: np.ndarray, x: np.ndarray, bottom: np.ndarray
) -> np.ndarray:
    # In files older than physics 7 every point has the volume of a square.
    places, volume = points[:, :2], points[:, 2] if points.shape[1] == 3 else spacing**2
    surface = np.asarray(surface_profile(places, volume, x, spacing=spacing, ground=ground))
    return np.where(surface > bottom + LEAST_HEIGHT, surface, np.nan)
