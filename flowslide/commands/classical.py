"""`flowslide classical CASE`: Kinetics, ZIF and IMM on one case.

Prints a table and writes `classical.json`, its page and one picture per slide. Judgement calls come
from the `classical.yaml` of the case; an option given here replaces the same call of every slide.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from flowslide.commands import options
from pipeline.cli import add_common

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
    from flowslide import api
    from flowslide.run import Call
    from pipeline.config import load_config
    from pipeline.files import working_in

    settings = load_config(arguments.config, arguments.overrides)
    case = api.load_case(arguments.case, settings=settings)
    out = Path(arguments.out or Path(settings.results_folder) / case.name / "classical")
    with working_in(out):
        found = api.analysed_classically(
            case, Call(), arguments.run, arguments.slide, _changes(arguments)
        )
        for analysis in found.analyses:
            print(found.table(analysis, every_option=not arguments.quiet), end="\n\n")
        for reason in found.refused:
            print(f"Not analysed: {reason}")
        found.save(out)
    print(f"wrote {out}")
    return 0


def _changes(arguments: argparse.Namespace) -> dict[str, Any]:
    """Judgement calls given on the command line."""
    changes = {
        name: value for _, name, _ in CALLS if (value := getattr(arguments, name)) is not None
    }
    return changes | ({"count_others": False} if arguments.liquefied_alone else {})
