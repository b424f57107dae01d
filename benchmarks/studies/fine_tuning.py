"""A model learns on from a case's own runs (the paper's outlook): errors there before and after.

    python -m benchmarks.studies.fine_tuning --model models/coarse [--case NAME] [--out DIR]
        [--runs 40] [--steps 600] [--spacing-factor 2] [--learning-rate 3e-4]

Variants of the case's section, its parameters drawn between their bounds (strengths by their
logarithm), are simulated, packed and learned; a fifth of them judges. Kept in the folder: the
variants, their runs, the data, the model and `training.png`, the history of its loss. Started
again, it goes on where it was.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geometry.case import load_case
from geometry.scenes.scene import scene_text
from gns.data.dataset import Windows
from gns.data.metadata import read_metadata
from gns.evaluation.evaluate import evaluate
from gns.evaluation.score_tables import by_template
from gns.network.simulator import Simulator
from gns.training.checkpoints import MODEL_FILE, ModelFolder
from inversion.back_analysis.case import inversion_case
from pipeline.cli import CommandParser, base_parser, main_exit
from pipeline.config import load_config
from pipeline.files import make_folder, write_text
from pipeline.table import aligned
from report.pictures.rollouts import save_history


def parser() -> CommandParser:
    """The command line."""
    result = base_parser("python -m benchmarks.studies.fine_tuning", __doc__.splitlines()[0])
    result.add_argument("--model", default="models/coarse", metavar="DIR")
    result.add_argument("--case", default="lower_san_fernando")
    result.add_argument("--out", default="results/fine_tuning", metavar="DIR")
    result.add_argument("--runs", type=int, default=40)
    result.add_argument("--steps", type=int, default=600)
    result.add_argument("--learning-rate", type=float, default=3e-4)
    result.add_argument("--spacing-factor", type=float, default=2.0)
    return result


def main(argv: Sequence[str] | None = None) -> None:
    """Simulate, pack, learn, compare."""
    options = parser().parse_args(argv)
    out = make_folder(options.out)
    config = load_config(None, [f"inversion.spacing_factor={options.spacing_factor}"])
    case = inversion_case(load_case(options.case, config))
    scenes = write_variants(case, out / "scenes", options.runs)
    duration = f"simulation.duration_s={case.setup.settings.duration_s}"
    thrust = Simulator.load(Path(options.model) / MODEL_FILE).config.thrust
    water = [] if thrust else ["simulation.water=buoyant"]
    call("mpm_taichi", "run", *scenes, "--out", out / "runs", *settings([duration, *water]))
    shares = ["gns.pack.valid_share=0.2", "gns.pack.test_share=0.2"]
    runs = sorted((out / "runs").glob("*.h5"))
    call("gns", "pack", *runs, "--out", out / "dataset", *settings(shares))
    learning = [
        f"steps={options.steps}",
        f"learning_rate={options.learning_rate}",
        f"muon_learning_rate={5.0 * options.learning_rate}",
        "warmup_steps=20",
        "unroll_ramp=0",
        "averaging=0.99",
        f"validate_every={max(options.steps // 6, 1)}",
        f"checkpoint_every={max(options.steps // 6, 1)}",
    ]
    call(
        "gns", "train", "--scale", "coarse", "--data", out / "dataset", "--out", out / "model",
        "--from", options.model, "--processes", "2", "--joint-batch", "--threads", "1",
        *settings([f"gns.train_of_scale.coarse.{one}" for one in learning]),
    )  # fmt: skip
    lines = ModelFolder(out / "model").read_metrics()
    save_history(lines, out / "training.png", f"{options.model}, learning on from {case.title}")
    rows = [["on variants it never saw", "runs", "runout error, d", "90 %, d", "% of travel"]]
    for name, folder in (("before", Path(options.model)), ("after", out / "model")):
        rows.append([name, *errors(Simulator.load(folder / "model.pt"), out / "dataset")])
    print(aligned(rows, left={0}))


def write_variants(case, folder: Path, number: int) -> list[Path]:
    """The case's section with other values; the same ones every time."""
    make_folder(folder)
    parameters, generator = case.parameters, np.random.default_rng(0)
    low, high = parameters.low, parameters.high
    paths = []
    for place in range(number):
        share = generator.uniform(size=len(low))
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.where(
                parameters.logarithmic,
                np.exp(np.log(low) + share * (np.log(high) - np.log(low))),
                low + share * (high - low),
            )
        scene = parameters.scene(case.setup.scene, values)
        scene = scene.changed(name=f"{case.name}_{place:03d}")
        paths.append(folder / f"{place:03d}.json")
        write_text(paths[-1], scene_text(scene))
    return paths


def errors(simulator: Simulator, data: Path) -> list[str]:
    """Of the held-out variants: number, median and 90 % of the runout's error, % of travel."""
    windows = Windows(data, "test", stride=simulator.stride_in(read_metadata(data)))
    row = by_template([one.score for one in evaluate(simulator, windows)])["all"]
    names = ("runs", "runout, d", "90 %, d", "runout, % of travel")
    return [f"{row[name]:.3g}" for name in names]


def settings(changes: Sequence[str]) -> list[str]:
    """As options."""
    return [word for change in changes for word in ("--set", change)]


def call(*words: object) -> None:
    """A command of ours; its errors end this one."""
    subprocess.run([sys.executable, "-m", *map(str, words)], check=True)


if __name__ == "__main__":
    main_exit(main)
