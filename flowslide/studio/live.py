"""Live runs: what a slider asks for, simulated at once; the newest question wins.

One thread owns the solver, since its kernels belong to the thread that made them. A question that
arrives while another of the same page waits takes its place; one that is computed already may end
within `PATIENCE_S`, so that a slider that is dragged shows deposits on its way. Runs are kept by
content, so that a question that was asked before is answered at once. The numbers are those of
`flowslide simulate`: the same case, the same settings, the same readings.
"""

from __future__ import annotations

from collections import OrderedDict
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event, Lock
from time import monotonic
from typing import Any, Literal, Protocol

from pydantic import Field

from flowslide.studio.frames import deposit
from geometry.case import Case
from geometry.random_scenes.sketch import signed_area
from geometry.scenes.scene import scene_from_mapping, scene_hash
from inversion.problem.scene_changes import pool_at
from mpm_taichi.comparison import read_deposit, simulate_case
from mpm_taichi.trajectory import Run
from pipeline.cli import InputError
from pipeline.documents import StrictDocument
from pipeline.files import content_hash
from pipeline.progress import Cancelled

#: Bytes of runs that are kept: some thirty of Lower San Fernando at 2 m.
KEPT_BYTES = 40e6
#: How long a run may go on when a newer question of its page waits [s].
PATIENCE_S = 1.5
#: Points of a live run, some ten seconds of one core: others are jobs.
MOST_POINTS = 20_000


class Changes(StrictDocument):
    """Values of the sliders."""

    strengths_kpa: dict[str, float] = Field(default_factory=dict, description="by material")
    friction_deg: dict[str, float] = Field(default_factory=dict, description="by material")
    water_level: float | None = Field(None, description="[m]; null: no water; absent: as it is")


class Switched(StrictDocument):
    """An effect that is switched on."""

    name: str
    amplitude: float


class Asked(StrictDocument):
    """A question as the page sends it; with documents, of a case that is not saved."""

    type: Literal["run"]
    id: int = Field(0, description="which the answer repeats")
    case: str = Field("new", description="name of the case")
    set: str | None = Field(None, description="of measurements; null: the one that the file names")
    spacing_m: float | None = Field(None, gt=0)
    film: bool = Field(False, description="send the way to the deposit as well")
    changes: Changes = Changes()
    effects: list[Switched] = Field(default_factory=list)
    scene: dict[str, Any] | None = None
    measurements: dict[str, Any] | None = None

    @property
    def documents(self) -> dict[str, Any] | None:
        """Of the case; None: those of its files."""
        if self.scene is None:
            return None
        return {"scene": self.scene, "measurements": self.measurements}


@dataclass(frozen=True)
class Question:
    """What is to be answered.

    Attributes:
        number: of the question, which the answer repeats.
        case: with everything resolved and changed.
        film: send the way to the deposit as well.
    """

    number: int
    case: Case
    film: bool


def question(asked: Asked, case: Case) -> Question:
    """What a page asks about a case.

    Raises:
        InputError: no such set or material, or a number that cannot be; one line.
    """
    if case.survey is not None:
        case = case.with_set(asked.set)
    spacing = asked.spacing_m or case.scene.spacing
    points = sum(abs(signed_area(zone.polygon)) for zone in case.scene.zones) / spacing**2
    if points > MOST_POINTS:
        raise InputError(
            f"{points:,.0f} points at a spacing of {spacing:g} m: sliders take at most "
            f"{MOST_POINTS:,}; take a coarser spacing, or Simulate under Ask, which is a job"
        )
    case = _at_spacing(case, asked.spacing_m)
    document, changes = case.scene.model_dump(), asked.changes
    for key, values in (("cohesion_kpa", "strengths_kpa"), ("friction_deg", "friction_deg")):
        for material, value in getattr(changes, values).items():
            if material not in document["materials"]:
                raise InputError(f"{values}: there is no material {material!r}")
            document["materials"][material][key] = value
            if key == "cohesion_kpa":  # a strength of its own replaces a ratio
                document["materials"][material].pop("strength_ratio", None)
    if "water_level" in changes.model_fields_set:
        level, moved = changes.water_level, None
        if level is not None:
            moved = pool_at(case.scene, level)["phreatic_line"]
        document |= {"water_level": level, "phreatic_line": moved}
    document["effects"] |= {one.name: one.amplitude for one in asked.effects}
    scene = scene_from_mapping(document, "scene with the sliders' values")
    return Question(asked.id, replace(case, scene=scene), asked.film)


