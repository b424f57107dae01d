"""What the questions of a diagnosis share: the case, its model, its folder, its clock.

In: a case folder and the settings. Out: a `Session`. Runs are kept by content in `runs/` of the
folder, so a question goes on where another ended, or where it was killed itself. What depends on
the clock or the machine goes into `timing.json`; every other file has the same bytes whenever it is
made.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import diagnosis
import geometry
import inversion
import mpm_taichi
from diagnosis.body_diagnosis import body_diagnosis
from diagnosis.case import Diagnosed, diagnosis_case
from diagnosis.hypotheses.engine_model import EngineModel, RunModel
from diagnosis.hypotheses.hypothesis_file import (
    BASE,
    FOLDER,
    Hypothesis,
    check_parent,
    find_hypothesis,
    load_hypothesis,
)
from diagnosis.options import Options
from diagnosis.ranking import Ranked, Ranking
from diagnosis.verdict.sections_file import save_sections
from diagnosis.verdict.verdict import CompareDocument, ExplainDocument, Verdict
from geometry.case import Case
from geometry.sides import outward_of
from inversion.back_analysis.body_case import BodyCase
from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import OnRun, RunStore, Store
from inversion.estimation.forward import SectionSetup
from inversion.problem.state import State
from pipeline.cli import InputError
from pipeline.config import Config
from pipeline.files import content_hash, file_hash, read_json, write_json
from pipeline.manifest import code_version, machine, package_versions

TIMING = "timing.json"
#: Forward runs that a question takes, on opened slides in half less and in half more: the fit of
#: the base model and its errors, each hypothesis, and the search where the base model fails.
FOR_THE_FIT, FOR_EACH, FOR_THE_SEARCH = 40, 2.5, 250
HASH_DIGITS = 16
"""Of the hashes of the case's files that a verdict names: 64 bits tell any two files apart."""

Document = TypeVar("Document", CompareDocument, ExplainDocument, Verdict)


@dataclass
class Session:
    """One question about one case.

    Attributes:
        case: the case to diagnose.
        config: settings in force.
        folder: of the results.
        store: of the runs.
        hypothesis_name: of what replaces the base model.
        hypothesis: the same; None: the base model itself.
        say: called with a line of progress.
        spacing_m: as asked for; None: the case's own.
        engine: what predicts.
        ranked: called with the ranking of the hypotheses as it grows; None: nobody watches.
    """

    case: Diagnosed
    config: Config
    folder: Path
    store: Store
    hypothesis_name: str
    hypothesis: Hypothesis | None
    say: Callable[[str], None]
    spacing_m: float | None = None
    engine: Engine = MPM
    ranked: Ranked | None = None
    began: float = field(default_factory=time.perf_counter)

    @cached_property
    def model(self) -> RunModel:
        """The model as the statistics see it."""
        return self.case.model(self.store, self.engine)

    @cached_property
    def options(self) -> Options:
        """What the statistics know."""
        return self.case.options(self.model)

    @property
    def ranking(self) -> Ranking:
        """Tells who watches how the hypotheses stand."""
        return Ranking(self.ranked)

    def usual_runs(self, question: str) -> int:
        """About how many forward runs a comparison, an explanation or anything else takes."""
        runs = FOR_THE_FIT
        if question != "comparison":
            runs += round(FOR_EACH * len(self.model.candidates))
        if question not in ("comparison", "explanation"):
            runs += FOR_THE_SEARCH
        return min(runs, self.config.diagnosis.max_runs)

    @property
    def is_base(self) -> bool:
        """No other model stands in place of the base model."""
        return self.hypothesis is None

    @cached_property
    def root(self) -> Session:
        """The same question asked of the base model."""
        if self.is_base:
            return self
        case = self.case.again(self.spacing_m, None)
        return replace(self, case=case, hypothesis_name=BASE, hypothesis=None)

    @property
    def seconds(self) -> float:
        """Wall time since the command began [s]."""
        return time.perf_counter() - self.began

    @cached_property
    def hashes(self) -> dict[str, str]:
        """Of all that went in."""
        found = {path.name: file_hash(path)[:HASH_DIGITS] for path in self.case.files}
        found["scene at this spacing"] = self.case.scene_hash[:16]
        found["settings of the simulation"] = content_hash(self.case.setup.settings)
        if self.hypothesis is not None:
            found["hypothesis"] = content_hash(self.hypothesis)
        return found

    @property
    def manifest(self) -> dict[str, Any]:
        """How it was made, as far as that is the same on every machine and at any time."""
        failures = sorted(self.model.failures.items(), key=lambda pair: repr(pair[0]))
        return {
            **self.manifest_core,
            "failed_runs": {describe(state): reason for state, reason in failures},
        }

    @cached_property
    def manifest_core(self) -> dict[str, Any]:
        """Settings, seeds, versions: known before the first run."""
        return {
            "settings": {
                "diagnosis": self.config.diagnosis.model_dump(mode="json"),
                "simulation": self.case.setup.settings.model_dump(mode="json"),
                "synthetic": self.options.synthetic,
                "spacing_m": self.case.setup.scene.spacing,
                **({} if self.engine is MPM else {"engine": self.engine.name}),
            },
            "seeds": {"noise": self.options.seed},
            "hypothesis": self.hypothesis_name,
            "physics_versions": {
                package.__name__: package.PHYSICS_VERSION
                for package in (geometry, mpm_taichi, inversion, diagnosis)
            },
        }

    def made_from(self, model: Hypothesis | None) -> str:
        """Hash of all that decides the error of a model: the case, settings, a person's changes."""
        own = None if model is None or model.by != "engineer" else model
        files = {path.name: file_hash(path)[:HASH_DIGITS] for path in self.case.files}
        versions = self.manifest_core["physics_versions"]
        settings = self.manifest_core["settings"]
        return content_hash(
            {
                "files": files,
                "settings": settings,
                "versions": versions,
                "options": asdict(self.root.options),
                "model": own,
            }
        )

    def without(self, effects: Sequence[str]) -> Session:
        """The same question asked of the model without some of its effects."""
        assert self.hypothesis is not None
        kept = {n: e for n, e in self.hypothesis.effects.items() if n not in effects}
        model = self.hypothesis.model_copy(update={"effects": kept})
        case = self.case.again(self.spacing_m, model)
        return replace(self, case=case, hypothesis=model)

    def timeless(self, document: Document) -> Document:
        """A document without what depends on the clock or on runs that were kept before."""
        changes: dict[str, Any] = {"runs": document.runs.model_copy(update={"computed": None})}
        if isinstance(document, Verdict):
            changes |= {"seconds": None, "hashes": self.hashes, "manifest": self.manifest}
        return document.model_copy(update=changes)

    def write_timing(self, command: str) -> None:
        """Put what depends on the clock and the machine into a file of its own, by command."""
        path = self.folder / TIMING
        own = {
            "made": datetime.now(UTC).isoformat(timespec="seconds"),
            "seconds": round(self.seconds, 2),
            "runs_asked": self.model.runs,
            "runs_computed": self.model.computed,
            "code_version": code_version(),
            "packages": package_versions(),
            "machine": machine(),
        }
        write_json(path, {**self._timing_before(path), command: own})

    def _timing_before(self, path: Path) -> dict[str, Any]:
        """Timings of earlier commands; a file that cannot be read is reported and rewritten."""
        if not path.is_file():
            return {}
        try:
            before = read_json(path)
            if isinstance(before, dict):
                return before
            kind = type(before).__name__
            raise InputError(f"{path}: must be a mapping of commands, not {kind}")
        except InputError as error:
            self.say(f"{error}; it is rewritten")
        return {}

    def write_sections(self, base: State, final: State) -> None:
        """Write the points before and after the slide, for the pictures, if the engine has any."""
        model, setup = self.model, self.case.setup
        if not (isinstance(model, EngineModel) and isinstance(setup, SectionSetup)):
            return
        if not model.keeps_runs:
            return
        before, after = model.points(base), model.points(final)
        toes = {
            entry.name: (float(setup.foot[side]), float(outward_of(side)))
            for entry in setup.targets.entries
            if (side := entry.toe_side) is not None
        }
        save_sections(
            self.folder,
            initial=(before.initial, before.initial_volume),
            base=before.moved,
            final=after.moved,
            spacing=setup.scene.spacing,
            ground=np.asarray(setup.scene.ground.points),
            toes=toes,
        )


