"""The one table of all reports: HTML on a page, aligned text on a terminal."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from io import StringIO

from pipeline.table import aligned

Cell = str | int | float | None

#: Characters of a cell that are kept on one line, and from which on it is given room.
SHORT, LONG = 14, 45
#: A number, its sign and its unit are not separated at the end of a line.
JOINED = re.compile(r"(?<=[\d±=<]) (?=[\d±%°]|(?:kPa|m|s|std)\b)|(?<=\bp) (?=[=<])")
NUMBER = re.compile(r"\(?[+-]?[\d.]+(?:e[+-]?\d+)?(?:[ %)/,]|$)")
SPACE = "\N{NO-BREAK SPACE}"
#: Characters of a line on a terminal, for tables that are folded to it.
TERMINAL = 120
#: Replacements for characters outside ASCII on a plain terminal or in a log.
PLAIN = str.maketrans(
    {
        "\N{MINUS SIGN}": "-",
        "±": "+-",
        "²": "2",
        "³": "3",
        "σ": "sigma",
        "°": " deg",
        SPACE: " ",
        "\N{RIGHTWARDS ARROW}": "->",
        "\N{HORIZONTAL ELLIPSIS}": "...",
    }
)


@dataclass(frozen=True)
class Table:
    """A table; None and NaN are shown as a dash on a page and as nothing on a terminal."""

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(f"a row has {len(row)} cells, the header has {len(self.header)}")

    def html(self) -> str:
        """The table as HTML; numbers are aligned to the right."""
        head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in self.header)
        body = "\n".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in self.rows)
        caption = f"<caption>{html.escape(self.caption)}</caption>" if self.caption else ""
        return (
            f'<div class="wide"><table>{caption}<thead><tr>{head}</tr></thead>'
            f"<tbody>\n{body}\n</tbody></table></div>"
        )

    def text(
        self,
        left: Collection[int] | None = None,
        *,
        without: Collection[str] = (),
        folded: bool = False,
    ) -> str:
        """The table as lines of plain text; empty without rows.

        Args:
            left: numbers of the columns aligned to the left; None: those with words in them.
            without: headers of columns that are left out.
            folded: long cells go over several lines where the table is wider than a terminal.
        """
        table = self.without_empty_columns(without)
        if not table.rows:
            return ""
        rows = [
            [plain("" if _missing(cell) else _shown(cell)) for cell in row]
            for row in (table.header, *table.rows)
        ]
        if left is None:
            left = [k for k, column in enumerate(zip(*rows[1:], strict=True)) if _words(column)]
        caption = f"{plain(self.caption)}\n" if self.caption else ""
        lines = aligned(rows, left=left)
        if folded and max(map(len, lines.splitlines())) > TERMINAL:
            lines = _folded(rows, left)
        return caption + lines

    def without_empty_columns(self, without: Collection[str] = ()) -> Table:
        """The table without columns that have nothing in them, or a header in `without`."""
        kept = [
            k
            for k in range(len(self.header))
            if self.header[k] not in without and any(row[k] not in (None, "") for row in self.rows)
        ]
        return replace(
            self,
            header=[self.header[k] for k in kept],
            rows=[[row[k] for k in kept] for row in self.rows],
        )


def _folded(rows: Sequence[Sequence[str]], left: Collection[int]) -> str:
    """Rows as lines that fit a terminal, long cells folded over several of them."""
    from rich.console import Console
    from rich.table import Table as Grid

    grid = Grid(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    for column, name in enumerate(rows[0]):
        width = max(len(row[column]) for row in rows)
        grid.add_column(
            name,
            justify="left" if column in left else "right",
            overflow="fold",
            no_wrap=column == 0 and width <= TERMINAL // 3,
        )
    for row in rows[1:]:
        grid.add_row(*row)
    console = Console(
        width=TERMINAL, color_system=None, file=StringIO(), markup=False, highlight=False
    )
    console.print(grid)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())


def text(words: str) -> str:
    """Text as HTML; a number stays on one line with its sign and its unit."""
    return html.escape(JOINED.sub(SPACE, words))


def plain(words: str) -> str:
    """Text for a terminal or a log, without the characters that some of them lack."""
    return words.translate(PLAIN).replace("( deg", "(deg")


def _missing(value: Cell) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))


def _shown(value: Cell) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _words(column: Sequence[str]) -> bool:
    """Most cells of a column do not begin with a number."""
    filled = [cell for cell in column if cell]
    return 2 * sum(NUMBER.match(cell) is None for cell in filled) > len(filled)


def _cell(value: Cell) -> str:
    if _missing(value):
        return "<td>&ndash;</td>"
    if isinstance(value, str):
        kind = ' class="short"' if len(value) <= SHORT else ' class="long"' * (len(value) >= LONG)
        return f"<td{kind}>{text(value)}</td>"
    return f'<td class="number">{_shown(value)}</td>'
