"""What a learner needs of the time between stored frames.

    python -m benchmarks.studies.frame_interval


A learned simulator advances by one frame at a time and learns the second difference of positions
(acceleration x frame^2). Too short a frame: the second difference drowns in rounding and in the
noise of single points, and a rollout takes many steps. Too long: points fly past their neighbours
within a frame, and what happens between two frames cannot be inferred from the frames before.

Runs are simulated once with the finest interval and thinned. Intervals are in units of
sqrt(spacing / gravity), lengths in spacings. `--write` updates the tables of
`docs/records/frame-interval.md`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.generated_pages import RECORDS, renew
from geometry.random_scenes.templates import draw_scene
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import Run, write_runs
from pipeline.cli import CommandParser, base_parser, main_exit
from pipeline.config import Config, load_config

INTERVALS = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
FINEST = 0.1
MOVING = 0.01
"""A point moves when it is faster than this share of sqrt(gravity x spacing)."""
RADIUS = 3.0
"""Connectivity radius of the learner, in spacings: 1.5 cells."""
TRAINING_NOISE = 0.067 / np.sqrt(9.81 * 1.0)
"""Noise of the last velocity in the paper's training at 1 m (0.067 m/s), as in `MOVING`."""
BUDGET_GB = 50.0
PAGE = RECORDS / "frame-interval.md"


def parser() -> CommandParser:
    """The command line."""
    result = base_parser("python -m benchmarks.studies.frame_interval", __doc__.splitlines()[0])
    result.add_argument("--coarse", type=int, default=20, help="scenes of `coarse`; default 20")
    result.add_argument("--large", type=int, default=3, help="scenes of `large`; default 3")
    result.add_argument(
        "--disk", type=int, default=16, help="scenes per scale for the bytes on disk; default 16"
    )
    result.add_argument("--threads", type=int, default=1, help="CPU threads; default 1")
    result.add_argument("--write", action="store_true", help=f"renew the tables of {PAGE.name}")
    return result


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, and renew the page where asked."""
    options = parser().parse_args(argv)
    config = load_config(None)
    parts = []
    for scale, number in (("coarse", options.coarse), ("large", options.large)):
        runs = dense_runs(config, scale, number, options.threads)
        rows = [measure(runs, round(interval / FINEST)) for interval in INTERVALS]
        heading = f"{len(runs)} scene{'s' if len(runs) > 1 else ''} of `{scale}`"
        parts.append(f"{heading}:\n\n{learner_table(rows)}")
        print(parts[-1], end="\n\n", flush=True)
    disk = [on_disk(config, scale, options.disk, options.threads) for scale in ("large", "small")]
    parts.append(disk_table(disk))
    print(parts[-1])
    if options.write:
        renew(PAGE, table="\n" + "\n\n".join(parts))


def dense_runs(config: Config, scale: str, number: int, threads: int) -> list[Run]:
    """The first scenes of a scale with the finest frame interval."""
    settings = config.simulation_for(scale).model_copy(update={"frame_interval": FINEST})
    scenes = [draw_scene(config, scale, index) for index in range(number)]
    return [run for run in simulate(scenes, settings, threads=threads) if not run.failed]


# --- what a learner sees ---


@dataclass(frozen=True)
class Interval:
    """One interval, over all moving points and frames of all runs; lengths in spacings."""

    interval: float
    displacement: tuple[float, float, float]  # per frame: median, 99 %, largest
    second_difference: float  # root mean square
    rounding: float  # of float32 positions in a second difference, over the above
    training_noise: float  # of the paper, over the above
    point_noise: float  # share of the second difference that neighbours do not have
    left_by_acceleration: float  # rms error of x(t) = 3 x(t-1) - 3 x(t-2) + x(t-3), over rms second
    frames: float  # per run


def measure(runs: Sequence[Run], every: int) -> Interval:
    """Statistics of runs of which every n-th frame is kept."""
    steps, seconds, thirds, noises, frames, resolution = [], [], [], [], [], []
    interval = FINEST * every
    for run in runs:
        spacing = run.scene.spacing
        x = run.positions[::every].astype(np.float64) / spacing
        frames.append(len(x))
        resolution.append(np.spacing(np.float32(np.abs(run.positions).max())) / spacing)
        velocity = np.diff(x, axis=0)
        length = np.linalg.norm(velocity, axis=2)
        steps.append(length[length > MOVING * interval])
        second, third = np.diff(x, n=2, axis=0), np.diff(x, n=3, axis=0)
        moving = length[1:] > MOVING * interval
        seconds.append(np.sum(second[moving] ** 2, axis=1))
        thirds.append(np.sum(third[moving[1:]] ** 2, axis=1))
        for frame in range(0, len(second), max(1, len(second) // 12)):
            noises.append(own_part(x[frame + 1], second[frame], moving[frame]))
    step = np.concatenate(steps)
    rms = float(np.sqrt(np.concatenate(seconds).mean()))
    own, whole = np.sum(noises, axis=0)
    # Three rounded positions: variance (1 + 4 + 1) x ulp^2 / 12 a component.
    rounding = float(np.mean(resolution)) * np.sqrt(2.0 * 6.0 / 12.0)
    return Interval(
        interval=interval,
        displacement=(*np.quantile(step, [0.5, 0.99]), float(step.max())),
        second_difference=rms,
        rounding=rounding / rms,
        training_noise=float(TRAINING_NOISE) * interval / rms,
        point_noise=float(np.sqrt(own / whole)),
        left_by_acceleration=float(np.sqrt(np.concatenate(thirds).mean())) / rms,
        frames=float(np.mean(frames)),
    )


def own_part(x: np.ndarray, second: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Sums of squares (own, whole) of second differences of moving points.

    Own: the remainder after a plane has been fitted to the points within the radius of the learner.

    Args:
        x: positions (N, 2) in spacings.
        second: second differences (N, 2) in spacings.
        moving: (N,) bool.
    """
    tree = cKDTree(x)
    own = whole = 0.0
    chosen = np.flatnonzero(moving)[::7]
    for point, near in zip(chosen, tree.query_ball_point(x[chosen], RADIUS), strict=True):
        if len(near) < 8:
            continue
        plane = np.column_stack([np.ones(len(near)), x[near] - x[point]])
        here = np.linalg.lstsq(plane, second[near], rcond=None)[0][0]
        own += float(np.sum((second[point] - here) ** 2))
        whole += float(np.sum(second[point] ** 2))
    return np.array([own, whole])


