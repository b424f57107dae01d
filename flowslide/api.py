"""Functions for notebooks, web pages and the command line: a case in, answers out.

    import flowslide

    case = flowslide.load_case("lower_san_fernando")
    result = flowslide.back_analyse(case, spacing_m=3.0, quick=True)
    print(result.answer.parameters[0].value)

In: case folders, names of shipped cases, settings. Out: the same objects that the commands write as
documents. Nothing is printed here. The functions share these arguments:

`case`: what `load_case` returns; or a folder, or the name of a case that ships with the program.
`settings`: of all stages (`flowslide.load_settings`); None: those that the case was loaded with, or
    the defaults.
`measurement_set`: name of a set in `measurements.yaml`; None: the one that the file names.
`use_constructed`: let constructed data enter the fit.
`engine`: what predicts, a name of `inversion.engines.registry`, without a trained model unless
    stated otherwise.
`spacing_m`: distance between material points [m]; None: the case's own.
`device`, `threads`: "cpu" or "cuda"; CPU threads, None: all.
`out`: folder of the results, made where it is missing. Finished simulations are kept there, so that
    a call that was stopped continues where it was. None: nothing is kept.
`effect_files`, `measurement_files`: Python files with effects and measurement types of your own.
    They are executed, and known for the length of the call only.
`progress`: called as `progress(done, total, message)` after every simulation and at every stage;
    `total` is an estimate where the number of simulations is not known beforehand.
`hypothesis`: of a diagnosis, to go on from: a file, or its name in `out`; None: the base model.
`cancel`: a function that returns True, or a `threading.Event` that is set, to stop. It is asked
    between simulations and raises `Cancelled`.

Bad input raises `InputError`, work that cannot be done `WorkFailed`: one line for a person.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from pipeline.cli import InputError, WorkFailed
from pipeline.config import Config
from pipeline.config import load_config as load_settings
from pipeline.extras import require
from pipeline.files import working_in
from pipeline.progress import Cancel, Cancelled, Evaluated, Report, Watch

if TYPE_CHECKING:
    from diagnosis.session import Session
    from diagnosis.verdict.verdict import CompareDocument, ExplainDocument, Verdict
    from geometry.case import Case
    from geometry.scenes3d.scene3d import Scene3d
    from inversion.back_analysis.asked import Asked
    from inversion.back_analysis.back_analysis import BackAnalysis
    from inversion.back_analysis.by_engine import Choice
    from inversion.back_analysis.result import Result
    from inversion.posterior.document import PosteriorDocument
    from inversion.prediction.in_plan import BodyPrediction
    from inversion.prediction.known_strength import KnownStrength
    from mpm_taichi.comparison import Reading
    from mpm_taichi.readings3d import Maps
    from mpm_taichi.trajectory import Run
    from mpm_taichi.trajectory3d import Run3d

__all__ = [
    "Cancelled",
    "InputError",
    "Simulation",
    "Simulation3d",
    "WorkFailed",
    "back_analyse",
    "classical",
    "compare",
    "diagnose",
    "explain",
    "load_case",
    "load_settings",
    "posterior",
    "predict",
    "predict_3d",
    "predict_from_blow_counts",
    "simulate",
    "simulate_3d",
    "write_pdf",
    "write_report",
]

PREDICTION = "prediction.json"
BLOW_COUNT_PREDICTION = "from_blow_counts.json"
Files = Sequence[str | os.PathLike[str]]


def load_case(
    case: str | os.PathLike[str] | Case,
    *,
    settings: Config | None = None,
    measurement_set: str | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
) -> Case:
    """Read and check a case: its section and what was measured on it.

    Args:
        case: folder with `scene.yaml`, and `measurements.yaml` where something was measured; or the
            name of a case that ships with the program.
        settings: of all stages; None: the defaults.

    Raises:
        InputError: file, field, value and what is allowed.
    """
    from geometry import case as cases

    with own_code(effect_files, measurement_files):
        if not isinstance(case, cases.Case):
            case = cases.load_case(os.fspath(case), settings)
        elif settings is not None:
            case = replace(case, config=settings, simulation=settings.simulation)
        return case if measurement_set is None else case.with_set(measurement_set)


@dataclass(frozen=True)
class Simulation:
    """A simulated case history.

    Attributes:
        case: section and measurements.
        run: the trajectory: `positions` (T, N, 2) [m], `time` (T,) [s] of N material points.
        readings: every measurement, as simulated and as measured.
    """

    case: Case
    run: Run
    readings: list[Reading]


def simulate(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    film: Literal["mp4", "gif", "none"] = "none",
    strengths_kpa: Mapping[str, float] | None = None,
    water: bool = True,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    settings: Config | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> Simulation:
    """Simulate the section of a case by the material point method, and read what was measured.

    Args:
        case: with a section and measurements.
        out: folder of `runout.png`, `observables.csv` and the film; None: nothing is written.
        film: what kind of film is written to `out`.
        strengths_kpa: material -> cohesion, which is S_r where it liquefied [kPa].
        water: False takes the reservoir and the groundwater away.
        progress: called with the seconds of motion simulated.
        cancel: asked every few time steps.

    Raises:
        InputError: bad input.
        WorkFailed: the solver stopped the run.
        Cancelled: the caller asked for it.
    """
    from mpm_taichi.comparison import read_deposit, simulate_case

    watch = Watch(progress, cancel)
    with own_code(effect_files, measurement_files), ExitStack() as held:
        case = load_case(case, settings=settings, measurement_set=measurement_set)
        case = case.with_set(None).resolved(spacing_m=spacing_m)
        case = case.changed(water=water, strengths=strengths_kpa)
        if out is not None:
            _ready(Path(out), film)
            held.enter_context(working_in(out))
        seconds = max(round(case.simulation.duration_s), 1)
        words = f"simulating {case.title} (up to {seconds} s of motion)"
        run = simulate_case(
            case,
            device=device,
            threads=threads,
            on_time=lambda time: watch.reach(min(int(time), seconds), seconds, words),
        )
        watch.reach(seconds, seconds, words)
        done = Simulation(case, run, read_deposit(case, run))
        if out is not None:
            _write_simulation(done, Path(out), film)
        return done


def _ready(out: Path, film: str) -> None:
    """Find out before the simulation whether everything can be written."""
    from pipeline.files import ready_folder
    from report.pictures.video import check_video

    files = ["runout.png", "observables.csv"]
    if film != "none":
        check_video(out / f"runout.{film}")
        files.append(f"runout.{film}")
    ready_folder(out, files)


def _write_simulation(done: Simulation, out: Path, film: str) -> None:
    from mpm_taichi.comparison import write_observables
    from report.pictures.case_history import save_case_film, save_case_picture

    save_case_picture(done.case, done.run, done.readings, out / "runout.png")
    if film != "none":
        save_case_film(done.case, done.run, out / f"runout.{film}")
    write_observables(out / "observables.csv", done.readings)


@dataclass(frozen=True)
class Simulation3d:
    """A slide simulated in three dimensions.

    Attributes:
        scene: what `scene3d.yaml` says.
        run: the trajectory: `positions` (T, N, 3) [m], `time` (T,) [s] of N material points.
        maps: ground, thickness before and after, largest speed.
        readings: name with unit -> number; NaN where there is nothing to read.
        walls: edges of the domain that soil has reached; runouts are then too short.
    """

    scene: Scene3d
    run: Run3d
    maps: Maps
    readings: dict[str, float]
    walls: list[str]


def simulate_3d(
    scene: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    film: Literal["mp4", "gif", "none"] = "none",
    strengths_kpa: Mapping[str, float] | None = None,
    water: bool = True,
    spacing_m: float | None = None,
    settings: Config | None = None,
    threads: int | None = None,
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> Simulation3d:
    """Simulate a slide in three dimensions, on the CPU.

    Args:
        scene: `scene3d.yaml` or its folder.
        out: folder of the run, maps, readings, rasters and page, and of the checkpoint from which a
            stopped call goes on; None: nothing is written.
        film: what kind of film is written to `out`, from above and in perspective.
        strengths_kpa: material -> cohesion, which is S_r where it liquefied [kPa].
        water: False takes pool and groundwater away.
        progress: called with the seconds of motion simulated.
        cancel: asked at every frame.

    Raises:
        InputError: bad input.
        WorkFailed: the solver stopped the run.
        Cancelled: the caller asked for it.
    """
    from geometry.scenes3d.scene3d import load_scene_3d
    from mpm_taichi.readings3d import maps_of, readings_3d, walls_reached
    from mpm_taichi.simulate3d import simulate_3d as solve
    from mpm_taichi.solver3d.problem import problem_of
    from mpm_taichi.trajectory3d import write_run_3d
    from pipeline.files import ready_folder
    from report.pictures.ground_film import chosen_frames, save_ground_film
    from report.pictures.video import check_video
    from report.simulation3d import FILES, RASTERS, write_simulation_3d

    watch = Watch(progress, cancel)
    described = load_scene_3d(os.fspath(scene), spacing=spacing_m)
    described = described.changed(water=water, strengths_kpa=strengths_kpa)
    problem = problem_of(described)
    simulation = (settings or load_settings(None)).simulation
    if described.document.duration_s is not None:
        simulation = simulation.model_copy(update={"duration_s": described.document.duration_s})
    moving = None if out is None or film == "none" else Path(out) / f"slide.{film}"
    if moving is not None:
        check_video(moving)
    films = [] if moving is None else [moving.name]
    folder = None if out is None else ready_folder(out, ("run.h5", *FILES, *RASTERS, *films))
    seconds = max(round(simulation.duration_s), 1)
    words = (
        f"simulating {problem.name}, {len(problem.position)} points (up to {seconds} s of motion)"
    )
    with nullcontext() if folder is None else working_in(folder):
        run = solve(
            problem,
            simulation,
            threads=threads,
            checkpoint=folder and folder / "checkpoint.npz",
            on_frame=lambda time, _: watch.reach(min(int(time), seconds), seconds, words),
        )
    watch.reach(seconds, seconds, words)
    if folder is not None:
        write_run_3d(folder / "run.h5", run)
    if run.status == "failed":
        raise WorkFailed(f"{problem.name}: {run.reason}")
    maps = maps_of(described, problem, run)
    readings = readings_3d(described, problem, run, maps)
    done = Simulation3d(described, run, maps, readings, walls_reached(described, maps))
    if folder is not None:
        if moving is not None:
            chosen = chosen_frames(len(run.time))
            frames = [maps_of(described, problem, run, frame=frame) for frame in chosen]
            title, side = described.name, described.document.side
            save_ground_film(moving, title, run.time[chosen], frames, side=side)
        write_simulation_3d(described, maps, readings, done.walls, folder, moving)
    return done


def back_analyse(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    engine: str | None = None,
    model: str | os.PathLike[str] | None = None,
    method: Literal["gauss_newton", "lbfgsb"] | None = None,
    quick: bool = False,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    use_constructed: bool = False,
    report: Literal["film", "page", "none"] = "none",
    settings: Config | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    evaluated: Evaluated | None = None,
    cancel: Cancel | None = None,
) -> Result:
    """Find the strengths that the question of a case asks for, and how certain they are.

    Args:
        case: with a section, measurements and a question (`inversion.yaml`); or a body in three
            dimensions: `scene3d.yaml` or its folder, with `measurements3d.yaml`.
        out: `result.json`, `history.csv`, of a section `sections.npz` and `run.h5`, of a body
            rasters, and the report are written there.
        engine: "mpm", the material point method, "gns", a learned simulator, "direct", a learned
            model in one pass, or "mpm3d", the material point method over the width of the case's
            `scene3d.yaml`; None: the question's, else the settings'. Of a body "mpm3d" alone.
        model: of the engine "gns": a folder, or the name of a model that ships.
        method: of the search; None: the settings'.
        quick: the answer alone: one start, no variants, no seeds, no sensitivities,
            no waterfall.
        report: `report.html` with pictures and a film, without a new film, or none.
        evaluated: called as `evaluated(simulations, values, loss)` with the values by name that
            the search for the answer has tried, in outside units, after each of them.

    Returns:
        what `result.json` holds; strengths in kPa, lengths in m.

    Raises:
        InputError: bad input.
        WorkFailed: no simulation of the case can be read.
        Cancelled: the caller asked for it.
    """
    watch = Watch(progress, cancel, evaluated)
    with own_code(effect_files, measurement_files), _folder(out) as folder:
        asked = load_question(
            case,
            settings=settings,
            method=method,
            quick=quick,
            measurement_set=measurement_set,
            spacing_m=spacing_m,
            use_constructed=use_constructed,
        )
        choice = choose_engine(asked, engine, model)
        return answer(asked, choice, folder, watch, report=report, device=device, threads=threads)


def choose_engine(
    asked: Asked, engine: str | None = None, model: str | os.PathLike[str] | None = None
) -> Choice:
    """What answers a question; arguments as of `back_analyse`.

    Raises:
        InputError: no such engine or model, one that is not installed or cannot simulate the case.
    """
    from inversion.back_analysis.by_engine import chosen_engine

    return chosen_engine(asked, engine, None if model is None else os.fspath(model))


def answer(
    asked: Asked,
    choice: Choice,
    folder: Path,
    watch: Watch,
    *,
    report: Literal["film", "page", "none"] = "none",
    device: str = "cpu",
    threads: int | None = None,
) -> Result:
    """Answer a question that was read, by an engine that was chosen; see `back_analyse`."""
    from inversion.back_analysis.by_engine import back_analysis_by
    from inversion.back_analysis.result_files import answered
    from inversion.engines.run_store import RunStore

    plain = RunStore(folder / "runs", device=device, threads=threads, **_reports(watch))
    with working_in(folder):
        analysis = back_analysis_by(choice.engine, asked, plain, watch, choice.model, folder)
        with analysis.store.workers():
            result = answered(analysis, folder)
        if report != "none":
            watch.say("writing the report")
            _write_back_analysis(analysis, result, folder, film=report == "film")
    return result


def load_question(
    case: str | os.PathLike[str] | Case,
    *,
    settings: Config | None = None,
    method: str | None = None,
    quick: bool = False,
    measurement_set: str | None = None,
    spacing_m: float | None = None,
    use_constructed: bool = False,
) -> Asked:
    """A case, on a section or on a body, and the question of its `inversion.yaml`.

    Arguments as of `back_analyse`.

    Raises:
        InputError: file, field, value and what is allowed.
    """
    from geometry.case import Case
    from geometry.scenes3d.scene3d import is_body
    from inversion.back_analysis.body_case import body_case
    from inversion.back_analysis.case import inversion_case

    chosen: dict[str, Any] = {
        "measurement_set": measurement_set,
        "spacing_m": spacing_m,
        "use_constructed": use_constructed,
    }
    if not isinstance(case, Case) and is_body(case):
        config = _chosen(settings or load_settings(None), method, quick)
        return body_case(os.fspath(case), config, **chosen)
    found = load_case(case, settings=settings)
    return inversion_case(replace(found, config=_chosen(found.config, method, quick)), **chosen)


def _reports(watch: Watch) -> dict[str, Any]:
    """How a store of runs reports to a watch."""
    return {"on_run": watch.run_done, "on_frame": watch.frame_done}


def _write_back_analysis(
    analysis: BackAnalysis, result: Result, folder: Path, *, film: bool
) -> None:
    from inversion.back_analysis.body_case import BodyCase
    from report import back_analysis, back_analysis3d
    from report.data.back_analysis import load_back_analysis

    if isinstance(analysis.case, BodyCase):
        back_analysis3d.write_report(analysis, result, folder)
    else:
        back_analysis.write_report(load_back_analysis(folder, analysis.case, result), film=film)


def _chosen(config: Config, method: str | None, quick: bool) -> Config:
    changes: dict[str, Any] = {} if method is None else {"method": method}
    if quick:
        left_out = dict.fromkeys(("variants", "sensitivities", "waterfall"), False)
        changes |= {"starts": 1, "noise_seeds": 0, **left_out}
    chosen = config.inversion.model_copy(update=changes)
    return config.model_copy(update={"inversion": chosen})


def posterior(
    case: str | os.PathLike[str] | Case | Asked,
    *,
    out: str | os.PathLike[str] | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    use_constructed: bool = False,
    settings: Config | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> PosteriorDocument:
    """Everything unknown of a case, before and after its measurements.

    Args:
        case: with a section or a body, measurements and a question, as of `back_analyse`; or what
            `load_question` returns, which has been asked everything else already.
        out: `posterior.json`, the draws `posterior.nc` (ArviZ) and `report.html` are
            written there.
        engine: what predicts, a name of `inversion.engines.registry`, without a trained model;
            None: "mpm", of a body "mpm3d". "mpm3d" of a section: over the width of the case's
            `scene3d.yaml`.
        settings: see above; the group `posterior` says how many runs and draws.

    Returns:
        what `posterior.json` holds; strengths in kPa, lengths in m.

    Raises:
        InputError: bad input.
        WorkFailed: most of the simulations fail.
        Cancelled: the caller asked for it.
    """
    from inversion.back_analysis.asked import Asked as Question
    from inversion.back_analysis.by_engine import untrained_engine
    from inversion.engines.run_store import RunStore
    from inversion.posterior.infer import Inference
    from inversion.posterior.runs import CaseModel
    from inversion.posterior.summary import save_all
    from inversion.posterior.unknown import varied_case
    from report.posterior import write_report as write_posterior

    require("posterior", "a posterior")
    watch = Watch(progress, cancel)
    with own_code(effect_files, measurement_files), _folder(out) as folder, ExitStack() as held:
        if not isinstance(case, Question):
            case = load_question(
                case,
                settings=settings,
                measurement_set=measurement_set,
                spacing_m=spacing_m,
                use_constructed=use_constructed,
            )
        asked = case
        chosen = untrained_engine(asked, engine)
        plain = RunStore(folder / "runs", device=device, threads=threads, **_reports(watch))
        store = chosen.store_of(asked.folder, asked.setup, plain)
        inference = Inference(
            CaseModel(varied_case(asked, store.refused), store, chosen),
            asked.setup.targets,
            asked.config.posterior,
            watch,
        )
        held.enter_context(working_in(folder))
        with store.workers():
            document = save_all(inference.run(), folder)
        write_posterior(folder)
        return document


def predict(
    case: str | os.PathLike[str] | Case,
    strengths: Sequence[str | KnownStrength] = (),
    *,
    posterior: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    zones: Sequence[str] = (),
    distribution: Literal["lognormal", "normal"] = "lognormal",
    samples: int = 20_000,
    seeds: int = 3,
    engine: str = "mpm",
    spacing_m: float | None = None,
    settings: Config | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> dict[str, Any]:
    """The distribution of the runout that follows from that of the residual strength.

    Args:
        case: with a section, at least.
        strengths: mean and standard deviation [kPa] such as "18+-5", of some zones "1,6=4+-1".
            Empty: those of `posterior`.
        posterior: in place of strengths: `out` of a `posterior`, whose draws are the strengths.
        out: `prediction.json` and its page are written there.
        zones: of a single strength; empty: those whose strength `inversion.yaml` seeks, else the
            liquefied ones.
        distribution: of strengths that are given as text.
        samples: drawn from the strengths, at least 100.
        seeds: jitter seeds that measure the numerical noise; 0: none.

    Returns:
        what `prediction.json` holds (docs/files.md).

    Raises:
        InputError: bad input.
        WorkFailed: the simulations fail.
        Cancelled: the caller asked for it.
    """
    from inversion.engines.registry import untrained
    from inversion.engines.run_store import RunStore
    from inversion.prediction import predict as prediction
    from inversion.prediction.known_strength import placed
    from inversion.prediction.prediction_case import prediction_case
    from inversion.prediction.prediction_document import document_of
    from pipeline.files import write_json
    from report.prediction import write_report as write_page

    for name, value, least in (("samples", samples, 100), ("seeds", seeds, 0)):
        if value < least:
            raise InputError(f"--{name} {value}: at least {least}")
    watch = Watch(progress, cancel)
    with own_code(effect_files, measurement_files), _folder(out) as folder, ExitStack() as held:
        read = _strengths(strengths, posterior, zones, distribution)
        section = prediction_case(load_case(case, settings=settings), spacing_m=spacing_m)
        known = placed(read, list(zones) or section.default_zones, section.scene)
        chosen = untrained(engine)
        plain = RunStore(folder / "runs", device=device, threads=threads, on_run=watch.run_done)
        forward = chosen.made(chosen.store_of(section.folder, section.setup(known), plain))
        watch.plan({"simulating": (1 + seeds) * 7})
        held.enter_context(working_in(folder))
        with watch.stage("simulating"):
            found = prediction.predict(
                forward,
                section.setup(known),
                known,
                jittered=[section.setup(known, jitter_seed=s) for s in range(1, seeds + 1)],
                samples=samples,
            )
        sections = prediction.envelope(found, spacing=section.scene.spacing, ground=section.ground)
        document = {**document_of(section, known, found, sections), "engine": chosen.name}
        write_json(folder / PREDICTION, document)
        write_page(section.scene, document, folder)
        return document


def predict_3d(
    scene: str | os.PathLike[str],
    strengths: Sequence[str | KnownStrength] = (),
    *,
    posterior: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    zones: Sequence[str] = (),
    distribution: Literal["lognormal", "normal"] = "lognormal",
    thicker_than_m: Sequence[float] = (),
    samples: int = 20_000,
    spacing_m: float | None = None,
    settings: Config | None = None,
    threads: int | None = None,
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> BodyPrediction:
    """How far a slide would run in three dimensions, and where it would come to lie.

    Args:
        scene: `scene3d.yaml` or its folder.
        strengths: see `predict`; zones are those of the section or of the terrain.
        posterior: see `predict`.
        out: `prediction.json`, its page and the exceedance maps are written there.
        zones: of a single strength; empty: the liquefied ones.
        distribution: of strengths that are given as text.
        thicker_than_m: thicknesses of the deposit [m] of which the probability is mapped; empty:
            that from which soil counts as a deposit.
        samples: drawn from the strengths, at least 100.
        cancel: asked at every frame.

    Raises:
        InputError: bad input.
        WorkFailed: the simulations fail.
        Cancelled: the caller asked for it.
    """
    from geometry.scenes3d.scene3d import load_scene_3d
    from inversion.engines.body_engine import BodyEngine, body_store
    from inversion.engines.run_store import RunStore
    from inversion.prediction.in_plan import predict_in_plan, prediction_setup
    from inversion.prediction.known_strength import placed
    from inversion.prediction.response import design
    from pipeline.files import write_json
    from report.prediction3d import write_report as write_page

    if samples < 100:
        raise InputError(f"--samples {samples}: at least 100")
    if any(not 0.0 < thickness < float("inf") for thickness in thicker_than_m):
        raise InputError("--thicker-than: thicknesses must be greater than 0 m")
    watch = Watch(progress, cancel)
    with _folder(out) as folder, ExitStack() as held:
        described = load_scene_3d(os.fspath(scene), spacing=spacing_m)
        soil = described.soil
        liquefied = [z.name for z in soil.zones if soil.materials[z.material].liquefied]
        read = _strengths(strengths, posterior, zones, distribution)
        known = placed(read, list(zones) or liquefied, soil)
        simulation = (settings or load_settings(None)).simulation
        if described.document.duration_s is not None:
            simulation = simulation.model_copy(update={"duration_s": described.document.duration_s})
        setup = prediction_setup(described, simulation, known)
        plain = RunStore(folder / "runs", threads=threads, **_reports(watch))
        engine = BodyEngine(body_store(setup, plain))
        watch.plan({"simulating": len(design(len(known)))})
        held.enter_context(working_in(folder))
        with watch.stage("simulating"):
            found = predict_in_plan(
                engine,
                setup,
                known,
                thicker_than_m=sorted(thicker_than_m) or [setup.before.least],
                samples=samples,
            )
        write_json(folder / PREDICTION, found.document)
        write_page(found, folder)
        return found


def _strengths(
    strengths: Sequence[str | KnownStrength],
    posterior: str | os.PathLike[str] | None,
    zones: Sequence[str],
    distribution: Literal["lognormal", "normal"],
) -> Sequence[KnownStrength]:
    """The strengths of a prediction as they are given, or as a posterior has drawn them."""
    from inversion.prediction.known_strength import OPTION, drawn_strengths, parse_strength

    if bool(strengths) == (posterior is not None):
        raise InputError("predict: give strengths or a posterior, one of the two")
    if posterior is not None:
        read: Sequence[KnownStrength] = drawn_strengths(os.fspath(posterior))
    else:
        read = [parse_strength(s, distribution) if isinstance(s, str) else s for s in strengths]
    if zones and read[0].zones:
        raise InputError(f"--zones: {OPTION} names its zones already")
    return read


def predict_from_blow_counts(
    case: str | os.PathLike[str] | Case,
    *,
    zones: Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
    engine: str = "mpm",
    spacing_m: float | None = None,
    settings: Config | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> dict[str, Any]:
    """The slides that published relations give for the blow counts of a case, without a fit.

    Args:
        case: with a section whose liquefied zones have blow counts (`blow_counts.yaml`).
        zones: that liquefy, those of the section among them; empty: these alone.
        out: `from_blow_counts.json` and its page are written there.

    Returns:
        what `from_blow_counts.json` holds (docs/method/prediction.md).

    Raises:
        InputError: bad input.
        WorkFailed: the simulations fail.
        Cancelled: the caller asked for it.
    """
    from inversion.catalogue.correlations import RELATIONS
    from inversion.engines.registry import of_section
    from inversion.engines.run_store import RunStore
    from inversion.prediction import from_blow_counts
    from inversion.prediction.prediction_case import prediction_case
    from pipeline.files import write_json
    from report.from_blow_counts import write_report as write_page

    watch = Watch(progress, cancel)
    with own_code(effect_files, measurement_files), _folder(out) as folder, ExitStack() as held:
        section = prediction_case(load_case(case, settings=settings), spacing_m=spacing_m)
        chosen = of_section(engine)
        store = RunStore(folder / "runs", device=device, threads=threads, on_run=watch.run_done)
        watch.plan({"simulating": len(RELATIONS) * len(from_blow_counts.SCORES)})
        held.enter_context(working_in(folder))
        with watch.stage("simulating"):
            document = from_blow_counts.predict_from_blow_counts(
                section, store, zones=zones, engine=chosen
            )
        write_json(folder / BLOW_COUNT_PREDICTION, document)
        write_page(document, folder)
        return document


def classical(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    run: str | os.PathLike[str] | None = None,
    slide: str | None = None,
    judgement: Mapping[str, Any] | None = None,
    settings: Config | None = None,
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> dict[str, Any]:
    """Find S_r by the classical methods on the sections before and after a slide.

    Args:
        case: with a section, a measured side, and a surface after the slide.
        out: `classical.json`, its page and a picture per slide are written there.
        run: trajectory whose deposit is the section after the slide; None: as surveyed.
        slide: the only one; None: every slide of the case.
        judgement: calls that replace those of `classical.yaml`, by name (docs/method/classical.md).
        progress: called for each slide.
        cancel: asked between slides.

    Returns:
        what `classical.json` holds.

    Raises:
        InputError: bad input, or a slide that cannot be analysed.
        Cancelled: the caller asked for it.
    """
    from inversion.classical.sections_of_case import case_sections
    from inversion.classical.slides import analyse_slides
    from report.classical import save_all

    watch = Watch(progress, cancel)
    with own_code((), measurement_files), _folder(out) as folder, ExitStack() as held:
        sections = case_sections(
            load_case(case, settings=settings), run=None if run is None else os.fspath(run)
        )
        held.enter_context(working_in(folder))
        analyses, refused = analyse_slides(
            sections, slide=slide, changes=judgement, on_slide=watch.reach
        )
        return save_all(sections, analyses, refused, folder)


def diagnose(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    hypothesis: str | None = None,
    engine: str = "mpm",
    spacing_m: float | None = None,
    settings: Config | None = None,
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> Verdict:
    """Say whether the model of a case explains its measurements, and which effect it lacks if not.

    Args:
        case: with a section, measurements and a question.
        out: `verdict.json`, `sections.npz` and the hypotheses are written there.
        progress: called for each run; the total is the budget, which is rarely used up.

    Returns:
        what `verdict.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.
    """
    from diagnosis.answers import diagnosed

    with (
        own_code(effect_files, measurement_files),
        _session("diagnosis", case, out, hypothesis, engine, spacing_m, settings, threads,
                 Watch(progress, cancel)) as session,
    ):  # fmt: skip
        found = diagnosed(session)
        session.write_timing("run")
        return found


def compare(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    hypothesis: str | None = None,
    engine: str = "mpm",
    spacing_m: float | None = None,
    settings: Config | None = None,
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> CompareDocument:
    """Calibrate the model of a case, and test whether it explains the measurements.

    Args:
        case: with a section, measurements and a question.
        out: `compare.json`, `sections.npz` and the hypothesis are written there.
        progress: called for each run; the total is the budget, which is rarely used up.

    Returns:
        what `compare.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.
    """
    from diagnosis.answers import compared

    with (
        own_code(effect_files, measurement_files),
        _session("comparison", case, out, hypothesis, engine, spacing_m, settings, threads,
                 Watch(progress, cancel)) as session,
    ):  # fmt: skip
        found = compared(session)
        session.write_timing("compare")
        return found


def explain(
    case: str | os.PathLike[str] | Case,
    *,
    out: str | os.PathLike[str] | None = None,
    hypothesis: str | None = None,
    engine: str = "mpm",
    spacing_m: float | None = None,
    settings: Config | None = None,
    threads: int | None = None,
    effect_files: Files = (),
    measurement_files: Files = (),
    progress: Report | None = None,
    cancel: Cancel | None = None,
) -> ExplainDocument:
    """Rank the effects that would explain the misfit of a case, and say what cannot be told apart.

    Args:
        case: with a section, measurements and a question.
        out: `explain.json` and `sections.npz` are written there.
        progress: called for each run; the total is the budget, which is rarely used up.

    Returns:
        what `explain.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.
    """
    from diagnosis.answers import explained

    with (
        own_code(effect_files, measurement_files),
        _session("explanation", case, out, hypothesis, engine, spacing_m, settings, threads,
                 Watch(progress, cancel)) as session,
    ):  # fmt: skip
        found = explained(session)
        session.write_timing("explain")
        return found


@contextmanager
def _session(
    what: str,
    case: str | os.PathLike[str] | Case,
    out: str | os.PathLike[str] | None,
    hypothesis: str | None,
    engine: str,
    spacing_m: float | None,
    settings: Config | None,
    threads: int | None,
    watch: Watch,
) -> Iterator[Session]:
    """A session of a diagnosis within a stage of this name."""
    from diagnosis.session import open_session
    from inversion.engines.registry import of_section

    with _folder(out) as folder:
        case = load_case(case, settings=settings)
        watch.plan({what: case.config.diagnosis.max_runs})
        session = open_session(
            case,
            out=folder,
            hypothesis=hypothesis,
            spacing_m=spacing_m,
            engine=of_section(engine),
            threads=threads,
            say=watch.say,
            on_run=watch.run_done,
        )
        with working_in(session.folder), watch.stage(what):
            yield session


def write_report(
    folder: str | os.PathLike[str],
    *,
    case: str | os.PathLike[str] | None = None,
    film: bool = True,
) -> Path:
    """Write the page of a back-analysis or of a diagnosis, with its pictures next to it.

    Args:
        folder: `out` of `back_analyse`, `posterior` or `diagnose`.
        case: folder of the case, of a back-analysis; None: the one of that name that ships.
        film: of a back-analysis: make a new film; False: show the one that is there, if any.

    Returns:
        The page, `report.html`: one file that needs nothing else.

    Raises:
        InputError: the folder holds no result, posterior or verdict.
    """
    folder = Path(folder)
    if (folder / "posterior.json").is_file():
        from report.posterior import write_report as write_posterior

        return write_posterior(folder)
    if (folder / "verdict.json").is_file():
        from report.diagnosis import write_report as write_diagnosis

        return write_diagnosis(folder)
    from report.back_analysis import write_report as write_back_analysis
    from report.data.back_analysis import load_back_analysis

    return write_back_analysis(
        load_back_analysis(folder, None if case is None else os.fspath(case)), film=film
    )


def write_pdf(page: str | os.PathLike[str]) -> Path:
    """Print a page that this program has written into a PDF next to it.

    Args:
        page: such as `report.html`.

    Returns:
        The PDF, with page numbers, on A4.

    Raises:
        InputError: there is no such page, or neither Chromium nor Chrome is installed.
        WorkFailed: the browser prints nothing.
    """
    from report import pdf

    return pdf.write_pdf(page)


@contextmanager
def _folder(out: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder of the results; a temporary one where nothing is to be kept."""
    if out is not None:
        yield Path(out)
        return
    with TemporaryDirectory(prefix="flowslide_") as temporary:
        yield Path(temporary)


@contextmanager
def own_code(effect_files: Files, measurement_files: Files) -> Iterator[None]:
    """Effects and measurement types of the caller's own, for the length of a call."""
    with ExitStack() as stack:
        if effect_files:
            from mpm_taichi.effects import given_effects

            stack.enter_context(given_effects([os.fspath(file) for file in effect_files]))
        if measurement_files:
            from geometry.survey.registry import given_measurements

            stack.enter_context(given_measurements([os.fspath(file) for file in measurement_files]))
        yield
