"""Slides of finite width by paired differences: few coarse runs in three dimensions on plane ones.

A run over a width costs as much as ten to a hundred plane runs. What flanks do is much alike at
both spacings, so what a slide of width B reads is

    f(H/B) = f_plane + [f_wide(H/B) - f_plane] of a coarser spacing,

and what the spacing makes of a slide is in neither. Widths are whole cells: differences are taken
at the knots `RATIOS` and are linear between them, from none in plane strain on. The pair has
neither effects nor jitter, so that what else is on trial changes the plane run alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.scenes3d.scene3d import Section
from geometry.sides import SIDES
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import KeepsRuns, KeptRun, RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.estimation.forward import Forward, Prediction, Request, SectionSetup, WrappedEngine
from pipeline.cli import InputError

#: Heights over widths H/B of the runs in three dimensions, nearly: widths are whole cells.
RATIOS = (0.1, 0.2, 0.35, 0.6)
#: Spacing of the pair over that of the plane run; heights of room beyond open ends.
COARSER, ROOM = 1.5, 5.0
#: Settings of the pair, as the solver in three dimensions has them.
PAIRED = {
    "transfer": "affine_flip",
    "water_face": "fixed",
    "wall_contact": "smooth",
    "local_damping": 0.0,
    "volume_correction": True,
}


@dataclass
class FiniteWidth(WrappedEngine):
    """A forward engine that answers setups with a `height_over_width` as well.

    Attributes:
        engine: of the plane runs.
        store: whose folder, threads and reports the runs of the pairs have.
        wide_runs: simulations in three dimensions so far.
    """

    engine: Forward
    store: RunStore

    def __post_init__(self) -> None:
        self._stores: dict[str, RunStore] = {}

    @property
    def wide_runs(self) -> int:
        """Simulations in three dimensions so far."""
        return sum(one.computed for one in self._stores.values() if isinstance(one, RunStore3d))

    @property
    def keeps_runs(self) -> bool:
        """The engine has whole runs, for pictures and for the stress before failure."""
        return isinstance(self.engine, KeepsRuns)

    def kept_run(self, request: Request) -> KeptRun:
        """The plane run of a request, for pictures, where it keeps any."""
        assert isinstance(self.engine, KeepsRuns)
        return self.engine.kept_run(_plane(request))

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Plane predictions, and what the width adds to those that have one."""
        found = self.engine.predict([_plane(request) for request in requests])
        return [
            self._with_width(request, prediction)
            if request.section.height_over_width
            else prediction
            for request, prediction in zip(requests, found, strict=True)
        ]

    def _with_width(self, request: Request, plane: Prediction) -> Prediction:
        setup = paired(request.section)
        places, widths = knots(setup.scene)
        ratio = min(request.section.height_over_width, places[-1])
        upper = int(np.searchsorted(places, ratio))
        share = (
            ratio / places[0]
            if upper == 0
            else ((ratio - places[upper - 1]) / (places[upper] - places[upper - 1]))
        )
        flat = self._read(self._store(None, setup.scene), setup, request.values)
        parts = [(upper, share)] if upper == 0 else [(upper - 1, 1.0 - share), (upper, share)]
        moved = np.zeros(len(plane.values))
        for knot, weight in parts:
            if weight > 0.0:
                wide = self._read(self._store(widths[knot], setup.scene), setup, request.values)
                moved += weight * (wide.values - flat.values)
        values = plane.values + moved
        if np.all(np.isfinite(values[request.setup.targets.fitted])):
            return replace(plane, values=values)
        return replace(plane, values=values, status="failed", reason="no run over the width")

    def _read(self, store: RunStore, setup: SectionSetup, values: np.ndarray) -> Prediction:
        return MPMEngine(store).predict([setup.at(values)])[0]

    def _store(self, width: float | None, scene: Scene) -> RunStore:
        key = f"{width}"
        if key not in self._stores:
            shared = {"threads": self.store.threads}
            self._stores[key] = (
                RunStore(self.store.folder, **shared)
                if width is None
                else RunStore3d(
                    Section(file="", width_m=width), "rough", self.store.folder, **shared
                )
            )
        return self._stores[key]


def refused(setup: SectionSetup) -> str:
    """Why a setup has no pair; empty: it has one."""
    try:
        pair = paired(setup)
    except InputError as error:
        return str(error)
    return RunStore3d(Section(file="", width_m=1.0), "rough", None).refused(pair)


def paired(setup: SectionSetup) -> SectionSetup:
    """What both runs of a pair have: a coarser spacing, closed walls, no effects, no jitter.

    Nor does pore water flow in them.

    Raises:
        InputError: the section does not hold together at the coarser spacing.
    """
    scene = setup.scene
    domain, room = scene.domain, ROOM * scene.height
    left, right = (room if domain.is_open(side) else 0.0 for side in SIDES)
    closed = {
        **domain.model_dump(),
        "x_min": domain.x_min - left,
        "x_max": domain.x_max + right,
        "walls": "closed",
    }
    soils = scene.model_dump()["materials"]
    still = {"permeability_m_per_s": None, "excess_pressure_ratio": None}
    changes = {
        "domain": closed,
        "materials": {name: {**soil, **still} for name, soil in soils.items()},
        "spacing": COARSER * scene.spacing,
        "jitter": 0.0,
        "seed": 0,
        "effects": {},
    }
    return replace(
        setup,
        scene=scene_from_mapping({**scene.model_dump(), **changes}, f"{scene.name} over a width"),
        settings=setup.settings.model_copy(update=PAIRED),
        height_over_width=0.0,
    )


def knots(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """H/B that are run, ascending, and the widths B [m], in whole cells."""
    height = scene.height
    cells = np.unique([max(round(height / (ratio * scene.cell_size)), 2) for ratio in RATIOS])
    widths = cells[::-1] * scene.cell_size
    return height / widths, widths


def _plane(request: Request) -> Request:
    setup = request.section
    if not setup.height_over_width:
        return request
    return replace(request, setup=replace(setup, height_over_width=0.0))
