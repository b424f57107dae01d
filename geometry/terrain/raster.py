"""Elevations on a regular grid, and their files.

GeoTIFF, ESRI ASCII and XYZ are read and GeoTIFF is written by rasterio (extra `terrain`).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from pipeline.cli import InputError
from pipeline.extras import require
from pipeline.files import atomic_path, read_text

DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid", ".xyz": "XYZ"}
SUFFIXES = tuple(DRIVERS)
BESIDE = (".prj", ".tfw", ".wld")
"""Files of the same name that are read with a raster: its coordinate system, its place."""
MOST_BYTES, MOST_PIXELS = 1_000_000_000, 50_000_000
"""Of a raster's file, and of a raster."""

#: Metres in the unit of a band -> its names.
BAND_UNITS = {
    1.0: ("m", "metre", "meter", "metres", "meters"),
    0.1: ("dm", "decimetre", "decimeter"),
    0.01: ("cm", "centimetre", "centimeter", "centimetres", "centimeters"),
    0.001: ("mm", "millimetre", "millimeter", "millimetres", "millimeters"),
    0.3048: ("ft", "foot", "feet", "international foot"),
    1200.0 / 3937.0: ("us-ft", "ftus", "us_ft", "us survey foot", "us survey feet"),
}
#: What programs write where there is no value; by chance a pixel has one of them among its like.
MISSING = (0.0, -1.0, -99.0, -999.0, -9999.0, -99999.0, -32768.0, -32767.0, 999.0, 9999.0, 99999.0,
           32767.0, 65535.0, 255.0)  # fmt: skip
APART = 50.0  # in units of the file
MOST_ELEVATION = 100_000.0  # of a number in a file, in its unit: decimetres of the highest mountain
#: What no number in a text has, and the lines of a header.
NO_NUMBER = re.compile(rb"[^0-9eE+\-.,;\s](?!an\b|nf\b|AN\b|NF\b)")
HEADER = re.compile(rb"\s*[A-Za-z_]+\s+[-+0-9.,eE]+\s*$")


@dataclass(frozen=True)
class Raster:
    """Elevations on a regular grid of places, linear between them and level beyond its ends."""

    origin: tuple[float, float]  # of the first place [m]
    spacing: float  # m
    values: np.ndarray  # (nx, ny) [m]
    crs: str = ""  # coordinate reference system as WKT; empty: none

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Elevation at x, y [m], of any one shape."""
        values = np.asarray(self.values, dtype=float)
        (i, u), (j, v) = (
            _cell((place - start) / self.spacing, count)
            for place, start, count in zip((x, y), self.origin, values.shape, strict=True)
        )
        i1, j1 = np.minimum(i + 1, values.shape[0] - 1), np.minimum(j + 1, values.shape[1] - 1)
        low = (1.0 - v) * values[i, j] + v * values[i, j1]
        high = (1.0 - v) * values[i1, j] + v * values[i1, j1]
        return (1.0 - u) * low + u * high

    @classmethod
    def level(cls, elevation: float) -> Raster:
        """The same elevation everywhere [m]."""
        return cls((0.0, 0.0), 1.0, np.full((1, 1), float(elevation)))

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Places x (nx,) and y (ny,) [m]."""
        (x, y), (nx, ny) = self.origin, self.values.shape
        return x + self.spacing * np.arange(nx), y + self.spacing * np.arange(ny)


