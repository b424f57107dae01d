"""The example of the tutorial: a slide with one effect more than a plain simulation has.

    python -m benchmarks.hidden_effects.example   # writes docs/examples/hidden_effect*/

The slide is simulated with other cells, another time step and its points in other places than a
diagnosis has, surveyed as `survey.yaml` says, and the survey's errors are added. What is true goes
into a file of its own; the README next to the survey has its hash alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.laboratory import Laboratory, Request
from benchmarks.hidden_effects.making.seal import SALT, salt_of, seal
from benchmarks.hidden_effects.making.sections import Section, load_section, normal
from pipeline.cli import base_parser, main_exit
from pipeline.config import Config
from pipeline.files import write_json, write_text, yaml_text
from pipeline.random_numbers import Stream, number_of

FOLDER = Path("docs/examples/hidden_effect")
TRUTH = Path("docs/examples/hidden_effect_truth.json")
SURVEY = "history"
SEED = 1971
"""Of the survey's errors."""
VALUES = {"residual_strength": 9.2, "friction_fill": 33.1}
EFFECTS = {"overburden_strength": 0.45}
SPACING_FACTOR, JITTER, COURANT = 0.8, 0.5, 0.2


def main(argv: Sequence[str] | None = None) -> int:
    """Simulate, survey, seal."""
    parser = base_parser("python -m benchmarks.hidden_effects.example", __doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=None, help="CPU threads; default: all")
    arguments: argparse.Namespace = parser.parse_args(argv)
    print(f"sealed: {make(FOLDER, TRUTH, threads=arguments.threads)}")
    return 0


def make(folder: Path, truth_path: Path, *, threads: int | None = None) -> str:
    """Write the survey into the folder of the section, and the truth; return the truth's hash."""
    section = load_section(folder)
    request = Request(
        values=tuple(VALUES[name] for name in section.parameters.names),
        effects=EFFECTS,
        spacing_factor=SPACING_FACTOR,
        jitter=JITTER,
        seed=SEED,
        courant=COURANT,
    )
    (deposit,) = Laboratory(Config().simulation, threads=threads).deposits(section, [request])
    if deposit is None:
        raise RuntimeError("the slide failed or did not come to rest")
    places = surveys.profile_places(section, surveys.toe_of(section, deposit))
    entries = surveys.with_values(section, SURVEY, places, None)
    stream = Stream(SEED, number_of(section.name))
    factor = np.linalg.cholesky(surveys.covariance_of(entries))
    errors = factor @ np.array([normal(stream) for _ in range(len(factor))])
    measured = np.round(surveys.reading(entries, deposit) + errors, 3)
    truth = {
        "effects": EFFECTS,
        "parameters": VALUES,
        "spacing_factor": SPACING_FACTOR,
        "jitter_seed": SEED,
        "courant": COURANT,
        SALT: salt_of(SEED, section.name),
    }
    write_survey(section, folder, measured, places)
    write_json(truth_path, truth)
    return seal(truth)


def write_survey(section: Section, folder: Path, measured: np.ndarray, places: np.ndarray) -> None:
    """Write `measurements.yaml` and the profile it names.

    Args:
        section: where the survey was made.
        folder: of the case.
        measured: all values in the order of the survey, (m,) [m].
        places: of the profile, (n,) [m].
    """
    rows = [f"{x:.2f},{y:.3f}" for x, y in zip(places, measured, strict=False)]
    write_text(folder / surveys.PROFILE_FILE, "\n".join(["x_m,y_m", *rows]) + "\n")
    document = {
        "case": section.name,
        "upstream": section.survey.side,
        "axes": "x from the left foot before the slide, y above the firm ground",
        "initial": {},
        "default_set": "survey",
        "sets": {"survey": surveys.documents(section, SURVEY, measured, places)},
    }
    head = "# Made by python -m benchmarks.hidden_effects.example.\n"
    text = yaml_text(document, width=100, default_flow_style=None)
    write_text(folder / "measurements.yaml", head + text)


if __name__ == "__main__":
    main_exit(main)
