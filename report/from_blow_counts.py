"""The report of a prediction from blow counts: a table for the terminal, and a page.

In: the document of `inversion.prediction.from_blow_counts`. Out: text; a page with a chart of every
predicted number next to what was measured, and the strengths of the layers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from report.charts.from_blow_counts import draw_quantities
from report.numbers import fixed, span, unit_of
from report.page import PageSection, said, shown, tabulated, write_page
from report.sentences.small_cells import cells_of
from report.table import Table, plain

PAGE = "from_blow_counts.html"


def summary(document: dict[str, Any]) -> str:
    """The answer for a terminal or a log."""
    parts = [
        f"{document['title']}: predicted from blow counts at {document['spacing_m']:g} m, no fit",
        quantity_table(document).text(folded=True),
        strength_table(document).text(folded=True),
        *map(plain, remarks(document)),
    ]
    return "\n\n".join(parts)


def write_report(document: dict[str, Any], folder: Path) -> Path:
    """Write the page and its chart into a folder."""
    path = folder / PAGE
    chart = draw_quantities(document, folder / "from_blow_counts.svg")
    sections = [
        PageSection(
            "Predicted next to measured",
            [
                *shown(
                    chart,
                    "Predicted numbers by relation with their 5 to 95 % range, and the measured "
                    "value as a line.",
                    "Each liquefied layer has the strength that the relation gives at its blow "
                    "count and stress; nothing was fitted. Bar: 5 to 95 % by the scatter of the "
                    "relation, which moves all layers together. Line: measured, with one standard "
                    "deviation.",
                ),
                *tabulated(quantity_table(document)),
                *said(_doubts(document)),
            ],
        ),
        PageSection(
            "Strengths of the layers",
            [
                *said(["Median strength in kPa by relation."]),
                *tabulated(strength_table(document), source_table(document)),
            ],
        ),
    ]
    title = f"{document['title']}: predicted from blow counts"
    write_page(path, title, sections, lead=_agreement(document))
    return path


def quantity_table(document: dict[str, Any]) -> Table:
    """Rows: what was measured, and each relation; columns: the numbers at the median strengths."""
    quantities = document["relations"][0]["quantities"]
    header = ["", *(f"{entry['name']} ({unit_of(entry['unit'])})" for entry in quantities)]
    measured: list[str | None] = ["measured", *(_measured(entry) for entry in quantities)]
    rows = [[one["label"], *map(_predicted, one["quantities"])] for one in document["relations"]]
    known = [measured] if any(measured[1:]) else []
    return Table(header, [*known, *rows], "at the median strengths (5 to 95 %)")


def _predicted(entry: dict[str, Any]) -> str:
    words = (
        f"{fixed(entry['at_median'])} ({span(entry['quantiles']['5'], entry['quantiles']['95'])})"
    )
    if entry["censored"]:
        words += f", flows: {100 * entry['probability_beyond_measured']:.0f} %"
    return words


def _measured(entry: dict[str, Any]) -> str | None:
    if entry["measured"] is None:
        return None
    if entry["censored"]:
        return f"< {entry['measured']:g}"
    return f"{entry['measured']:g} ± {entry['std']:g}"


def strength_table(document: dict[str, Any]) -> Table:
    """Blow count, stress and median strengths of every layer."""
    relations = document["relations"]
    header = ["layer", "N1,60", "N1,60cs", "σ'_v0 (kPa)", *(one["label"] for one in relations)]
    rows = [
        [
            layer["zone"],
            _count(layer["n1_60"]),
            _count(layer["n1_60cs"]),
            f"{layer['sigma_v0_kpa']:.0f}",
            *(
                fixed(one["strengths_kpa"][layer["zone"]]) + "*" * (layer["zone"] in one["beyond"])
                for one in relations
            ),
        ]
        for layer in document["layers"]
    ]
    starred = any(one["beyond"] for one in relations)
    caption = "S_r (kPa)" + (
        "; *: blow count beyond the data, taken at their end" if starred else ""
    )
    return Table(header, rows, caption).without_empty_columns()


def source_table(document: dict[str, Any]) -> Table:
    """Where the blow counts come from."""
    rows = [[layer["zone"], layer["confidence"], layer["source"]] for layer in document["layers"]]
    return Table(["layer", "confidence", "source"], rows)


def _count(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"


def remarks(document: dict[str, Any]) -> list[str]:
    """What the numbers say, and doubts."""
    return [line for line in (_agreement(document), *_doubts(document)) if line]


def _agreement(document: dict[str, Any]) -> str:
    """Of each measured number, how many relations predict it; of a flow, how probable it is."""
    relations, words = document["relations"], []
    for number, first in enumerate(relations[0]["quantities"]):
        entries = [one["quantities"][number] for one in relations]
        if first["censored"]:
            chances = [100 * entry["probability_beyond_measured"] for entry in entries]
            words.append(
                f"{first['name']}: a flow, which did not happen, is predicted with a probability "
                f"of {min(chances):.0f} to {max(chances):.0f} %"
            )
        elif first["measured"] is not None:
            inside = sum(map(_within, entries))
            words.append(f"{first['name']}: {inside} of {len(entries)} relations predict it")
    if not words:
        return ""
    found = "; ".join(words)
    meaning = "Predicted: within 5 to 95 %, one standard deviation of the survey allowed."
    return f"{found[0].upper()}{found[1:]}. {meaning}"


def _within(entry: dict[str, Any]) -> bool:
    low, high = (entry["quantiles"][percent] for percent in ("5", "95"))
    return low - entry["std"] <= entry["measured"] <= high + entry["std"]


def _doubts(document: dict[str, Any]) -> list[str]:
    found = []
    moving = sum(not run["at_rest"] for one in document["relations"] for run in one["runs"])
    failed = sum(run["predicted"] is None for one in document["relations"] for run in one["runs"])
    if moving:
        found.append(
            f"{moving} simulations were cut off in motion and would run farther; increase "
            "duration_s of inversion.yaml, or use --set simulation.duration_s."
        )
    if failed:
        found.append(f"{failed} simulations failed and are left out.")
    other = [one["label"] for one in document["relations"] if one["other_kind"]]
    if other:
        found.append(
            f"Only the other kind of blow count is known for some layer: {'; '.join(other)}."
        )
    return found + cells_of(document)
