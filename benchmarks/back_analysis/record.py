"""What was measured: one record for each part, in `results.json` as soon as the part is done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.back_analysis.figures import Figure
from benchmarks.generated_pages import Measured
from inversion import PHYSICS_VERSION as INVERSION_VERSION
from mpm_taichi import PHYSICS_VERSION
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version, machine

RESULTS = Path(__file__).resolve().parent / "results.json"

PARTS = (
    "lower_san_fernando", "derivative", "wall_time", "reservoir", "la_marquesa", "misfits",
    "classical_methods", "twins",
)  # fmt: skip
"""Modules with a `TITLE` and a `run(folder, quick=...)`, in the order of the page."""

Record = dict[str, Any]


def make_record(measured: Measured) -> Record:
    """The record of a part; `error` is empty where it ran to its end."""
    return {
        "title": measured.title,
        "made": datetime.now(UTC).date().isoformat(),
        "seconds": round(measured.seconds, 1),
        "code_version": code_version(),
        "physics": {"mpm": PHYSICS_VERSION, "inversion": INVERSION_VERSION},
        "processor": machine()["processor"],
        "error": measured.error,
        "figures": [asdict(figure) for figure in measured.rows],
    }


def figures_of(record: Record) -> list[Figure]:
    """The figures of a record."""
    return [Figure(**figure) for figure in record["figures"]]


def missed(record: Record) -> list[str]:
    """What is not as asked."""
    found = [figure.quantity for figure in figures_of(record) if figure.met is False]
    return found + ([f"did not run to its end: {record['error']}"] if record["error"] else [])


def read_records(path: Path | None = None) -> dict[str, Record]:
    """All records by part, in the order of the page; none where there is no file."""
    path = path or RESULTS
    if not path.exists():
        return {}
    stored = read_json(path)["parts"]
    return {name: stored[name] for name in PARTS if name in stored}


def write_records(records: Mapping[str, Record], path: Path | None = None) -> None:
    """Write all records, whole or not at all."""
    write_json(path or RESULTS, {"parts": {n: records[n] for n in PARTS if n in records}})
