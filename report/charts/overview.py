"""The diagnosis in one picture: what was measured on top, what explains it below, S_r on the right.

In: a `DiagnosisData`. Out: a chart of up to four panels. The upper row has the measurements: how
far each is off before and after, and which S_r it asks for; the lower row the explanations: how
likely each is, and which S_r follows. Both panels on the right have one axis and one band, the
strength to use. Under them is how the answer could be refuted.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import ParameterWords
from report import style
from report.data.diagnosis import DiagnosisData
from report.data.overview import ExplanationRow, MeasurementRow, Overview, Range, overview
from report.numbers import fixed, percent, places_by, plural, unit_of
from report.sentences.diagnosis import (
    UNEXPLAINED,
    VERDICTS,
    explanation,
    quoted_value,
    refuted_sentence,
    shortened,
)

#: Inches: of the figure, of a row, and of what is around the panels.
WIDTH, ROW, LEFT, RIGHT, BETWEEN = 7.4, 0.38, 1.7, 1.3, 0.28
HEAD, ABOVE, BELOW, LINE, LEGEND = 0.3, 0.3, 0.48, 0.16, 0.17
#: Share of the width between the margins that the left panels take.
LEFT_SHARE = 0.47
#: Largest residual that is drawn in its place [std]; how far what is asked for is drawn beyond the
#: explanations, as a share of their range; ends of the axis of residuals, in the largest drawn.
MOST_STD, BEYOND, EDGE = 8.0, 0.4, 1.05
#: Characters of a name, of a line at the foot and of the heading; columns of the legend.
NAME, FOOT, LONGEST, COLUMNS = 26, 125, 88, 3
SHIFT = 0.17
COLOURS = (style.BEFORE, style.AFTER)


def draw_overview(data: DiagnosisData, *paths: Path) -> Path | None:
    """Save the picture under each path; the first of them, or None where there is nothing to show.

    A document has something to show if it has measurements or explanations.
    """
    figure = overview_figure(data)
    return None if figure is None else [style.save_figure(figure, path) for path in paths][0]


def overview_figure(data: DiagnosisData) -> Figure | None:
    """The picture, or None."""
    shown = overview(data)
    if not shown.measurements and not shown.explanations:
        return None
    foot = textwrap.wrap(refuted_sentence(data.verdict).replace(" ± ", "\xa0±\xa0"), FOOT)
    handles = _handles(data, shown)
    counts = [len(rows) for rows in (shown.measurements, shown.explanations) if rows]
    legend = LEGEND * math.ceil(len(handles) / COLUMNS) + 0.12
    bottom = legend + LINE * len(foot) + (0.16 if foot else 0.05)
    height = HEAD + sum(ROW * count + ABOVE + BELOW for count in counts) + bottom
    figure = style.new_figure(height, WIDTH)
    _write(figure, height - 0.2, _heading(data), fontsize=style.TEXT + 1, fontweight="bold")
    top = height - HEAD
    for rows in (shown.measurements, shown.explanations):
        if rows:
            top -= ABOVE + ROW * len(rows)
            _draw_row_of_panels(figure, top, shown, rows)
            top -= BELOW
    style.legend(figure, handles, columns=COLUMNS, y=bottom - legend)
    for place, line in enumerate(foot):
        _write(figure, bottom - legend - 0.16 - LINE * place, line, fontsize=style.SMALL)
    return figure


def _write(figure: Figure, up: float, text: str, *, left: float = 0.1, **more: object) -> None:
    """A line `up` inches above the foot and `left` inches from the edge."""
    at = left / figure.get_figwidth(), up / figure.get_figheight()
    figure.text(*at, style.words(text), color=style.TEXT_COLOUR, va="center", **more)


def _heading(data: DiagnosisData) -> str:
    """The verdict, and the strength to use."""
    found = data.verdict
    if found is None:
        return f"Base model against measurements: {getattr(data.document, 'alarm', '')}"
    used = [
        f"{p.words} {quoted_value(found, p.name, p.unit)}"
        for p in data.parameters
        if p.strength and p.name in found.quoted
    ]
    only = " (only a range)" if used and found.verdict in UNEXPLAINED else ""
    said = "; ".join([VERDICTS[found.verdict].capitalize(), *used])
    return textwrap.shorten(f"{said}{only}", LONGEST, placeholder="...")


def _draw_row_of_panels(
    figure: Figure,
    bottom: float,
    shown: Overview,
    rows: Sequence[MeasurementRow] | Sequence[ExplanationRow],
) -> None:
    """The panel of the rows, and on its right one for each strength."""
    count = len(shown.strengths)
    room = WIDTH - LEFT - (RIGHT if count == 1 else 0.15)
    wide = LEFT_SHARE * room if count else room
    ax = style.panel(figure, LEFT, bottom, wide, ROW * len(rows))
    _name_rows(ax, rows)
    asks = isinstance(rows[0], MeasurementRow)
    title = (_draw_residuals if asks else _draw_chances)(ax, rows)
    bold = {"fontsize": style.TEXT, "fontweight": "bold"}
    up = bottom + ROW * len(rows) + 0.13
    more = "" if asks or not shown.left_out else f" ({shown.left_out} more are not drawn)"
    _write(figure, up, title + more, **bold)
    left, each = LEFT + wide + BETWEEN, (room - wide) / max(count, 1) - BETWEEN
    for parameter in shown.strengths:
        beside = style.panel(figure, left, bottom, each, ROW * len(rows))
        _draw_strengths(beside, parameter, shown, rows)
        if parameter is shown.strengths[0]:
            title = "S_r that each asks for" if asks else "S_r that follows"
            _write(figure, up, title, left=left, **bold)
        left += each + BETWEEN


def _name_rows(ax: Axes, rows: Sequence[MeasurementRow] | Sequence[ExplanationRow]) -> None:
    style.quiet(ax, grid="x", left=False)
    ax.set_yticks(range(len(rows)), [_label(row) for row in rows], linespacing=1.15)
    ax.tick_params(axis="y", length=0, labelsize=style.SMALL, labelcolor=style.TEXT_COLOUR)
    ax.set_ylim(len(rows) - 0.42, -0.58)


def _label(row: MeasurementRow | ExplanationRow) -> str:
    """Two lines: the name, and how far it is off; of an explanation its name alone."""
    if isinstance(row, ExplanationRow):
        return style.wrapped(row.words or explanation(row.names), NAME, 2)
    count = len(row.off[0])
    role = "" if row.role == "fitted" else f" ({row.role})"
    name = f"{row.joined} {row.name}" if row.joined > 1 else shortened(row.name, NAME - len(role))
    said = " \N{RIGHTWARDS ARROW} ".join(_size(off) for off in row.off)
    numbers = "" if count == 1 else f"{plural(count, 'number')}: "
    return style.words(f"{name}{role}\n{numbers}{said} std")


def _size(off: Sequence[float]) -> str:
    """A residual with its sign, of several their root mean square."""
    if len(off) == 1:
        return f"{off[0]:+.1f}".replace("-", "\N{MINUS SIGN}")
    return fixed(math.sqrt(sum(one * one for one in off) / len(off)))


def _draw_residuals(ax: Axes, rows: Sequence[MeasurementRow]) -> str:
    largest = max(abs(one) for row in rows for off in row.off for one in off)
    reach = min(max(3.0, largest), MOST_STD)
    ax.set_xlim(-EDGE * reach, EDGE * reach)
    ax.axvspan(-2, 2, color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.8, zorder=1)
    for place, row in enumerate(rows):
        mark = style.ROLES[row.role][0]
        for at, off, colour in zip(_lines(place, len(row.off)), row.off, COLOURS, strict=False):
            _draw_off(ax, at, off, mark, colour)
    style.labels(ax, "measured \N{MINUS SIGN} modelled, standard deviations")
    ax.xaxis.label.set_size(style.SMALL)
    return "How far each measurement is off"


def _lines(place: float, count: int) -> list[float]:
    """Places of the lines of a row: before above after."""
    return [place] if count == 1 else [place - SHIFT, place + SHIFT]


def _draw_off(ax: Axes, at: float, off: Sequence[float], mark: str, colour: str) -> None:
    """One number as a mark; several as ticks about their mean, with a line from end to end."""
    reach = ax.get_xlim()[1] / EDGE
    within = [min(max(one, -reach), reach) for one in off]
    if len(off) > 1:
        ax.plot([min(within), max(within)], [at] * 2, color=colour, linewidth=1.0, zorder=2)
        ax.plot(within, [at] * len(within), "|", color=colour, markersize=7, zorder=2, alpha=0.7)
    middle = sum(off) / len(off)
    inside = abs(middle) <= reach
    shape = mark if inside else ">" if middle > 0 else "<"
    _draw_mark(ax, middle if inside else math.copysign(reach, middle), at, shape, colour)


def _draw_mark(ax: Axes, x: float, y: float, mark: str, colour: str, **more: object) -> None:
    style_of = {"color": colour, "markersize": 6.5, "markeredgecolor": "white", "zorder": 4}
    ax.plot([x], [y], marker=mark, linestyle="none", **{**style_of, **more})


def _draw_chances(ax: Axes, rows: Sequence[ExplanationRow]) -> str:
    """A bar for each explanation whose chance is known; words where it is not."""
    ax.set_xlim(0, 116)
    ax.set_xticks(range(0, 101, 25))
    for place, row in enumerate(rows):
        if row.chance is None:
            style.tell(ax, 0, place, row.note, color=style.NOTE)
            continue
        hatch = {"hatch": "////", "edgecolor": style.GREY} if row.kind == "else" else {}
        colour = {"base": style.BEFORE, "named": style.AFTER, "else": "white"}[row.kind]
        ax.barh(place, 100 * row.chance, height=0.5, color=colour, linewidth=0.8, zorder=3, **hatch)
        told = percent(row.chance) if row.chance >= 0.005 else "under 1 %"
        style.tell(ax, 100 * row.chance, place, told)
    style.labels(ax, "chance that it is right, %")
    ax.xaxis.label.set_size(style.SMALL)
    return "What explains it, and how likely that is"


# --- strengths ---


def shown_range(shown: Overview, name: str) -> tuple[float, float]:
    """Ends of the axis of a strength [kPa]: explanations, band, and what is asked for near them."""
    ends = [one for one in shown.bands[name] if math.isfinite(one)]
    for row in shown.explanations:
        ends += [one for one in row.strengths.get(name, ()) if one is not None]
    near = BEYOND * max(max(ends) - min(ends), 0.8 * max(ends))
    rows = shown.measurements
    asked = [end for row in rows for one in row.asked.get(name, ()) for end in one or ()]
    ends += [min(max(one, min(ends) - near), max(ends) + near) for one in asked]
    room = 0.06 * max(max(ends) - min(ends), 0.3 * max(ends))
    return max(min(ends) - room, 0.0), max(ends) + room


def _draw_strengths(
    ax: Axes,
    parameter: ParameterWords,
    shown: Overview,
    rows: Sequence[MeasurementRow] | Sequence[ExplanationRow],
) -> None:
    name = parameter.name
    style.quiet(ax, grid="x", left=False)
    ax.set_yticks([])
    ax.set_ylim(len(rows) - 0.42, -0.58)
    low, high = shown_range(shown, name)
    ax.set_xlim(low, high)
    first, last = shown.bands[name]
    ax.axvspan(first, min(last, high), color=style.OURS, alpha=0.13, linewidth=0, zorder=0)
    tell = len(shown.strengths) == 1
    for place, row in enumerate(rows):
        if isinstance(row, MeasurementRow):
            _draw_asked(ax, place, row, name, tell)
        elif name in row.strengths:
            _draw_explained(ax, place, row, row.strengths[name], tell)
    label = f"{parameter.words}, {unit_of(parameter.unit)}"
    style.labels(ax, style.wrapped(label, 40 if tell else 24, 1 if tell else 2))
    ax.xaxis.label.set_size(style.SMALL)


def _draw_asked(ax: Axes, place: int, row: MeasurementRow, name: str, tell: bool) -> None:
    asked = row.asked.get(name, [])
    if not any(asked):
        if not row.joined > 1 and row.asked:
            style.tell(ax, ax.get_xlim()[0], place, "does not notice $S_r$", color=style.NOTE)
        return
    mark = style.ROLES[row.role][0]
    for at, one, colour in zip(_lines(place, len(asked)), asked, COLOURS, strict=False):
        if one is not None:
            _draw_range(ax, at, one, mark, colour, tell=tell)


def _draw_explained(ax: Axes, place: int, row: ExplanationRow, one: Range, tell: bool) -> None:
    colour = {"base": style.BEFORE, "named": style.AFTER, "else": style.TEXT_COLOUR}[row.kind]
    _draw_range(ax, place, one, "o", colour, tell=tell, dashed=row.kind == "else")


def _draw_range(
    ax: Axes, at: float, one: Range, mark: str, colour: str, *, tell: bool, dashed: bool = False
) -> None:
    """A value with its range, cut at the edges of the panel, and both as text at its right."""
    left, right = ax.get_xlim()
    value, low, high = one
    line = {"linestyle": style.DASHED, "linewidth": 1.4} if dashed else {"linewidth": 2.2}
    ends = [min(max(end, left), right) for end in (low, high)]
    ax.plot(ends, [at] * 2, color=colour, alpha=0.75, zorder=3, **line)
    if value is not None:
        shape = "<" if value < left else ">" if value > right else mark
        _draw_mark(ax, min(max(value, left), right), at, shape, colour, clip_on=False)
    if tell:
        beside = {"transform": ax.get_yaxis_transform(), "va": "center", "fontsize": style.SMALL}
        ax.text(1.04, at, range_words(one), color=colour, **beside)


def range_words(one: Range) -> str:
    """A value with the ends of its range, to the same digits."""
    value, low, high = one
    if low == high:
        return "at a bound"
    places = min(places_by((high - low) / 4.0), 1)
    text = f"{fixed(low, places)} to {fixed(high, places)}"
    return text if value is None else f"{fixed(value, places)} ({text})"


# --- the legend ---


def _handles(data: DiagnosisData, shown: Overview) -> list[Artist]:
    """Only what is drawn."""
    final = data.final
    models = (
        ["base model"]
        if final is None
        else [
            "before: base model",
            f"after: with {shortened(explanation(list(final.effects)), 30)}",
        ]
    )
    rows = shown.measurements
    made = [_mark(label, colour) for label, colour in zip(models, COLOURS, strict=False)]
    if any(row.role == "held out" for row in rows):
        made.append(_mark("held out, not fitted", "white", "D", markeredgecolor=style.TEXT_COLOUR))
    if any(len(off) > 1 for row in rows for off in row.off):
        made.append(_mark("each number of several", style.GREY, "|", markersize=8))
    if rows:
        made.append(Patch(facecolor=style.LINE, alpha=0.55, label="95 % of noise"))
    if shown.strengths:
        words = "by all together, 95 %"
        if data.verdict is not None:
            only = data.verdict.verdict in UNEXPLAINED
            words = "$S_r$, only a range" if only else "$S_r$ to use, 95 %"
        made.append(Patch(facecolor=style.OURS, alpha=0.13, label=words))
        made.append(Line2D([], [], color=style.GREY, linewidth=2.2, label="95 % interval"))
    if any(row.kind == "else" and row.strengths for row in shown.explanations):
        label = "range of 9 in 10 slides on record"
        made.append(Line2D([], [], color=style.TEXT_COLOUR, linestyle=style.DASHED, label=label))
    return made


def _mark(label: str, colour: str, mark: str = "o", **more: object) -> Line2D:
    return Line2D(
        [],
        [],
        marker=mark,
        color=colour,
        linestyle="none",
        label=label,
        **{"markersize": 6, **more},
    )
