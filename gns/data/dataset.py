"""Training data: windows of frames of packed runs, never a whole data set.

In: a folder of packed data. Out: `Windows`, by run and frame or one after the other. A window is
one read of just its frames from the shard; of a run only its number, its size and where it lies
stay in memory, some 200 bytes, so memory does not grow with the data. Copies for other processes
(workers of a loader) open the files themselves.

A window ends its history at a known frame t and goes on with the frames to be predicted:

    t - history + 1, ..., t | t + 1, ..., t + window - history

Frames before 0 are made as a rollout makes its first window: equal ones at rest, otherwise the
initial velocity extrapolated backwards (`gns.data.scene_facts.before`).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.scenes.scene import Scene
from gns.data.metadata import Metadata, RunEntry, read_metadata
from gns.data.scene_facts import SceneFacts, before
from gns.data.shard import SPLITS, Shard
from gns.data.statistics import Moments
from pipeline.cli import InputError

HISTORY = 6
"""Frames of a history: five velocities (paper)."""

KEPT_FACTS = 16
"""Runs whose facts are kept in memory: 100 kB each at the most points there are."""


@dataclass(frozen=True)
class Window:
    """Some frames of a run.

    Attributes:
        run: number of the run.
        frame: the last known frame t.
        positions: (window, N, 2) float32 [m]; the first `history` of them are known.
        facts: of the scene.
    """

    run: int
    frame: int
    positions: np.ndarray
    facts: SceneFacts


class Windows:
    """Random access to the windows of a split, and to its whole runs.

    Args:
        folder: of the packed data.
        split: "train", "valid" or "test".
        window: frames of a window, known ones and those to be predicted; 7 predicts one.
        history: known frames among them.
        stride: take every n frames of the data as one; windows begin at any of them.

    Raises:
        InputError: no such data, another layout, flipped bytes, or a window that is not longer than
            its history.
    """

    def __init__(
        self,
        folder: str | Path,
        split: str,
        window: int = HISTORY + 1,
        history: int = HISTORY,
        stride: int = 1,
    ) -> None:
        if split not in SPLITS:
            raise InputError(f"split {split!r}: allowed are {', '.join(SPLITS)}")
        if not 1 <= history < window:
            raise InputError(f"window {window}: longer than its history of {history} frames (>= 1)")
        if stride < 1:
            raise InputError(f"stride {stride}: at least 1 is allowed")
        self.folder = Path(folder)
        self.split = split
        self.window = window
        self.history = history
        self.stride = stride
        self.metadata: Metadata = read_metadata(folder)
        self._shards: list[Shard] = []
        runs: list[tuple[int, int, int, int]] = []
        letters: list[str] = []
        for entry in self.metadata.splits[split]:
            shard = Shard(self.folder / entry.file)
            _check_same(shard, entry.key, entry.runs)
            shard.check()
            letters += [run.template for run in entry.runs]
            runs += [(run.run, len(self._shards), run.frames, run.points) for run in entry.runs]
            self._shards.append(shard)
        table = np.array(runs, dtype=np.int64).reshape(-1, 4)
        self.runs: np.ndarray = table[:, 0]
        """Numbers of the runs, (R,)."""
        self.frames: np.ndarray = table[:, 2]
        """Frames of each run, (R,)."""
        self.points: np.ndarray = table[:, 3]
        """Points of each run, (R,)."""
        self.templates: list[str] = letters
        """Letter of each run's template; "" for a scene made by hand."""
        self._shard_of = table[:, 1]
        self._row = {int(run): row for row, run in enumerate(self.runs)}
        ahead = (window - history) * stride
        self._ends = np.cumsum(np.maximum(self.frames - ahead, 0))
        self._facts: OrderedDict[int, SceneFacts] = OrderedDict()

    def __len__(self) -> int:
        """Number of windows of all runs; runs that are too short have none."""
        return int(self._ends[-1]) if len(self._ends) else 0

    def __getitem__(self, place: int) -> Window:
        """Window number `place`, the runs one after the other."""
        return self.at(*self.locate(place))

    def __iter__(self) -> Iterator[Window]:
        return (self[place] for place in range(len(self)))

    def locate(self, place: int) -> tuple[int, int]:
        """Run and last known frame of window number `place`."""
        if not 0 <= place < len(self):
            raise IndexError(f"window {place} of {len(self)}")
        row = int(np.searchsorted(self._ends, place, side="right"))
        start = int(self._ends[row - 1]) if row else 0
        return int(self.runs[row]), place - start

    def template_of(self, run: int) -> str:
        """Letter of a run's template; "" for a scene made by hand."""
        return self.templates[self._row_of(run)]

    def first_of(self, place: int) -> int:
        """Number of the first window, at t = 0, of the run to which window `place` belongs."""
        return place - self.locate(place)[1]

    def at(self, run: int, frame: int) -> Window:
        """The window of a run whose last known frame is `frame`, 0 and up.

        Raises:
            InputError: no such run, or not enough frames behind `frame`.
        """
        row = self._row_of(run)
        stop = frame + 1 + (self.window - self.history) * self.stride
        if not 0 <= frame or stop > self.frames[row]:
            raise InputError(
                f"{self.folder}: run {run}: a window of {self.window} at frame {frame} needs "
                f"{stop} frames; there are {self.frames[row]}"
            )
        first = frame - (self.history - 1) * self.stride
        facts = self.facts(run)
        positions = self._shards[self._shard_of[row]].positions(run, max(first, 0), stop)
        if first < 0:
            start = positions[0]  # frame 0
            frame_time = facts.frame_time / self.stride
            earlier = before(start, facts.initial_velocity, frame_time, -first)
            positions = np.concatenate([earlier, positions])
        return Window(run=run, frame=frame, positions=positions[:: self.stride], facts=facts)

    def facts(self, run: int) -> SceneFacts:
        """Facts of a run's scene before it moved."""
        if run in self._facts:
            self._facts.move_to_end(run)
            return self._facts[run]
        facts = self._shards[self._shard_of[self._row_of(run)]].facts(run)
        if self.stride > 1:
            numbers = {**facts.numbers, "frame_time": facts.frame_time * self.stride}
            facts = replace(facts, numbers=numbers)
        self._facts[run] = facts
        if len(self._facts) > KEPT_FACTS:
            self._facts.popitem(last=False)
        return facts

    def squares(self, run: int) -> np.ndarray:
        """Mean squares of the accelerations of a run's moving points, over single frames, (2,)."""
        stored = self._shards[self._shard_of[self._row_of(run)]].array(run, "moments")
        acceleration = Moments.from_stored(stored[1])
        return acceleration.std**2 + acceleration.mean**2

    def positions(self, run: int, first: int = 0, stop: int | None = None) -> np.ndarray:
        """Frames of a run, `stride` apart, (T, N, 2) float32 [m].

        Args:
            run: number of the run.
            first: frame of the data to begin with.
            stop: frame of the data before which to end; None: the last is the end.
        """
        found = self._shards[self._shard_of[self._row_of(run)]].positions(run, first, stop)
        return found[:: self.stride]

    def scene(self, run: int) -> Scene:
        """The scene of a run."""
        text = self._shards[self._shard_of[self._row_of(run)]].scene(run)
        return Scene.model_validate_json(text)

    def close(self) -> None:
        """Close the files; reading opens them again."""
        for shard in self._shards:
            shard.close()

    def _row_of(self, run: int) -> int:
        if run not in self._row:
            raise InputError(f"{self.folder}: no run {run} in the split {self.split}")
        return self._row[run]


def _check_same(shard: Shard, key: str, runs: list[RunEntry]) -> None:
    """The shard is the one that the metadata describe."""
    if shard.key != key or shard.run_numbers != [run.run for run in runs]:
        raise InputError(
            f"{shard.path}: is not the shard that metadata.json describes; pack the trajectories "
            "again"
        )
    for run in runs:
        if shard.shape(run.run) != (run.frames, run.points, 2):
            raise InputError(
                f"{shard.path}: run {run.run}: positions {shard.shape(run.run)}, but metadata.json "
                f"says {run.frames} frames of {run.points} points; pack again"
            )
