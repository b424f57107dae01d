"""Radial spreading: a cylinder of sand against three dimensions, its mass, and where it acts."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect, relative_width
from mpm_taichi.effects.framework.hooks import NodeView
from mpm_taichi.effects.framework.registry import effects_on
from mpm_taichi.simulate import simulate
from mpm_taichi.simulate3d import simulate_3d
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver3d.problem import extruded
from pipeline.cli import InputError
from pipeline.config import SimulationSettings

RADIUS, ASPECT = 30.0, 3.0
SETTINGS = SimulationSettings(duration_s=25.0)


def column(amplitude=0.0, *, spacing=3.0, aspect=ASPECT, right=140.0, **sand):
    """Half of the section through a cylinder of sand, the axis at x = 0."""
    height = aspect * RADIUS
    corners = [[0, 0], [RADIUS, 0], [RADIUS, height], [0, height]]
    soil = {"friction_deg": 36.9, "cohesion_kpa": 0, "density": 1800, "youngs_modulus_mpa": 159}
    return scene_from_mapping(
        {
            "name": "column",
            "domain": {"x_min": 0, "x_max": right, "y_max": 1.2 * height},
            "ground": {"points": [[0, 0], [right, 0]]},
            "zones": [{"name": "sand", "material": "sand", "polygon": corners}],
            "materials": {"sand": {**soil, **sand}},
            "spacing": spacing,
            "effects": {"radial_spreading": amplitude},
        }
    )


def reach(distance):
    """Distance within which 97 % of the points lie [m]."""
    return float(np.quantile(distance, 0.97))


def test_a_cylinder_has_the_mass_of_its_sector_and_keeps_it():
    (run,) = simulate([column(ASPECT)], SETTINGS, threads=1)
    # Half of the plane column: its width is x / R.
    assert run.audit["mass_kg_per_m"] == pytest.approx(1800 * 0.5 * RADIUS * 90, rel=0.02)
    wide = relative_width(effects_on(run.scene), run.scene, run.positions[-1].astype(float))
    assert run.bulk_volume @ wide == pytest.approx(0.5 * RADIUS * 90, rel=0.02)
    assert 0.0 < run.audit["numerical_share"] < 0.08
    assert abs(run.audit["volume_growth"]) < 0.01


@pytest.mark.slow
def test_a_cylinder_runs_as_far_as_in_three_dimensions():
    plane, round_ = simulate([column(), column(ASPECT)], SETTINGS, threads=1)
    whole = extruded(column().changed(effects={}), 140.0)
    inside = np.hypot(*whole.position[:, :2].T) < RADIUS
    kept = {name: getattr(whole, name)[inside] for name in ("position", "volume", "material")}
    run = simulate_3d(replace(whole, zone=whole.zone[inside], **kept), SETTINGS, threads=1)
    solid = np.hypot(*run.positions[-1][:, :2].T)
    # Points of the section stand for more soil the farther from the axis they began.
    share = np.repeat(round_.positions[-1][:, 0], (10 * round_.positions[0][:, 0]).astype(int))
    assert reach(share) == pytest.approx(reach(solid), rel=0.05)
    assert reach(plane.positions[-1][:, 0]) > 1.2 * reach(solid)
    per_m = 2.0 * np.pi * RADIUS / 4.0  # a quarter of the circle at the foot
    assert per_m * round_.audit["released_j_per_m"] == pytest.approx(
        run.audit["released_j"], rel=0.03
    )


def test_a_strong_cylinder_stands_still():
    (run,) = simulate([column(1.0, aspect=1.0, cohesion_kpa=500)], SETTINGS, threads=1)
    assert run.came_to_rest
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 1e-4 * RADIUS


def dam():
    """A dam with bare ground before both feet, at x of 40 and 80 m."""
    zone = {"name": "a", "material": "s", "polygon": [[40, 0], [80, 0], [60, 10]]}
    return scene_from_mapping(
        {
            "name": "dam",
            "domain": {"x_min": 0, "x_max": 120, "y_max": 20},
            "ground": {"points": [[0, 0], [120, 0]]},
            "zones": [zone],
            "materials": {"s": {"friction_deg": 30, "cohesion_kpa": 0}},
            "spacing": 1.0,
            "effects": {"radial_spreading": 0.5},
        }
    )


def test_within_a_dam_the_width_is_one_and_it_grows_before_both_feet():
    places = np.array([[10.0, 0], [40, 0], [60, 0], [80, 0], [100, 0]])
    found = relative_width(effects_on(dam()), dam(), places)
    assert found == pytest.approx([2.5, 1, 1, 1, 2])


def by_kernel(scene, x):
    """Width at x (N,) [m] and its slope [1/m], (N, 2), as the kernels have them."""
    (active,) = effects_on(scene)
    width = ti.func(effect("radial_spreading").width)
    names = ("amplitude", *effect("radial_spreading").constant_names)
    numbers = ti.types.struct(**dict.fromkeys(names, ti.f32))
    own = numbers(**dict(zip(names, map(float, active.numbers(scene)), strict=True)))

    @ti.kernel
    def fill(x: ti.types.ndarray(), found: ti.types.ndarray(), cell: ti.f32):
        for k in range(x.shape[0]):
            place = NodeView(x=x[k], y=0.0, time=0.0, cell=cell)
            now = width(own, place)
            found[k, 0], found[k, 1] = now[0], now[1]

    start("cpu", 1)
    found = np.zeros((len(x), 2), np.float32)
    fill(x.astype(np.float32), found, scene.cell_size)
    return found.astype(float)


@pytest.mark.parametrize(
    "scene", [dam(), column(ASPECT), column(1.0)], ids=["dam", "cylinder", "flat"]
)
def test_the_width_at_the_start_is_that_of_the_kernels(scene):
    """Within the section, before its feet, and at an axis, where the width ends above 0."""
    x = np.linspace(0.5, scene.domain.x_max - 0.5, 97)
    places = np.column_stack([x, np.zeros_like(x)])
    found = relative_width(effects_on(scene), scene, places)
    wide, slope = by_kernel(scene, x).T
    assert wide == pytest.approx(found, rel=1e-5)
    ahead, behind = (
        relative_width(effects_on(scene), scene, places + [step, 0.0]) for step in (1e-3, -1e-3)
    )
    assert slope == pytest.approx((ahead - behind) / 2e-3, abs=1e-4)


def test_it_needs_room_before_a_foot():
    with pytest.raises(InputError, match="no foot of the section has room"):
        effects_on(column(1.0, right=RADIUS + 3.0))
    assert effect("radial_spreading").family == "dimension"
