"""Pictures of a diagnosis for the documents: those of its page, as PNG.

    python -m benchmarks.hidden_effects.tutorial_pictures   # the example of the tutorial
    python -m benchmarks.hidden_effects.tutorial_pictures FOLDER --out docs/images/diagnosis

A folder that has no verdict yet is diagnosed first (about a minute).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from diagnosis.verdict.verdict import FILE_NAME
from flowslide.command_line import main as flowslide
from pipeline.cli import base_parser, main_exit
from report.charts.confounding import draw_confounding
from report.charts.fingerprints import draw_fingerprints
from report.charts.overview import draw_overview
from report.charts.profile import draw_profile
from report.charts.residuals import draw_residuals
from report.data.diagnosis import load_diagnosis

#: Of a picture: few, so that the checkout stays small.
COLOURS = 64
CASE = Path("docs/examples/hidden_effect")
OUT = Path("docs/images/diagnosis")
DRAWN = {
    "overview": draw_overview,
    "profile": draw_profile,
    "residuals": draw_residuals,
    "fingerprints": draw_fingerprints,
    "confounding": draw_confounding,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Draw."""
    parser = base_parser(
        "python -m benchmarks.hidden_effects.tutorial_pictures", __doc__.splitlines()[0]
    )
    default = Path("results") / CASE.name / "diagnosis"
    parser.add_argument("folder", nargs="?", type=Path, default=default, help="of a diagnosis")
    parser.add_argument("--out", type=Path, default=OUT, help=f"default: {OUT}")
    arguments: argparse.Namespace = parser.parse_args(argv)
    if not (arguments.folder / FILE_NAME).is_file():
        flowslide(["diagnose", "run", str(CASE), "--out", str(arguments.folder), "--page", "no"])
    data = load_diagnosis(arguments.folder)
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWN.items():
        path = draw(data, arguments.out / f"{name}.png")
        if path is not None:
            few = Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
            few.save(path, optimize=True)
    return 0


if __name__ == "__main__":
    main_exit(main)
