"""`blind reopen`: the files of an opened set, written again from its record.

A record keeps what every slide measured, so that another version of the method can judge the same
slides without making them again. They are no longer blind: a rule that was made by looking at them
shows here what it changes, not how good it is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places
from benchmarks.hidden_effects.making.make import write_case
from benchmarks.hidden_effects.making.plan import Planned
from benchmarks.hidden_effects.making.truth import Made
from benchmarks.hidden_effects.scoring.digest import METHOD
from pipeline.cli import InputError
from pipeline.files import write_json


def reopen(
    rows: Sequence[Mapping[str, Any]], benchmark: Benchmark, places: Places, names: Collection[str]
) -> int:
    """Write cases, truths and hashes of an opened set.

    Args:
        rows: of its record.
        benchmark: its plan.
        places: where to.
        names: of cases, or verdicts that the record has of them; empty: all.

    Returns:
        how many cases were written.

    Raises:
        InputError: there is no such case, or the record is not of this plan.
    """
    found = [
        row
        for row in rows
        if not names or {row["truth"]["name"], row["verdicts"][METHOD]["verdict"]} & set(names)
    ]
    if not found:
        raise InputError(f"--cases: none of {', '.join(names)} is in the record")
    for row in found:
        _write(row["truth"], benchmark, places)
    sealed = [
        {key: row["truth"][key] for key in ("name", "section", "survey")}
        | {"sha256": row["sha256"]}
        for row in found
    ]
    write_json(places.sealed, sealed)
    return len(found)


def _write(truth: Mapping[str, Any], benchmark: Benchmark, places: Places) -> None:
    """One case as it was given to the judge, and its truth."""
    plan, section = benchmark.plan, benchmark.section(truth)
    measured, where = np.array(truth["measured"]), np.array(truth["places"])
    documents = surveys.documents(section, truth["survey"], measured, where)
    profile = np.column_stack([where, measured[: len(where)]])
    planned = Planned(
        truth["name"], truth["kind"], tuple(truth["effects"]), section.name, truth["survey"], 0
    )
    source = plan.sources[truth["source"]] if "source" in truth else None
    made = Made(dict(truth), documents, profile)
    write_case(section, planned, made, places, plan.duration_s, source, plan.stated)
    write_json(places.truth(planned.name), made.truth)
