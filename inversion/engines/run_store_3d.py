"""Simulations of extruded sections, kept by content as those of sections are.

A section that is asked for is simulated between the flanks of `scene3d.yaml`, and what is kept of
the run is its middle section. So the usual engine, and the estimator, measurements and reports
above it, work in three dimensions as they are.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.scenes3d.scene3d import FILE_NAME, Flanks, Section, read_document
from inversion.engines.run_store import RunStore, Store, kept_run
from inversion.estimation.forward import HistoryReader, SectionSetup, Setup
from mpm_taichi.batch import run_key
from pipeline.cli import InputError
from pipeline.files import content_hash

if TYPE_CHECKING:
    from mpm_taichi.middle_section import MiddleSection
    from pipeline.config import SimulationSettings


class RunStore3d(RunStore):
    """Runs by content of sections over a width.

    Args:
        section: width, slope of the flanks, walls.
        flanks: contact of vertical flanks.
        folder: of the files; None: in memory alone.
        options: as of `Store`.

    Raises:
        InputError: another device than the CPU.
    """

    def __init__(
        self, section: Section, flanks: Flanks, folder: str | Path | None, **options: Any
    ) -> None:
        super().__init__(folder, **options)
        if self.device != "cpu":
            raise InputError(f"device {self.device}: three dimensions run on the CPU alone")
        self.section, self.flanks = section, flanks

    @property
    def of_cells(self) -> RunStore:
        """Plane runs: cells cost in a section what they cost over a width."""
        return RunStore(self.folder, **self.options)

    @contextmanager
    def workers(self) -> Iterator[None]:
        """None: a run uses all threads."""
        yield

    def refused(self, setup: Setup) -> str:
        """Why the solver does not simulate a setup; empty: it does."""
        from mpm_taichi.simulate3d import refuse_problem
        from mpm_taichi.solver3d.problem import extruded

        assert isinstance(setup, SectionSetup)
        try:
            narrow = 3.0 * setup.scene.spacing
            refuse_problem(extruded(self.walled(setup.scene), narrow), setup.settings)
        except InputError as error:
            return str(error)
        return ""

    def key(self, scene: Scene, settings: SimulationSettings) -> str:
        """Hash of everything the numbers of a run depend on."""
        section = self.section.model_dump(exclude={"file"})
        return content_hash(
            {"two": run_key(scene, settings, self.device), **section, "flanks": self.flanks}
        )

    def simulate(self, scene: Scene, settings: SimulationSettings) -> MiddleSection:
        """Simulate a section over the width; its middle."""
        from mpm_taichi.middle_section import middle_section
        from mpm_taichi.simulate3d import simulate_3d
        from mpm_taichi.solver3d.problem import extruded

        walled = self.walled(scene)
        problem = extruded(
            walled,
            self.section.width_m,
            flanks=self.flanks,
            flank_slope=self.section.flank_slope,
        )
        run = simulate_3d(problem, settings, threads=self.threads)
        return middle_section(problem, run, walled, settings)

    def walled(self, scene: Scene) -> Scene:
        """The section between closed walls; they move by whole spacings, so its points stay."""
        domain, d = scene.domain, scene.spacing
        left = domain.x_min if self.section.x_min is None else self.section.x_min
        right = domain.x_max if self.section.x_max is None else self.section.x_max
        left = domain.x_min + d * math.floor((left - domain.x_min) / d)
        changed = {**domain.model_dump(), "x_min": left, "x_max": right, "walls": "closed"}
        return scene_from_mapping(
            {**scene.model_dump(), "domain": changed}, f"{scene.name} in three dimensions"
        )

    def write_run(self, scene: Scene, settings: SimulationSettings, path: Path) -> None:
        """Simulate once more with all frames, of which the middle section is written."""
        from mpm_taichi.trajectory import write_runs

        with redirect_stdout(sys.stderr):
            write_runs(path, {0: self.simulate(scene, settings)})

    def _compute(
        self,
        missing: dict[str, tuple[Scene, SimulationSettings]],
        readers: Mapping[str, Sequence[HistoryReader]],
    ) -> None:
        with redirect_stdout(sys.stderr):
            for done, (key, (scene, settings)) in enumerate(missing.items(), start=1):
                self._keep(key, kept_run(self.simulate(scene, settings), readers[key]))
                if self.on_run is not None:
                    self.on_run(done, len(missing))


def store_over_width(folder: Path, setup: SectionSetup, store: Store) -> RunStore3d:
    """The store of a case's runs over the width that the `scene3d.yaml` of its folder says.

    Args:
        folder: of the case.
        setup: what will be simulated, at least.
        store: whose folder, threads and reports it takes over.

    Raises:
        InputError: no such file, one without a section, or a setup that the solver refuses.
    """
    document = read_document(folder / FILE_NAME)
    if document.section is None:
        raise InputError(f"{folder / FILE_NAME}: the engine mpm3d needs a section")
    solid = RunStore3d(document.section, document.flanks, store.folder, **store.options)
    if reason := solid.refused(setup):
        raise InputError(f"{folder / FILE_NAME}: {reason}")
    return solid
