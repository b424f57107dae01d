"""A deposit in plan of which nothing but readings are taken."""

from __future__ import annotations

import numpy as np

from geometry.survey3d.measured import DepositMap
from geometry.terrain.raster import Raster
from inversion.engines.body_setup import KeptMaps


def deposit(kept: KeptMaps) -> DepositMap:
    """Flat ground without soil, and the readings of a run."""
    flat = Raster((0.0, 0.0), 1.0, np.zeros((2, 2)))
    return DepositMap(None, flat, flat, flat, 1.0, kept.readings)
