"""Measured surfaces: polylines in a CSV file next to the measurements of a case.

In: a CSV with the columns `x_m`, `y_m` and, where parts of the line are of different worth, `part`.
Out: a `Profile`. A file that is empty, unsorted or not a table of numbers is refused in one line.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pipeline.cli import InputError

COLUMNS = ("x_m", "y_m", "part")
#: Part name of a profile without the column `part`.
WHOLE = "surveyed"


@dataclass(frozen=True)
class Profile:
    """A measured surface: places (n,), elevations (n,) [m], and the part each vertex belongs to."""

    x: np.ndarray
    y: np.ndarray
    part: list[str]

    def pieces(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Stretches of one part each (part, x, y); a stretch starts where the one before ended."""
        pieces = []
        start = 0
        for end in range(1, len(self.part) + 1):
            if end == len(self.part) or self.part[end] != self.part[start]:
                first = max(start - 1, 0)
                pieces.append((self.part[start], self.x[first:end], self.y[first:end]))
                start = end
        return pieces

    def only(self, part: str | None) -> Profile:
        """The vertices of one part; None: all of them."""
        if part is None:
            return self
        kept = np.array([name == part for name in self.part], dtype=bool)
        return Profile(self.x[kept], self.y[kept], [part] * int(kept.sum()))


def load_profile(path: str | Path) -> Profile:
    """Read a surface profile: CSV with x_m, y_m and perhaps part; `#` starts a comment.

    Raises:
        InputError: no such file, no rows, a missing or unknown column, a value that is not a
            finite number, or x that does not ascend.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    numbered = _lines(path)
    # Line by line: a cell of this table never runs over several lines.
    cells = [next(csv.reader([line])) for _, line in numbered]
    columns = [name.strip() for name in cells[0]] if cells else []
    _check_columns(columns, path)
    rows = [dict(zip_longest(columns, row)) for row in cells[1:]]
    if len(rows) < 2:
        raise InputError(f"{path}: holds {len(rows)} points; a profile needs at least 2")
    lines = [number for number, _ in numbered[1:]]
    for line, row in zip(lines, cells[1:], strict=True):
        if any(cell.strip() for cell in row[len(columns) :]):
            raise InputError(
                f"{path}: line {line}: {len(row)} cells for {len(columns)} columns; decimals take "
                "a point, and nothing stands behind the last column"
            )
    points = np.array(
        [
            [_number(row, column, f"{path}: line {line}") for column in COLUMNS[:2]]
            for line, row in zip(lines, rows, strict=True)
        ]
    )
    for line, left, right in zip(lines[1:], points[:-1, 0], points[1:, 0], strict=True):
        if right <= left:
            raise InputError(
                f"{path}: line {line}: x_m {right:g} follows {left:g}; x_m must ascend from line "
                "to line"
            )
    parts = [(row.get("part") or WHOLE).strip() for row in rows]
    return Profile(points[:, 0], points[:, 1], parts)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Numbers and texts of the lines that are neither empty nor comments."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a UTF-8 text file") from None
    return [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _check_columns(columns: list[str], path: Path) -> None:
    for column in COLUMNS[:2]:
        if column not in columns:
            near = [name for name in columns if name.startswith(column[0])]
            found = f" (found {near[0]!r})" if near else ""
            raise InputError(
                f"{path}: column {column} is missing{found}; needed are x_m and y_m in metres, "
                "and part where the line has several"
            )
    for column in columns:
        if column not in COLUMNS:
            raise InputError(f"{path}: unknown column {column!r}; allowed are {', '.join(COLUMNS)}")


def _number(row: Mapping[str, str | None], column: str, where: str) -> float:
    try:
        value = float(row[column])  # type: ignore[arg-type]
    except (TypeError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{where}: {column}: {row[column]!r} is not a finite number")
    return value
