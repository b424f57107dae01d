"""Truths and verdicts together: seals are checked, then everything is kept in one small table.

The table is the benchmark's record: a line per case with what was hidden, what was said by the
method and by each ablation, and the hash that was published before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import Field

from benchmarks.hidden_effects.making.benchmark import Benchmark, Places
from benchmarks.hidden_effects.making.make import sealed_cases
from benchmarks.hidden_effects.making.seal import is_sealed
from benchmarks.hidden_effects.run import METHOD, VARIANTS
from benchmarks.hidden_effects.scoring.curves import recovered, runs_alike
from benchmarks.hidden_effects.scoring.digest import Digest, load_digest
from benchmarks.hidden_effects.scoring.records import checked_rows, read_truth
from benchmarks.hidden_effects.scoring.score import Judged
from pipeline.cli import InputError
from pipeline.config import validate_settings
from pipeline.documents import StrictDocument
from pipeline.files import read_json, write_text

Row = dict[str, Any]
"""`truth`, `sha256`, and `verdicts`: variant -> digest."""


def open_truths(places: Places, variants: Sequence[str]) -> list[Row]:
    """The cases that the method has judged, with their truths.

    Raises:
        InputError: a truth is not the one that was sealed, or a file is not of its form.
    """
    rows = []
    for sealed in sealed_cases(places):
        name = sealed["name"]
        if not places.verdict(name, METHOD).is_file():
            continue
        truth = read_truth(places.truth(name))
        if not is_sealed(truth, sealed["sha256"]):
            raise InputError(f"{places.truth(name)}: is not the truth that was sealed")
        verdicts = {
            variant: load_digest(places.verdict(name, variant)).model_dump(mode="json")
            for variant in variants
            if places.verdict(name, variant).is_file()
        }
        rows.append({"truth": truth, "sha256": sealed["sha256"], "verdicts": verdicts})
    return checked_rows(rows, str(places.out))


def save_rows(rows: Sequence[Row], path: str | Path) -> None:
    """Write the record, one line for each case."""
    import json

    lines = [json.dumps(row, separators=(",", ":"), allow_nan=False) for row in rows]
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


Slides = TypeVar("Slides", bound="SlideRow")


class SlideRow(StrictDocument):
    """A row on one slide, in a record of several sets."""

    of: str = Field(description="words for its set")
    truth: dict[str, Any] = Field(description="what `strangers.KEPT` names of it")


def load_slides(kind: type[Slides], path: Path) -> list[Slides]:
    """A record of several sets; empty where there is none.

    Raises:
        InputError: not of this form; one line.
    """
    rows = read_json(path) if path.is_file() else []
    return [validate_settings(kind, row, origin=str(path)) for row in rows]


def add_slides(kind: type[Slides], found: Sequence[Slides], path: Path) -> None:
    """Add slides to a record; of one that is there the newer row stays."""
    rows = {(one.of, one.truth["name"]): one for one in [*load_slides(kind, path), *found]}
    save_rows([rows[key].model_dump(mode="json") for key in sorted(rows)], path)


def load_rows(path: str | Path) -> list[Row]:
    """Read a record; the seals of its truths are checked again.

    Raises:
        InputError: no such file, not of its form, or a truth that does not match its hash.
    """
    rows = checked_rows(read_json(path), str(path))
    for row in rows:
        if not is_sealed(row["truth"], row["sha256"]):
            raise InputError(f"{path}: {row['truth'].get('name')}: is not what was sealed")
    return rows


def judged(rows: Sequence[Row], benchmark: Benchmark, variant: str) -> list[Judged]:
    """What the score takes, of the cases that a variant has judged."""
    found = []
    for row in rows:
        if variant in row["verdicts"]:
            digest = validate_settings(Digest, row["verdicts"][variant], origin="record")
            found.append(Judged(row["truth"], digest, *_law(row["truth"], digest, benchmark)))
    return found


def shared(by_variant: Mapping[str, Sequence[Judged]]) -> dict[str, list[Judged]]:
    """The method and its ablations, each on the cases that all of them have judged."""
    chosen = [name for name in VARIANTS if by_variant.get(name)]
    if chosen == [METHOD]:
        return {}
    named = [{one.truth["name"] for one in by_variant[name]} for name in chosen]
    common = set.intersection(*named)
    return {
        name: [one for one in by_variant[name] if one.truth["name"] in common] for name in chosen
    }


def _law(
    truth: Mapping[str, Any], digest: Digest, benchmark: Benchmark
) -> tuple[bool | None, bool]:
    """Of a strength law outside the library: its curve was recovered, a law like it was named.

    The first is None where there is no law.
    """
    if truth["kind"] != "outside" or "source" in truth:
        return None, False
    (name,) = truth["effects"]
    law = benchmark.plan.laws.get(name)
    if law is None:
        return None, False
    section = benchmark.section(truth)
    scene = section.scene.changed(effects=dict(truth["effects"]))
    curve = recovered(digest.curve, scene, name, law)
    return curve, runs_alike(digest.effects, scene, name, law)
