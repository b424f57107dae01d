"""Which engine answers, and the back-analysis by it: most have the usual one, a few their own.

An engine whose back-analysis is not the usual one registers it here by its name. Nothing heavy is
imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase
from inversion.engines.registry import Engine, engine_named
from inversion.engines.run_store import RunStore
from pipeline.cli import InputError
from pipeline.places import MODELS, names_of, resolve
from pipeline.progress import Watch


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
        InputError: no such engine, one that is not installed, a model for an engine without one,
            or a trained engine without a model.
    """
    settings = case.config.inversion
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


Make = Callable[[InversionCase, RunStore, Watch, Path | None, Path], BackAnalysis]
"""From a case, a store of runs, a watch, the model's folder and that of the results."""


def _with_learned_simulator(
    case: InversionCase, store: RunStore, watch: Watch, model: Path | None, folder: Path
) -> BackAnalysis:
    from gns.data.scene_facts import with_known_water
    from inversion.back_analysis.with_learned_simulator import SurrogateAnalysis
    from inversion.engines.gns_engine import prepare
    from inversion.engines.rollout_store import RolloutStore
    from inversion.engines.trained_model import load_model

    prepare(store.device, store.threads)
    chosen = load_model(model, store.device)
    known, left_out = with_known_water(
        case.scene, case.setup.settings, thrust=chosen.simulator.config.thrust
    )
    return SurrogateAnalysis(
        replace(case, setup=replace(case.setup, settings=known)),
        store,
        watch.say,
        watch,
        model=chosen,
        rollouts=RolloutStore(folder / "rollouts"),
        on_frame=watch.frame_done,
        left_out=left_out,
    )


def _in_three_dimensions(
    case: InversionCase, store: RunStore, watch: Watch, model: Path | None, folder: Path
) -> BackAnalysis:
    from inversion.back_analysis.in_three_dimensions import in_three_dimensions

    return in_three_dimensions(case, store, watch)


def _with_direct_model(
    case: InversionCase, store: RunStore, watch: Watch, model: Path | None, folder: Path
) -> BackAnalysis:
    from inversion.back_analysis.with_direct_model import DirectAnalysis

    return DirectAnalysis(case, store, watch.say, watch, engine_name="direct")


_own: dict[str, Make] = {
    "gns": _with_learned_simulator,
    "mpm3d": _in_three_dimensions,
    "direct": _with_direct_model,
}


def register_back_analysis(name: str, make: Make) -> None:
    """Give an engine a back-analysis of its own."""
    _own[name] = make


def back_analysis_by(
    engine: Engine,
    case: InversionCase,
    store: RunStore,
    watch: Watch,
    model: Path | None = None,
    folder: Path = Path(),
) -> BackAnalysis:
    """The back-analysis of a case by an engine.

    Args:
        engine: what predicts.
        case: with its question.
        store: of runs.
        watch: told of progress.
        model: folder of the model of an engine that was trained.
        folder: of the results.
    """
    make = _own.get(engine.name)
    if make is not None:
        return make(case, store, watch, model, folder)
    return BackAnalysis(case, store, watch.say, watch, engine_name=engine.name)
