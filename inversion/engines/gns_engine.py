"""The learned simulator as a forward engine, differentiated through whole rollouts (Diff-GNS).

In: the requests of the material point method, and a trained model whose weights stay as they are.
Out: the same predictions, read from the end of a rollout by the same lines, and their derivative
with respect to every parameter: exact, by forward mode where there are few parameters and by
reverse mode where there are fewer numbers to fit (`gns.rollout.differentiate`). A rollout starts
from the scene alone, as in `gns.rollout.rollout`, and ends at rest by the same rule.

Which points are neighbours has no derivative. With a smooth cut-off a neighbour that comes or goes
has no weight, and the derivative is that of finite differences; with a sharp one a finite step also
sees messages that appear and vanish, which the derivative leaves out.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene
from gns.data.distance import FARTHEST
from gns.data.scene_facts import SceneFacts, first_window, start_of
from gns.network.units import ScaledScene
from gns.rollout.differentiate import REVERSE_COST, jacobian, reverse_jacobian
from gns.rollout.rollout import Rest, RestWatch, frames_of, wrong_step
from gns.rollout.traced_rollout import trace
from gns.rollout.zone_parameters import UnknownProperty, scene_function
from gns.training.processes import check_device, use_threads
from inversion.engines.read_run import prediction_of
from inversion.engines.rollout_readings import RolledOut, RolloutReading
from inversion.engines.rollout_store import (
    RolloutStore,
    derivative_key,
    entry_keys,
    rollout_key,
)
from inversion.engines.run_store import KeptRun
from inversion.engines.trained_model import TrainedModel
from inversion.estimation.forward import Forward, Prediction, Request, SectionSetup
from inversion.problem.question import material_key
from inversion.problem.scene_changes import moves_with_pool
from pipeline.cli import InputError, WorkFailed

Mode = Literal["cheaper", "forward", "reverse"]


@dataclass(frozen=True)
class StartingRollout:
    """A rollout that is about to begin.

    Attributes:
        setup: the question.
        scene: with all values put in.
        facts: of the scene.
        start: positions at t = 0, (N, 2) [m]; volume: of the points, (N,) [m2].
        window: the first window (history, N, 2) [m].
        frames: most frames, t = 0 among them.
        scene_of: the scene in the model's units as a function of the unknown values.
        rest: when the rollout is over; None: after its last frame.
        key: `rollout_key`.
    """

    setup: SectionSetup
    scene: Scene
    facts: SceneFacts
    start: np.ndarray
    volume: np.ndarray
    window: np.ndarray
    frames: int
    scene_of: Callable[[Tensor], ScaledScene]
    rest: Rest | None
    key: str


def prepare(device: str, threads: int | None) -> None:
    """Check the device and bound the threads of this process.

    Raises:
        InputError: there is no such device here.
    """
    check_device(device)
    use_threads(threads)


class GNSEngine(Forward):
    """`inversion.estimation.forward.Forward` by a learned simulator.

    Args:
        store: where rollouts and derivatives are kept.
        model: the simulator.
        mode: of the derivative: the cheaper, or one of them.
        on_frame: called for each frame of a rollout: its number, and of how many at most.
    """

    def __init__(
        self,
        store: RolloutStore,
        model: TrainedModel,
        *,
        mode: Mode = "cheaper",
        on_frame: Callable[[int, int], None] | None = None,
    ) -> None:
        super().__init__()
        self.store = store
        self.model = model
        self.mode = mode
        self.on_frame = on_frame

    def way(self, setup: SectionSetup) -> Literal["forward", "reverse"]:
        """The cheaper way to the derivative, in steps for each frame, or the one asked for.

        Where both come to the same, reverse: measured at 6,256 points it then takes 30 % less.
        """
        if self.mode != "cheaper":
            return self.mode
        fitted = int(setup.targets.fitted.sum())
        backward = 1 + (REVERSE_COST - 1) * fitted
        return "reverse" if backward <= 1 + len(setup.parameters.specs) else "forward"

    def outside(self, request: Request) -> list[str]:
        """Properties of the section outside the ranges of the training, one sentence each."""
        slide = self._slide(request)
        return self.model.simulator.outside(slide.start, slide.facts)

    def distance(self, request: Request, *, anywhere: bool = False) -> float | None:
        """Of a section to those learned from (`Simulator.distance`); None: not known.

        Args:
            request: the question.
            anywhere: answer also far outside what the model has learned from.

        Raises:
            InputError: the section lies beyond FARTHEST.
        """
        slide = self._slide(request)
        away = self.model.simulator.distance(slide.start, slide.facts)
        if away is not None and away > FARTHEST and not anywhere:
            raise InputError(
                f"{slide.scene.name}: lies at {away:.1f} from the training of the model "
                f"{self.model.name} (1: as far as its outermost scenes from each other); beyond "
                f"{FARTHEST:g} it answers with inversion.outside_training: true alone; ask the "
                "engine mpm"
            )
        return away

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Predictions of all requests, one rollout after the other.

        Raises:
            InputError: a scene or its settings hold what no learned simulator has been shown.
        """
        found = []
        for request in requests:
            self.runs += 1
            slide = self._slide(request)
            run = self.store.run(slide.key, request.section.reader)
            if run is None:
                run = self._rolled_out(slide, request.values)
            found.append(prediction_of(request.section, run))
        return found

    def derivative(
        self, request: Request, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Prediction and exact derivative; see `inversion.estimation.forward.Forward`.

        Rows of what could not be read are NaN, and in reverse mode those of what is not fitted.
        """
        self.runs += 1
        setup, slide = request.section, self._slide(request)
        names = entry_keys(setup.targets, setup.foot)
        fitted = "".join(str(int(one)) for one in setup.targets.fitted)
        way = self.way(setup)
        key = derivative_key(
            slide.key, setup.parameters, way if way == "forward" else f"reverse {fitted}"
        )
        run = self.store.run(slide.key, setup.reader)
        rows = self.store.rows(key, names)
        if run is None or (rows is None and run.status != "failed"):
            run, rows = self._differentiated(slide, request.values, run, key, names)
        count = len(setup.parameters.specs)
        if rows is None:
            derivative = np.full((len(setup.targets.names), count), np.nan)
        else:
            derivative = np.concatenate([rows[name] for name in names])
        return prediction_of(setup, run), derivative, np.zeros(count)

    # -- rollouts ------------------------------------------------------------------------------

    def _slide(self, request: Request) -> StartingRollout:
        simulator, scene = self.model.simulator, request.scene
        settings = simulator.settings(request.section.settings)
        points = fill(scene)
        facts, start = start_of(scene, settings, points)
        rest = Rest(settings.early_stop_energy_fraction, settings.early_stop_hold_s)
        return StartingRollout(
            setup=request.section,
            scene=scene,
            facts=facts,
            start=start,
            volume=points.volume,
            window=first_window(start, facts, simulator.config.history),
            frames=max(frames_of(settings.duration_s, facts), 2),
            scene_of=scene_function(simulator.scaled(facts), facts, _unknowns(request)),
            rest=rest if settings.early_stop else None,
            key=rollout_key(scene, settings, self.model.hash),
        )

    def _rolled_out(self, slide: StartingRollout, values: np.ndarray) -> KeptRun:
        """Roll out and keep the run."""
        began = time.perf_counter()
        watch = _Watch(slide, self.on_frame)
        parameter = next(self.model.simulator.parameters())
        try:
            with torch.no_grad():
                scene = slide.scene_of(torch.as_tensor(values).to(parameter))
            rolled = trace(
                self.model.simulator, scene, slide.window, slide.frames, until=watch.over
            )
            frames, reason = rolled.frames, ""
        except WorkFailed as error:
            frames, reason = _held(slide), str(error)
        return self._keep(slide, frames, watch.at_rest, reason, time.perf_counter() - began)

    def _differentiated(
        self,
        slide: StartingRollout,
        values: np.ndarray,
        run: KeptRun | None,
        key: str,
        names: list[str],
    ) -> tuple[KeptRun, dict[str, np.ndarray] | None]:
        """Roll out with the derivative and keep both; the run that is known stays as it is."""
        began = time.perf_counter()
        watch = _Watch(slide, self.on_frame)
        frames = slide.frames
        until: Callable[[Tensor, int], bool] | None = watch.over
        if run is not None:  # its frames again, whatever rest would say of other digits
            frames, until = int(round(run.end_s / slide.facts.frame_time)) + 1, None
        reading = RolloutReading(
            slide.setup,
            slide.scene,
            slide.volume,
            slide.facts.frame_time,
            lambda: watch.at_rest if run is None else run.at_rest,
        )
        differentiate = jacobian
        if self.way(slide.setup) == "reverse":
            differentiate, reading.wanted = reverse_jacobian, slide.setup.targets.fitted
        rows, reason = None, ""
        try:
            _, slopes, _ = differentiate(
                self.model.simulator,
                slide.scene_of,
                values,
                slide.window,
                frames,
                reading,
                until=until,
            )
            rows = dict(zip(names, reading.by_entry(slopes), strict=True))
        except WorkFailed as error:
            reason = str(error) if reading.frames is None else ""
        if run is None:
            seen = _held(slide) if reading.frames is None else reading.frames
            run = self._keep(slide, seen, watch.at_rest, reason, time.perf_counter() - began)
        if rows is not None:
            self.store.keep_rows(key, rows)
        return run, rows

    def _keep(
        self, slide: StartingRollout, frames: np.ndarray, at_rest: bool, reason: str, seconds: float
    ) -> KeptRun:
        """Put the results of a rollout that a back-analysis needs into the store.

        Positions are in single precision as those of any run, unless the model is of double.
        """
        double = next(self.model.simulator.parameters()).dtype == torch.float64
        frames = frames.astype(np.float64 if double else np.float32)
        run = RolledOut(
            scene=slide.scene,
            positions=frames,
            time=slide.facts.frame_time * np.arange(len(frames)),
            initial_volume=slide.volume,
            bulk_volume=slide.volume,
            came_to_rest=at_rest,
            status="failed" if reason else "finished",
            reason=reason,
        )
        kept = KeptRun(
            initial=frames[0].copy(),
            final=frames[-1].copy(),
            zone=slide.facts.zone.astype(np.int32),
            initial_volume=slide.volume.astype(np.float32),
            vertical_stress=np.full(slide.facts.points, np.nan, np.float32),
            status=run.status,
            reason=reason,
            end_s=float(run.time[-1]),
            at_rest=at_rest,
            wall_time_s=seconds,
            readings=slide.setup.reader.read(run),
        )
        self.store.keep_run(slide.key, kept)
        return kept


def _unknowns(request: Request) -> list[UnknownProperty]:
    scene = request.scene
    place = {zone.name: number for number, zone in enumerate(scene.zones)}
    return [
        UnknownProperty(
            material_key(spec.property),
            tuple(place[name] for name in spec.zones),
            float(value),
            moves_with_pool(scene) if spec.property == "water_level" else None,
        )
        for spec, value in zip(request.section.parameters.specs, request.values, strict=True)
    ]


class _Watch:
    """Ends a rollout at rest, and stops one that goes wrong, as `gns.rollout.rollout` does."""

    def __init__(self, slide: StartingRollout, on_frame: Callable[[int, int], None] | None) -> None:
        self.facts = slide.facts
        self.frames = slide.frames
        self.on_frame = on_frame
        self.rest = RestWatch(slide.rest, slide.facts)
        self.frame = 0
        self.at_rest = False

    def over(self, after: Tensor, now: Tensor) -> bool:
        """Whether the rollout ends with this step (N, 2) [spacings]."""
        self.frame += 1
        wrong = wrong_step(after, now, self.facts.frame_interval)
        if wrong:
            at = self.frame * self.facts.frame_time
            if self.on_frame is not None:
                self.on_frame(self.frames - 1, self.frames - 1)
            raise WorkFailed(f"frame {self.frame}, t = {at:.2f} s: {wrong}")
        self.at_rest = self.rest.over(after - now)
        if self.on_frame is not None:
            last = self.frames - 1
            self.on_frame(last if self.at_rest else self.frame, last)
        return self.at_rest


def _held(slide: StartingRollout) -> np.ndarray:
    """Frames of a slide that could not be rolled out: the first alone."""
    return slide.window[-1:].astype(float)
