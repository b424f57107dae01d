"""Small cases in three dimensions: a bank over a width, and a body in a gully between rasters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.verification.three_dimensions import slab_scene
from geometry.terrain.raster import Raster, write_raster
from pipeline.files import write_text, yaml_text


def write_bank(folder: Path, *, spacing: float = 2.0, duration_s: float = 3.0) -> Path:
    """A bank of clay 16 m wide; its clay is marked as liquefied."""
    folder.mkdir(parents=True)
    section = slab_scene(spacing)
    section["materials"]["soil"]["liquefied"] = True
    document = {
        "name": "bank", "section": {"file": "part/bank.yaml", "width_m": 16.0},
        "flanks": "smooth", "duration_s": duration_s,
        "lines": {"road": [[30.0, 0.0], [30.0, 16.0]]},
    }  # fmt: skip
    write_text(folder / "part" / "bank.yaml", yaml_text(section))
    write_text(folder / "scene3d.yaml", yaml_text(document))
    return folder


def write_gully(folder: Path, **more: object) -> Path:
    """A body of slimes in a gully that falls along x, and what was surveyed after it had slid."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    folder.mkdir(parents=True)
    x, y = np.meshgrid(np.arange(0.0, 41.0), np.arange(0.0, 17.0), indexing="ij")
    base = -0.3 * x + 0.02 * (y - 8.0) ** 2
    body = np.where((x > 4.0) & (x < 20.0), 4.0, 0.0)
    for name, values in (("base", base), ("surface", base + body), ("after", base + 0.5 * body)):
        write_raster(Raster((1000.0, 500.0), 1.0, values[: 31 if name == "after" else None]),
                     folder / f"{name}.tif")  # fmt: skip
    terrain = {
        "surface": "surface.tif", "base": "base.tif", "origin": [1000.0, 500.0],
        "zones": [{"name": "upper", "material": "sand", "bottom": 0.5},
                  {"name": "lower", "material": "slimes"}],
        "materials": {"slimes": {"friction_deg": 0, "cohesion_kpa": 1, "liquefied": True},
                      "sand": {"friction_deg": 30, "cohesion_kpa": 1}}, **more,
    }  # fmt: skip
    document = {"name": "gully", "spacing": 1.0, "duration_s": 2.0, "terrain": terrain,
                "paths": {"down": [[4.0, 8.0], [38.0, 8.0]]}}  # fmt: skip
    write_text(folder / "scene3d.yaml", yaml_text(document))
    shared = {"confidence": "published", "source": "test"}
    entries = [
        {"name": "surface", "type": "surface_after", "file": "after.tif", "every_m": 5.0,
         "std_m": 0.5, **shared},
        {"name": "way", "type": "path_runout", "path": "down", "value_m": 6.0, "std_m": 2.0,
         "held_out": True, **shared},
    ]  # fmt: skip
    survey = {"case": "gully", "default_set": "field", "sets": {"field": entries}}
    write_text(folder / "measurements3d.yaml", yaml_text(survey))
    question = {"parameters": [{"name": "s", "label": "S_r", "zones": ["lower"],
                                "property": "residual_strength_kpa", "start": 2.0, "low": 0.5,
                                "high": 9.0}], "loss": "misfit"}  # fmt: skip
    write_text(folder / "inversion.yaml", yaml_text(question))
    return folder
