"""What is measured: rows, in one JSON file that is whole after every measurement."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pipeline.cli import InputError
from pipeline.files import read_json, write_json
from pipeline.table import aligned

HEADING = ("measured", "value", "unit", "beside it")


def row(what: str, value: float | None = None, unit: str = "", beside: str = "") -> dict[str, Any]:
    """One figure.

    Args:
        what: is measured.
        value: None: there is no figure, and `beside` says why.
        unit: of the value.
        beside: what it is to be compared with, or why it is missing.
    """
    return {"what": what, "value": value, "unit": unit, "beside": beside}


class Record:
    """The rows measured so far, by stage and measurement.

    Args:
        path: of the file; need not be there.
        made: what rows of one file have in common, such as the device.

    Raises:
        InputError: the file holds rows of something else.
    """

    def __init__(self, path: Path, made: dict[str, Any]) -> None:
        self.path, self.made = path, made
        self.rows: list[dict[str, Any]] = []
        if path.is_file():
            document = read_json(path)
            if document.get("made") != made:
                raise InputError(
                    f"{path}: made: {document.get('made')}, not {made}; give another --out"
                )
            self.rows = document["rows"]

    def add(self, stage: str, measurement: str, rows: Iterable[dict[str, Any]]) -> None:
        """Keep and print the rows of a measurement."""
        found = [{"stage": stage, "measurement": measurement, **one} for one in rows]
        self.rows += found
        write_json(self.path, {"made": self.made, "rows": self.rows})
        for one in found:
            print(f"{stage}: {'  '.join(filter(None, cells(one)))}", flush=True)

    def fail(self, stage: str, measurement: str, why: str) -> None:
        """Keep the error of a measurement in the place of its rows."""
        self.add(stage, measurement, [{**row(measurement, beside=why), "failed": True}])

    def forget_failures(self) -> None:
        """What failed is measured again."""
        self.rows = [one for one in self.rows if not one.get("failed")]

    def tried(self, stage: str, measurement: str) -> bool:
        """Whether there are rows of a measurement, or its error."""
        return any((one["stage"], one["measurement"]) == (stage, measurement) for one in self.rows)

    def value(self, stage: str, what: str) -> float | None:
        """A figure that was measured before; None: it was not."""
        found = [one["value"] for one in self.rows if (one["stage"], one["what"]) == (stage, what)]
        return found[-1] if found else None

    def table(self) -> str:
        """All rows as a table."""
        stages = list(dict.fromkeys(one["stage"] for one in self.rows))
        lines: list[tuple[str, ...]] = [HEADING]
        for stage in stages:
            lines.append((f"-- {stage}", "", "", ""))
            lines += [cells(one) for one in self.rows if one["stage"] == stage]
        return aligned(lines, left=(0, 2, 3))


def cells(one: dict[str, Any]) -> tuple[str, str, str, str]:
    """A row as it is printed."""
    value = "" if one["value"] is None else f"{one['value']:.4g}"
    beside = f"FAILED: {one['beside']}" if one.get("failed") else one["beside"]
    return one["what"], value, one["unit"], beside