# --- bytes ---


@dataclass(frozen=True)
class Disk:
    """Bytes of a scale at its default interval."""

    scale: str
    runs: int
    points: float  # mean
    frames: float  # mean
    trajectory_mb: float  # mean per run, as stored
    packed_mb: float  # mean per run, 2 x float32 x points x frames
    number_of_runs: int  # of the whole scale
    longest_gb: float  # of the whole scale if no run stopped early

    @property
    def total_gb(self) -> float:
        """Trajectories and packed data of the whole scale."""
        return self.number_of_runs * (self.trajectory_mb + self.packed_mb) / 1e3


def on_disk(config: Config, scale: str, number: int, threads: int) -> Disk:
    """Bytes of evenly chosen scenes of a scale, written as the batches write them."""
    total = config.scale(scale).number_of_scenes
    settings = config.simulation_for(scale)
    indices = np.linspace(0, total - 1, number).round().astype(int)
    runs = simulate([draw_scene(config, scale, int(i)) for i in indices], settings, threads=threads)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "runs.h5"
        write_runs(path, dict(enumerate(runs)))
        stored = path.stat().st_size
    packed = [8 * run.points * run.frames for run in runs]
    share = stored / sum(packed)
    most = [8 * run.points * (settings.duration_s / run.time[1] + 1) for run in runs]
    return Disk(
        scale=scale,
        runs=len(runs),
        points=float(np.mean([run.points for run in runs])),
        frames=float(np.mean([run.frames for run in runs])),
        trajectory_mb=stored / len(runs) / 1e6,
        packed_mb=float(np.mean(packed)) / 1e6,
        number_of_runs=total,
        longest_gb=total * float(np.mean(most)) * (1.0 + share) / 1e9,
    )


# --- tables ---


def learner_table(rows: Sequence[Interval]) -> str:
    """The statistics as markdown."""
    lines = [
        "| interval | displacement a frame: median, 99 %, largest | second difference, rms | "
        "rounding in it | training noise in it | points' own part of it | "
        "left by constant acceleration | frames a run |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        median, most, largest = row.displacement
        lines.append(
            f"| {row.interval:.1f} | {median:.3f}, {most:.2f}, {largest:.2f} | "
            f"{row.second_difference:.4f} | {100 * row.rounding:.2g} % | "
            f"{100 * row.training_noise:.0f} % | {100 * row.point_noise:.0f} % | "
            f"{100 * row.left_by_acceleration:.0f} % | {row.frames:.0f} |"
        )
    return "\n".join(lines)


def disk_table(rows: Sequence[Disk]) -> str:
    """Bytes as markdown."""
    lines = [
        "| scale | sample | points | frames | trajectory, MB a run | packed, MB a run | "
        "whole scale, GB | if nothing stopped early, GB | |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for row in rows:
        verdict = "pass" if row.longest_gb <= BUDGET_GB else "**over**"
        lines.append(
            f"| `{row.scale}`, {row.number_of_runs:,} runs | {row.runs} | {row.points:,.0f} | "
            f"{row.frames:.0f} | {row.trajectory_mb:.2f} | {row.packed_mb:.2f} | "
            f"{row.total_gb:.1f} | {row.longest_gb:.1f} | {verdict}, {BUDGET_GB:g} GB allowed |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main_exit(main)
