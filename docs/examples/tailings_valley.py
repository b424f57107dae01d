"""A tailings dam on an idealised valley, as rasters and a scene: the example of the how-to page.

    python docs/examples/tailings_valley.py tailings      # writes the folder `tailings`
    flowslide simulate tailings
    flowslide predict tailings --residual-strength 3+-1 --thicker-than 1,3

The valley falls 1 in 25 along x and its sides rise 1 in 2.5. A dam 16 m high, of rolled fill, holds
tailings up to 1 m below its crest; liquefied slimes lie under drained sand. All of it is invented.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from geometry.terrain.raster import Raster, write_raster
from pipeline.files import write_text, yaml_text

PIXEL, LENGTH, WIDTH = 4.0, 640.0, 240.0
CREST_X, HEIGHT, SLOPE = 200.0, 16.0, 2.5
"""Of the dam: where its crest begins [m], height over the valley floor [m], run over rise."""
CREST_WIDTH, FREEBOARD, SAND = 6.0, 1.0, 4.0
FLOOR, SIDE, FALL = 40.0, 0.4, 0.04
"""Half width of the valley floor [m], rise of its sides over their run, fall along the valley."""


def write_example(folder: Path) -> None:
    """Write base, layer and surface as GeoTIFF, and `scene3d.yaml`."""
    x, y = np.meshgrid(
        np.arange(0.0, LENGTH + PIXEL, PIXEL), np.arange(0.0, WIDTH + PIXEL, PIXEL), indexing="ij"
    )
    middle = 0.5 * WIDTH
    base = 100.0 - FALL * x + SIDE * np.maximum(np.abs(y - middle) - FLOOR, 0.0)
    crest = 100.0 - FALL * CREST_X + HEIGHT
    downstream = crest - (x - CREST_X - CREST_WIDTH) / SLOPE
    dam = np.where(x >= CREST_X, np.minimum(crest, downstream), -np.inf)
    pond = np.where(x < CREST_X, crest - FREEBOARD, -np.inf)
    surface = np.maximum(base, np.maximum(dam, pond))
    folder.mkdir(parents=True, exist_ok=True)
    for name, values in (("base", base), ("surface", surface)):
        write_raster(Raster((0.0, 0.0), PIXEL, values), folder / f"{name}.tif")
    box = [[CREST_X, 0.0], [LENGTH, 0.0], [LENGTH, WIDTH], [CREST_X, WIDTH]]
    document = {
        "name": "tailings_valley",
        "description": "A tailings dam on an idealised valley; all of it is invented",
        "spacing": 3.0,
        "duration_s": 60.0,
        "terrain": {
            "surface": "surface.tif",
            "base": "base.tif",
            "zones": [
                {"name": "dam", "material": "fill", "plan": box},
                {"name": "sand", "material": "sand", "bottom": crest - FREEBOARD - SAND},
                {"name": "slimes", "material": "slimes"},
            ],
            "materials": {
                "fill": {"friction_deg": 0, "cohesion_kpa": 15, "density": 1950},
                "sand": {"friction_deg": 28, "cohesion_kpa": 1, "density": 1800},
                "slimes": {
                    "friction_deg": 0, "cohesion_kpa": 3, "density": 1700, "liquefied": True,
                },
            },
        },
        "paths": {"valley": [[CREST_X, middle], [LENGTH, middle]]},
        "lines": {"road": [[290.0, 0.0], [290.0, WIDTH]]},
    }  # fmt: skip
    write_text(folder / "scene3d.yaml", yaml_text(document))


if __name__ == "__main__":
    write_example(Path(sys.argv[1]))
