"""What the diagnosis says of laboratory experiments of which it is known what their model lacks.

    python -m benchmarks.studies.diagnosed_experiments [--cases aluminium_bars ...] [--page]

Each case of `case_histories/experiments` is diagnosed as `flowslide diagnose` does it; its page and
its runs are kept in `results/benchmarks/diagnosed_experiments/<case>`, so a study that was stopped
resumes. A verdict is judged by its name: one that is right, none (silence), or one that is false;
without a name by the explanation that leads, too.
What is found is kept in `diagnosed_experiments.json` and shown on `docs/records/diagnosed-dams.md`.
`--page` only renews that page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import flowslide
from benchmarks.generated_pages import RECORDS, ROOT, renew, table
from geometry.scenes.scene import load_scene
from pipeline.cli import base_parser, main_exit
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version
from report.diagnosis import write_report

RECORD = Path(__file__).with_suffix(".json")
PAGE = RECORDS / "diagnosed-dams.md"
CASES = ROOT / "case_histories" / "experiments"
FOLDER = ROOT / "results/benchmarks/diagnosed_experiments"
COARSEST = 2.0
"""Spacing [m] that is fine enough for every experiment."""
UNKNOWN = "unknown_effect"
"""The verdict that something is missing that has no name."""


@dataclass(frozen=True)
class Known:
    """What is known to be wrong in the model of an experiment.

    Attributes:
        missing: in words.
        names: hypotheses that say so; none: nothing is to be seen.
        enough: the measurements are enough to see it.
    """

    missing: str
    names: frozenset[str] = frozenset()
    enough: bool = False


_RATE = Known("friction that rises with the rate of shear", frozenset({"inertial_friction"}))
EXPERIMENTS: dict[str, Known] = {
    "aluminium_bars": replace(_RATE, enough=True),
    "granular_column": _RATE,
    "granular_column_tall": _RATE,
    "granular_column_short": Known("hardly anything: a thick slow slide"),
    "granular_cylinder": Known(
        "the third dimension: it spreads to all sides", frozenset({"radial_spreading"})
    ),
    "granular_slope": Known(
        "the inclination of the plane, 10 degrees",
        frozenset({"base_tilt", "foreland_on_the_right"}),
    ),
    "aluminium_bars_smooth_floor": Known(
        "the floor is rough; put in: a slippery one",
        frozenset({"rough_base", "bonded_base", "base_friction"}),
        enough=True,
    ),
    "aluminium_bars_in_water": Known(
        "the bars were dry; put in: 20 m of water",
        frozenset({"no_water", "pool_level", "drawdown"}),
    ),
}


def judged(known: Known, verdict: str, leading: Sequence[str]) -> str:
    """What a verdict is: `right`, `right leads`, `silent`, `missed` or `false`.

    It is `silent` without a right name, `missed` if the data are enough for one; `right leads`
    where no name is given and the right one has most of the probability.

    Args:
        known: of the experiment.
        verdict: in one word.
        leading: the explanation that leads, or the members of its family.
    """
    if verdict != "identified" and known.names.intersection(leading):
        return "right leads"
    named = leading
    if verdict == UNKNOWN:
        named = [] if known.names else [UNKNOWN]
    elif verdict != "identified":
        named = []
    if named:
        return "right" if known.names.intersection(named) else "false"
    if not known.names:
        return "right"
    return "missed" if known.enough else "silent"


def fine_enough(name: str) -> float:
    """Spacing [m] of a twentieth of the height of an experiment, at most `COARSEST`."""
    return min(COARSEST, load_scene(CASES / name / "scene.yaml").height / 20.0)


def found_of(name: str, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept of a verdict."""
    answer, base, final = (verdict[part] for part in ("answer", "base", "final"))
    named = answer["members"] or [effect["name"] for effect in answer["effects"]]
    return {
        "verdict": verdict["verdict"],
        "leading": named,
        "judged": judged(EXPERIMENTS[name], verdict["verdict"], named),
        "tested": len(verdict["tested"]),
        "runs": verdict["runs"]["asked"],
        "models": [_model(base), _model(final)],
    }


def _model(summary: Mapping[str, Any]) -> dict[str, Any]:
    kept = {name: round(value, 3) for name, value in summary["values"].items()}
    error = {name: round(value, 3) for name, value in summary["std"].items()}
    held_out = summary["held_out"]
    return {
        "values": kept,
        "std": error,
        "chi2": round(summary["chi2"], 2),
        "dof": summary["dof"],
        "held_out": round(held_out["chi2"], 2),
        "held_out_numbers": held_out["n"],
    }


def shown(stored: Mapping[str, Any]) -> str:
    """The table of the page."""
    rows = []
    for name, known in EXPERIMENTS.items():
        if name not in stored["cases"]:
            continue
        one = stored["cases"][name]
        names = ", ".join(word.replace("_", " ") for word in one["leading"])
        if names and one["verdict"] != "identified":
            names += " leads"
        rows.append([
            f"`{name}`", known.missing, one["verdict"].replace("_", " ") + (names and f": {names}"),
            one["judged"],
            *(_both(one["models"], text) for text in (_friction, _misfit, _held_out)),
        ])  # fmt: skip
    header = ("experiment", "what is known to be missing or wrong", "verdict", "which is",
              "friction (degrees)", "chi2, on", "held out, on")  # fmt: skip
    return table(header, rows, "llllrrr")


def _both(models: Sequence[Mapping[str, Any]], text: Any) -> str:
    before, after = (text(model) for model in models)
    return before if before == after else f"{before} → {after}"


def _friction(model: Mapping[str, Any]) -> str:
    return f"{model['values']['friction']:.1f} ± {model['std']['friction']:.1f}"


def _misfit(model: Mapping[str, Any]) -> str:
    return f"{model['chi2']:.1f} / {model['dof']}"


def _held_out(model: Mapping[str, Any]) -> str:
    numbers = model["held_out_numbers"]
    return f"{model['held_out']:.1f} / {numbers}" if numbers else "none"


def _stored() -> dict[str, Any]:
    """What other runs of the study, which may go on at the same time, have kept."""
    return read_json(RECORD) if RECORD.exists() else {"cases": {}}


def main(argv: Sequence[str] | None = None) -> int:
    """Diagnose, print, keep, and renew the page."""
    parser = base_parser("python -m benchmarks.studies.diagnosed_experiments",
                         "Experiments of which it is known what their model lacks.")  # fmt: skip
    parser.add_argument("--cases", nargs="+", choices=list(EXPERIMENTS), default=list(EXPERIMENTS))
    parser.add_argument(
        "--spacing", type=float, help="of points [m]; default: a twentieth of the height, at most 2"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--page", action="store_true", help="only renew the page")
    options = parser.parse_args(argv)
    version = code_version()  # before the record itself changes
    for name in [] if options.page else options.cases:
        folder, spacing = FOLDER / name, options.spacing or fine_enough(name)
        verdict = flowslide.diagnose(CASES / name, out=folder, spacing_m=spacing,
                                     threads=options.threads)  # fmt: skip
        write_report(folder)
        kept = found_of(name, verdict.model_dump()) | {"spacing_m": spacing}
        print(f"{name}: {kept['verdict']} {kept['leading']} ({kept['judged']})", flush=True)
        cases = _stored()["cases"] | {name: kept}
        ordered = {each: cases[each] for each in EXPERIMENTS if each in cases}
        write_json(RECORD, {"code_version": version, "cases": ordered})
    renew(PAGE, experiments=shown(_stored()))
    return 0


if __name__ == "__main__":
    main_exit(main)
