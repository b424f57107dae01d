"""The report of the classical methods: `classical.json`, one picture per slide, and a page.

In: the analyses of a case. Out: files in a folder. What is constructed, recalled or made by machine
says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from inversion.classical.analysis import Analysis
from inversion.classical.document import document
from inversion.classical.sections_of_case import CaseSections
from pipeline.files import write_json
from report.numbers import fixed, span
from report.page import PageSection, folded, said, shown, tabulated, write_page
from report.pictures.classical import save_picture
from report.table import Table

RESULT, PAGE = "classical.json", "classical.html"


def save_all(
    case: CaseSections, analyses: Sequence[Analysis], refused: Sequence[str], folder: Path
) -> dict[str, Any]:
    """Write document, pictures and page into a folder; the document."""
    found = document(case, analyses, refused)
    sections = []
    for analysis, entry in zip(analyses, found["analyses"], strict=True):
        path = folder / f"{_file_name(analysis.judgement.name)}.png"
        save_picture(case, analysis, path)
        sections.append(_slide(entry, path))
    if refused:
        sections.append(PageSection("Not analysed", said(refused)))
    write_page(folder / PAGE, f"{case.title}: classical methods", sections, lead=lead(found))
    write_json(folder / RESULT, found)
    return found


def lead(found: dict[str, Any]) -> str:
    """Every slide with the strength of every method and its range over the judgement calls."""
    lines = []
    for entry in found["analyses"]:
        values = [
            f"{method['title']} {fixed(method['value_kpa'])} kPa "
            f"({span(method['low_kpa'], method['high_kpa'])})"
            for method in entry["methods"]
            if method["value_kpa"] is not None
        ]
        lines.append(f"{entry['name']} slide: {', '.join(values) or 'no method has an answer'}.")
    text = " ".join(lines)
    return f"{text[:1].upper()}{text[1:]}"


def _slide(entry: dict[str, Any], picture: Path) -> PageSection:
    return PageSection(
        f"The {entry['name']} slide",
        [
            *tabulated(_methods(entry)),
            *said([f"{'; '.join(entry['labels'])}."]),
            *shown(
                picture,
                "Section with slip surface and slices, velocities of the mass, and the strength of "
                "each method under every judgement call.",
                least_width_px=820,
            ),
            *folded("Every judgement call in numbers", _options(entry)),
        ],
    )


def _methods(entry: dict[str, Any]) -> Table:
    rows = [
        [
            method["title"],
            fixed(method["value_kpa"]),
            span(method["low_kpa"], method["high_kpa"]),
            None if method["motion"] is None else fixed(method["motion"]["duration_s"]),
            None
            if method["motion"] is None
            else fixed(method["motion"]["highest_velocity_m_per_s"]),
            method["reason"],
        ]
        for method in entry["methods"]
    ]
    rows += [
        [
            key.replace("_", " "),
            f"{one['value']:g}",
            span(one.get("low"), one.get("high")),
            None,
            None,
            f"published elsewhere, {one.get('confidence', '')}",
        ]
        for key, one in entry["published"].items()
    ]
    header = ["method", "S_r (kPa)", "range (kPa)", "time to stop (s)", "highest speed (m/s)", ""]
    return Table(header, rows, "range: over the judgement calls, one changed at a time")


def _options(entry: dict[str, Any]) -> Table:
    names = dict.fromkeys(
        (option["name"], option["words"])
        for method in entry["methods"]
        for option in method["options"]
    )
    values = {
        (option["name"], method["title"]): option
        for method in entry["methods"]
        for option in method["options"]
    }
    titles = [method["title"] for method in entry["methods"]]
    rows = [
        [words, *(_value(values.get((name, title))) for title in titles)] for name, words in names
    ]
    return Table(["judgement call", *titles], rows, "S_r (kPa); in brackets: not in the range")


def _value(option: dict[str, Any] | None) -> str | None:
    if option is None:
        return None
    value = "none" if option["value_kpa"] is None else fixed(option["value_kpa"])
    return value if option["in_range"] else f"({value})"


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)
