"""What the direct models are worth next to the solver at twice the spacing.

    python -m benchmarks.studies.direct_models --data results/direct/runs [--page FILE]

Reads the test scenes of the runs, asks the models that ship, simulates some of the scenes once more
with their points elsewhere, and leaves a page with the tables of the cards and two pictures:
runouts with their intervals, and deposits.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from benchmarks.performance import direct_request
from benchmarks.studies import direct_on_dams, learned_screening
from gns.direct.judge import FAR, coarse_alone
from gns.direct.predictor import MODEL_FILE, Predictor
from gns.direct.runs import random_section
from gns.direct.sections import outcome_of, places
from gns.direct.train import Sample, answers, read_samples
from mpm_taichi.simulate import simulate_each
from pipeline.config import load_config
from pipeline.files import read_yaml, write_text
from pipeline.places import MODELS, resolve

PAGE = Path("docs/records/direct-models.md")
PICTURES = Path("docs/images/direct")
KINDS = {"direct": "direct model", "corrected": "corrected"}
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
    folders = {kind: resolve(kind, MODELS) for kind in KINDS}
    models = {kind: Predictor.load(folder / MODEL_FILE) for kind, folder in folders.items()}
    cards = {kind: read_yaml(folder / "card.yaml") for kind, folder in folders.items()}
    pictures = Path(arguments.pictures)
    pictures.mkdir(parents=True, exist_ok=True)
    _draw_runouts(samples, models, pictures / "runout.png")
    _draw_deposits(samples, models, pictures / "deposits.png")
    learned_screening.draw(pictures / "screening.png")
    write_text(Path(arguments.page), page(cards, solver_noise(samples[:ELSEWHERE])))


def solver_noise(samples: list[Sample]) -> dict[str, float]:
    """How far runs of the same scenes with their points elsewhere differ, as a row of the table."""
    config = load_config(None)
    scenes = [random_section(config, one.run).changed(jitter=JITTER, seed=SEED) for one in samples]
    again = []
    for place, run in simulate_each([(scene, config.simulation) for scene in scenes]):
        one = samples[place]
        own = one.section.spacing * one.section.height
        ended = outcome_of(one.section, run.positions[0], run.positions[-1], own)
        if run.status != "failed" and ended is not None:
            again.append(replace(one, coarse=ended))
    return coarse_alone(again).row()


def page(cards: dict[str, dict], noise: dict[str, float]) -> str:
    """The record; `noise`: of `solver_noise`."""
    first = cards["direct"]
    seconds = first["solver_seconds_a_case"]
    rows = {KINDS[kind]: card["accuracy"] for kind, card in cards.items()}
    rows = {"solver at twice the spacing": first["solver_at_twice_the_spacing"], **rows}
    together = {name: table["all"] for name, table in rows.items()}
    together["the solver itself, its points elsewhere"] = {**noise, "covered, %": np.nan}
    lines = [
        "# Direct models",
        "",
        "Learned models without steps ([method](../method/direct.md)), and the solver at twice the "
        "spacing alone, on the test scenes of their runs: random dams and slopes at 2 m spacing "
        "that no model has seen. d is the spacing; the runout is that of the side that ran "
        f"farther; far are runouts beyond {FAR:g} d. Medians, but where a column says otherwise.",
        "",
        "Made by `python -m benchmarks.studies.direct_models` from "
        + "; ".join(f"{_learned(card)} ({KINDS[kind]})" for kind, card in cards.items())
        + ". The solver at twice the spacing is judged on the scenes of the first.",
        "",
        _table(together, "all scenes"),
        "",
        "Time of a case on one core: "
        + ", ".join(
            [
                f"solver {1000 * seconds['at the spacing']:.0f} ms at the spacing and "
                f"{1000 * seconds['at twice the spacing']:.0f} ms at twice it (side by side in "
                "batches, on a machine with other work)",
                *(
                    f"network of the {KINDS[kind]} {1000 * card['seconds_a_case']:.1f} ms"
                    for kind, card in cards.items()
                ),
            ]
        )
        + ".",
        "",
        "![Runouts](../images/direct/runout.png)",
        "",
        "Bars are the models' 90 % intervals.",
        "",
        "Asked were a median of 1.5 d and 5 % of far runouts, intervals that hold 85 to 95 %, and "
        f"20 ms a case. The corrected model costs the run at twice the spacing as well. The solver "
        f"itself was run on {ELSEWHERE} of them with its points elsewhere: there is more to learn. "
        f"{_request()} No case history was learned from; but that there are dams of hydraulic fill "
        "comes from the error at Lower San Fernando without them ([what "
        "decided](../method/direct.md#training)).",
        "",
        "![Deposits](../images/direct/deposits.png)",
        "",
        "## By template",
        "",
        "(a) to (d) are the paper's; `dam` are free-standing dams with shells of two layers, "
        "`hydraulic` those of hydraulic fill.",
        "",
    ]
    for name, table in rows.items():
        own = {key: row for key, row in table.items() if key != "all"}
        lines += [_table(own, name), ""]
    lines += ["## Dams of the case histories", "", direct_on_dams.WORDS, ""]
    lines += [direct_on_dams.table(), "", direct_on_dams.ANSWERS, "", direct_on_dams.answers(), ""]
    lines += [direct_on_dams.VARIANTS_WORDS, "", direct_on_dams.variants(), ""]
    return "\n".join([*lines, learned_screening.shown()])


def _learned(card: dict) -> str:
    runs, networks = card["runs"], card["training"]["networks"]
    return (
        f"{runs['train']} training, {runs['calibration']} calibration and {runs['test']} test "
        f"scenes, {networks} network{'s' if networks > 1 else ''}"
    )


def _request() -> str:
    first, later, network = direct_request.medians()
    return (
        f"A whole prediction of Lower San Fernando at 2 m takes {first:.0f} ms of one core the "
        f"first time and {later:.0f} ms where strengths alone differ from the one before, of which "
        f"the network takes {network:.0f} (`python -m benchmarks.performance.direct_request`)."
    )


def _table(rows: dict[str, dict[str, float]], title: str) -> str:
    head = f"| {title} | " + " | ".join(COLUMNS) + " |"
    rule = "|---|" + "---|" * len(COLUMNS)
    body = [
        f"| {name} | " + " | ".join(_number(row.get(column, np.nan)) for column in COLUMNS) + " |"
        for name, row in rows.items()
    ]
    return "\n".join([head, rule, *body]).replace(" covered, %", " in the 90 % interval, %")


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "-"
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


def _draw_runouts(samples: list[Sample], models: dict[str, Predictor], path: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.9), sharex=True, sharey=True)
    before = np.stack([one.fine.toes_before for one in samples])
    spacing = np.array([one.section.spacing for one in samples])
    way = np.abs(np.stack([one.fine.toes for one in samples]) - before)
    rows, side = np.arange(len(samples)), np.argmax(way, axis=1)
    outward = np.where(side == 0, -1.0, 1.0)
    true = way[rows, side] / spacing
    coarse = np.stack([one.coarse.toes for one in samples])
    shown = [("solver at twice the spacing", coarse, None)]
    for kind, predictor in models.items():
        answer = answers(predictor.model, samples)
        interval = predictor.toe_factor * answer.toe_scale.numpy()
        shown.append((KINDS[kind], answer.toes.numpy(), interval))
    limit = 1.05 * true.max()
    for axis, (title, toes, interval) in zip(axes, shown, strict=True):
        found = outward * (toes - before)[rows, side] / spacing
        axis.plot([0, limit], [0, limit], color="0.6", linewidth=0.8)
        if interval is None:
            axis.plot(true, found, "o", markersize=3, color="#3b6ea5")
        else:
            axis.errorbar(
                true, found, interval[rows, side] / spacing, fmt="o", markersize=3,
                linewidth=0.6, color="#3b6ea5", ecolor="#a9c3dd",
            )  # fmt: skip
        axis.set(title=title, xlabel="runout of the solver (d)", xlim=(-2, limit), ylim=(-5, limit))
    axes[0].set_ylabel("predicted (d)")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_deposits(samples: list[Sample], models: dict[str, Predictor], path: Path) -> None:
    """Scenes at even places of the order of their runout."""
    travel = [np.abs(one.fine.toes - one.fine.toes_before).max() for one in samples]
    order = np.argsort(travel)
    chosen = [samples[order[int(share * (len(order) - 1))]] for share in (0.35, 0.55, 0.75, 0.92)]
    figure, axes = plt.subplots(len(chosen), 1, figsize=(9, 8.5))
    for axis, one in zip(axes, chosen, strict=True):
        x = places()
        ground = one.section.ground
        axis.fill_between(
            x, ground, ground + one.section.thickness, color="0.9", label="before the slide"
        )
        axis.plot(x, ground + one.fine.thickness, color="black", linewidth=1.4, label="solver")
        axis.plot(
            x,
            ground + one.coarse.thickness,
            color="0.5",
            linestyle=":",
            label="at twice the spacing",
        )
        for (kind, predictor), colour in zip(models.items(), ("#c26a2d", "#3b6ea5"), strict=True):
            coarse = one.coarse if predictor.corrected else None
            forecast = predictor.predict(one.section, one.fine.toes_before, coarse)
            axis.plot(
                x, ground + forecast.thickness / one.section.height, color=colour,
                linewidth=1.1, label=KINDS[kind],
            )  # fmt: skip
        near = np.abs(x) < 1.15 * max(np.abs(one.fine.toes).max(), np.abs(one.section.feet).max())
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
