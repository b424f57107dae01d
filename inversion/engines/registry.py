"""The forward engines by name: what each is called, where its results lie, how it is made.

A new engine is two files: one that predicts (`inversion.estimation.forward.Forward`) and one that
registers it with `register_engine`; back-analysis, prediction, diagnosis, commands and reports find
it by its name. Nothing heavy is imported before an engine is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from pipeline.cli import InputError
from pipeline.extras import require

if TYPE_CHECKING:
    from geometry.survey.measured import Measured
    from inversion.engines.run_store import Store
    from inversion.estimation.forward import Forward, SectionSetup, Setup

#: The engine that judges the others.
REFERENCE = "mpm"


@dataclass(frozen=True)
class Engine:
    """A forward engine.

    Attributes:
        name: in options, questions and documents.
        title: heading of a table.
        description: as part of a sentence.
        short: in a chart.
        folder: of its results, below results/<case>/.
        forward: makes it; runs are kept in the store. None: its back-analysis alone makes it.
        store: the store that its runs need, from the folder of a case, a setup and a plain store,
            or an `InputError`; None: the plain one.
        analysis: "module:function" that makes its back-analysis, where that is not the usual one;
            called as `inversion.back_analysis.by_engine.back_analysis_by` says.
        trained: it needs a trained model, whose folder its back-analysis is given.
        effects: it simulates the physical effects of a scene, and whatever may be assumed of its
            soils, its water and its ground.
        reads: whether it can predict a measurement.
        learned_effects: of an engine without effects: those that it predicts all the same, with
            the default values of their further numbers, and up to which amplitude; None: none.
        unseen: of an engine without effects: reason why it cannot predict a changed setup, or would
            ignore the change; empty if it can. None: only changes of section and survey count.
        waterfall: it can solve the steps of a waterfall, which may be sections of other cases.
        extra: of the installation, without which it cannot run; empty: it needs none.
    """

    name: str
    title: str
    description: str
    short: str
    folder: str
    forward: Callable[[Store], Forward] | None = None
    store: Callable[[Path, Setup, Store], Store] | None = None
    analysis: str = ""
    trained: bool = False
    effects: bool = True
    reads: Callable[[Measured], bool] = lambda entry: True
    learned_effects: Callable[[], Mapping[str, float]] | None = None
    unseen: Callable[[SectionSetup, SectionSetup], str] | None = None
    waterfall: bool = True
    extra: str = ""

    @property
    def is_learned(self) -> bool:
        """A model that was trained on runs of the solver, which may judge it."""
        return self.extra == "learned"

    def store_of(self, folder: Path, setup: Setup, plain: Store) -> Store:
        """The store of its runs for a case.

        Raises:
            InputError: the case lacks what its runs need; one line.
        """
        return plain if self.store is None else self.store(folder, setup, plain)

    def made(self, store: Store) -> Forward:
        """The engine itself.

        Args:
            store: of its runs, from `store_of`.

        Raises:
            InputError: its back-analysis alone can make it.
        """
        if self.forward is None:
            raise InputError(
                f"engine: {self.label} needs a trained model: back-analysis alone has it"
            )
        return self.forward(store)

    def check_installed(self) -> None:
        """Check that it can run here.

        Raises:
            InputError: its extra is not installed; the line says what to install.
        """
        if self.extra:
            require(self.extra, f"the engine {self.name}")

    @property
    def suffix(self) -> str:
        """Of folders of its results that are no back-analyses: those of engines lie apart."""
        return self.folder.removeprefix("inversion")

    @property
    def said(self) -> str:
        """Who has answered, for a sentence; empty for the engine that judges the others."""
        return "" if self.name == REFERENCE else f"by {self.description}"

    @property
    def label(self) -> str:
        """Name for a terminal, with what it is short for."""
        return self.name if self.name == self.short.lower() else f"{self.name} ({self.short})"


def _mpm(store: Store) -> Forward:
    from inversion.engines.mpm_engine import MPMEngine
    from inversion.engines.run_store import RunStore

    assert isinstance(store, RunStore)
    return MPMEngine(store)


def _mpm3d(store: Store) -> Forward:
    from inversion.engines.body_engine import BodyEngine, BodyStore

    return BodyEngine(store) if isinstance(store, BodyStore) else _mpm(store)


def _store_3d(folder: Path, setup: Setup, store: Store) -> Store:
    from inversion.engines.body_engine import body_store
    from inversion.engines.run_store_3d import store_over_width
    from inversion.estimation.forward import SectionSetup

    if isinstance(setup, SectionSetup):
        return store_over_width(folder, setup, store)
    return body_store(setup, store)


def _direct(store: Store) -> Forward:
    from inversion.engines.direct_engine import shipped

    return shipped("direct")


def _learned_by_direct() -> Mapping[str, float]:
    from inversion.engines.direct_engine import learned_effects

    return learned_effects("direct")


def _on_the_deposit(entry: Measured) -> bool:
    from inversion.engines.direct_engine import readable

    return readable(entry)


def _unseen_by_columns(before: SectionSetup, after: SectionSetup) -> str:
    from inversion.engines.direct_engine import unseen

    return unseen(before, after)


_engines: dict[str, Engine] = {}


def register_engine(engine: Engine) -> Engine:
    """Make an engine known by its name; one of the same name gives way."""
    _engines[engine.name] = engine
    return engine


def engines() -> Mapping[str, Engine]:
    """All engines by name."""
    return MappingProxyType(_engines)


def engine_named(name: str, source: str = "") -> Engine:
    """The engine of a name.

    Raises:
        InputError: there is none; `source` says where the name stands.
    """
    if name not in _engines:
        where = f"{source}: " if source else ""
        raise InputError(f"{where}engine: no engine {name!r}; there are {', '.join(_engines)}")
    return _engines[name]


def untrained(name: str) -> Engine:
    """The engine of a name, which answers more than a back-analysis.

    Raises:
        InputError: there is none, it needs a trained model, or is not installed.
    """
    chosen = engine_named(name)
    if chosen.trained:
        raise InputError(
            f"engine: {chosen.label} needs a trained model: back-analysis alone has it"
        )
    chosen.check_installed()
    return chosen


def of_section(name: str) -> Engine:
    """The engine of a name, which answers questions about a plane section.

    Raises:
        InputError: there is none, it needs a trained model, is not installed, or simulates more
            than the section.
    """
    chosen = untrained(name)
    if chosen.store is not None:
        raise InputError(
            f"engine: {chosen.label} answers back-analyses, posteriors and predictions"
        )
    return chosen


MPM = register_engine(
    Engine(
        name=REFERENCE,
        title="material point method",
        description="the material point method",
        short="MPM",
        folder="inversion",
        forward=_mpm,
    )
)
register_engine(
    Engine(
        name="gns",
        title="Diff-GNS",
        description="a learned simulator (Diff-GNS)",
        short="Diff-GNS",
        folder="inversion_gns",
        analysis="inversion.back_analysis.with_learned_simulator:surrogate_analysis",
        trained=True,
        effects=False,
        waterfall=False,
        extra="learned",
    )
)
register_engine(
    Engine(
        name="mpm3d",
        title="material point method in three dimensions",
        description="the material point method in three dimensions",
        short="MPM in 3-D",
        folder="inversion_3d",
        forward=_mpm3d,
        store=_store_3d,
        effects=False,
        waterfall=False,
    )
)
register_engine(
    Engine(
        name="direct",
        title="direct model",
        description="a learned model that predicts the deposit in one pass",
        short="direct",
        folder="inversion_direct",
        forward=_direct,
        analysis="inversion.back_analysis.with_direct_model:direct_analysis",
        effects=False,
        learned_effects=_learned_by_direct,
        reads=_on_the_deposit,
        unseen=_unseen_by_columns,
        extra="learned",
    )
)
