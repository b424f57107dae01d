"""What the direct model is worth.

    python -m benchmarks.studies.direct_models --data results/direct/runs [--page FILE]

Reads the test scenes of the runs, asks the model that ships, simulates some of the scenes once more
with their points elsewhere, and leaves a page with the table of the card and two pictures: runouts
with their intervals, and deposits.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from benchmarks.generated_pages import renew
from benchmarks.performance import direct_request
from benchmarks.studies import learned_on_dams
from gns.direct.judge import FAR, judged_run
from gns.direct.predictor import MODEL_FILE, DirectPredictor
from gns.direct.runs import read_runs
from gns.direct.sections import outcome_of, places
from gns.direct.train import Sample, answers, read_samples
from mpm_taichi.simulate import simulate_each
from pipeline.config import load_config
from pipeline.files import read_yaml
from pipeline.places import MODELS, resolve

PAGE = Path("docs/method/direct.md")
PICTURES = Path("docs/images/direct")
ELSEWHERE = 240
"""Test scenes that are simulated with their points elsewhere."""
JITTER, SEED = 0.5, 7
COLUMNS = (
    "runs", "far", "travel, d", "runout, d", "90 %, d", "runout of far ones, d",
    "runout of far ones, %", "profile, % of area", "covered, %",
    "half-way time, %", "duration, %", "times covered, %",
)  # fmt: skip


def main() -> None:
    """Judge, draw, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", default="results/direct/runs", metavar="DIR")
    parser.add_argument("--page", default=str(PAGE), metavar="FILE")
    parser.add_argument("--pictures", default=str(PICTURES), metavar="DIR")
    arguments = parser.parse_args()
    samples = list(read_samples(Path(arguments.data), ["test"]))
    folder = resolve("direct", MODELS)
    predictor, card = DirectPredictor.load(folder / MODEL_FILE), read_yaml(folder / "card.yaml")
    pictures = Path(arguments.pictures)
    pictures.mkdir(parents=True, exist_ok=True)
    _draw_runouts(samples, predictor, pictures / "runout.png")
    _draw_deposits(samples, predictor, pictures / "deposits.png")
    noise = solver_noise(samples[:ELSEWHERE], Path(arguments.data))
    renew(Path(arguments.page), record=page(card, noise))


def solver_noise(samples: list[Sample], data: Path) -> dict[str, float]:
    """How far runs of the same scenes with their points elsewhere differ, as a row of the table."""
    config, wanted = load_config(None), {one.run for one in samples}
    drawn = {one.number: one.scene for one in read_runs(data) if one.number in wanted}
    scenes = [drawn[one.run].changed(jitter=JITTER, seed=SEED) for one in samples]
    again = {}
    for place, run in simulate_each([(scene, config.simulation) for scene in scenes]):
        one = samples[place]
        own = one.section.spacing * one.section.height
        ended = outcome_of(
            one.section, run.positions[0], run.positions[-1], run.initial_volume, own
        )
        if run.status != "failed" and ended is not None:
            again[place] = ended
    return judged_run([samples[place] for place in again], list(again.values())).row()


def page(card: dict, noise: dict[str, float]) -> str:
    """The record; `noise`: of `solver_noise`."""
    runs, accuracy = card["runs"], card["accuracy"]
    together = {
        "direct model": accuracy["all"],
        "the solver itself, its points elsewhere": {**noise, "covered, %": np.nan},
    }
    lines = [
        "On the test scenes of its "
        "runs: random dams and slopes at 2 m spacing that it has not seen. d is the spacing; the "
        "runout is that of the side that ran farther; far are runouts beyond "
        f"{FAR:g} d. Medians, but where a column says otherwise.",
        "",
        "Made by `python -m benchmarks.studies.direct_models` from "
        f"{runs['train']} training, {runs['calibration']} calibration and {runs['test']} test "
        f"scenes; {card['training']['networks']} networks.",
        "",
        _table(together, "all scenes"),
        "",
        "Time of a case on one core: solver "
        f"{1000 * card['solver_seconds_a_case']:.0f} ms (side by side in batches, on a machine "
        f"with other work), network {1000 * card['seconds_a_case']:.1f} ms.",
        "",
        "![Runouts](../images/direct/runout.png)",
        "",
        "Bars are the model's 90 % intervals.",
        "",
        "Asked were a median of 1.5 d and 5 % of far runouts, intervals that hold 85 to 95 %, and "
        f"20 ms a case. The solver itself was run on {ELSEWHERE} of them with its points "
        "elsewhere: there is more to learn. "
        f"{_request()}",
        "",
        "![Deposits](../images/direct/deposits.png)",
        "",
        "By template: `models/direct/card.yaml`.",
        "",
    ]
    lines += ["### Dams of the case histories", "", learned_on_dams.WORDS, ""]
    lines += [learned_on_dams.dams(), "", learned_on_dams.ANSWERS, "", learned_on_dams.answers()]
    lines += ["", learned_on_dams.VARIANTS_WORDS, "", learned_on_dams.variants(), ""]
    return "\n".join(lines)


