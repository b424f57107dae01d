"""Rasters: places, files of three formats, what is refused."""

from __future__ import annotations

import warnings
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from threading import Thread

import numpy as np
import pytest

from geometry.terrain import raster
from geometry.terrain.raster import Raster, hillshade, read_raster, write_raster
from pipeline.cli import InputError

PLANE = Raster((10.0, 20.0), 2.0, np.add.outer(np.arange(4.0), 10.0 * np.arange(3.0)))
"""Rises by 0.5 along x and by 5 along y; 4 x 3 places, x from 10 to 16, y from 20 to 24."""


def write_plane(path) -> None:
    """The plane as a file of any of the formats."""
    if path.suffix == ".tif":
        return write_raster(PLANE, path)
    rows = "\n".join(" ".join(f"{v:g}" for v in row) for row in PLANE.values.T[::-1])
    head = "ncols 4\nnrows 3\nxllcorner 9\nyllcorner 19\ncellsize 2\n"
    x, y = np.meshgrid(*PLANE.axes, indexing="xy")
    table = np.column_stack([x.ravel(), y.ravel(), PLANE.values.T.ravel()])
    if path.suffix == ".asc":
        path.write_text(head + rows + "\n")
    else:
        np.savetxt(path, table, fmt="%g")


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


@pytest.mark.parametrize("name", ["a.asc", "a.xyz"])
def test_esri_ascii_and_xyz_are_read_at_their_places(name, tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    write_plane(tmp_path / name)
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


VRT = """<VRTDataset rasterXSize="4" rasterYSize="3"><GeoTransform>0,1,0,4,0,-1</GeoTransform>
<Metadata><MDI key="INTERNAL_MASK_FLAGS_1">2</MDI></Metadata>
<VRTRasterBand dataType="Byte" band="1"><SimpleSource><SourceBand>1</SourceBand>
<SourceFilename relativeToVRT="0">/vsicurl/{}</SourceFilename>
</SimpleSource></VRTRasterBand></VRTDataset>"""
OVERVIEW = """<PAMDataset><Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">/vsicurl/{}</MDI>
</Metadata></PAMDataset>"""


@pytest.fixture
def server():
    """An HTTP server that writes down what it is asked; the address changes with every use."""
    asked: list[str] = []

    class Server(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_error(404)

        do_HEAD = do_GET

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Server) as serving:
        Thread(target=serving.serve_forever, args=(0.01,), daemon=True).start()
        numbers = count()
        yield asked, lambda: f"http://127.0.0.1:{serving.server_port}/{next(numbers)}.tif"
        serving.shutdown()


def write_band(path, values, *, dtype="float32", epsg=None, scale=1.0, offset=0.0, unit=""):
    """A GeoTIFF as an agency may pack it; `values` has its rows from the top."""
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    values = np.asarray(values, dtype)
    height, width = values.shape
    place = rasterio.Affine(2.0, 0.0, 9.0, 0.0, -2.0, 25.0)
    shape = {"width": width, "height": height, "count": 1, "dtype": dtype}
    with rasterio.open(path, "w", driver="GTiff", transform=place, crs=epsg, **shape) as file:
        file.write(values, 1)
        file.scales, file.offsets, file.units = (scale,), (offset,), (unit,)


@pytest.mark.parametrize(
    ("dtype", "scale", "offset", "unit"),
    [
        ("int16", 0.1, 0.0, ""),
        ("int32", 0.001, 50.0, "metre"),
        ("float32", 1.0, 0.0, "ft"),
        ("float64", 1.0, 3.0, "US survey foot"),
        ("int16", 1.0, 0.0, "dm"),
    ],
)
def test_scale_offset_and_unit_of_a_band_are_applied(dtype, scale, offset, unit, tmp_path):
    metres = {"ft": 0.3048, "US survey foot": 1200.0 / 3937.0, "dm": 0.1}.get(unit, 1.0)
    stored = (PLANE.values.T[::-1] / metres - offset) / scale
    stored = stored if dtype.startswith("float") else np.round(stored)
    write_band(tmp_path / "a.tif", stored, dtype=dtype, scale=scale, offset=offset, unit=unit)
    found = read_raster(tmp_path / "a.tif")
    assert found.values == pytest.approx(PLANE.values, abs=1e-5)
    assert found.origin == PLANE.origin


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"epsg": "EPSG:4326"}, "is in units of degree; project it to metres"),
        ({"epsg": "EPSG:2264"}, "is in units of US survey foot; convert places and elevations"),
        ({"epsg": "EPSG:32633+6360"}, "is in units of US survey foot"),  # heights in feet
        ({"unit": "fathom"}, "its values are in 'fathom', not in metres"),
    ],
)
def test_what_is_not_in_metres_is_refused(changes, words, tmp_path):
    write_band(tmp_path / "a.tif", PLANE.values.T, **changes)
    with pytest.raises(InputError) as caught:
        read_raster(tmp_path / "a.tif")
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_rasters_of_one_scene_have_one_coordinate_system(tmp_path):
    write_band(tmp_path / "a.tif", PLANE.values.T, epsg="EPSG:32633")
    write_band(tmp_path / "b.tif", PLANE.values.T, epsg="EPSG:32634")
    crs = read_raster(tmp_path / "a.tif").crs
    assert read_raster(tmp_path / "a.tif", crs=crs).crs == crs
    with pytest.raises(InputError, match="'WGS 84 / UTM zone 34N', that of the surface 'WGS 84 / "):
        read_raster(tmp_path / "b.tif", crs=crs)


