"""The report of a prediction: a table for the terminal, one picture, and a page.

In: the document of `inversion.prediction`, and the scene. Out: text; a PNG with the section, the
band of final surfaces and the exceedance curves of the toes; the page that shows both.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from geometry.scenes.scene import Scene
from inversion.engines.registry import REFERENCE, engine_named
from inversion.prediction.prediction_document import QUANTILES
from report.charts.hydrograph import HYDROGRAPH, save_hydrographs
from report.numbers import fixed, unit_of
from report.page import PageSection, said, shown, tabulated, write_page
from report.pictures.scene import draw_section
from report.sentences.prediction import first_order_words, line_words
from report.sentences.small_cells import cells_of
from report.style import LINE, labels, new_figure, panel, save_figure, tidy
from report.table import Table
from report.tables import dam_breach

PAGE, PICTURE = "prediction.html", "prediction.png"
#: Least share of slides at the edge of the domain that is reported.
EDGE_SHOWN = 1e-3
TOES = ("#0072b2", "#cc79a7")
BAND, MEDIAN, MEASURED = "#222222", "#111111", "#009e73"


def summary(document: dict[str, Any]) -> str:
    """The answer for a terminal or a log."""
    toes = toes_of(document)
    lines = [
        f"{document['case']}: {strength_words(document)}{_by(document)}",
        "",
        quantity_table(document).text(),
        "",
        exceedance_table(toes).text() if toes else "no toe moves",
        *remarks(document),
        *dam_breach_words(document),
        f"{len(document['runs'])} simulations, {document['samples']} samples",
    ]
    return "\n".join(lines)


def write_report(scene: Scene, document: dict[str, Any], folder: Path) -> Path:
    """Write the page of a prediction and its picture into a folder.

    Args:
        scene: before the slide.
        document: as `prediction_document.document_of` makes it.
        folder: to write into.
    """
    picture = folder / PICTURE
    save_prediction_picture(scene, document, picture)
    toes = toes_of(document)
    parts = [
        *shown(
            picture,
            "Section with the band of the final surfaces, and the probability that each toe runs "
            "farther than a distance.",
            "Band: final surfaces between 5 and 95 % of all slides that the strengths allow. Under "
            "it: the probability that a toe runs farther.",
            least_width_px=820,
        ),
        *tabulated(quantity_table(document), exceedance_table(toes) if toes else None),
        *said([f"{line[0].upper()}{line[1:]}." for line in remarks(document)]),
        *said(
            [
                f"{len(document['runs'])} simulations, {document['samples']} samples, points every "
                f"{document['spacing_m']:g} m."
            ]
        ),
    ]
    title = f"{document['case'].replace('_', ' ')}: prediction"
    lead = f"Assumed: {strength_words(document)}{_by(document)}."
    sections = [PageSection("How far it would run", parts), *dam_breach_sections(document, folder)]
    write_page(folder / PAGE, title, sections, lead=lead)
    return folder / PAGE


def _by(document: dict[str, Any]) -> str:
    by = engine_named(document.get("engine", REFERENCE)).said
    return f", {by}" if by else ""


def strength_words(document: dict[str, Any]) -> str:
    """The strengths that were assumed."""
    return "; ".join(strength["words"] for strength in document["strengths"])


def quantity_table(document: dict[str, Any]) -> Table:
    """Every predicted number with its distribution, and what was measured."""
    rows = []
    for entry in document["quantities"]:
        probability = entry["probability_beyond_measured"]
        rows.append(
            [
                f"{entry['name']} ({unit_of(entry['unit'])})",
                fixed(entry["mean"]),
                fixed(entry["std"]),
                plus_minus_fixed(entry["first_order"]),
                *map(fixed, entry["quantiles"].values()),
                None if entry["measured"] is None else _measured(entry),
                None if probability is None else f"{100 * probability:.1f} %",
            ]
        )
    header = [
        "quantity",
        "mean",
        "std",
        "first order",
        *(f"{percent} %" for percent in QUANTILES),
        "measured",
        "P(beyond it)",
    ]
    return Table(header, rows)


def plus_minus_fixed(moments: dict[str, float]) -> str:
    """Mean and standard deviation in a cell."""
    return f"{fixed(moments['mean'])} ± {fixed(moments['std'])}"


def dam_breach_words(document: dict[str, Any]) -> list[str]:
    """The lines of a terminal on what a dam breach study asks for."""
    lacking = ", ".join(map(str, dam_breach.unanswered(document)))
    items = f"{dam_breach.TITLE}: items in {PAGE}; not given: {lacking}"
    return [*line_words(document), items]


def dam_breach_sections(document: dict[str, Any], folder: Path) -> list[PageSection]:
    """What passes the lines over time, and the items of a dam breach study."""
    chart = save_hydrographs(document["hydrographs"], folder / HYDROGRAPH)
    drawn = shown(
        chart,
        "Discharge and volume through the line over time, median and 5 to 95 %",
        "At each time the volumes of all slides are sorted; the discharge is that of the sorted "
        "volumes, so that its integral is the volume that has passed.",
    )
    told = said([f"{line[0].upper()}{line[1:]}." for line in line_words(document)])
    released = [PageSection("What is released", [*drawn, *told])] if drawn else []
    items = [*said([dam_breach.LEAD]), *tabulated(dam_breach.dam_breach_table(document))]
    return [*released, PageSection(dam_breach.TITLE, items)]


def remarks(document: dict[str, Any]) -> list[str]:
    """What the numbers do not say by themselves, and doubts."""
    lines = []
    for entry in document["quantities"]:
        if entry["censored"]:
            lines.append(
                f"{entry['name']}: the probability that it flows, a toe that moves more than "
                f"{entry['measured']:g} {unit_of(entry['unit'])}, is "
                f"{100 * entry['probability_beyond_measured']:.1f} %"
            )
    for entry in toes_of(document):
        if entry["probability_at_the_edge"] > EDGE_SHOWN:
            lines.append(
                f"{entry['name']}: {100 * entry['probability_at_the_edge']:.1f} % of the slides "
                "reach the edge of the domain and would run farther; use a scene with a wider "
                "domain"
            )
    if document["failed_runs"]:
        lines.append(f"{document['failed_runs']} simulations failed and are left out")
    if document["runs_cut_off"]:
        lines.append(
            f"{document['runs_cut_off']} simulations were cut off in motion and would run farther; "
            "increase their duration_s, or use --set simulation.duration_s"
        )
    lines += document.get("remarks", [])
    lines += first_order_words(document)
    return lines + [line.rstrip(".") for line in cells_of(document)]


def _measured(entry: dict[str, Any]) -> str:
    """The measured value, or the limit that was not exceeded."""
    return f"{'< ' * entry['censored']}{entry['measured']:g}"


def toes_of(document: dict[str, Any]) -> list[dict[str, Any]]:
    """The quantities that are runouts of a toe, measured or below a limit."""
    return [entry for entry in document["quantities"] if entry["type"] in ("toe_runout", "no_flow")]


def exceedance_table(toes: Sequence[dict[str, Any]]) -> Table:
    """Round distances, and the probability that each toe runs farther."""
    last = max(max(entry["exceedance"]["beyond"]) for entry in toes)
    step = _round_step(max(last, 1e-6) / 8.0)
    places = np.arange(0.0, last + step, step)
    rows = []
    for entry in toes:
        curve = entry["exceedance"]
        chance = np.interp(places, curve["beyond"], curve["probability"], left=1.0, right=0.0)
        rows.append([entry["name"], *(f"{100 * p:.1f} %" for p in chance)])
    header = ["", *(f"{place:g} m" for place in places)]
    return Table(header, rows, "probability that the toe runs farther than")


def _round_step(step: float) -> float:
    """The next of 1, 2, 5, 10, ..."""
    power = 10.0 ** np.floor(np.log10(step))
    return float(next(m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= step * 0.999) * power)


def save_prediction_picture(scene: Scene, document: dict[str, Any], path: str | Path) -> None:
    """Write the picture.

    Args:
        scene: before the slide.
        document: as `prediction_document.document_of` makes it.
        path: a PNG file.
    """
    left, right, top = _extent(scene, document)
    width = 10.0
    section = (width - 1.0) * (top - scene.ground.lowest + 0.06 * top) / (right - left)
    total = section + 4.9
    figure = new_figure(total, width)
    ax = panel(figure, 0.75, 4.0, 9.1, section)
    draw_section(ax, scene, names=False)
    ax.set(xlim=(left, right), ylim=(scene.ground.lowest - 0.05 * top, top))
    _draw_band(ax, document["sections"])
    labels(ax, "x (m)", "y (m)")
    figure.text(
        0.075,
        1 - 0.3 / total,
        document["case"].replace("_", " "),
        fontsize=12,
        weight="bold",
        va="center",
    )
    figure.text(0.075, 1 - 0.55 / total, strength_words(document), fontsize=9, va="center")
    draw_curves(panel(figure, 0.75, 0.55, 9.1, 2.75), document)
    save_figure(figure, path, dpi=150)


def _extent(scene: Scene, document: dict[str, Any]) -> tuple[float, float, float]:
    """Left, right and top of what is to be seen [m]."""
    left, right = scene.foot("left"), scene.foot("right")
    sections = document["sections"]
    if sections is not None:
        x, y = np.array(sections["x_m"]), np.array(sections["y_95_m"])
        there = x[y > scene.ground.height(x) + 0.02]
        left, right = min(left, there.min()), max(right, there.max())
    margin = 0.03 * (right - left)
    top = max(y for zone in scene.zones for _, y in zone.polygon)
    return left - margin, right + margin, top + 0.12 * (top - scene.ground.lowest)


def _draw_band(ax: Axes, sections: dict[str, Any] | None) -> None:
    if sections is None:
        return
    x = np.array(sections["x_m"])
    ax.fill_between(
        x,
        sections["y_5_m"],
        sections["y_95_m"],
        color=BAND,
        alpha=0.28,
        zorder=5,
        linewidth=0,
        label="final surface, 5 to 95 %",
    )
    ax.plot(x, sections["y_50_m"], color=MEDIAN, linewidth=1.6, zorder=6, label="50 %")
    ax.legend(fontsize=8, loc="upper right", frameon=False)


def draw_curves(ax: Axes, document: dict[str, Any]) -> None:
    """Exceedance of each toe, and what was measured."""
    for entry, colour in zip(toes_of(document), TOES, strict=False):
        curve = entry["exceedance"]
        beyond = np.array(curve["beyond"])
        ax.plot(
            beyond,
            100 * np.array(curve["probability"]),
            color=colour,
            linewidth=1.8,
            label=entry["name"],
        )
        if entry["measured"] is not None:
            ax.axvline(
                entry["measured"],
                color=colour,
                linestyle="--",
                linewidth=1.2,
                label=f"measured: {_measured(entry)} m",
            )
    ax.set(ylim=(0, 100))
    labels(ax, "runout of the toe (m)", "probability of a longer runout (%)")
    ax.grid(color=LINE, linewidth=0.6)
    tidy(ax)
    ax.legend(fontsize=8, frameon=False, loc="upper right")
