"""Runs for the direct model: random sections, each simulated once.

In: the settings, numbers of scenes. Out: files `runs_PPPP.npz` of `RUNS_PER_PART` scenes, written
whole, so that a job that is killed goes on with the next part. Of ten scenes seven are dams that
stand free: four with shells of two layers (`geometry.random_scenes.embankment_dam`), three of
hydraulic fill (`geometry.random_scenes.hydraulic_fill_dam`). The others are templates (a) to (d).
All have the water of a case history: pressure in and on the soil, and a pool that follows it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.random_scenes.embankment_dam import draw_dam
from geometry.random_scenes.hydraulic_fill_dam import draw_hydraulic_fill_dam
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.scene import Scene
from gns.direct.arrivals import Arrivals, arrivals_of
from gns.direct.effects import DRAWN, NAMES, SPACING, draw_effects, learned_of
from gns.direct.sections import check_settings
from pipeline.cli import InputError
from pipeline.files import atomic_path, content_hash
from pipeline.random_numbers import Stream, number_of

if TYPE_CHECKING:
    from mpm_taichi.trajectory import Run
    from pipeline.config import Config, SimulationSettings

RUNS_PER_PART = 50
#: Of ten scenes, how many are dams, the last of them of hydraulic fill.
DAMS_IN_TEN, HYDRAULIC_IN_TEN = 7, 3
#: Effects of ten scenes: four have none, five one, one two.
EFFECTS_IN_TEN = (0, 0, 0, 0, 1, 1, 1, 1, 1, 2)
#: Share of the template scenes with a pool, and the width of their domain [m].
WATER_SHARE, WIDTH = 0.5, 400.0


@dataclass(frozen=True)
class SlideRun:
    """A scene and what is kept of its run; N points.

    Attributes:
        number: of the scene.
        scene: at the spacing of the run.
        initial: positions before the slide (N, 2) float32 [m]; final: after it.
        volume: of the points before it (N,) float32 [m2 per m of width].
        seconds: computing time [s].
        at_rest: it stopped by itself.
        arrivals: when its toes and its soil got where.
    """

    number: int
    scene: Scene
    initial: np.ndarray
    final: np.ndarray
    volume: np.ndarray
    seconds: float
    at_rest: bool
    arrivals: Arrivals


def random_section(config: Config, number: int) -> Scene:
    """Scene of a number: a dam or one of the templates (a) to (d)."""
    place = number % 10
    if place < DAMS_IN_TEN:
        hydraulic = place >= DAMS_IN_TEN - HYDRAULIC_IN_TEN
        draw = draw_hydraulic_fill_dam if hydraulic else draw_dam
        return draw(config.geometry.seed, number, SPACING)
    shares = config.geometry.template_shares.model_copy(update={"e": 0.0})
    geometry = config.geometry.model_copy(
        update={"template_shares": shares, "water_share": WATER_SHARE}
    )
    size = config.scale("coarse").model_copy(
        update={
            "spacing_m": SPACING,
            "domain_width_m": WIDTH,
            "enlarged_share": 0.0,
            "dams_from": None,
            "mixed_from": None,
            "turns": [],
        }
    )
    own = config.model_copy(
        update={"geometry": geometry, "scales": {**config.scales, "coarse": size}}
    )
    return draw_scene(own, "coarse", 100_000 + number)


def random_slide(config: Config, number: int) -> Scene:
    """Section of a number, with as many effects as `EFFECTS_IN_TEN` says."""
    stream = Stream(config.geometry.seed, number_of("effects"), number)
    scene = random_section(config, number)
    return draw_effects(scene, stream, EFFECTS_IN_TEN[stream.integer(0, 9)])


def part_file(folder: Path, part: int) -> Path:
    """Where a part lies."""
    return folder / f"runs_{part:04d}.npz"


def simulate_parts(
    config: Config,
    folder: Path,
    parts: Sequence[int],
    *,
    threads: int | None = None,
    tell: Callable[[str], None] = print,
    size: int = RUNS_PER_PART,
) -> None:
    """Draw and simulate the parts that are not there yet.

    Args:
        config: settings; water and pool are those of its simulation.
        folder: of the files.
        parts: their numbers; part p has scenes p * size to (p + 1) * size - 1.
        threads: CPU threads; None: all.
        tell: called with a line for each part.
        size: scenes of a part.

    Raises:
        InputError: settings by which the runs would be others than the models are shown as, or a
            part that is there has runs of other settings.
    """
    key = _key(config)
    for part in parts:
        path = part_file(folder, part)
        if path.exists():
            _check_key(path, key)
            continue
        began = time.perf_counter()
        numbers = range(part * size, (part + 1) * size)
        scenes = {number: random_slide(config, number) for number in numbers}
        for scene in scenes.values():
            check_settings(scene, config.simulation)
        kept = _kept(scenes, config.simulation, threads)
        _write(path, key, kept)
        took = time.perf_counter() - began
        tell(f"part {part}: {len(kept)} of {size} runs in {took:.0f} s")


def read_runs(folder: Path) -> Iterator[SlideRun]:
    """All runs of a folder, by their number.

    Raises:
        InputError: there are none.
    """
    for file, number, scene in _stored(folder):
        initial = file[f"{number}_fine_initial"]
        # Before physics 7 every point had the volume of a square of the lattice.
        squares = np.full(len(initial), scene.spacing**2, np.float32)
        yield SlideRun(
            number,
            scene,
            initial,
            file[f"{number}_fine_final"],
            file.get(f"{number}_fine_volume", squares),
            float(file[f"{number}_fine_facts"][0]),
            bool(file[f"{number}_fine_facts"][1]),
            Arrivals(file[f"{number}_fine_toes_s"], file[f"{number}_fine_way_s"]),
        )


def learned_effects(folder: Path) -> tuple[str, ...]:
    """Effects that enough runs of a folder have on for a model to learn them.

    Raises:
        InputError: there are no runs.
    """
    return learned_of(scene for _, _, scene in _stored(folder))


def _stored(folder: Path) -> Iterator[tuple[Any, int, Scene]]:
    """Of each run its open file, whose arrays are read where they are asked for, number, scene."""
    files = sorted(folder.glob("runs_*.npz"))
    if not files:
        raise InputError(f"{folder}: has no runs_PPPP.npz; flowslide gns direct-runs makes them")
    for path in files:
        with np.load(path, allow_pickle=False) as file:
            for number in file["numbers"]:
                scene = Scene.model_validate_json(str(file[f"{number}_scene"]))
                yield file, int(number), scene


def _kept(
    scenes: dict[int, Scene], settings: SimulationSettings, threads: int | None
) -> list[SlideRun]:
    """What is kept of the runs that went well, by number."""
    from mpm_taichi.simulate import simulate_each

    numbers, requests = list(scenes), [(scene, settings) for scene in scenes.values()]
    found = {
        numbers[place]: run
        for place, run in simulate_each(requests, threads=threads)
        if run.status != "failed"
    }
    return [_kept_of(number, scenes[number], found[number]) for number in sorted(found)]


def _kept_of(number: int, scene: Scene, run: Run) -> SlideRun:
    first, last = run.positions[0].copy(), run.positions[-1].copy()
    volume = run.initial_volume
    arrivals = arrivals_of(run.positions, run.time, volume, run.scene.spacing)
    rests = run.came_to_rest
    return SlideRun(number, scene, first, last, volume, run.wall_time_s, rests, arrivals)


def _key(config: Config) -> str:
    """Of all settings that the runs follow from."""
    size = config.scale("coarse")
    effects = [*NAMES, *DRAWN, *EFFECTS_IN_TEN]
    return content_hash(
        {
            "geometry": config.geometry,
            "coarse": size,
            "runs": config.simulation,
            "effects": effects,
        }
    )


def _check_key(path: Path, key: str) -> None:
    """Runs of other settings are not mixed with these.

    Raises:
        InputError: the part has another key.
    """
    with np.load(path, allow_pickle=False) as file:
        if "key" not in file.files or str(file["key"]) != key:
            raise InputError(
                f"{path}: has runs of other settings (geometry, simulation, scales.coarse) or of "
                "an earlier version; give another folder with --out, or remove it"
            )


def _write(path: Path, key: str, runs: list[SlideRun]) -> None:
    """The arrays are called `fine` since there was a coarse run beside: files stay readable."""
    arrays: dict[str, np.ndarray] = {"key": np.array(key)}
    arrays["numbers"] = np.array([run.number for run in runs])
    for run in runs:
        arrays[f"{run.number}_scene"] = np.array(run.scene.model_dump_json())
        own = f"{run.number}_fine"
        arrays[f"{own}_initial"], arrays[f"{own}_final"] = run.initial, run.final
        arrays[f"{own}_volume"] = run.volume
        arrays[f"{own}_facts"] = np.array([run.seconds, run.at_rest])
        arrays[f"{own}_toes_s"], arrays[f"{own}_way_s"] = run.arrivals.toes, run.arrivals.way
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
