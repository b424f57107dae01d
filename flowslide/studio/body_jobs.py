"""What a job on a body does: the functions of the commands, and the maps that the page shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypedDict

from flowslide.studio.bodies import SECTION_FILE, load_survey_of
from flowslide.studio.body_maps import (
    exceedance_message,
    measured_surface,
    reading_rows,
    slide_message,
)
from flowslide.studio.jobs import RESULTS, Job, joint_of
from geometry.scenes3d.scene3d import FILE_NAME, Scene3d, load_scene_3d
from geometry.survey3d.survey import FILE_NAME as SURVEY_FILE
from geometry.terrain.raster import read_raster
from mpm_taichi.solver3d.problem import has_sloping_water, problem_of
from pipeline.cli import InputError
from pipeline.config import Config, load_config
from pipeline.files import atomic_path

SLIDE, EXCEEDANCE = "slide.bin", "exceedance.bin"
FIXED_WATER = "simulation.water_face=fixed"
FIXED_WORDS = "The water level slopes: it stays where it is while the soil moves."
Found = dict[str, Any]
Evaluated = Callable[[int, Mapping[str, float], float], None]


class _Common(TypedDict):
    """Options that every question shares."""

    out: Path
    progress: Callable[[int, int, str], None]
    spacing_m: float | None
    threads: int | None
    settings: Config


def work(
    job: Job, out: Path, progress: Callable[[int, int, str], None], evaluated: Evaluated
) -> Found:
    """Answer a job on a body; what was found, for the list of jobs.

    Args:
        job: as it was asked for.
        out: folder of its results.
        progress: as of `flowslide`.
        evaluated: as of `flowslide.back_analyse`.

    Raises:
        InputError: the body does not have what is asked.
        WorkFailed: the solver stopped a run.
    """
    scene = load_scene_3d(Path(job.folder), spacing=job.options.spacing_m)
    slopes = has_sloping_water(scene)
    settings = load_config(None, [FIXED_WATER] if slopes else [])
    common: _Common = {
        "out": out,
        "progress": progress,
        "spacing_m": job.options.spacing_m,
        "threads": job.threads,
        "settings": settings,
    }
    match job.kind:
        case "simulate":
            found = _simulate(job, common)
        case "back_analyse":
            found = _back_analyse(job, common, evaluated)
        case "posterior":
            found = _posterior(job, common)
        case "predict":
            found = _predict(job, scene, common)
        case _:
            raise InputError(f"kind {job.kind!r}: not in three dimensions")
    if slopes:
        found["answer"].append(FIXED_WORDS)
    return found


def _simulate(job: Job, common: _Common) -> Found:
    """A run with its page, and its film as the page shows it."""
    import flowslide
    from flowslide.studio import job_answers
    from report.simulation3d import warning  # it draws as well, which the server does not

    strengths, folder = job.options.strengths_kpa, Path(job.folder)
    done = flowslide.simulate_3d(folder / FILE_NAME, strengths_kpa=strengths, **common)
    survey = load_survey_of(folder, done.scene)
    entries = [] if survey is None else survey.chosen()
    shown = slide_message(
        done.scene,
        done.problem,
        done.run,
        reading_rows(done.scene, done.maps, done.readings, entries),
        warning(done.walls, done.readings),
        measured_surface(done.scene, entries),
        duration_s=done.scene.document.duration_s or common["settings"].simulation.duration_s,
        job=job.id,
    )
    _write(common["out"] / SLIDE, shown)
    return job_answers.simulation_3d(done)


def _question_of(job: Job) -> tuple[Path, str | None]:
    """What is asked, and by which engine: maps in plan, or a section over its width."""
    folder = Path(job.folder)
    if (folder / SURVEY_FILE).is_file() or not (folder / SECTION_FILE).is_file():
        return folder / FILE_NAME, None
    return folder, "mpm3d"


def _back_analyse(job: Job, common: _Common, evaluated: Evaluated) -> Found:
    import flowslide
    from flowslide.studio import job_answers

    place, engine = _question_of(job)
    result = flowslide.back_analyse(
        place, quick=job.options.quick, evaluated=evaluated, report="page", engine=engine, **common
    )
    return job_answers.back_analysis(result)


def _posterior(job: Job, common: _Common) -> Found:
    import flowslide
    from flowslide.studio import job_answers

    place, engine = _question_of(job)
    return job_answers.posterior(flowslide.posterior(place, engine=engine, **common))


def _predict(job: Job, scene: Scene3d, common: _Common) -> Found:
    """A prediction, and its exceedance maps as the page shows them."""
    import flowslide
    from flowslide.studio import job_answers
    from report.prediction3d import doubts, raster_name

    out, drawn = common["out"], job.options.posterior
    document = flowslide.predict(
        Path(job.folder) / FILE_NAME,
        job.options.strengths,
        ratios=job.options.ratios,
        distribution=job.options.distribution,
        posterior=None if drawn is None else out.parent.parent / drawn / RESULTS["posterior"],
        joint=joint_of(out.parent) if job.options.joint else None,
        thicker_than_m=job.options.thicker_than_m,
        **common,
    )
    rasters = {
        one["thicker_than_m"]: out / raster_name(one["thicker_than_m"])
        for one in document["inundation"]
    }
    if all(path.is_file() for path in rasters.values()):  # written with the extra `terrain` alone
        maps = {key: read_raster(path, origin=scene.origin) for key, path in rasters.items()}
        _write(out / EXCEEDANCE, exceedance_message(scene, problem_of(scene), maps, job=job.id))
    found = job_answers.prediction(document)
    found["answer"] += [f"{line[0].upper()}{line[1:]}." for line in doubts(document)]
    return found


def _write(path: Path, content: bytes) -> None:
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
