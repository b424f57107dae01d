from __future__ import annotations

import numpy as np
import pytest

from inversion.classical.section import ClassicalSection, ClassicalSoil


@pytest.fixture
def soil():
    def make(
        cohesion_kpa=0.0, friction_deg=0.0, unit_weight_kn=20.0, liquefied=False, name="soil"
    ) -> ClassicalSoil:
        density = 1e3 * unit_weight_kn / 9.81
        tangent = float(np.tan(np.radians(friction_deg)))
        return ClassicalSoil(name, 1e3 * cohesion_kpa, tangent, density, density, liquefied)

    return make


@pytest.fixture
def section():
    def make(*zones, ground=0.0, water=None) -> ClassicalSection:
        """Zones are pairs of a polygon and a soil; ground and water levels or polylines."""

        def line(level):
            return np.atleast_2d(level if np.ndim(level) else [0.0, level]).astype(float)

        return ClassicalSection(
            [np.asarray(polygon, dtype=float) for polygon, _ in zones],
            [soil for _, soil in zones],
            line(ground),
            None if water is None else line(water),
            [str(number) for number in range(len(zones))],
        )

    return make


@pytest.fixture
def mirrored():
    def make(section: ClassicalSection) -> ClassicalSection:
        flip = np.array([-1.0, 1.0])
        water = None if section.water is None else (section.water * flip)[::-1]
        return ClassicalSection(
            [polygon * flip for polygon in section.polygons],
            section.soils,
            (section.ground * flip)[::-1],
            water,
            section.names,
        )

    return make


@pytest.fixture
def dam(soil, section):
    """A dam 10 m high with a liquefied layer, a pool on the left, and its slip surface."""
    weak = soil(12.0, liquefied=True, name="weak")
    shell = soil(2.0, 32.0, name="shell")
    core = soil(30.0, name="core")

    def make(water=7.0):
        return section(
            ([[4, 0], [30, 0], [31, 3], [9, 3]], weak),
            ([[0, 0], [4, 0], [9, 3], [31, 3], [32, 10], [25, 10]], shell),
            ([[30, 0], [60, 0], [40, 10], [32, 10], [31, 3]], core),
            ground=[[-40.0, 0.0], [80.0, 0.0]],
            water=water,
        )

    return make
