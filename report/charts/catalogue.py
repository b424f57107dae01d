"""The catalogue in one picture: strength ratio against blow count, correlations, our answers.

In: the catalogue and our answers. Out: a picture (png, svg or pdf). What is only quoted from memory
is hollow, and the legend says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from inversion.catalogue.catalogue import (
    FOLDER,
    Entry,
    OurAnswer,
    Strength,
    blow_count,
    load_catalogue,
    load_strengths,
)
from inversion.catalogue.correlations import (
    OLSON_STARK_BAND,
    OLSON_STARK_LARGEST,
    RELATIONS,
    olson_stark_2002,
)
from report.style import HALO, HELD_OUT, TEXT_COLOUR, new_figure, save_figure, tell, tidy

# Colours that keep apart for every kind of colour vision (Okabe and Ito).
LINE_COLOURS = ("#0072b2", "#009e73", "#56b4a0", "#8a5a00", "#cc79a7")
CASE_COLOUR, OUR_COLOUR = "#444444", HELD_OUT
STRESSES_KPA = (50.0, 100.0, 300.0)
LARGEST_COUNT, LARGEST_RATIO = 15.5, 0.36
#: Place of the answers of cases without a blow count.
NO_COUNT = 14.0
#: Distance between our answers at one blow count, so that no bar hides another.
APART = 0.25
LABEL_SIZE = 7.5
#: Height of a line of words about our answers [points].
LINE = 12.0
#: Width and height of a character of a label, in its size.
CHARACTER = (0.56, 1.25)
Box = tuple[float, float, float, float]
#: Words of a case's name that the picture omits.
DISPENSABLE = (" Dam", " Roadway", " Highway", " Railway", " Embankment", "North Dike of ")
NOTE = (
    "Hollow: strength, stress or blow count is quoted from memory and unverified. "
    "Bars: stated range; one standard deviation for ours.\n"
    "Blow counts are (N1)60 as tabulated; Idriss and Boulanger and Weber ask for the clean-sand "
    "equivalent. Our ratios use the stress of our sections."
)


def draw_catalogue(
    path: str | Path, answers: Sequence[OurAnswer] = (), *, folder: Path = FOLDER
) -> None:
    """Save the picture.

    Args:
        path: png, svg or pdf.
        answers: ours, see `catalogue.answers_of`.
        folder: of the catalogue's files.

    Raises:
        InputError: another suffix, or a catalogue that cannot be read.
    """
    figure = catalogue_figure(load_catalogue(folder), load_strengths(folder), answers)
    save_figure(figure, path, dpi=150)


def catalogue_figure(
    entries: Sequence[Entry], strengths: Sequence[Strength], answers: Sequence[OurAnswer]
) -> Figure:
    """The figure itself; for tests and for reports."""
    width, height, share = 8.6, 6.6, 0.70
    figure = new_figure(height, width)
    ax = figure.add_axes((0.085, 0.27, 0.89, share))
    tidy(ax)
    top = _top(strengths, answers, share * height * 72.0)
    ax.set(xlim=(0.0, LARGEST_COUNT), ylim=(0.0, top))
    ax.set_xlabel("blow count (N$_1$)$_{60}$")
    ax.set_ylabel("strength ratio S$_r$ / σ'$_{v0}$")
    handles = _draw_correlations(ax)
    _draw_cases(ax, strengths, _draw_answers(ax, entries, strengths, answers))
    handles += _marker_handles(strengths, bool(answers))
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.07, 0.065),
        ncols=2,
        frameon=False,
        fontsize=8,
        columnspacing=2.0,
    )
    figure.text(0.085, 0.015, NOTE, fontsize=7.5, color=TEXT_COLOUR, linespacing=1.4)
    return figure


def _top(strengths: Sequence[Strength], answers: Sequence[OurAnswer], height: float) -> float:
    """Upper end of the axis: all values and their bars below the words, of `height` in points."""
    highest = [answer.ratio + answer.ratio_std for answer in answers]
    highest += [s.ratio for s in strengths if s.ratio is not None]
    words = min(0.5, LINE * (len(answers) + 1) / height)
    return max(LARGEST_RATIO, 1.03 * max(highest, default=0.0) / (1.0 - words))


def _draw_correlations(ax: Axes) -> list[Line2D | Patch]:
    count = np.linspace(0.0, 12.6, 200)
    handles: list[Line2D | Patch] = []
    inside = count[count <= OLSON_STARK_LARGEST]
    middle = olson_stark_2002(inside)
    ax.fill_between(
        inside,
        middle - OLSON_STARK_BAND,
        middle + OLSON_STARK_BAND,
        color=LINE_COLOURS[0],
        alpha=0.13,
        linewidth=0,
        zorder=1,
    )
    for relation, colour in zip(RELATIONS.values(), LINE_COLOURS, strict=True):
        stresses = STRESSES_KPA if relation.by_stress else (100.0,)
        shift = -5 if relation.clean_sand else 5  # so that two labels at one place stay apart
        for stress in stresses:
            ratio = relation.ratio(count, stress)
            ax.plot(count, ratio, color=colour, linewidth=1.6, zorder=2)
            if relation.by_stress:
                tell(ax, count[-1], ratio[-1], f"{stress:g} kPa", away=(3, shift), color=colour)
        words = relation.label
        if relation.band is not None:
            words += f", ±{relation.band:g}"
        if relation.by_stress:
            words += f", σ'$_{{v0}}$ {', '.join(f'{s:g}' for s in stresses)} kPa"
        handles.append(Line2D([], [], color=colour, linewidth=1.6, label=words))
    return handles


def _draw_cases(ax: Axes, strengths: Sequence[Strength], taken: list[Box]) -> None:
    shown = [s for s in strengths if s.ratio is not None and s.n1_60 is not None]
    for strength in shown:
        x, y = strength.n1_60, strength.ratio
        taken.append(_box(ax, x, y, (-5, -5, 5, 5)))
        if strength.ratio_range is not None:
            ax.plot([x, x], strength.ratio_range, color=CASE_COLOUR, linewidth=1.1, zorder=3)
        ax.plot(
            [x],
            [y],
            marker="o",
            markersize=6,
            color=CASE_COLOUR,
            zorder=4,
            linestyle="none",
            markerfacecolor="white" if strength.recalled else CASE_COLOUR,
        )
    for strength in shown:
        _place_label(ax, _short(strength), strength.n1_60, strength.ratio, taken)


def _draw_answers(
    ax: Axes, entries: Sequence[Entry], strengths: Sequence[Strength], answers: Sequence[OurAnswer]
) -> list[Box]:
    """Our answers, each with a letter and its words above the data; returns what they cover."""
    taken: list[Box] = []
    shared: dict[float, int] = {}
    for number, answer in enumerate(answers):
        row = blow_count(answer, strengths, entries)
        x = NO_COUNT if row is None else row.n1_60
        shared[x] = shared.get(x, 0) + 1
        x += shared[x] * APART
        low = min(answer.ratio_std, answer.ratio)
        if answer.bound:  # an arrow upwards
            bar = {"yerr": 0.15 * ax.get_ylim()[1], "lolims": True}
        else:
            bar = {"yerr": [[low], [answer.ratio_std]], "capsize": 3}
        ax.errorbar(
            [x], [answer.ratio], fmt="none", ecolor=OUR_COLOUR, linewidth=1.6, zorder=7, **bar
        )
        ax.plot(
            [x],
            [answer.ratio],
            marker="o",
            markersize=12,
            color=OUR_COLOUR,
            markeredgecolor="white",
            zorder=8,
        )
        letter = chr(ord("A") + number % 26)
        ax.annotate(
            letter,
            (x, answer.ratio),
            ha="center",
            va="center",
            fontsize=LABEL_SIZE,
            color="white",
            fontweight="bold",
            zorder=9,
        )
        taken.append(_box(ax, x, answer.ratio, (-8, -8, 8, 8)))
        zones = f"zone{'s' * (len(answer.zones) > 1)} {', '.join(answer.zones)}"
        title = answer.title.replace("$", r"\$")  # no formula
        words = f"{letter}  {title}, {zones}: {answer.words}"
        ax.annotate(
            words,
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(8, -6 - LINE * number),
            textcoords="offset points",
            va="top",
            fontsize=8,
            color=OUR_COLOUR,
            path_effects=HALO,
            zorder=9,
        )
    if NO_COUNT in shared:
        ax.axvline(NO_COUNT - 0.1, color="#999999", linewidth=0.7, linestyle=":")
        ax.text(
            NO_COUNT,
            ax.get_ylim()[1],
            "blow count\nunknown",
            fontsize=LABEL_SIZE,
            color="#666666",
            va="top",
        )
    return taken


def _place_label(ax: Axes, words: str, x: float, y: float, taken: list[Box]) -> None:
    """Write a label next to a point where it covers nothing, else at the first place."""
    width, height = (LABEL_SIZE * part for part in CHARACTER)
    width *= len(words)
    half = 0.5 * height
    places = [(side, up) for up in (-10.0, 0.0, 10.0, -20.0, 20.0) for side in (7.0, -7.0 - width)]
    boxes = [_box(ax, x, y, (a, b - half, a + width, b + half)) for a, b in places]
    free = [n for n, box in enumerate(boxes) if not any(_overlap(box, other) for other in taken)]
    chosen = free[0] if free else 0
    taken.append(boxes[chosen])
    ax.annotate(
        words,
        (x, y),
        xytext=places[chosen],
        textcoords="offset points",
        va="center",
        fontsize=LABEL_SIZE,
        color=CASE_COLOUR,
        path_effects=HALO,
        zorder=6,
    )


def _box(ax: Axes, x: float, y: float, around: Box) -> Box:
    """A rectangle around a point: left, bottom, right, top in points; the result in pixels."""
    px, py = ax.transData.transform((x, y))
    scale = ax.figure.dpi / 72.0
    return (
        px + scale * around[0],
        py + scale * around[1],
        px + scale * around[2],
        py + scale * around[3],
    )


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _short(strength: Strength) -> str:
    """The case's name without what everybody knows, and the part where there are several."""
    name = strength.name
    for words in DISPENSABLE:
        name = name.replace(words, "")
    return f"{name}, {strength.part}" if strength.name.startswith("La Marquesa") else name


def _marker_handles(strengths: Sequence[Strength], ours: bool) -> list[Line2D]:
    dot = {"linestyle": "none", "marker": "o", "color": CASE_COLOUR, "markersize": 6}
    handles = []
    if any(not s.recalled for s in strengths if s.ratio is not None):
        handles.append(Line2D([], [], **dot, label="case history, as published"))
    handles.append(
        Line2D([], [], **dot, markerfacecolor="white", label="case history, partly recalled")
    )
    if ours:
        letter = {**dot, "color": OUR_COLOUR, "markersize": 9, "markeredgecolor": "white"}
        handles.append(Line2D([], [], **letter, label="our back-analysis (letters)"))
    return handles
