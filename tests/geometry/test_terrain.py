"""Rasters: places, files of three formats, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.terrain.raster import Raster, hillshade, read_raster, write_raster
from pipeline.cli import InputError

PLANE = Raster((10.0, 20.0), 2.0, np.add.outer(np.arange(4.0), 10.0 * np.arange(3.0)))
"""Rises by 0.5 along x and by 5 along y; 4 x 3 places, x from 10 to 16, y from 20 to 24."""


def test_elevations_are_linear_between_places_and_level_beyond():
    assert PLANE.at(np.array(13.0), np.array(21.0)) == pytest.approx(1.5 + 5.0)
    assert PLANE.at(np.array([0.0, 99.0]), np.array([0.0, 99.0])) == pytest.approx([0.0, 23.0])


def test_a_slope_that_faces_the_light_is_bright():
    west = Raster((0.0, 0.0), 1.0, np.add.outer(np.arange(5.0), np.zeros(5)))
    east = Raster((0.0, 0.0), 1.0, -west.values)
    assert hillshade(west, azimuth_deg=270.0) == pytest.approx(1.0)
    assert hillshade(east, azimuth_deg=270.0) == pytest.approx(0.0, abs=1e-12)


def test_a_geotiff_is_read_by_its_own_library_at_its_place(tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    utm = rasterio.crs.CRS.from_epsg(32633).to_wkt()
    placed = Raster(PLANE.origin, PLANE.spacing, PLANE.values, utm)
    write_raster(placed, tmp_path / "a.tif", origin=(500000.0, 5000000.0))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.crs.to_epsg() == 32633
        assert file.bounds == (500009.0, 5000019.0, 500017.0, 5000025.0)
        value = next(file.sample([(500016.0, 5000020.0)]))
    assert value == pytest.approx([3.0])
    again = read_raster(tmp_path / "a.tif", origin=(500000.0, 5000000.0))
    assert again.origin == PLANE.origin and again.spacing == PLANE.spacing
    assert np.array_equal(again.values, PLANE.values)
    assert again.crs == utm


def test_esri_ascii_and_xyz_are_read_at_their_places(tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    rows = "\n".join(" ".join(f"{v:g}" for v in row) for row in PLANE.values.T[::-1])
    head = "ncols 4\nnrows 3\nxllcorner 9\nyllcorner 19\ncellsize 2\nNODATA_value -9999\n"
    (tmp_path / "a.asc").write_text(head + rows + "\n")
    x, y = np.meshgrid(*PLANE.axes, indexing="xy")
    table = np.column_stack([x.ravel(), y.ravel(), PLANE.values.T.ravel()])
    np.savetxt(tmp_path / "a.xyz", table, fmt="%g")
    for name in ("a.asc", "a.xyz"):
        read = read_raster(tmp_path / name)
        assert read.origin == pytest.approx(PLANE.origin)
        assert np.array_equal(read.values, PLANE.values)


def test_what_is_no_raster_is_refused_in_one_line(tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    with pytest.raises(InputError, match=r"no\.tif: no such file"):
        read_raster(tmp_path / "no.tif")
    with pytest.raises(InputError, match="a raster is one of"):
        read_raster(tmp_path / "a.csv")
    (tmp_path / "a.tif").write_text("not a picture")
    with pytest.raises(InputError, match=r"a\.tif: not a raster"):
        read_raster(tmp_path / "a.tif")
    gaps = Raster((0.0, 0.0), 1.0, np.array([[1.0, np.nan], [1.0, 1.0]]))
    write_raster(gaps, tmp_path / "gaps.tif")
    with pytest.raises(InputError, match="1 of 4 pixels have no value"):
        read_raster(tmp_path / "gaps.tif")