_last: list[tuple[Case, float | None, Case]] = []


def _at_spacing(case: Case, spacing_m: float | None) -> Case:
    """The case at a spacing; the last one is kept, since a slider asks about it again and again."""
    for known, spacing, found in _last:
        if known is case and spacing == spacing_m:
            return found
    found = case.resolved(spacing_m=spacing_m)
    _last[:] = [(case, spacing_m, found)]
    return found


class Solver(Protocol):
    """What answers the sliders: `Live`, or `live_process.LiveProcess`."""

    threads: int | None

    def ask(self, asked: Question, asker: object = None) -> Future[bytes | None]:
        """Answer a question; None where a newer one of the same asker has taken its place."""

    def stop(self, asker: object = None) -> None:
        """Stop what is computed for an asker."""


class Live:
    """The solver behind the sliders.

    Args:
        threads: CPU threads; None: all.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads
        self._owner = ThreadPoolExecutor(1, thread_name_prefix="solver")
        self._lock = Lock()
        self._newest: dict[object, Event] = {}
        self._kept: OrderedDict[str, Run] = OrderedDict()

    def warm(self, case: Case) -> Future[Any]:
        """Have the kernels compiled before the first question."""
        short = case.simulation.model_copy(update={"duration_s": 0.2})
        return self._owner.submit(self._run, replace(case, simulation=short), Event())

    def ask(self, asked: Question, asker: object = None) -> Future[bytes | None]:
        """Answer a question; None where a newer one of the same asker has taken its place.

        The future raises InputError and WorkFailed.

        Args:
            asked: the question.
            asker: who asks, such as a page; those of others go on.
        """
        stop = Event()
        with self._lock:
            if asker in self._newest:
                self._newest[asker].set()
            self._newest[asker] = stop
        return self._owner.submit(self._answer, asked, stop)

    def stop(self, asker: object = None) -> None:
        """Stop what is computed for an asker."""
        with self._lock:
            if asker in self._newest:
                self._newest.pop(asker).set()

    def close(self) -> None:
        """Stop, and end the thread."""
        for asker in list(self._newest):
            self.stop(asker)
        self._owner.shutdown(wait=True, cancel_futures=True)

    def _answer(self, asked: Question, stop: Event) -> bytes | None:
        if stop.is_set():
            return None
        case = asked.case
        key = content_hash(
            {
                "scene": scene_hash(case.scene),
                "settings": case.simulation.model_dump(mode="json"),
            }
        )
        run = self._kept.get(key)
        cached = run is not None
        if run is None:
            try:
                run = self._run(case, stop)
            except Cancelled:
                return None
        self._keep(key, run)
        # Read again each time: what was measured may be another since.
        readings = [] if case.survey is None else read_deposit(case, run, at_start=False)
        return deposit(case, run, readings, film=asked.film, id=asked.number, cached=cached)

    def _run(self, case: Case, stop: Event) -> Run:
        begun = monotonic()

        def on_time(time: float) -> None:
            if stop.is_set() and monotonic() - begun > PATIENCE_S:
                raise Cancelled("a newer question")

        return simulate_case(case, threads=self.threads, on_time=on_time)

    def _keep(self, key: str, run: Run) -> None:
        """Keep a run as the newest; the oldest go."""
        self._kept[key] = run
        self._kept.move_to_end(key)
        while len(self._kept) > 1 and sum(map(_size, self._kept.values())) > KEPT_BYTES:
            self._kept.popitem(last=False)


def _size(run: Run) -> int:
    """Bytes of a run, about."""
    return run.positions.nbytes + 60 * run.points
