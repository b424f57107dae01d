"""The section that measurements of speed and accuracy share: a dam of seven zones with its pool.

It is that of Lower San Fernando as the paper assumes it, with the reservoir: level base, few and
thick zones, so that it is there at any spacing, and kept records stay comparable.
"""

from __future__ import annotations

from pathlib import Path

from geometry.scenes.scene import Scene, load_scene

FILE = Path(__file__).resolve().parents[1] / "case_histories/lower_san_fernando_paper/scene.yaml"
POOL_M = 35.9


def dam_section() -> Scene:
    """The section, 1 m between its points."""
    return load_scene(FILE).changed(water_level=POOL_M)
