"""The back-analysis by each engine: most have the usual one, a few their own.

An engine whose back-analysis is not the usual one registers it here by its name. Nothing heavy is
imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase
from inversion.engines.registry import Engine
from inversion.engines.run_store import RunStore
from pipeline.progress import Watch

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
    name: str, case: InversionCase, store: RunStore, watch: Watch, model: Path | None, folder: Path
) -> BackAnalysis:
    from inversion.back_analysis.with_direct_model import DirectAnalysis

    return DirectAnalysis(case, store, watch.say, watch, engine_name=name)


_own: dict[str, Make] = {
    "gns": _with_learned_simulator,
    "mpm3d": _in_three_dimensions,
    "direct": partial(_with_direct_model, "direct"),
    "corrected": partial(_with_direct_model, "corrected"),
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
