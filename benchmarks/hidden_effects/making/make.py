"""`blind make`: simulate what is hidden, write what is surveyed, seal what is true.

Case by case, each in one go, so that a killed job continues with the next case. `sealed.json` is
written last; no diagnosis starts without it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from benchmarks.hidden_effects.making.base_model import BaseModel
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places, SourcePlan, Stated
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.plan import Planned, Reach
from benchmarks.hidden_effects.making.reach import measure_reach
from benchmarks.hidden_effects.making.seal import seal
from benchmarks.hidden_effects.making.sections import Section
from benchmarks.hidden_effects.making.surveys import PROFILE_FILE
from benchmarks.hidden_effects.making.truth import Made, Maker
from benchmarks.hidden_effects.scoring.records import read_reach, read_sealed, read_truth
from geometry.scenes.scene import save_scene
from inversion.problem.scene_changes import with_properties
from pipeline.cli import InputError
from pipeline.files import write_json, write_text, yaml_text

OnCase = Callable[[int, int, str], None]
"""Called with (cases done, cases in all, what was made)."""


def _silent(done: int, total: int, words: str) -> None:
    """Tell nobody."""


def make(
    benchmark: Benchmark,
    places: Places,
    laboratory: Laboratory,
    *,
    part: tuple[int, int] = (0, 1),
    on_case: OnCase = _silent,
) -> None:
    """Make the cases of a benchmark that are not there yet; seal them when all are.

    Args:
        benchmark: what to make.
        places: where to.
        laboratory: that simulates.
        part: (k, n): every n-th case from the k-th on, for several jobs side by side.
        on_case: called for each case.
    """
    base = base_models(laboratory)
    row = benchmark.cases(reach_of(benchmark, places, laboratory, base, on_case))
    maker = Maker(laboratory, benchmark.plan.seed, base, benchmark.plan.other_realisation)
    mine = row[part[0] :: part[1]]
    for number, planned in enumerate(mine, start=1):
        words = "was there"
        if not _is_there(places, planned):
            words = _make_one(maker, planned, benchmark.sections[planned.section], places)
        on_case(number, len(mine), f"{planned.name}: {words}")
    if all(_is_there(places, planned) for planned in row):
        seal_all(row, places)


def base_models(laboratory: Laboratory) -> Callable[[Section], BaseModel]:
    """The base model of each section, simulated when it is first asked for."""
    found: dict[tuple[str, str], BaseModel] = {}

    def base(section: Section) -> BaseModel:
        key = section.name, section.scene.ground.contact
        if key not in found:
            found[key] = BaseModel.simulate(laboratory, section)
        return found[key]

    return base


def reach_of(
    benchmark: Benchmark,
    places: Places,
    laboratory: Laboratory,
    base: Callable[[Section], BaseModel] | None = None,
    on_case: OnCase = _silent,
) -> Reach:
    """How well each effect can be seen, measured once.

    Args:
        benchmark: the benchmark to make.
        places: where it is kept.
        laboratory: that simulates.
        base: base models of the sections; None: they are simulated where they are needed.
        on_case: called for each effect.
    """
    if not places.reach.is_file():
        base = base_models(laboratory) if base is None else base
        reach = measure_reach(benchmark, laboratory, base, lambda words: on_case(0, 0, words))
        write_json(
            places.reach, [{"of": key, "lambda": round(seen, 3)} for key, seen in reach.items()]
        )
    return {tuple(entry["of"]): entry["lambda"] for entry in read_reach(places.reach)}


def seal_all(row: Sequence[Planned], places: Places) -> None:
    """Write the hashes of all truths, and what could not be made."""
    truths = [read_truth(places.truth(planned.name)) for planned in row]
    write_json(places.sealed, [
        {"name": truth["name"], "section": truth["section"], "survey": truth["survey"],
         "sha256": seal(truth)}
        for truth in truths if not truth.get("skipped")
    ])  # fmt: skip
    write_json(places.skipped, [
        {name: truth[name] for name in ("kind", "effects", "section", "survey")}
        for truth in truths if truth.get("skipped")
    ])  # fmt: skip


def sealed_cases(places: Places) -> list[dict[str, Any]]:
    """The sealed cases, in their order.

    Raises:
        InputError: the benchmark has not been sealed, or the file is not what was written.
    """
    if not places.sealed.is_file():
        raise InputError(
            f"{places.sealed}: missing; `blind make` writes it when all cases are made"
        )
    return read_sealed(places.sealed)


def _is_there(places: Places, planned: Planned) -> bool:
    return places.truth(planned.name).is_file()


def _make_one(maker: Maker, planned: Planned, section: Section, places: Places) -> str:
    """Make one case; the truth is written last, so that it stands for the whole."""
    began, runs = time.perf_counter(), maker.laboratory.runs
    made = maker.make(planned, section)
    cost = f"{maker.laboratory.runs - runs} runs, {time.perf_counter() - began:.1f} s"
    if made is None:
        skip(planned, places)
        return f"skipped, it cannot be seen or sees no end: {cost}"
    write_case(section, planned, made, places, maker.laboratory.settings.duration_s)
    write_json(places.truth(planned.name), made.truth)
    return f"made at {made.truth['spacing_factor']:.2f} spacings: {cost}"


def skip(planned: Planned, places: Places) -> None:
    """Say in place of the truth that a case could not be made."""
    write_json(places.truth(planned.name), {
        "name": planned.name, "kind": planned.kind, "effects": list(planned.effects),
        "section": planned.section, "survey": planned.survey, "skipped": True,
    })  # fmt: skip


def write_case(
    section: Section,
    planned: Planned,
    made: Made,
    places: Places,
    duration_s: float,
    wanted: SourcePlan | None = None,
    stated: Stated | None = None,
) -> None:
    """Write what a diagnosis sees: section, survey and question, with first guesses put in."""
    folder = places.case(planned.name)
    guesses = [
        change for spec in section.question.parameters for change in spec.changes(spec.start)
    ]
    save_scene(with_properties(section.scene, guesses), folder / "scene.yaml")
    rows = [f"{x:.2f},{y:.3f}" for x, y in made.profile]
    write_text(folder / PROFILE_FILE, "\n".join(["x_m,y_m", *rows]) + "\n")
    _write_yaml(places, planned, "measurements.yaml", {
        "case": planned.name,
        "upstream": section.survey.side,
        "initial": {},
        "default_set": planned.survey,
        "sets": {planned.survey: made.entries},
    })  # fmt: skip
    question = section.question.model_dump(mode="json", exclude_defaults=True)
    question["duration_s"] = duration_s
    if stated is not None:
        question["sensitivities"] = stated.sensitivities(section)
    _write_yaml(places, planned, "inversion.yaml", question)
    _write_yaml(places, planned, "diagnosis.yaml", {
        "synthetic": True, **({} if wanted is None else wanted.known_to_the_judge),
    })  # fmt: skip


def _write_yaml(places: Places, planned: Planned, name: str, document: dict[str, Any]) -> None:
    text = yaml_text(document, width=100, default_flow_style=None)
    write_text(places.case(planned.name) / name, text)
