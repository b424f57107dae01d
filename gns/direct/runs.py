"""Runs for the direct model: random sections, each simulated at a spacing and at twice that.

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
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ValidationError

from geometry.random_scenes.embankment_dam import draw_dam
from geometry.random_scenes.hydraulic_fill_dam import draw_hydraulic_fill_dam
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.scene import Scene
from gns.direct.arrivals import Arrivals, arrivals_of
from gns.direct.sections import check_settings
from pipeline.cli import InputError
from pipeline.files import atomic_path, content_hash

if TYPE_CHECKING:
    from mpm_taichi.trajectory import Run
    from pipeline.config import Config, SimulationSettings

RUNS_PER_PART = 50
#: Of ten scenes, how many are dams, the last of them of hydraulic fill.
DAMS_IN_TEN, HYDRAULIC_IN_TEN = 7, 3
#: Spacing of the runs [m]; the model knows lengths in heights of the section alone.
SPACING = 2.0
#: Spacing of the second run of each scene over that of the first.
COARSER = 2.0
#: Share of the template scenes with a pool, and the width of their domain [m].
WATER_SHARE, WIDTH = 0.5, 400.0


@dataclass(frozen=True)
class Ended:
    """What is kept of a run; N points.

    Attributes:
        initial: positions before the slide (N, 2) float32 [m]; final: after it.
        seconds: computing time [s].
        at_rest: it stopped by itself.
        arrivals: when its toes and its soil got where.
    """

    initial: np.ndarray
    final: np.ndarray
    seconds: float
    at_rest: bool
    arrivals: Arrivals


@dataclass(frozen=True)
class PairedRun:
    """A scene with its run, and that at twice the spacing.

    Attributes:
        number: of the scene.
        scene: at the spacing of `fine`.
        fine: what is learned.
        coarse: what the correction starts from.
    """

    number: int
    scene: Scene
    fine: Ended
    coarse: Ended


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
        update={"spacing_m": SPACING, "domain_width_m": WIDTH, "enlarged_share": 0.0,
                "dams_from": None, "mixed_from": None}
    )  # fmt: skip
    own = config.model_copy(
        update={"geometry": geometry, "scales": {**config.scales, "coarse": size}}
    )
    return draw_scene(own, "coarse", 100_000 + number)


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
        scenes = {number: random_section(config, number) for number in numbers}
        for scene in scenes.values():
            check_settings(scene, config.simulation)
        coarse = {number: _coarser(scene) for number, scene in scenes.items()}
        numbers = [number for number in numbers if coarse[number] is not None]
        pairs = [
            _ended([each[number] for number in numbers], config.simulation, threads)
            for each in (scenes, coarse)
        ]
        kept = {
            number: PairedRun(number, scenes[number], pairs[0][place], pairs[1][place])
            for place, number in enumerate(numbers)
            if place in pairs[0] and place in pairs[1]
        }
        _write(path, key, list(kept.values()))
        took = time.perf_counter() - began
        tell(f"part {part}: {len(kept)} of {size} runs in {took:.0f} s")


def read_runs(folder: Path) -> Iterator[PairedRun]:
    """All runs of a folder, by their number.

    Raises:
        InputError: there are none.
    """
    files = sorted(folder.glob("runs_*.npz"))
    if not files:
        raise InputError(f"{folder}: has no runs_PPPP.npz; flowslide gns direct-runs makes them")
    for path in files:
        with np.load(path, allow_pickle=False) as file:
            for number in file["numbers"]:
                ended = [
                    Ended(
                        file[f"{number}_{name}_initial"],
                        file[f"{number}_{name}_final"],
                        float(file[f"{number}_{name}_facts"][0]),
                        bool(file[f"{number}_{name}_facts"][1]),
                        Arrivals(file[f"{number}_{name}_toes_s"], file[f"{number}_{name}_way_s"]),
                    )
                    for name in ("fine", "coarse")
                ]
                scene = Scene.model_validate_json(str(file[f"{number}_scene"]))
                yield PairedRun(int(number), scene, *ended)


def _coarser(scene: Scene) -> Scene | None:
    """The same at twice the spacing; None: a zone is too thin for that."""
    try:
        return scene.changed(spacing=COARSER * scene.spacing)
    except ValidationError:
        return None


def _ended(
    scenes: list[Scene], settings: SimulationSettings, threads: int | None
) -> dict[int, Ended]:
    """The runs that went well, by place."""
    from mpm_taichi.simulate import simulate_each

    return {
        place: _kept(run)
        for place, run in simulate_each([(scene, settings) for scene in scenes], threads=threads)
        if run.status != "failed"
    }


def _kept(run: Run) -> Ended:
    first, last = run.positions[0], run.positions[-1]
    arrivals = arrivals_of(run.positions, run.time, run.scene.spacing)
    return Ended(first.copy(), last.copy(), run.wall_time_s, run.came_to_rest, arrivals)


def _key(config: Config) -> str:
    """Of all settings that the runs follow from."""
    size = config.scale("coarse")
    return content_hash({"geometry": config.geometry, "coarse": size, "runs": config.simulation})


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


def _write(path: Path, key: str, runs: list[PairedRun]) -> None:
    arrays: dict[str, np.ndarray] = {"key": np.array(key)}
    arrays["numbers"] = np.array([run.number for run in runs])
    for run in runs:
        arrays[f"{run.number}_scene"] = np.array(run.scene.model_dump_json())
        for name in ("fine", "coarse"):
            ended = getattr(run, name)
            arrays[f"{run.number}_{name}_initial"] = ended.initial
            arrays[f"{run.number}_{name}_final"] = ended.final
            arrays[f"{run.number}_{name}_facts"] = np.array([ended.seconds, ended.at_rest])
            arrays[f"{run.number}_{name}_toes_s"] = ended.arrivals.toes
            arrays[f"{run.number}_{name}_way_s"] = ended.arrivals.way
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