def _cell(place: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Number of the place before each and the way to the next one [0-1]."""
    place = np.clip(place, 0.0, count - 1.0)
    first = np.minimum(np.floor(place).astype(np.int64), max(count - 2, 0))
    return first, place - first


def read_raster(
    path: str | Path, *, origin: tuple[float, float] = (0.0, 0.0), crs: str = ""
) -> Raster:
    """Read the first band of a raster file; its places are the centres of the pixels.

    Scale, offset and unit of the band are applied.

    Args:
        path: a file of one of `SUFFIXES`.
        origin: subtracted from the coordinates [m], so that they are small.
        crs: coordinate system of what it belongs to, as WKT; empty: not known.

    Raises:
        InputError: no rasterio, no such file, one that is too large, one without a place, turned or
            oblong pixels, pixels without a value or with one that means none, a coordinate system
            that is not in metres or not that of what it belongs to, a word for a number, or values
            that another file beside it changes.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a raster is one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    rasterio = _rasterio()
    try:
        with _opened(path, rasterio) as file:
            if path.suffix.lower() == ".asc":
                _check_words(path)
            if file.width * file.height > MOST_PIXELS:
                raise InputError(
                    f"{path}: {file.width} x {file.height} pixels; at most {MOST_PIXELS:,} are read"
                )
            band = file.read(1, masked=True)
            place = file.transform
            system = file.crs.to_wkt() if file.crs else ""
            _check_system(path, system, crs)
            scale = file.scales[0] * _metres(path, file.units[0])
            offset = file.offsets[0] * _metres(path, file.units[0])
    except rasterio.errors.RasterioError as error:
        raise InputError(f"{path}: not a raster ({error})") from error
    if place.is_identity:
        raise InputError(f"{path}: does not say where it lies (a GeoTIFF does, or a file .tfw)")
    if place.b or place.d or place.a <= 0 or not np.isclose(place.a, abs(place.e), rtol=1e-6):
        raise InputError(f"{path}: pixels must be square and rows must run east")
    values = np.ma.filled(band.astype(float), np.nan)
    if np.isnan(values).any():
        lacking = int(np.isnan(values).sum())
        raise InputError(f"{path}: {lacking} of {values.size} pixels have no value; fill them")
    _check_values(path, values, place)
    values = offset + scale * values
    if place.e < 0:
        values = values[::-1]
    south = place.f + (place.e * len(values) if place.e < 0 else 0.0)
    start = (place.c + 0.5 * place.a - origin[0], south + 0.5 * place.a - origin[1])
    return Raster(start, float(place.a), np.ascontiguousarray(values.T), system)


def _check_system(path: Path, wkt: str, other: str) -> None:
    """Check that a coordinate system is in metres, along each of its axes, and the same as another.

    Raises:
        InputError: it is in degrees or feet, or another one; one line.
    """
    if not wkt:
        return
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        system = CRS.from_wkt(wkt)
    except CRSError as error:
        raise InputError(f"{path}: coordinate system: {error}") from None
    for axis in system.axis_info:
        if axis.unit_conversion_factor == 1.0:
            continue
        advice = "project it" if "degree" in axis.unit_name else "convert places and elevations"
        raise InputError(
            f"{path}: the coordinate system {system.name!r} is in units of {axis.unit_name}; "
            f"{advice} to metres (gdalwarp -t_srs; in QGIS: Warp)"
        )
    if other and not system.equals(CRS.from_wkt(other), ignore_axis_order=True):
        raise InputError(
            f"{path}: the coordinate system is {system.name!r}, that of the surface "
            f"{CRS.from_wkt(other).name!r}; project all rasters to one"
        )


def _metres(path: Path, unit: str | None) -> float:
    """Metres in the unit that a band names; none is the metre.

    Raises:
        InputError: it is no unit of length that we know.
    """
    name = (unit or "m").strip().lower()
    for metres, names in BAND_UNITS.items():
        if name in names:
            return metres
    raise InputError(f"{path}: its values are in {unit!r}, not in metres")


def _check_values(path: Path, values: np.ndarray, place: Any) -> None:
    """Check for numbers that stand for a missing value, which the file does not say.

    Args:
        path: for messages.
        values: of the pixels, rows from the top, as they are stored.
        place: of the pixels.

    Raises:
        InputError: there is one; the line has its number and place.
    """
    found = np.unique(values)
    if found.tolist() == [0.0, 255.0]:  # a mask
        return
    for value in {found[0], found[-1]}:
        others = found[found != value]
        apart = np.abs(others - value).min(initial=np.inf) if others.size else 0.0
        if abs(value) > MOST_ELEVATION or (value in MISSING and apart > APART):
            row, column = (int(k) for k in np.argwhere(values == value)[0])
            x, y = _rasterio().transform.xy(place, row, column)
            raise InputError(
                f"{path}: {int((values == value).sum())} of {values.size} pixels have the value "
                f"{value:g}, the first at ({x:.10g}, {y:.10g})"
                + (f"; the others have {others[0]:g} to {others[-1]:g}" if others.size else "")
                + ": it looks like a missing value that is not declared; fill it"
            )


def _check_words(path: Path) -> None:
    """Check that a grid in text holds numbers alone after its header: GDAL takes a word for 0.

    Raises:
        InputError: there is a word; the line has its number.
    """
    for number, line in enumerate(path.read_bytes().splitlines(), start=1):
        if NO_NUMBER.search(line) and not HEADER.match(line):
            word = next(part for part in line.split() if NO_NUMBER.search(part))
            raise InputError(
                f"{path}: line {number}: {word.decode('utf-8', 'replace')!r}: no number"
            )


@contextmanager
def _opened(path: Path, rasterio: Any) -> Iterator[Any]:
    """A raster as a dataset of the format that its suffix names, opened from memory.

    GDAL goes by the content, not by the suffix, and by files beside it: either may be a list of
    places in the network, which it would then ask. In memory there is nothing but what is put
    there.
    """
    for beside in (Path(f"{path}.msk"), Path(f"{path}.aux.xml")):
        if beside.is_file() and (beside.suffix == ".msk" or "NoDataValue" in read_text(beside)):
            raise InputError(f"{beside}: is not read; put what it says into {path.name}")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path}: more than {MOST_BYTES / 1e6:.0f} MB")
    found = [(path, path.suffix.lower())]
    found += [(path.with_suffix(one), one) for one in BESIDE if path.with_suffix(one).is_file()]
    folder = str(uuid4())
    with ExitStack() as stack:
        raster, *_ = [
            stack.enter_context(
                rasterio.MemoryFile(one.read_bytes(), dirname=folder, filename=f"raster{suffix}")
            )
            for one, suffix in found
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            opened = raster.open(driver=DRIVERS[path.suffix.lower()])
        yield stack.enter_context(opened)


def write_raster(
    raster: Raster, path: str | Path, *, origin: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Write a GeoTIFF of one band, float32, NaN for no value; `origin` [m] is added.

    Raises:
        InputError: no rasterio, or another suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in (".tif", ".tiff"):
        raise InputError(f"{path}: a raster is written as .tif")
    rasterio = _rasterio()
    (nx, ny), d = raster.values.shape, raster.spacing
    west, north = raster.origin[0] + origin[0], raster.origin[1] + origin[1] + (ny - 1) * d
    transform = rasterio.Affine(d, 0.0, west - 0.5 * d, 0.0, -d, north + 0.5 * d)
    with atomic_path(path) as temporary:
        with rasterio.open(
            temporary,
            "w",
            driver="GTiff",
            width=nx,
            height=ny,
            count=1,
            dtype="float32",
            transform=transform,
            nodata=np.nan,
            compress="deflate",
            crs=raster.crs or None,
        ) as file:
            file.write(raster.values.T[::-1].astype(np.float32), 1)


def hillshade(
    raster: Raster, *, azimuth_deg: float = 315.0, height_deg: float = 45.0
) -> np.ndarray:
    """Brightness (nx, ny) [0-1] of the surface under a light from `azimuth_deg` (0: from +y)."""
    if min(raster.values.shape) < 2:
        return np.full(raster.values.shape, np.sin(np.radians(height_deg)))
    dx, dy = np.gradient(np.asarray(raster.values, float), raster.spacing)
    azimuth, height = np.radians(azimuth_deg), np.radians(height_deg)
    light = np.cos(height) * np.sin(azimuth), np.cos(height) * np.cos(azimuth)
    facing = np.sin(height) - dx * light[0] - dy * light[1]
    return np.clip(facing / np.sqrt(1.0 + dx**2 + dy**2), 0.0, 1.0)


def _rasterio() -> Any:
    require("terrain", "a raster")
    import rasterio
    import rasterio.errors
    import rasterio.transform

    return rasterio
