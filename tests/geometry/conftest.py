"""What the geometry tests share: scenes of simple shape, and the section of Lower San Fernando."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from geometry import Scene, load_scene
from geometry.scenes.fill import fill
from pipeline.config import Config, load_config

SOIL = {"friction_deg": 30.0, "cohesion_kpa": 1.0}


def scene_of(
    polygons: Sequence[Sequence[tuple[float, float]]],
    *,
    spacing: float = 1.0,
    ground: Sequence[tuple[float, float]] = ((-1000.0, 0.0), (1000.0, 0.0)),
    **fields,
) -> Scene:
    """A scene of polygons of one soil in a wide domain."""
    return Scene.model_validate(
        {
            "name": "test",
            "domain": {
                "x_min": -1000.0,
                "x_max": 1000.0,
                "y_max": 1000.0,
                "walls": "open",
                "left": "free",
                "right": "free",
            },
            "ground": {"points": list(ground)},
            "zones": [
                {"name": f"zone_{i}", "polygon": list(polygon), "material": "soil"}
                for i, polygon in enumerate(polygons)
            ],
            "materials": {"soil": SOIL},
            "spacing": spacing,
            **fields,
        }
    )


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    """`scene_of`, for tests."""
    return scene_of


@pytest.fixture(scope="session")
def config() -> Config:
    """The packaged configuration."""
    return load_config(None)


@pytest.fixture(scope="session")
def case_folder(root: Path) -> Path:
    """Folder of Lower San Fernando as the paper assumes it."""
    return root / "case_histories" / "lower_san_fernando_paper"


@pytest.fixture(scope="session")
def dam(case_folder: Path) -> Scene:
    """Lower San Fernando before the slide."""
    return load_scene(case_folder / "scene.yaml")


@pytest.fixture(scope="session")
def deposit(case_folder: Path) -> Callable[..., np.ndarray]:
    """Points (N, 2) of Lower San Fernando after the slide: the constructed profile, filled."""
    with (case_folder / "post_failure_profile.csv").open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        surface = [(float(row["x_m"]), float(row["y_m"])) for row in rows]

    def filled(spacing: float, **fields) -> np.ndarray:
        ground = [(0.0, 2.0), (390.0, 2.0)]
        return fill(scene_of([surface], spacing=spacing, ground=ground, **fields)).position

    return filled
