"""Twin experiments: strengths that are known.

Twenty slides with a known S_r: sections from the random templates (a) to (d) with a liquefied
zone, and both dams, simulated with jittered points at 0.8 times the spacing of the fit. Surveyed
are the toe (standard deviation 3 % of the section's height) and 14 points of the surface (1.5 %),
with random errors; the case grants the model half a spacing (`model_std_m`). The tool answers
from three first guesses that know nothing of the truth (20 kPa for every template). A section is
left out where S_r does not decide the runout: the slide is shorter than 0.3 heights, reaches the
wall, or would stop less than 0.1 heights earlier with 30 % more strength. The search was improved
on another set of twins; of these themselves one thing was learned, to take noise off the derivative
(without it, and with errors in kPa, 90 % lie within 2 standard deviations).

Judged is `std_total`: the survey's errors, the scatter over jitter seeds, and the change of the
answer when the cells are 1.5 times as large.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure, at_least, at_most
from benchmarks.back_analysis.twin_cases import Truth, plans, truth_of, write_case
from geometry.case import load_case
from geometry.scenes.fill import point_count
from inversion import PHYSICS_VERSION as INVERSION_VERSION
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import Result
from mpm_taichi import PHYSICS_VERSION
from pipeline.cli import WorkFailed
from pipeline.files import content_hash, read_json, write_json

TITLE = "Twin experiments: strengths that are known"

#: Twins of each group, in full and with --quick; templates: together, and of each letter.
DAMS, TEMPLATES, OF_A_LETTER = (2, 1), (16, 2), (5, 1)
SPACING_M = (1.5, 3.0)
CELL_FACTOR = 1.5
SETTINGS = (
    "inversion.starts=3", "inversion.step_seeds=3", "inversion.noise_seeds=4",
    "inversion.variants=false",
)  # fmt: skip
#: Raised when the way a twin is made or judged changes; kept records are then made again.
VERSION = 8


@dataclasses.dataclass(frozen=True)
class Twin:
    """What came out of one.

    Attributes:
        name: of the case.
        group: template or dam.
        truth_kpa, answer_kpa: strength.
        std_data, std_noise, std_cells, std_total: standard deviations of the answer [kPa].
        starts_kpa: answers from the first guesses.
        loss: standardised misfit; numbers: of measured numbers fitted.
        runout_m, height_m, points: of the case.
        runs: simulations.
    """

    name: str
    group: str
    truth_kpa: float
    answer_kpa: float
    std_data: float
    std_noise: float
    std_cells: float
    std_total: float
    starts_kpa: list[float]
    loss: float
    numbers: int
    runout_m: float
    height_m: float
    points: int
    runs: int

    @property
    def error(self) -> float:
        """Of the strength, relative."""
        return self.answer_kpa / self.truth_kpa - 1.0

    @property
    def in_std(self) -> float:
        """Error in standard deviations, of logarithms: as strengths are fitted and quoted."""
        return float(np.log(self.answer_kpa / self.truth_kpa)) * self.answer_kpa / self.std_total

    @property
    def starts_apart(self) -> float:
        """Largest difference between the starts' answers and the answer, relative."""
        return max(abs(value / self.answer_kpa - 1.0) for value in self.starts_kpa)


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Make, fit and judge the twins."""
    twins, unanswered = all_twins(quick)
    if folder is not None:
        from benchmarks.back_analysis.pictures import twins_picture

        twins_picture(twins, folder / "twins.png")
    return figures(twins, unanswered)


def figures(twins: list[Twin], unanswered: Sequence[str] = ()) -> list[Figure]:
    """The table; `unanswered` are names of twins without an answer, which count as misses."""
    errors = np.array([abs(twin.error) for twin in twins])
    away = np.array([abs(twin.in_std) for twin in twins])
    within = np.sum(away <= 2) / (len(twins) + len(unanswered))
    apart = np.array([twin.starts_apart for twin in twins])
    signed = np.array([twin.error for twin in twins])
    share = [twin.std_total / twin.answer_kpa for twin in twins]
    note = "; ".join(
        f"{t.name}: {t.truth_kpa:.1f} found as {t.answer_kpa:.1f} ± {t.std_total:.1f} kPa"
        for t in twins
    )
    rough = [t.name for t in twins if t.starts_apart > 0.01]
    return [
        Figure("twins", f"{len(twins) + len(unanswered)}", "20",
               len(twins) + len(unanswered) >= 20, note),
        at_least("S_r within 2 standard deviations", 100 * within, 85, unit="%",
                 note=f"no answer: {'; '.join(unanswered)}" if unanswered else ""),
        at_most("median error of S_r", 100 * float(np.median(errors)), 3, unit="%",
                note=f"mean with sign {100 * signed.mean():+.1f} %, largest "
                f"{100 * errors.max():.1f} %"),
        Figure("median standard deviation quoted", f"{100 * np.median(share):.2g} %",
               note=f"errors in standard deviations: rms {np.sqrt(np.mean(away**2)):.2g}"),
        at_least("three starts within 1 % of the answer", 100 * np.mean(apart <= 0.01), 100,
                 unit="%", note=f"largest difference {100 * apart.max():.2g} %"
                 + (f"; more than 1 % at {', '.join(rough)}" if rough else "")),
        Figure("simulations of one twin", f"{np.mean([t.runs for t in twins]):.0f}",
               note="three searches, 4 seeds and the larger cells"),
    ]  # fmt: skip


def all_twins(quick: bool) -> tuple[list[Twin], list[str]]:
    """The twins in order, made or read; and those without an answer, each with the reason."""
    config, truths = lab.config(), lab.store("twins/truths")
    wanted = {lab.LSFD: DAMS[quick], lab.LA_MARQUESA: DAMS[quick]}
    templates, found, unanswered, groups = TEMPLATES[quick], [], [], []
    for group, plan in plans(config, spacing_m=SPACING_M[quick]):
        have = groups.count(group)
        of_templates = sum(one.startswith("template") for one in groups)
        if have >= wanted.get(group, OF_A_LETTER[quick]) or (
            group.startswith("template") and of_templates >= templates
        ):
            continue
        truth = truth_of(plan, config, truths)
        if truth is not None:
            groups.append(group)
            try:
                twin = twin_of(group, truth)
                found.append(twin)
                lab.say(f"{len(groups)}: {twin.name}: {twin.truth_kpa:.2f} kPa found as "
                        f"{twin.answer_kpa:.2f} +- {twin.std_total:.2f}, starts "
                        f"{[round(value, 2) for value in twin.starts_kpa]}")  # fmt: skip
            except WorkFailed as error:
                unanswered.append(f"{plan.name}: {truth.strength_kpa:.1f} kPa: {error}")
                lab.say(unanswered[-1])
        if len(groups) >= templates + sum(wanted.values()):
            return found, unanswered


def twin_of(group: str, truth: Truth) -> Twin:
    """Fit one twin, or read what a run before left."""
    folder = lab.FOLDER / "twins" / truth.plan.name
    key = content_hash(
        [VERSION, PHYSICS_VERSION, INVERSION_VERSION, truth.scene, truth.side, truth.plan.scene,
         CELL_FACTOR, SETTINGS]
    )  # fmt: skip
    record = folder / "twin.json"
    if record.is_file():
        kept = read_json(record)
        if kept["key"] == key:
            return Twin(**kept["twin"])
    write_case(truth, folder, cell_factor=CELL_FACTOR)
    case = inversion_case(load_case(folder, lab.config(*SETTINGS)))
    store = lab.store(f"twins/{folder.name}/runs")
    analysis = BackAnalysis(case, store, lambda line: None)
    twin = judged(group, truth, analysis.run())
    write_json(record, {"key": key, "twin": dataclasses.asdict(twin)})
    return twin


def judged(group: str, truth: Truth, result: Result) -> Twin:
    """The figures of one twin."""
    answer = result.answer.parameters[0]
    return Twin(
        name=truth.plan.name,
        group=group,
        truth_kpa=truth.strength_kpa,
        answer_kpa=answer.value,
        std_data=answer.std_data,
        std_noise=result.noise.answer_std[answer.name] if result.noise else 0.0,
        std_cells=answer.std_by_source.get("cell size", 0.0),
        std_total=answer.std_total,
        starts_kpa=[start.answer[answer.name] for start in result.starts],
        loss=result.answer.loss,
        numbers=sum(m.role == "fitted" for m in result.measurements),
        runout_m=truth.runout_m,
        height_m=truth.height,
        points=point_count(truth.plan.scene),
        runs=result.runs,
    )
