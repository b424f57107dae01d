"""Tables of a posterior."""

from __future__ import annotations

import math
from collections.abc import Iterable

from inversion.posterior.document import (
    PosteriorDocument,
    PredictedNumber,
    Spread,
    UnknownAnswer,
)
from report.data.back_analysis import MANY
from report.numbers import fixed, limited, number, percent, signed, unit_of
from report.table import Table

#: Inputs with a smaller share are not in the tables of a terminal.
LEAST_SHARE = 0.005


def parameter_table(document: PosteriorDocument) -> Table:
    """What was asked for."""
    rows = [
        [
            one.label,
            f"{number(one.after.mean)} ± {number(one.after.std, 2)} {unit_of(one.unit)}",
            number(one.after.median),
            _range(one.after.interval_50),
            _range(one.after.interval_95),
            None if one.ratio is None else f"{one.ratio.median:.3f}",
            None if one.ratio is None else _range(one.ratio.interval_95),
            percent(one.narrowed),
        ]
        for one in document.parameters
    ]
    header = [
        "after the data",
        "mean",
        "median",
        "50 %",
        "95 %",
        "S_r/σ'_v0",
        "95 % of it",
        "variance that went",
    ]
    return Table(header, rows)


def of_maps(document: PosteriorDocument) -> dict[str, list[PredictedNumber]]:
    """Measurements of so many numbers that these are not named one by one."""
    groups: dict[str, list[PredictedNumber]] = {}
    for one in document.numbers:
        groups.setdefault(one.group, []).append(one)
    return {name: own for name, own in groups.items() if name and len(own) > MANY}


def named(document: PosteriorDocument) -> list[PredictedNumber]:
    """The numbers of all other measurements."""
    maps = of_maps(document)
    return [one for one in document.numbers if one.group not in maps]


def _rms(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return math.sqrt(sum(value * value for value in known) / max(len(known), 1))


def _map_name(name: str, own: list[PredictedNumber]) -> str:
    return f"{name}, {len(own)} numbers, rms ({unit_of(own[0].unit)})"


def predicted_table(document: PosteriorDocument) -> Table:
    """Measured numbers, of a map their root mean squares."""
    rows = [
        [
            f"{one.name} ({unit_of(one.unit)})",
            one.role,
            limited(one.measured, one.censored),
            number(one.std, 2),
            f"{number(one.after.mean)} ± {number(one.after.std, 2)}",
            _range(one.after.interval_95),
            _range(one.before.interval_95),
            None
            if one.censored and one.difference_in_std >= 0.0
            else signed(-one.difference_in_std),
        ]
        for one in named(document)
    ]
    rows += [
        [
            _map_name(name, own),
            own[0].role,
            None,
            number(_rms(one.std for one in own), 2),
            f"off by {number(_rms(one.after.mean - one.measured for one in own), 2)}",
            None,
            None,
            fixed(_rms(one.difference_in_std for one in own), 1),
        ]
        for name, own in of_maps(document).items()
    ]
    header = [
        "number",
        "role",
        "measured",
        "std",
        "predicted",
        "95 %",
        "before the data",
        "predicted minus measured, in std",
    ]
    return Table(header, rows)


def share_tables(document: PosteriorDocument) -> list[Table]:
    """Shares of the variance of each parameter."""
    return [
        Table(
            ["input", "first order", "total"],
            [
                [share.name, percent(share.first), percent(share.total)]
                for share in one.sobol
                if max(share.first, share.total) >= LEAST_SHARE
            ],
            f"what moves {one.label}: shares of its posterior variance",
        )
        for one in document.parameters
    ]


def nuisance_table(document: PosteriorDocument) -> Table:
    """The nuisances."""
    return Table(_HEADER, [_before_after(one) for one in document.nuisances])


def unknown_table(document: PosteriorDocument) -> Table:
    """Every unknown."""
    return Table(_HEADER, [_before_after(one) for one in document.unknowns])


def emulator_table(document: PosteriorDocument) -> Table:
    """How good the emulator is."""
    rows = [
        [
            f"{one.name} ({unit_of(one.unit)})",
            fixed(one.left_out_std, 2),
            signed(one.correction, 2),
            fixed(one.correction_std, 2),
        ]
        for one in named(document)
    ]
    rows += [
        [
            _map_name(name, own),
            fixed(_rms(one.left_out_std for one in own), 2),
            fixed(_rms(one.correction for one in own), 2),
            fixed(_rms(one.correction_std for one in own), 2),
        ]
        for name, own in of_maps(document).items()
    ]
    header = ["number", "error of the emulator, left out", "fine less coarse", "scatter of it"]
    return Table(header, rows)


def confirmation_table(document: PosteriorDocument) -> Table:
    """Runs of the solver at draws of a posterior that a learned model found."""
    rows = [
        [
            one.name,
            str(one.runs),
            signed(one.difference, 2),
            fixed(one.scatter, 2),
            fixed(one.stated_std, 2),
        ]
        for one in document.confirmation
    ]
    header = ["number", "runs", "solver less model, mean", "scatter of it", "error reckoned with"]
    return Table(header, rows, "by the solver at draws of the posterior")


def other_ways_table(document: PosteriorDocument) -> Table:
    """Errors of the model: other ways to simulate."""
    names, maps = [one.name for one in named(document)], of_maps(document)
    rows = [
        [
            way,
            *(signed(change[name], 2) for name in names),
            *(fixed(_rms(change[one.name] for one in own), 2) for own in maps.values()),
        ]
        for way, change in document.other_ways.items()
    ]
    headings = [_map_name(name, own) for name, own in maps.items()]
    return Table(
        ["simulated otherwise", *names, *headings],
        rows,
        "change of the numbers: errors of the model",
    )


_HEADER = ["unknown", "prior", "before", "after", "95 % after", "variance that went"]


def _before_after(one: UnknownAnswer) -> list[str]:
    return [
        one.label,
        one.prior,
        _mean(one.before),
        _mean(one.after),
        _range(one.after.interval_95),
        percent(one.narrowed),
    ]


def _mean(one: Spread) -> str:
    return f"{number(one.mean, 2 if abs(one.mean) < 1 else 3)} ± {number(one.std, 2)}"


def _range(interval: tuple[float, float]) -> str:
    return f"{number(interval[0])} to {number(interval[1])}"