def _request() -> str:
    first, later, network = direct_request.medians()
    return (
        f"A whole prediction of Lower San Fernando at 2 m takes {first:.0f} ms of one core the "
        f"first time and {later:.0f} ms where strengths alone differ from the one before, of which "
        f"the network takes {network:.0f} (`python -m benchmarks.performance direct_request`)."
    )


def _table(
    rows: dict[str, dict[str, float]], title: str, columns: tuple[str, ...] = COLUMNS
) -> str:
    head = f"| {title} | " + " | ".join(columns) + " |"
    rule = "|---|" + "---|" * len(columns)
    body = [
        f"| {name} | " + " | ".join(_number(row.get(column, np.nan)) for column in columns) + " |"
        for name, row in rows.items()
    ]
    return "\n".join([head, rule, *body]).replace(" covered, %", " in the 90 % interval, %")


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "-"
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


def _draw_runouts(samples: list[Sample], predictor: DirectPredictor, path: Path) -> None:
    figure, axis = plt.subplots(figsize=(4.6, 4.2))
    before = np.stack([one.outcome.toes_before for one in samples])
    spacing = np.array([one.section.spacing for one in samples])
    way = np.abs(np.stack([one.outcome.toes for one in samples]) - before)
    rows, side = np.arange(len(samples)), np.argmax(way, axis=1)
    outward = np.where(side == 0, -1.0, 1.0)
    true = way[rows, side] / spacing
    answer = answers(predictor.model, samples)
    found = outward * (answer.toes.numpy() - before)[rows, side] / spacing
    interval = (predictor.toe_factor * answer.toe_scale.numpy())[rows, side] / spacing
    limit = 1.05 * true.max()
    axis.plot([0, limit], [0, limit], color="0.6", linewidth=0.8)
    axis.errorbar(
        true, found, interval, fmt="o", markersize=3, linewidth=0.6, color="#3b6ea5",
        ecolor="#a9c3dd",
    )  # fmt: skip
    axis.set(xlabel="runout of the solver (d)", ylabel="of the direct model (d)")
    axis.set(xlim=(-2, limit), ylim=(-5, limit))
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_deposits(samples: list[Sample], predictor: DirectPredictor, path: Path) -> None:
    """Scenes at even places of the order of their runout."""
    travel = [np.abs(one.outcome.toes - one.outcome.toes_before).max() for one in samples]
    order = np.argsort(travel)
    chosen = [samples[order[int(share * (len(order) - 1))]] for share in (0.35, 0.55, 0.75, 0.92)]
    figure, axes = plt.subplots(len(chosen), 1, figsize=(9, 8.5))
    for axis, one in zip(axes, chosen, strict=True):
        x = places()
        ground = one.section.ground
        axis.fill_between(
            x, ground, ground + one.section.thickness, color="0.9", label="before the slide"
        )
        axis.plot(x, ground + one.outcome.thickness, color="black", linewidth=1.4, label="solver")
        forecast = predictor.predict(one.section, one.outcome.toes_before)
        thickness = forecast.thickness / one.section.height
        axis.plot(x, ground + thickness, color="#c26a2d", linewidth=1.1, label="direct model")
        near = np.abs(x) < 1.15 * max(
            np.abs(one.outcome.toes).max(), np.abs(one.section.feet).max()
        )
        axis.set_xlim(x[near].min(), x[near].max())
        axis.set_ylabel("heights")
        axis.set_title(one.name, loc="left", fontsize=9)
    axes[0].legend(fontsize=8, ncols=3)
    axes[-1].set_xlabel("heights of the section")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


if __name__ == "__main__":
    main()
