"""Extras of the installation: what some commands need and others do without.

A command, or the function that knows first, calls `require` before any work.
"""

from __future__ import annotations

from importlib.util import find_spec

from pipeline.cli import InputError

#: The modules that are imported of each extra, as pyproject.toml lists their distributions.
MODULES = {
    "dxf": ("ezdxf",),
    "learned": ("torch",),
    "posterior": ("dynesty", "h5netcdf", "xarray"),
    "studio": ("ruamel", "starlette", "uvicorn", "websockets"),
    "terrain": ("pyproj", "rasterio"),
    "video": ("imageio_ffmpeg",),
}


def has(extra: str) -> bool:
    """True where everything of an extra is installed; nothing is imported."""
    return not _missing(extra)


def require(extra: str, what: str) -> None:
    """Check that an extra is installed.

    Args:
        extra: its name.
        what: that needs it, as the subject of a sentence.

    Raises:
        InputError: it is not; the line says what to install.
    """
    if missing := _missing(extra):
        modules = " and ".join(missing)
        raise InputError(f"{what} needs {modules}: pip install 'flowslide[{extra}]'")


def _missing(extra: str) -> list[str]:
    return [name for name in MODULES[extra] if find_spec(name) is None]
