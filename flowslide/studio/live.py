"""Live runs: what a slider asks for, simulated at once; the newest question wins.

One thread owns the solver, since its kernels belong to the thread that made them. A question that
arrives while another is computed stops that one. Runs are kept by content, so that a question that
was asked before is answered at once. The numbers are those of `flowslide simulate`: the same case,
the same settings, the same readings.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event, Lock
from typing import Any

from flowslide.studio.frames import deposit
from geometry.case import Case
from geometry.scenes.scene import scene_from_mapping, scene_hash
from geometry.survey.measured import Measured
from mpm_taichi.comparison import Reading, read_deposit, simulate_case
from mpm_taichi.trajectory import Run
from pipeline.cli import InputError
from pipeline.files import content_hash
from pipeline.progress import Cancelled

#: Bytes of runs that are kept.
KEPT_BYTES = 400e6


@dataclass(frozen=True)
class Question:
    """What a page asks for.

    Attributes:
        number: of the question, which the answer repeats.
        case: with everything resolved and changed.
        film: send the way to the deposit as well.
    """

    number: int
    case: Case
    film: bool


def question(message: Mapping[str, Any], case: Case) -> Question:
    """Read a question of the page about a case.

    Args:
        message: `id`, `film`, `spacing_m`, `effects` ([{name, amplitude}]) and `changes`:
            `strengths_kpa` and `friction_deg` by material, `water_level` [m].
        case: that it is about.

    Raises:
        InputError: a number that cannot be; one line.
    """
    if case.survey is not None:
        case = case.with_set(message.get("set"))
    case = case.resolved(spacing_m=message.get("spacing_m"))
    document = case.scene.model_dump()
    changes = message.get("changes") or {}
    for key, values in (("cohesion_kpa", "strengths_kpa"), ("friction_deg", "friction_deg")):
        for material, value in (changes.get(values) or {}).items():
            if material not in document["materials"]:
                raise InputError(f"{values}: there is no material {material!r}")
            document["materials"][material][key] = value
    if "water_level" in changes:
        document["water_level"] = changes["water_level"]
        if changes["water_level"] is None:
            document["phreatic_line"] = None
    effects = {one["name"]: one["amplitude"] for one in message.get("effects") or []}
    document["effects"] = {**document["effects"], **effects}
    scene = scene_from_mapping(document, "scene with the sliders' values")
    return Question(
        int(message.get("id", 0)), replace(case, scene=scene), bool(message.get("film"))
    )


class Live:
    """The solver behind the sliders.

    Args:
        threads: CPU threads; None: all.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads
        self._owner = ThreadPoolExecutor(1, thread_name_prefix="solver")
        self._lock = Lock()
        self._newest: Event | None = None
        self._kept: OrderedDict[str, tuple[Run, list[Reading]]] = OrderedDict()

    def warm(self, case: Case) -> Future[Any]:
        """Have the kernels compiled before the first question."""
        short = case.simulation.model_copy(update={"duration_s": 0.2})
        return self._owner.submit(self._run, replace(case, simulation=short), Event())

    def ask(self, asked: Question) -> Future[bytes | None]:
        """Answer a question; None where a newer one has stopped it.

        The future raises InputError and WorkFailed.
        """
        stop = Event()
        with self._lock:
            if self._newest is not None:
                self._newest.set()
            self._newest = stop
        return self._owner.submit(self._answer, asked, stop)

    def stop(self) -> None:
        """Stop what is computed."""
        with self._lock:
            if self._newest is not None:
                self._newest.set()

    def close(self) -> None:
        """Stop, and end the thread."""
        self.stop()
        self._owner.shutdown(wait=True, cancel_futures=True)

    def _answer(self, asked: Question, stop: Event) -> bytes | None:
        if stop.is_set():
            return None
        key = content_hash({
            "scene": scene_hash(asked.case.scene),
            "measured": [one.model_dump(mode="json") for one in asked.case.measured],
            "settings": asked.case.simulation.model_dump(mode="json"),
        })  # fmt: skip
        cached = key in self._kept
        if not cached:
            try:
                run = self._run(asked.case, stop)
            except Cancelled:
                return None
            self._keep(key, run, _readings(asked.case, run))
        self._kept.move_to_end(key)
        run, readings = self._kept[key]
        return deposit(
            asked.case, run, readings, film=asked.film, id=asked.number, cached=cached,
            chi2=_chi2(readings),
        )  # fmt: skip

    def _run(self, case: Case, stop: Event) -> Run:
        def on_time(time: float) -> None:
            if stop.is_set():
                raise Cancelled("a newer question")

        return simulate_case(case, threads=self.threads, on_time=on_time)

    def _keep(self, key: str, run: Run, readings: list[Reading]) -> None:
        self._kept[key] = run, readings
        while (
            len(self._kept) > 1 and sum(_size(run) for run, _ in self._kept.values()) > KEPT_BYTES
        ):
            self._kept.popitem(last=False)


def _readings(case: Case, run: Run) -> list[Reading]:
    return [] if case.survey is None else read_deposit(case, run, at_start=False)


def _chi2(readings: list[Reading]) -> dict[str, float]:
    """Sum of squared differences in standard deviations of the survey, fitted and held out.

    Numbers alone: of a series only its root mean square is known here.
    """
    total = {"fitted": 0.0, "held_out": 0.0}
    for one in readings:
        measured: Measured | None = one.measurement
        if measured is not None and one.difference_in_std is not None:
            total["held_out" if measured.held_out else "fitted"] += one.difference_in_std**2
    return total


def _size(run: Run) -> int:
    return run.positions.nbytes + 60 * run.points
