"""Which engine answers, and what each of them has said to the same question.

In: command line, question and configuration; the folders of results that lie side by side. Out: the
engine with its model's folder; `EngineAnswer`s of one table. Nothing heavy is imported here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.result import FILE_NAME, EngineAnswer, Result, load_result
from inversion.engines.registry import REFERENCE, Engine, engine_named, engines
from pipeline.cli import InputError
from pipeline.places import MODELS, names_of, resolve


@dataclass(frozen=True)
class Choice:
    """An engine, and for one that was trained the folder of its model."""

    engine: Engine
    model: Path | None = None


def chosen_engine(case: InversionCase, engine: str | None, model: str | None) -> Choice:
    """The engine of a back-analysis: the command line's, else the question's, else the settings'.

    Args:
        case: with its question and settings.
        engine: of the command line; None: not given.
        model: the same.

    Raises:
        InputError: no such engine, a model for an engine without one, or a trained engine without a
            model.
    """
    settings = case.config.inversion
    chosen = engine_named(engine or case.question.engine or settings.engine, case.source)
    if not chosen.trained:
        if model is not None:
            raise InputError(
                f"--model {model}: goes with --engine gns; the engine is {chosen.name}"
            )
        return Choice(chosen)
    text = model or case.question.model or settings.model
    if not text:
        known = ", ".join(names_of(MODELS, "model.pt")) or "none"
        raise InputError(
            f"{case.source}: engine: {chosen.name} needs a model: give --model DIR, model in this "
            f"file, or inversion.model; models/ has {known}"
        )
    return Choice(chosen, resolve(text, MODELS))


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
        and [p.name for p in found.answer.parameters] == [p.name for p in result.answer.parameters]
    )
    return found if same else None
