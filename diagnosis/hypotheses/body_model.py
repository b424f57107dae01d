"""The solver of bodies in three dimensions as the model of a diagnosis.

A state is a body with other assumptions (`diagnosis.hypotheses.body`), values of its parameters,
jittered points or finer cells. There are no effects, no second transfer scheme, no whole runs for
pictures, and no measurements are proposed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from diagnosis.hypotheses.body import assumptions
from diagnosis.hypotheses.engine_model import Numerics, RunModel
from inversion.back_analysis.deviations import LEFT_OUT
from inversion.engines.body_setup import BodySetup
from inversion.engines.registry import Engine
from inversion.engines.run_store import Store
from inversion.problem.question import Sensitivity
from inversion.problem.state import State
from pipeline.cli import InputError


class BodyModel(RunModel[BodySetup]):
    """A forward engine that simulates bodies.

    Args:
        setup: body, settings, parameters and measurements of the base model.
        store: of the runs.
        engine: what predicts; its runs are kept in the store.
        sensitivities: of the question: what is said to be uncertain, and by how much.
        priors: candidate -> (mean, std) of its amplitude, in place of its own.
        numerics: how the model's own error is measured.
    """

    def __init__(
        self,
        setup: BodySetup,
        store: Store,
        *,
        engine: Engine,
        sensitivities: Sequence[Sensitivity] = (),
        priors: Mapping[str, tuple[float, float]] | None = None,
        numerics: Numerics | None = None,
    ) -> None:
        super().__init__(
            setup,
            store,
            engine.made(store),
            found=assumptions(setup, sensitivities),
            priors=priors,
            numerics=numerics,
        )

    def simulates(self, state: State) -> bool:
        """See `Model`: it has one transfer scheme."""
        return state.numerics != "transfer"

    def setup_of(self, state: State) -> BodySetup:
        """See `RunModel`."""
        setup, acting = self._assumed(state)
        if acting:
            raise InputError(f"{next(iter(acting))}: {LEFT_OUT}")
        if state.numerics == "fine":
            setup = setup.at_spacing(setup.scene.spacing / self.numerics.finer, setup.scene.name)
        if state.seed:
            setup = setup.jittered(self.numerics.jitter, state.seed)
        return setup
