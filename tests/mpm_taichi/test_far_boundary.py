"""Ground that goes on, in the solver: no flow through, free to settle, and its groundwater."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from geometry.survey.columns import toe
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.water import Groundwater, MovingFace, head_places, moving_face
from pipeline.config import SimulationSettings

SETTINGS = SimulationSettings(duration_s=8.0)


def section(*polygons, x=(-40.0, 60.0), **more):
    """Zones of weak soil on level ground, in open walls."""
    return scene_from_mapping(
        {
            "name": "cut",
            "domain": {"x_min": x[0], "x_max": x[1], "y_max": 12.0, "walls": "open"},
            "ground": {"points": [[-100, 0], [100, 0]]},
            "zones": [
                {"name": f"zone_{n}", "polygon": polygon, "material": "soil"}
                for n, polygon in enumerate(polygons)
            ],
            "materials": {
                "soil": {"friction_deg": 0, "cohesion_kpa": 6, "density": 1900,
                         "youngs_modulus_mpa": 10, "liquefied": True}
            },
            "spacing": 0.5,
            **more,
        }
    )  # fmt: skip


def test_half_a_dam_at_a_far_boundary_is_half_of_the_dam():
    """A smooth wall in the plane of symmetry: the toe runs as that of the whole section."""
    whole = section([[-20, 0], [0, 8], [20, 0]])
    half = section([[-20, 0], [0, 8], [0, 0]])
    assert half.domain.goes_on("right") and half.domain.x_max == 0.0
    runs = simulate([whole, half], SETTINGS, threads=1)
    toes = [toe(run.positions[-1].astype(float), 0.25, spacing=0.5, side="left") for run in runs]
    ran = -20.0 - toes[0]
    assert ran > 8.0 and toes[1] == pytest.approx(toes[0], abs=0.03 * ran)
    assert runs[1].positions[-1][:, 0].max() < 0.5 * half.spacing
    assert "right" not in runs[1].wall_contact, "ground that goes on is no arrival at a wall"


def test_level_ground_that_goes_on_stays_where_it_is():
    layer = section([[-20, 0], [20, 0], [20, 5], [-20, 5]])
    assert all(layer.domain.goes_on(side) for side in ("left", "right"))
    (run,) = simulate([layer], SETTINGS, threads=1)
    moved = np.abs(run.positions[-1] - run.positions[0]).max()
    assert moved < 0.05 * layer.spacing


def test_no_pool_fills_what_sinks_behind_a_far_boundary():
    """The water table of an impoundment is groundwater: its head goes down with the soil."""
    scene = section(
        [[-20, 0], [0, 8], [30, 8], [30, 0]],
        water_level=8.0, phreatic_line=[[-20, 0], [0, 7], [30, 8]],
    )  # fmt: skip
    settings = SETTINGS.model_copy(update={"water": "pore_pressure", "water_face": "moving"})
    x, y = np.meshgrid(np.arange(-19.75, 30.0, 0.5), np.arange(0.25, 8.0, 0.5))
    position = np.stack([x.ravel(), y.ravel()], axis=1)
    position = position[position[:, 1] < 8.0 + 0.4 * np.minimum(position[:, 0], 0.0)]
    face = moving_face(scene, settings, position)
    assert isinstance(face, Groundwater)
    places = head_places(np.arange(-25.0, 31.0), 1.0)
    inside = (places > -10.0) & (places < 25.0)
    np.testing.assert_allclose(
        face.head(places, position)[inside], scene.phreatic_level(places)[inside], atol=0.5
    )
    sunk = position * [1.0, 0.5]
    assert (face.head(places, sunk)[places > 5.0] < 4.3).all()
    # The same water against a free face is a pool, and one that stands above the ground as well.
    free = scene.changed(domain={**scene.domain.model_dump(), "right": "free"})
    deep = scene.changed(water_level=9.0, phreatic_line=[(-20, 0), (0, 7), (10, 9), (30, 9)])
    for other in (free, deep):
        assert type(moving_face(other, settings, position)) is MovingFace
