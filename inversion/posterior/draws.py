"""The draws of a posterior as a file: ArviZ's groups in NetCDF, `posterior.nc`.

Groups: `posterior` and `prior` (the unknowns), `posterior_predictive` and `prior_predictive` (the
measured numbers and sigma'_v0, with all errors of the model), `observed_data`, `log_likelihood`.
One chain of draws of equal weight; `arviz.from_netcdf` reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.cli import InputError
from pipeline.extras import require
from pipeline.files import atomic_path, file_or_within

FILE_NAME = "posterior.nc"


@dataclass(frozen=True)
class Draws:
    """Draws of equal weight, s of each.

    Attributes:
        unknowns: names, (q,).
        posterior: (s, q).
        prior: (s, q).
        numbers: names, (k,).
        posterior_predictive: (s, k).
        prior_predictive: (s, k).
        log_likelihood: of all fitted measurements at once, (s,).
        observed: measured numbers by name.
        facts: attributes of the file.
    """

    unknowns: list[str]
    posterior: np.ndarray
    prior: np.ndarray
    numbers: list[str]
    posterior_predictive: np.ndarray
    prior_predictive: np.ndarray
    log_likelihood: np.ndarray
    observed: dict[str, float]
    facts: dict[str, Any]


def save_draws(draws: Draws, path: str | Path) -> Path:
    """Write the file; it appears when whole."""
    import xarray

    def group(names: Sequence[str], values: np.ndarray) -> xarray.Dataset:
        count = len(values)
        return xarray.Dataset(
            {key(name): (("chain", "draw"), values[None, :, k]) for k, name in enumerate(names)},
            coords={"chain": [0], "draw": np.arange(count)},
        )

    observed = {key(name): ((), value) for name, value in draws.observed.items()}
    data = xarray.DataTree.from_dict(
        {
            "/": xarray.Dataset(attrs=draws.facts),
            "posterior": group(draws.unknowns, draws.posterior),
            "prior": group(draws.unknowns, draws.prior),
            "posterior_predictive": group(draws.numbers, draws.posterior_predictive),
            "prior_predictive": group(draws.numbers, draws.prior_predictive),
            "log_likelihood": group(["fitted measurements"], draws.log_likelihood[:, None]),
            "observed_data": xarray.Dataset(observed),
        }
    )
    path = Path(path)
    with atomic_path(path) as temporary:
        data.to_netcdf(str(temporary), engine="h5netcdf")
    return path


def load_draws(path: str | Path) -> Draws:
    """Read a `posterior.nc`, or the one in a folder.

    Raises:
        InputError: no such file, or not one of ours; one line.
    """
    require("posterior", f"{path}: draws of a posterior")
    import xarray

    path = file_or_within(path, FILE_NAME)
    if not path.is_file():
        raise InputError(f"{path}: no such file; `flowslide posterior CASE` makes it")
    try:
        with xarray.open_datatree(path, engine="h5netcdf") as file:
            data = file.load()
        unknowns = list(data["posterior"].data_vars)
        numbers = list(data["posterior_predictive"].data_vars)

        def block(group: Any, names: Sequence[str]) -> np.ndarray:
            return np.stack([group[name].values[0] for name in names], axis=1)

        return Draws(
            unknowns=unknowns,
            posterior=block(data["posterior"], unknowns),
            prior=block(data["prior"], unknowns),
            numbers=numbers,
            posterior_predictive=block(data["posterior_predictive"], numbers),
            prior_predictive=block(data["prior_predictive"], numbers),
            log_likelihood=data["log_likelihood"]["fitted measurements"].values[0],
            observed={
                name: float(one.values.flat[0])
                for name, one in data["observed_data"].data_vars.items()
            },
            facts=dict(data.attrs),
        )
    except (OSError, AttributeError, KeyError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as draws of a posterior ({error})") from None


def key(name: str) -> str:
    """A name as NetCDF takes it."""
    return name.replace("/", "|")
