"""What a dam breach study asks for, item by item, and what a prediction answers.

The numbers of the items are ours. Studies after the Canadian Dam Association's bulletin *Tailings
Dam Breach Analysis* (2021) and the *Global Industry Standard on Tailings Management* (2020) ask for
these matters; their clauses are not quoted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from report.numbers import fixed, unit_of
from report.table import Table

NOT_HERE = "not given"
Document = Mapping[str, Any]
TITLE = "What a dam breach study asks for"
LEAD = (
    "Numbers of the items are this report's own. For studies by the Canadian Dam Association's "
    "bulletin Tailings Dam Breach Analysis (2021) and the Global Industry Standard on Tailings "
    "Management (2020)."
)


def dam_breach_table(document: Document) -> Table:
    """The items, and what answers each."""
    rows = [[str(number), asks, answer(document)] for number, (asks, answer) in enumerate(ITEMS, 1)]
    return Table(["item", "a study asks for", "here"], rows)


def unanswered(document: Document) -> list[int]:
    """Numbers of the items that this prediction does not answer."""
    return [
        number
        for number, (_, answer) in enumerate(ITEMS, 1)
        if answer(document).startswith(NOT_HERE)
    ]


def _strengths(document: Document) -> str:
    return "; ".join(one["words"] for one in document["strengths"])


def _told(document: Document, *kinds: str) -> str:
    """Median and 5 to 95 % of the quantities whose names begin so."""
    found = [
        f"{one['name']} {fixed(one['quantiles']['50'])} {unit_of(one['unit'])} "
        f"({fixed(one['quantiles']['5'])} to {fixed(one['quantiles']['95'])})"
        for one in document["quantities"]
        if one["name"].startswith(kinds)
    ]
    return "; ".join(found)


def _mobilised(document: Document) -> str:
    return _told(document, "mobilised volume", "volume moved") or f"{NOT_HERE}: {_no_history()}"


def _released(document: Document) -> str:
    return _told(document, "released volume", "volume across") or _no_line(document)


def _hydrograph(document: Document) -> str:
    peaks = _told(document, "peak discharge", "peak across")
    return f"hydrograph.csv; {peaks}" if peaks else _no_line(document)


def _no_line(document: Document) -> str:
    why = "name a line in scene3d.yaml" if "inundation" in document else _no_history()
    return f"{NOT_HERE}: {why}"


def _no_history() -> str:
    return "this engine predicts the deposit alone"


def _runout(document: Document) -> str:
    toes = [one["name"] for one in document["quantities"] if one["type"] == "toe_runout"]
    return _told(document, *toes) if toes else f"{NOT_HERE}: no toe moves"


def _area(document: Document) -> str:
    found = document.get("inundation")
    if not found:
        return f"{NOT_HERE} of a section; of a scene3d.yaml maps with probabilities"
    return "; ".join(
        f"thicker than {one['thicker_than_m']:g} m: {one['area_m2']['50']:.0f} m² with at least "
        "50 %, maps in exceedance.png and GeoTIFFs"
        for one in found
    )


def _uncertainty(document: Document) -> str:
    return (
        f"{document['samples']} samples, and first-order second-moment beside them; error of the "
        "model itself is not part of it"
    )


def _speed(document: Document) -> str:
    told = _told(document, "largest speed")
    return told or f"{NOT_HERE}: time over depth and speed at places downstream"


def _always(words: str) -> Callable[[Document], str]:
    return lambda _: words


ITEMS: Sequence[tuple[str, Callable[[Document], str]]] = (
    ("strength of the liquefied soil, with its uncertainty", _strengths),
    ("mobilised volume, with its interval", _mobilised),
    ("released volume, with its interval", _released),
    ("outflow over time", _hydrograph),
    ("runout distance", _runout),
    ("area that is inundated", _area),
    ("uncertainty and sensitivity of the result", _uncertainty),
    ("depth and speed of the flow", _speed),
    (
        "breach: its trigger, width, depth and time of formation",
        _always(f"{NOT_HERE}: the soil liquefies at once, over the whole zone"),
    ),
    (
        "pond: its volume, and outflow of water in fair weather and in a flood",
        _always(f"{NOT_HERE}: water loads the soil and does not flow; add its outflow by hand"),
    ),
    (
        "flow downstream: dilution, entrainment, rheology, arrival times",
        _always(f"{NOT_HERE}: by a flood model that starts from the hydrograph"),
    ),
    (
        "consequences: people at risk, environment, classification",
        _always(f"{NOT_HERE}"),
    ),
)
