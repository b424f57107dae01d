"""`flowslide classical CASE`: Kinetics, ZIF and IMM on one case.

Prints a table and writes `classical.json` and one picture per slide. Judgement calls come from the
case's `classical.yaml`; an option given here replaces the same call of every slide.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from inversion.classical.analysis import Analysis
    from inversion.classical.judgement import Judgement
    from inversion.classical.sections_of_case import CaseSections

RESULT = "classical.json"

#: Options that replace a judgement call, by the name of its field in `Judgement`.
CALLS: list[tuple[str, str, dict[str, Any]]] = [
    (
        "--water",
        "water",
        {
            "help": "weights less uplift, total weights with water pressures, or no water",
            "choices": ("buoyant", "pore_pressure", "none"),
        },
    ),
    (
        "--water-line",
        "water_line",
        {
            "help": "level: still water at pool level in the whole mass; phreatic: as in the scene",
            "choices": ("level", "phreatic"),
        },
    ),
    (
        "--slip-surface",
        "slip_surface",
        {"help": "CSV next to classical.yaml (x_m, y_m), or `search`", "metavar": "FILE"},
    ),
    (
        "--base-strength",
        "base_strength",
        {
            "help": "of what lay there (place), what came (carried), or the weaker of the two",
            "choices": ("weaker", "place", "carried"),
        },
    ),
    (
        "--unit-weight-factor",
        "unit_weight_factor",
        {"help": "all densities times this", "type": float, "metavar": "F"},
    ),
    ("--method", "method", {"help": "of ZIF", "choices": ("spencer", "force", "ordinary")}),
    (
        "--zif-share",
        "zif_share",
        {"help": "zero inertial factor of ZIF", "type": float, "metavar": "F"},
    ),
    ("--sections", "sections", {"help": "number of sections of IMM", "type": int, "metavar": "N"}),
    (
        "--path-end",
        "path_end",
        {"help": "end slope of the path of Kinetics", "choices": ("slip", "level")},
    ),
    (
        "--path-stages",
        "path_stages",
        {
            "help": "which section's weight and lengths Kinetics takes",
            "choices": ("varying", "before", "after"),
        },
    ),
    ("--time-step", "time_step_s", {"help": "of Kinetics", "type": float, "metavar": "S"}),
]


DESCRIPTION = (
    "Find S_r by the classical methods on the sections before and after a slide. "
    "Each reports a value and a range over the judgement calls."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_case(parser)
    parser.add_argument(
        "--out", metavar="DIR", help="folder of the results; default: RESULTS/CASE/classical"
    )
    parser.add_argument(
        "--run", metavar="FILE", help="take the deposit of this trajectory as the section after"
    )
    parser.add_argument("--slide", metavar="NAME", help="one slide of the case alone")
    calls = parser.add_argument_group("judgement calls (see docs/method/classical.md)")
    for option, name, kind in CALLS:
        calls.add_argument(option, dest=name, default=None, **kind)
    calls.add_argument(
        "--liquefied-alone",
        action="store_true",
        help="leave the strength of soil that did not liquefy out",
    )
    options.add_measurements_code(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; 0 when done."""
    from geometry.case import load_case
    from inversion.classical.document import document, table
    from inversion.classical.sections_of_case import case_sections
    from pipeline.config import load_config
    from pipeline.files import write_json
    from report.pictures.classical import save_picture

    config = load_config(arguments.config, arguments.overrides)
    case = case_sections(load_case(arguments.case, config), run=arguments.run)
    out = Path(arguments.out or Path(config.results_folder) / case.name / "classical")
    analyses, refused = analyse_all(case, arguments)
    for analysis in analyses:
        print(table(case, analysis, every_option=not arguments.quiet), end="\n\n")
        save_picture(case, analysis, out / f"{_file_name(analysis.judgement.name)}.png")
    for reason in refused:
        print(f"Not analysed: {reason}")
    write_json(out / RESULT, document(case, analyses, refused))
    print(f"wrote {out / RESULT} and {len(analyses)} picture{'' if len(analyses) == 1 else 's'}")
    return 0


def analyse_all(
    case: CaseSections, arguments: argparse.Namespace
) -> tuple[list[Analysis], list[str]]:
    """Every slide of a case, and why others could not be analysed.

    Without a `classical.yaml` nobody has said that these sections make a slide, so sections that do
    not belong together are a finding and no error.

    Raises:
        InputError: what the file or the options ask for cannot be.
    """
    from inversion.classical.analysis import analyse
    from inversion.classical.judgement import FILE_NAME

    asked = (case.folder / FILE_NAME).is_file() or arguments.slide is not None
    analyses, refused = [], []
    try:
        judgements = _judgements(case, arguments)
    except InputError as problem:
        if asked or _changes(arguments):
            raise
        return [], [str(problem)]
    for judgement in judgements:
        try:
            analyses.append(analyse(case, judgement))
        except InputError as problem:
            if asked or _changes(arguments):
                raise
            refused.append(str(problem))
    return analyses, refused


def _judgements(case: CaseSections, arguments: argparse.Namespace) -> list[Judgement]:
    """The judgements of the case with the options given on the command line."""
    from pydantic import ValidationError

    from geometry.scenes.scene import document_error
    from inversion.classical.judgement import FILE_NAME, Judgement, load_judgements

    changes = _changes(arguments)
    judgements = load_judgements(case.folder, case.measurements)
    if arguments.slide is not None:
        names = [judgement.name for judgement in judgements]
        if arguments.slide not in names:
            raise InputError(f"--slide {arguments.slide}: the case has {', '.join(names)}")
        judgements = [j for j in judgements if j.name == arguments.slide]
    try:
        return [Judgement.model_validate(j.model_dump() | changes) for j in judgements]
    except ValidationError as error:
        raise InputError(document_error(error, f"{FILE_NAME} with the options given")) from None


def _changes(arguments: argparse.Namespace) -> dict[str, Any]:
    """Judgement calls given on the command line."""
    changes = {
        name: value for _, name, _ in CALLS if (value := getattr(arguments, name)) is not None
    }
    return changes | ({"count_others": False} if arguments.liquefied_alone else {})


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)
