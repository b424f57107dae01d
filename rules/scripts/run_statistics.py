"""Statistics of the runs of one scale: a picture and a page, from the table of the runs.

In: `runs.csv` of `flowslide runs status --csv`. Out: `failed.txt`, `runs.png`,
`runs.html`. A run named in `failed.txt` is left out of everything later.
"""

from __future__ import annotations

import argparse
import csv
import statistics
from collections.abc import Sequence
from pathlib import Path

from pipeline.cli import InputError, base_parser, main_exit
from pipeline.files import write_text
from report.page import PageSection, Paragraph, Picture, write_page
from report.style import new_figure, save_figure, tidy
from report.table import Table

FINISHED, FAILED = "#2f6f9f", "#c8553d"

Row = dict[str, str]


def main(argv: Sequence[str] | None = None) -> None:
    """Read the table, draw the picture, write the page."""
    arguments = _parse(argv)
    rows = read_rows(arguments.table)
    write_text(arguments.failed, list_of_failed(rows))
    draw(rows, arguments.picture, title=f"Runs of the scale {arguments.name}")
    write_page(
        arguments.page,
        f"Runs of the scale {arguments.name}",
        [
            PageSection("Statistics", [Picture(arguments.picture, "four histograms of the runs")]),
            PageSection("By template", [by_template(rows)]),
            PageSection("Failed runs", [failures(rows)]),
            PageSection("All runs", [all_runs(rows)]),
        ],
        lead=summary(rows),
    )
    print(summary(rows))


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = base_parser("run_statistics.py", "Draw and tabulate the runs of one scale.")
    parser.add_argument("table", type=Path, help="runs.csv")
    parser.add_argument("--name", required=True, help="name of the scale")
    parser.add_argument("--failed", type=Path, required=True, help="list of failed runs to write")
    parser.add_argument("--picture", type=Path, required=True, help="png to write")
    parser.add_argument("--page", type=Path, required=True, help="html to write")
    return parser.parse_args(argv)


def read_rows(path: Path) -> list[Row]:
    """The rows of `runs.csv`; an `InputError` if there are none."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise InputError(f"{path}: lists no runs")
    return rows


def finished(rows: Sequence[Row]) -> list[Row]:
    """The runs that did not fail."""
    return [row for row in rows if row["status"] == "finished"]


def travel(row: Row) -> float:
    """The larger of the two distances that the mass spread, m."""
    return max(float(row["travel_left_m"]), float(row["travel_right_m"]))


def template(row: Row) -> str:
    """Letter of the random template."""
    return row["template"] or "other"


def summary(rows: Sequence[Row]) -> str:
    """The answer in one sentence."""
    good = finished(rows)
    text = f"{len(rows)} runs, {len(rows) - len(good)} failed"
    if good:
        distances = [travel(row) for row in good]
        steps = sum(float(row["points"]) * float(row["steps"]) for row in good)
        seconds = sum(float(row["wall_time_s"]) for row in good)
        text += f"; median travel {statistics.median(distances):.1f} m"
        text += f", longest {max(distances):.1f} m"
        if seconds > 0:
            text += f"; {seconds / 3600:.2f} h of one core's work"
            text += f" at {steps / seconds / 1e6:.1f} million point-steps/s"
    return text + "."


def draw(rows: Sequence[Row], path: Path, *, title: str) -> None:
    """Four histograms: runs by template, travel, time of motion, time of computing."""
    good = finished(rows)
    figure = new_figure(6.5, 10.0, layout="constrained")
    axes = figure.subplots(2, 2)
    figure.suptitle(title)
    names = sorted({template(row) for row in rows})
    counts = [sum(template(row) == name for row in good) for name in names]
    failed = [sum(template(row) == name for row in rows) for name in names]
    failed = [total - count for total, count in zip(failed, counts, strict=True)]
    axes[0, 0].bar(names, counts, color=FINISHED, label="finished")
    axes[0, 0].bar(names, failed, bottom=counts, color=FAILED, label="failed")
    axes[0, 0].set(xlabel="template", ylabel="runs")
    axes[0, 0].legend(frameon=False)
    for axis, values, label in (
        (axes[0, 1], [travel(row) for row in good], "travel (m)"),
        (axes[1, 0], [float(row["duration_s"]) for row in good], "motion simulated (s)"),
        (axes[1, 1], [float(row["wall_time_s"]) for row in good], "computing time of a run (s)"),
    ):
        axis.hist(values, bins=min(40, max(5, len(values) // 5)), color=FINISHED)
        axis.set(xlabel=label, ylabel="runs")
    for axis in axes.flat:
        tidy(axis)
        axis.yaxis.get_major_locator().set_params(integer=True)
    save_figure(figure, path)


def by_template(rows: Sequence[Row]) -> Table:
    """One line for each template."""
    lines = []
    for name in sorted({template(row) for row in rows}):
        some = [row for row in rows if template(row) == name]
        good = finished(some)
        walls = sum(bool(row["wall_contact"]) for row in good)
        distances = [travel(row) for row in good]
        median = statistics.median(distances) if distances else None
        lines.append([name, len(some), len(some) - len(good), walls, median])
    return Table(["template", "runs", "failed", "reached a wall", "median travel (m)"], lines)


def list_of_failed(rows: Sequence[Row]) -> str:
    """A line for each failed run: its number, and after a tab scene, seed, time and reason."""
    return "".join(
        f"{row['index']}\t{row['scene']}, seed {row['seed']}, at {row['duration_s']} s: "
        f"{row['reason']}\n"
        for row in rows
        if row["status"] != "finished"
    )


def failures(rows: Sequence[Row]) -> Table | Paragraph:
    """The failed runs with their reasons."""
    lines = [
        [row["index"], row["scene"], row["seed"], float(row["duration_s"]), row["reason"]]
        for row in rows
        if row["status"] != "finished"
    ]
    if not lines:
        return Paragraph("None.")
    return Table(["run", "scene", "seed", "stopped at (s)", "reason"], lines)


def all_runs(rows: Sequence[Row]) -> Table:
    """Every run in a line."""
    numbers = ("points", "steps", "duration_s", "wall_time_s", "travel_left_m", "travel_right_m")
    lines = [
        [row["index"], row["scene"], template(row), row["status"], row["wall_contact"]]
        + [float(row[name]) for name in numbers]
        for row in rows
    ]
    header = ["run", "scene", "template", "status", "walls", "points", "steps"]
    header += ["motion (s)", "computing (s)", "left (m)", "right (m)"]
    return Table(header, lines)


if __name__ == "__main__":
    main_exit(main)