def describe(state: State) -> str:
    """A state in a line."""
    words = [f"{value:.4g}" for value in state.values]
    words += [f"{name} {amplitude:.4g}" for name, amplitude in state.effects]
    if state.seed:
        words.append(f"jitter {state.seed}")
    if state.numerics != "own":
        words.append(state.numerics)
    return ", ".join(words)


def open_session(
    case: Case | BodyCase,
    *,
    out: str | Path | None = None,
    hypothesis: str | None = None,
    spacing_m: float | None = None,
    engine: Engine = MPM,
    threads: int | None = None,
    say: Callable[[str], None] = lambda line: None,
    on_run: OnRun | None = None,
    ranked: Ranked | None = None,
) -> Session:
    """Read everything a diagnosis needs, before the first simulation.

    Args:
        case: with measurements; a section, or a body in three dimensions.
        out: folder of the results; None: `<results_folder>/<case>/diagnosis`, of another engine
            `diagnosis_direct`, of a body `diagnosis_on_maps`.
        hypothesis: a file to go on from, or its name in `hypotheses/` of the folder; None: the
            base model.
        spacing_m: of material points; None: the case's own.
        engine: what predicts.
        threads: CPU threads; None: all.
        say: called with a line of progress.
        on_run: called for each run of a batch.
        ranked: called with the ranking of the hypotheses as it grows; None: nobody watches.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    own = "diagnosis_on_maps" if isinstance(case, BodyCase) else f"diagnosis{engine.suffix}"
    folder = Path(out or Path(case.config.results_folder) / case.name / own)
    if (folder / "models").is_dir() and not (folder / FOLDER).is_dir():
        say(f"{folder / 'models'}: is not read any more; rename it to {FOLDER}")
    name, model, origin = BASE, None, ""
    if hypothesis is not None:
        name, path = find_hypothesis(folder, hypothesis)
        model, origin = load_hypothesis(path), str(path)
        check_parent(model, path, folder)
    asked: Diagnosed
    if isinstance(case, BodyCase):
        asked = body_diagnosis(case, spacing_m=spacing_m, hypothesis=model, source=origin)
    else:
        asked = diagnosis_case(
            case, spacing_m=spacing_m, hypothesis=model, hypothesis_source=origin
        )
    plain = RunStore(folder / "runs", threads=threads, on_run=on_run)
    store = engine.store_of(asked.folder, asked.setup, plain)
    return Session(asked, case.config, folder, store, name, model, say, spacing_m, engine, ranked)
