"""The files of a back-analysis: result.json, history.csv, sections.npz, run.h5.

A result is written with what the classical methods and other engines have said to the same
question, as far as their results lie next to its folder.
"""

from __future__ import annotations

import csv
import io
from functools import partial
from pathlib import Path

import numpy as np

from geometry.scenes.fill import fill
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.result import (
    FILE_NAME,
    EngineAnswer,
    Result,
    load_result,
    save_result,
)
from inversion.back_analysis.result_checks import check_classical
from inversion.engines.content_store import write_arrays
from inversion.engines.registry import REFERENCE, engine_named, engines
from inversion.engines.run_store import RunStore
from inversion.engines.workers import Job
from inversion.estimation.search import SearchResult
from pipeline.cli import InputError
from pipeline.files import read_json, write_text

HISTORY, SECTIONS, RUN = "history.csv", "sections.npz", "run.h5"
#: Next to the folder of the result, as `flowslide classical` writes it.
CLASSICAL = Path("classical/classical.json")


def answered(analysis: BackAnalysis, folder: Path) -> Result:
    """Run a back-analysis and write everything; the result as written."""
    case, store = analysis.case, analysis.store
    more: list[Job] = []
    if isinstance(case, InversionCase) and isinstance(store, RunStore):
        more = [partial(save_answer_run, case, store, analysis, folder / RUN)]
    result = analysis.run(more)
    write_text(folder / HISTORY, history_text(result))
    timings = {**result.timings, "in all": round(sum(result.timings.values()), 3)}
    result = result.model_copy(update={"timings": timings})
    if isinstance(case, InversionCase):
        save_sections(case, analysis.found, folder / SECTIONS)
        result = with_neighbours(result, folder)
    save_result(result, folder)
    return result


def history_text(result: Result) -> str:
    """The iterations as CSV: values, loss, all measured quantities."""
    parameters = [parameter.name for parameter in result.answer.parameters]
    quantities = [m.name for m in result.measurements if m.role != "constructed"]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ["iteration", "kind", "accepted", "runs_so_far", f"loss_{result.answer.loss_unit}"]
        + parameters
        + quantities
    )
    for line in result.iterations:
        loss = "" if line.loss is None else f"{line.loss:.6g}"
        predicted = [line.predicted.get(name) for name in quantities]
        writer.writerow(
            [line.iteration, line.kind, str(line.accepted).lower(), line.runs_so_far, loss]
            + [f"{line.values[name]:.6g}" for name in parameters]
            + ["" if value is None else f"{value:.6g}" for value in predicted]
        )
    return text.getvalue()


def save_sections(case: InversionCase, found: SearchResult, path: Path) -> None:
    """Where the points lie at each iteration, for the pictures.

    Arrays: `initial` (N, 2) [m]; `final` (K, N, 2) [m], one for each of the K lines of the history;
    `iteration` (K,), `accepted` (K,), `loss` (K,), `values` (K, p), `names` (p,), `zone` (N,),
    `zone_names`, `spacing` [m], `answer`: the line of the answer.
    """
    evaluations = found.evaluations
    points = fill(case.scene)
    count = len(points)
    kept = [evaluation.prediction.positions for evaluation in evaluations]
    ends = np.stack([p if len(p) == count else np.full((count, 2), np.nan) for p in kept])
    # The last one at these values: a coarse run before it may have had the same.
    answer = max(
        place
        for place, evaluation in enumerate(evaluations)
        if evaluation.accepted and np.array_equal(evaluation.values, found.values)
    )
    write_arrays(
        path,
        {
            "initial": points.position.astype(np.float32),
            "final": ends.astype(np.float32),
            "iteration": np.array([evaluation.iteration for evaluation in evaluations], np.int32),
            "accepted": np.array([evaluation.accepted for evaluation in evaluations]),
            "loss": np.array([evaluation.loss for evaluation in evaluations]),
            "values": np.array([evaluation.values for evaluation in evaluations]),
            "names": np.array(case.parameters.names),
            "zone": points.zone,
            "zone_names": np.array([zone.name for zone in case.scene.zones]),
            "spacing": np.array(case.scene.spacing),
            "answer": np.array(answer, np.int32),
        },
    )


def save_answer_run(
    case: InversionCase, store: RunStore, analysis: BackAnalysis, path: Path
) -> None:
    """Simulate the answer once more with all frames, for the film and for other tools."""
    store.write_run(case.setup.scene_at(analysis.found.values), case.setup.settings, path)


def with_neighbours(result: Result, folder: Path) -> Result:
    """The result with what the classical methods and another engine have left next to its folder.

    Raises:
        InputError: a file of theirs is damaged, or of an unknown form.
    """
    found = {"classical": classical_beside(folder), "engines": side_by_side(result, folder)}
    return result.model_copy(update={key: value for key, value in found.items() if value})


def classical_beside(folder: Path) -> list[dict]:
    """Results of the classical methods from the folder next to that of the result, if any.

    Raises:
        InputError: the file is damaged, or of an unknown form.
    """
    path = folder.resolve().parent / CLASSICAL
    if not path.is_file():
        return []
    document = read_json(path)
    analyses = document.get("analyses") if isinstance(document, dict) else None
    if not isinstance(analyses, list):
        raise InputError(f"{path}: has no list `analyses`; write it by flowslide classical")
    try:
        check_classical(analyses)
    except ValueError as error:
        raise InputError(f"{path}: {error}; write it by flowslide classical") from None
    return analyses


def own_answer(result: Result) -> EngineAnswer:
    """The answer of a result's own engine."""
    engine, parameters = engine_named(result.engine), result.answer.parameters
    return EngineAnswer(
        name=engine.title,
        engine=result.engine,
        note="corrected by paired runs" if engine.trained else "its own answer",
        spacing_m=result.spacing_m,
        values={p.name: p.value for p in parameters},
        std={p.name: p.std_total for p in parameters},
        predicted={m.name: m.predicted for m in result.measurements if m.role != "constructed"},
        loss=result.answer.loss,
    )


def side_by_side(result: Result, folder: Path) -> list[EngineAnswer]:
    """The engines' answers to the same question, as far as they are there; empty: one alone.

    Args:
        result: of one engine, to be written into `folder`.
        folder: the results of the others are looked for next to it.
    """
    if result.engine == REFERENCE:
        others = [_other(result, folder, name) for name in engines() if name != REFERENCE]
        rows = [row for other in others if other is not None for row in _rows(other)]
        return [*rows, own_answer(result)] if rows else []
    reference = _other(result, folder, REFERENCE)
    if reference is not None:
        return [*_rows(result), own_answer(reference)]
    return _rows(result) if engine_named(result.engine).trained else []


def _rows(result: Result) -> list[EngineAnswer]:
    """Rows that an engine other than the reference reports about itself."""
    rows = [row for row in result.engines if not (row.engine == REFERENCE and row.std)]
    return rows or [own_answer(result)]


def _other(result: Result, folder: Path, name: str) -> Result | None:
    """The answer of another engine to the same question, if there is one."""
    sibling = folder.resolve().parent / engine_named(name).folder
    if sibling == folder.resolve() or not (sibling / FILE_NAME).is_file():
        return None
    found = load_result(sibling)
    same = (
        found.engine == name
        and found.case == result.case
        and found.measurement_set == result.measurement_set
        and _asked_of(found) == _asked_of(result)
    )
    return found if same else None


def _asked_of(result: Result) -> list[tuple[str, str]]:
    """Names and units of the unknowns: a strength is not compared with a strength ratio."""
    return [(p.name, p.unit) for p in result.answer.parameters]
