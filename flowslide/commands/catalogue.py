"""`flowslide catalogue`: the catalogue as a table, and as a picture with our answers."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError

if TYPE_CHECKING:
    from inversion.catalogue.catalogue import Entry, Strength

FILE_NAME = "result.json"


DESCRIPTION = (
    "Print the catalogue of flow slides with the strengths others found, and draw "
    "strength ratio against blow count with the published correlations and our answers."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_out(parser, "picture: png, svg or pdf; default: none", metavar="FILE")
    parser.add_argument(
        "--result",
        action="append",
        metavar="FILE",
        help=f"{FILE_NAME} of a back-analysis, may be repeated; default: all of --results",
    )
    parser.add_argument(
        "--results",
        metavar="DIR",
        help=f"folder in which */inversion/{FILE_NAME} are looked for; default: results",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the table; draw the picture if asked."""
    from inversion.catalogue.catalogue import load_answers, load_catalogue, load_strengths

    found = arguments.result
    if found is None:
        found = sorted(_results(arguments.results).glob(f"*/inversion/{FILE_NAME}"))
    answers = load_answers(found)
    if arguments.out is not None and Path(arguments.out).is_dir():
        raise InputError(f"--out {arguments.out}: is a folder; give the name of a picture")
    if arguments.out is not None:
        from report.style import check_suffix  # before the table is printed

        check_suffix(arguments.out)
    print(catalogue_table(load_catalogue(), load_strengths()))
    for answer in answers:
        print(
            f"our answer: {answer.title}, {answer.label}: {answer.words}, "
            f"ratio {answer.ratio_words}".replace("±", "+-")
        )
    if arguments.out is not None:
        from report.charts.catalogue import draw_catalogue  # matplotlib takes its time

        draw_catalogue(arguments.out, answers)
        print(f"wrote {arguments.out}")
    return 0


def _results(given: str | None) -> Path:
    """The folder of --results; without it `results`, which need not be there yet.

    Raises:
        InputError: a folder that was named is not there.
    """
    if given is not None and not Path(given).is_dir():
        raise InputError(f"--results {given}: no such folder")
    return Path("results" if given is None else given)


def catalogue_table(entries: Sequence[Entry], strengths: Sequence[Strength]) -> str:
    """Cases and strengths as text; what is recalled says so."""
    from pipeline.table import aligned

    heading = [
        "case",
        "length m",
        "height m",
        "template",
        "S_r kPa",
        "range",
        "by",
        "sigma'_v0",
        "(N1)60",
        "",
    ]
    rows = [heading]
    for entry in entries:
        size = [f"{entry.length_m:g}", f"{entry.height_m:g}", entry.template]
        found = [strength for strength in strengths if strength.name == entry.name]
        if not found:
            rows.append([entry.name, *size, *[""] * 6])
        for number, strength in enumerate(found):
            first = [entry.name, *size] if number == 0 else [""] * 4
            rows.append([*first, *_strength_cells(strength)])
    return aligned(rows, left={0, 3, 6, 9})


def _strength_cells(strength: Strength) -> list[str]:
    span = "" if strength.low_kpa is None else f"{strength.low_kpa:g}-{strength.high_kpa:g}"
    by = strength.source + (f", {strength.part}" if strength.part else "")
    trust = strength.confidence
    if strength.soil_confidence and strength.soil_confidence != strength.confidence:
        trust += f"; stress and blow count {strength.soil_confidence}"
    return [
        f"{strength.s_r_kpa:.1f}",
        span,
        by,
        "" if strength.sigma_v0_kpa is None else f"{strength.sigma_v0_kpa:g}",
        "" if strength.n1_60 is None else f"{strength.n1_60:g}",
        trust,
    ]