@pytest.mark.parametrize("missing", [-9999.0, -32768.0, -3.4e38, 0.0, 1e20])
@pytest.mark.parametrize("name", ["a.tif", "a.asc"])
def test_a_number_that_means_no_value_is_refused_with_its_place(missing, name, tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    values = PLANE.values.T[::-1] + 98.0
    values[1, 2] = missing
    if name == "a.tif":
        write_band(tmp_path / name, values)
    else:
        rows = "\n".join(" ".join(f"{v:g}" for v in row) for row in values)
        head = "ncols 4\nnrows 3\nxllcorner 9\nyllcorner 19\ncellsize 2\n"
        (tmp_path / name).write_text(head + rows + "\n")
    with pytest.raises(InputError) as caught:
        read_raster(tmp_path / name)
    assert "1 of 12 pixels have the value" in str(caught.value)
    assert "the first at (14, 22); the others have 98 to 121" in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        np.add.outer(np.arange(3.0), np.arange(4.0)),  # a beach begins at 0
        np.array([[0.0, 255.0], [255.0, 0.0]]),  # a mask
        np.zeros((3, 4)),
        np.array([[-999.0, -1000.0], [-1001.0, -998.0]]),  # the sea bed
    ],
)
def test_elevations_among_their_like_are_elevations(values, tmp_path):
    write_band(tmp_path / "a.tif", values)
    assert np.array_equal(read_raster(tmp_path / "a.tif").values, values[::-1].T)


@pytest.mark.parametrize("name", ["a.asc", "a.xyz"])
def test_a_word_in_a_grid_is_refused(name, tmp_path):
    """GDAL takes it for 0 in an ESRI grid."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    write_plane(tmp_path / name)
    text = (tmp_path / name).read_text()
    (tmp_path / name).write_text(text.replace("21", "none", 1))
    with pytest.raises(InputError, match="line [0-9]+: 'none': no number|not a raster"):
        read_raster(tmp_path / name)


@pytest.mark.parametrize("suffix", [".tif", ".asc", ".xyz"])
def test_a_raster_cannot_ask_the_network(server, suffix, tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    asked, address = server
    path = tmp_path / f"a{suffix}"
    path.write_text(VRT.format(address()))
    with pytest.raises(InputError, match=f"a{suffix}: not a raster"):
        read_raster(path)
    write_plane(path)
    for beside, text in ((".ovr", VRT), (".aux.xml", OVERVIEW)):
        (tmp_path / f"a{suffix}{beside}").write_text(text.format(address()))
    assert np.array_equal(read_raster(path).values, PLANE.values)
    (tmp_path / f"a{suffix}.aux.xml").write_text("<PAMDataset><NoDataValue>5</NoDataValue>")
    with pytest.raises(InputError, match=r"\.aux\.xml: is not read; put what it says into a\."):
        read_raster(path)
    (tmp_path / f"a{suffix}.msk").write_text(VRT.format(address()))
    with pytest.raises(InputError, match=r"\.msk: is not read; put what it says into a\."):
        read_raster(path)
    assert not asked
    with pytest.raises(rasterio.RasterioIOError), rasterio.open(path) as file:
        file.read(1, masked=True)
    assert asked, "GDAL alone asks"


def test_place_and_coordinate_system_are_read_from_beside(tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    write_plane(tmp_path / "a.asc")
    (tmp_path / "a.prj").write_text(rasterio.crs.CRS.from_epsg(32633).to_wkt())
    assert "UTM" in read_raster(tmp_path / "a.asc").crs
    bare = {"driver": "GTiff", "width": 4, "height": 3, "count": 1, "dtype": "float32"}
    with warnings.catch_warnings(action="ignore"):
        with rasterio.open(tmp_path / "b.tif", "w", **bare) as file:
            file.write(PLANE.values.T[::-1].astype(np.float32), 1)
    with pytest.raises(InputError, match=r"b\.tif: does not say where it lies"):
        read_raster(tmp_path / "b.tif")
    (tmp_path / "b.tfw").write_text("2\n0\n0\n-2\n10\n24\n")
    assert read_raster(tmp_path / "b.tif").origin == PLANE.origin


def test_a_raster_that_is_too_large_is_not_read(monkeypatch, tmp_path):
    """The header of a small file may claim any size."""
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    huge = {"driver": "GTiff", "width": 400_000, "height": 400_000, "count": 1, "dtype": "float32",
            "sparse_ok": True, "tiled": True, "blockxsize": 4096, "blockysize": 4096,
            "transform": rasterio.Affine(1.0, 0.0, 9.0, 0.0, -1.0, 9.0)}  # fmt: skip
    with rasterio.open(tmp_path / "a.tif", "w", **huge):
        pass
    assert (tmp_path / "a.tif").stat().st_size < 1_000_000
    with pytest.raises(InputError, match="400000 x 400000 pixels; at most 50,000,000 are read"):
        read_raster(tmp_path / "a.tif")
    write_plane(tmp_path / "b.asc")
    monkeypatch.setattr(raster, "MOST_BYTES", 50)
    with pytest.raises(InputError, match=r"b\.asc: more than 0 MB"):
        read_raster(tmp_path / "b.asc")
