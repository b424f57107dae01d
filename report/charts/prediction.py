"""The picture of a prediction: the section with the band of final surfaces, exceedance curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from geometry.scenes.scene import Scene
from report.pictures.scene import draw_section
from report.style import LINE, labels, new_figure, panel, save_figure, tidy

TOES = ("#0072b2", "#cc79a7")
BAND, MEDIAN, MEASURED = "#222222", "#111111", "#009e73"


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
    words = "; ".join(strength["words"] for strength in document["strengths"])
    figure.text(0.075, 1 - 0.3 / total, document["case"].replace("_", " "), fontsize=12,
                weight="bold", va="center")  # fmt: skip
    figure.text(0.075, 1 - 0.55 / total, f"S_r = {words}", fontsize=9, va="center")
    _draw_curves(panel(figure, 0.75, 0.55, 9.1, 2.75), document)
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
    ax.fill_between(x, sections["y_5_m"], sections["y_95_m"], color=BAND, alpha=0.28, zorder=5,
                    linewidth=0, label="final surface, 5 to 95 %")  # fmt: skip
    ax.plot(x, sections["y_50_m"], color=MEDIAN, linewidth=1.6, zorder=6, label="50 %")
    ax.legend(fontsize=8, loc="upper right", frameon=False)


def _draw_curves(ax: Axes, document: dict[str, Any]) -> None:
    """Exceedance of each toe, and what was measured."""
    toes = [entry for entry in document["quantities"] if entry["type"] == "toe_runout"]
    for entry, colour in zip(toes, TOES, strict=False):
        curve = entry["exceedance"]
        beyond = np.array(curve["beyond"])
        ax.plot(beyond, 100 * np.array(curve["probability"]), color=colour, linewidth=1.8,
                label=entry["name"])  # fmt: skip
        if entry["measured"] is not None:
            ax.axvline(entry["measured"], color=colour, linestyle="--", linewidth=1.2,
                       label=f"measured: {entry['measured']:g} m")  # fmt: skip
    ax.set(ylim=(0, 100))
    labels(ax, "runout of the toe (m)", "probability of a longer runout (%)")
    ax.grid(color=LINE, linewidth=0.6)
    tidy(ax)
    ax.legend(fontsize=8, frameon=False, loc="upper right")
