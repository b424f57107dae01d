"""`flowslide runs status`: the runs of trajectory files, and which of them failed."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpm_taichi.trajectory import RunSummary

DESCRIPTION = "List the runs of trajectory files, and which of them failed."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="trajectory files")
    parser.add_argument(
        "--csv", metavar="FILE", help="write the list there; then only the failures are printed"
    )


def run(arguments: argparse.Namespace) -> None:
    """List them."""
    from mpm_taichi.trajectory import list_runs

    listed = [(path, run) for path in arguments.files for run in list_runs(path)]
    runs = [run for _, run in listed]
    if arguments.csv is not None:
        write_runs_table(Path(arguments.csv), listed)
    else:
        print(_table(runs))
    for one in runs:
        if one.status == "failed":
            print(failure_line(one))
    print(totals(runs))


def failure_line(run: RunSummary) -> str:
    """One line that names a failed run: number, scene, seed, time, reason."""
    return (
        f"failed: run {run.index} ({run.scene}, seed {run.seed}) at {run.duration_s:.3g} s: "
        f"{run.reason}"
    )


def totals(runs: Sequence[RunSummary]) -> str:
    """Runs, failures, speed, in a few words."""
    failed = sum(run.status == "failed" for run in runs)
    work = sum(run.points * run.steps for run in runs)
    seconds = sum(run.wall_time_s for run in runs)
    rate = f", {work / seconds / 1e6:.1f} million point-steps/s" if seconds > 0 else ""
    return f"{len(runs)} runs, {failed} failed{rate}"


def write_runs_table(path: Path, runs: Sequence[tuple[str, RunSummary]]) -> None:
    """Write (trajectory file, run) rows as CSV, one column a field of `RunSummary`."""
    from dataclasses import fields

    from mpm_taichi.trajectory import RunSummary
    from pipeline.files import atomic_path

    names = [field.name for field in fields(RunSummary) if field.name != "key"]
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["file", *names])
        for source, run in runs:
            values = (getattr(run, name) for name in names)
            texts = [f"{value:.6g}" if isinstance(value, float) else value for value in values]
            writer.writerow([source, *texts])


def _table(runs: Sequence[RunSummary]) -> str:
    """The runs as text, columns aligned."""
    from pipeline.table import aligned

    heading = [
        "run",
        "scene",
        "points",
        "steps",
        "motion s",
        "wall s",
        "Mps/s",
        "left m",
        "right m",
        "status",
    ]
    rows = [
        [
            str(run.index),
            run.scene,
            str(run.points),
            str(run.steps),
            f"{run.duration_s:.1f}",
            f"{run.wall_time_s:.2f}",
            f"{run.point_steps_per_s / 1e6:.1f}",
            f"{run.travel_left_m:.1f}",
            f"{run.travel_right_m:.1f}",
            f"{run.status} {'(wall ' + run.wall_contact + ')' if run.wall_contact else ''}".strip(),
        ]
        for run in runs
    ]
    return aligned([heading, *rows], left={1, len(heading) - 1})
