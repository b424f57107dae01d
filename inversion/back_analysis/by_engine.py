"""Which engine answers, and the back-analysis by it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

from inversion.back_analysis.asked import Asked
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.body_case import ENGINE as OF_BODIES
from inversion.back_analysis.body_case import BodyCase
from inversion.engines.registry import REFERENCE, Engine, engine_named, untrained
from inversion.engines.run_store import Store
from pipeline.cli import InputError
from pipeline.places import MODELS, names_of, resolve
from pipeline.progress import Watch


@dataclass(frozen=True)
class Choice:
    """An engine, and for one that was trained the folder of its model."""

    engine: Engine
    model: Path | None = None


def chosen_engine(case: Asked, engine: str | None, model: str | None) -> Choice:
    """The engine of a back-analysis: the command line's, else the question's, else the settings'.

    Args:
        case: with its question and settings.
        engine: of the command line; None: not given.
        model: the same.

    Raises:
        InputError: no such engine, one that is not installed or does not simulate bodies, a model
            for an engine without one, or a trained engine without a model.
    """
    settings = case.config.inversion
    if isinstance(case, BodyCase):
        if engine not in (None, OF_BODIES):
            raise InputError(f"--engine {engine}: not in three dimensions ({case.folder})")
        if model is not None:
            raise InputError(f"--model: not in three dimensions ({case.folder})")
        return Choice(engine_named(OF_BODIES))
    chosen = engine_named(engine or case.question.engine or settings.engine, case.source)
    chosen.check_installed()
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


def back_analysis_by(
    engine: Engine,
    case: Asked,
    plain: Store,
    watch: Watch,
    model: Path | None = None,
    folder: Path = Path(),
) -> BackAnalysis:
    """The back-analysis of a case by an engine.

    Args:
        engine: what predicts.
        case: with its question.
        plain: store of runs, from which the engine makes its own.
        watch: called with the progress.
        model: folder of the model of an engine that was trained.
        folder: of the results.

    Raises:
        InputError: the case lacks what the engine needs.
    """
    store = engine.store_of(case.folder, case.setup, plain)
    if engine.analysis:
        return resolve_name(engine.analysis)(case, store, watch, model, folder)
    return BackAnalysis(case, store, watch.say, watch, engine_name=engine.name)


def untrained_engine(case: Asked, engine: str | None) -> Engine:
    """The engine of what is more than a back-analysis.

    Args:
        case: with its question.
        engine: its name; None: the one that judges the others.

    Raises:
        InputError: no such engine, one that needs a trained model, is not installed or does not
            simulate such a case.
    """
    if isinstance(case, BodyCase):
        return chosen_engine(case, engine, None).engine
    return untrained(engine or REFERENCE)
