"""Which engine answers, and what each of them has said to the same question.

In: command line, question and configuration; the folders of results that lie side by side. Out: the
engine with its model's folder; `EngineAnswer`s of one table. Nothing heavy is imported here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.result import FILE_NAME, EngineAnswer, Result, load_result
from pipeline.cli import InputError
from pipeline.places import MODELS, names_of, resolve

Name = Literal["mpm", "gns"]
#: Folder of an engine's result below results/<case>/.
FOLDERS: dict[str, str] = {"mpm": "inversion", "gns": "inversion_gns"}
WORDS: dict[str, str] = {"mpm": "material point method", "gns": "Diff-GNS"}


@dataclass(frozen=True)
class Choice:
    """An engine, and for `gns` the folder of its model."""

    name: Name
    model: Path | None = None


def chosen_engine(case: InversionCase, engine: str | None, model: str | None) -> Choice:
    """The engine of a back-analysis: the command line's, else the question's, else the settings'.

    Args:
        case: with its question and settings.
        engine: of the command line; None: not given.
        model: the same.

    Raises:
        InputError: a model for an engine without one, or the engine gns without a model.
    """
    settings = case.config.inversion
    name = engine or case.question.engine or settings.engine
    if name == "mpm":
        if model is not None:
            raise InputError(f"--model {model}: goes with --engine gns; the engine is mpm")
        return Choice("mpm")
    text = model or case.question.model or settings.model
    if not text:
        known = ", ".join(names_of(MODELS, "model.pt")) or "none"
        raise InputError(
            f"{case.source}: engine: gns needs a model: give --model DIR, model in this file, or "
            f"inversion.model; models/ has {known}"
        )
    return Choice("gns", resolve(text, MODELS))


def own_answer(result: Result) -> EngineAnswer:
    """The answer of a result's own engine."""
    parameters = result.answer.parameters
    return EngineAnswer(
        name=WORDS[result.engine],
        engine=result.engine,
        note="its own answer" if result.engine == "mpm" else "corrected by runs beside it",
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
        folder: the other engine's is looked for beside it.
    """
    other = _other(result, folder)
    if result.engine == "mpm":
        rows = [] if other is None else [row for row in other.engines if not _is_own_mpm(row)]
        return [*rows, own_answer(result)] if rows else []
    rows = [row for row in result.engines if not _is_own_mpm(row)]
    return rows if other is None else [*rows, own_answer(other)]


def _other(result: Result, folder: Path) -> Result | None:
    """What the other engine has answered to the same question, if it has."""
    name = "gns" if result.engine == "mpm" else "mpm"
    beside = folder.resolve().parent / FOLDERS[name]
    if beside == folder.resolve() or not (beside / FILE_NAME).is_file():
        return None
    found = load_result(beside)
    same = (
        found.engine == name
        and found.case == result.case
        and found.measurement_set == result.measurement_set
        and [p.name for p in found.answer.parameters] == [p.name for p in result.answer.parameters]
    )
    return found if same else None


def _is_own_mpm(row: EngineAnswer) -> bool:
    return row.engine == "mpm" and bool(row.std)
