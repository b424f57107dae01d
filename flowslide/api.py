"""Functions for notebooks, web pages and the command line: a case in, answers out.

    import flowslide

    case = flowslide.load_case("lower_san_fernando")
    result = flowslide.back_analyse(case, spacing_m=3.0, quick=True)
    print(result.answer.parameters[0].value)

In: case folders, names of shipped cases, settings. Out: the same objects that the commands write as
documents. Nothing is printed here. The functions share these arguments:

`case`: what `load_case` returns; or a folder, or the name of a case that ships with the program.
`measurement_set`: name of a set in `measurements.yaml`; None: the one that the file names.
`use_constructed`: let constructed data enter the fit.
`engine`: what predicts, a name of `inversion.engines.registry`, without a trained model unless
    stated otherwise.
`spacing_m`: distance between material points [m]; None: the case's own.
`out`: folder of the results, made where it is missing. Finished simulations are kept there, so that
    a call that was stopped continues where it was. None: nothing is kept.
`hypothesis`: of a diagnosis, to go on from: a file, or its name in `out`; None: the base model.
`options`: settings, device, threads, code of your own, progress, a way to stop
    (`flowslide.run.SectionOptions`, and those like it of functions that have fewer).

Bad input raises `InputError`, work that cannot be done `WorkFailed`: one line for a person.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Unpack

from flowslide.run import (
    BodyOptions,
    Call,
    DiagnosisOptions,
    JointOptions,
    Place,
    SectionOptions,
    SurveyOptions,
)
from pipeline.cli import InputError, WorkFailed
from pipeline.config import Config
from pipeline.config import load_config as load_settings
from pipeline.extras import require
from pipeline.files import working_in
from pipeline.progress import Cancelled, Evaluated

if TYPE_CHECKING:
    from diagnosis.answers import Extended, Track
    from diagnosis.ranking import Ranked
    from diagnosis.session import Session
    from diagnosis.verdict.verdict import CompareDocument, ExplainDocument, Verdict
    from geometry.case import Case
    from geometry.scenes3d.scene3d import Scene3d
    from inversion.back_analysis.asked import Asked
    from inversion.back_analysis.back_analysis import BackAnalysis
    from inversion.back_analysis.body_case import BodyCase
    from inversion.back_analysis.by_engine import Choice
    from inversion.back_analysis.result import Result
    from inversion.classical.analysis import Analysis
    from inversion.classical.sections_of_case import CaseSections
    from inversion.engines.registry import Engine
    from inversion.joint.document import JointDocument
    from inversion.posterior.document import PosteriorDocument
    from inversion.prediction.known_strength import KnownStrength
    from mpm_taichi.comparison import ComparedReading
    from mpm_taichi.readings3d import Maps
    from mpm_taichi.solver3d.problem import Problem3d
    from mpm_taichi.trajectory import Run as SimulatedRun
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
    "joint",
    "load_case",
    "load_settings",
    "posterior",
    "predict",
    "predict_from_blow_counts",
    "simulate",
    "simulate_3d",
    "write_pdf",
    "write_report",
]

PREDICTION, HYDROGRAPH = "prediction.json", "hydrograph.csv"
BLOW_COUNT_PREDICTION = "from_blow_counts.json"
#: Jitter seeds that measure the noise of a predicted runout, where nothing else is asked for: a run
#: in three dimensions takes a minute.
SEEDS, SEEDS_3D = 3, 0
Answer = TypeVar("Answer")


def load_case(
    case: Place | Case, *, measurement_set: str | None = None, **options: Unpack[SectionOptions]
) -> Case:
    """Read and check a case: its section and what was measured on it.

    Args:
        case: folder with `scene.yaml`, and `measurements.yaml` where something was measured; or the
            name of a case that ships with the program.
        options: see above; settings and code of your own count here.

    Raises:
        InputError: file, field, value and what is allowed.

    Examples:
        >>> load_case("lower_san_fernando").title
        'Lower San Fernando'
    """
    run = Call.of(SectionOptions, options)
    with run.own_code():
        found = run.case(case)
        return found if measurement_set is None else found.with_set(measurement_set)


@dataclass(frozen=True)
class Simulation:
    """A simulated case history.

    Attributes:
        case: section and measurements.
        run: the trajectory: `positions` (T, N, 2) [m], `time` (T,) [s] of N material points.
        readings: every measurement, as simulated and as measured.
    """

    case: Case
    run: SimulatedRun
    readings: list[ComparedReading]


def simulate(
    case: Place | Case,
    *,
    out: Place | None = None,
    film: Literal["mp4", "gif", "none"] = "none",
    strengths_kpa: Mapping[str, float] | None = None,
    water: bool = True,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    **options: Unpack[SectionOptions],
) -> Simulation:
    """Simulate the section of a case by the material point method, and read what was measured.

    Args:
        case: with a section; what was measured is compared, where there is something.
        out: folder of `runout.png`, `observables.csv` and the film; None: nothing is written.
        film: what kind of film is written to `out`.
        strengths_kpa: material -> cohesion, which is S_r where it liquefied [kPa].
        water: False takes the reservoir and the groundwater away.
        options: see above; progress is in seconds of motion, and cancel asked every few steps.

    Raises:
        InputError: bad input.
        WorkFailed: the solver stopped the run.
        Cancelled: the caller asked for it.

    Examples:
        >>> done = simulate("lower_san_fernando", spacing_m=3.0, threads=1)
        >>> for one in done.readings:
        ...     if one.name == "upstream toe":
        ...         print(f"{one.simulated:.0f} m of {one.measured:.0f} m")
        24 m of 53 m
    """
    from geometry.scenes.fill import point_count
    from mpm_taichi.comparison import read_deposit, simulate_case

    own = Call.of(SectionOptions, options)
    with own.own_code(), ExitStack() as held:
        found = own.case(case)
        found = found if measurement_set is None else found.with_set(measurement_set)
        found = found.resolved(spacing_m=spacing_m)
        found = found.changed(water=water, strengths=strengths_kpa)
        if out is not None:
            _ready(Path(out), film)
            held.enter_context(working_in(out))
        seconds = max(round(found.simulation.duration_s), 1)
        points = point_count(found.scene)
        words = f"simulating {found.title}, {points} points (up to {seconds} s of motion)"
        own.watch.reach(0, seconds, words)
        run = simulate_case(
            found,
            device=own.device,
            threads=own.threads,
            on_time=lambda time: own.watch.reach(min(int(time), seconds), seconds, words),
        )
        own.watch.reach(seconds, seconds, words)
        done = Simulation(found, run, read_deposit(found, run))
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
        problem: its points before the slide, ground and water.
        run: the trajectory: `positions` (T, N, 3) [m], `time` (T,) [s] of N material points.
        maps: ground, thickness before and after, largest speed.
        readings: name with unit -> number; NaN where there is nothing to read.
        walls: edges of the domain that soil has reached; runouts are then too short.
    """

    scene: Scene3d
    problem: Problem3d
    run: Run3d
    maps: Maps
    readings: dict[str, float]
    walls: list[str]


def simulate_3d(
    scene: Place,
    *,
    out: Place | None = None,
    film: Literal["mp4", "gif", "none"] = "none",
    strengths_kpa: Mapping[str, float] | None = None,
    water: bool = True,
    spacing_m: float | None = None,
    **options: Unpack[BodyOptions],
) -> Simulation3d:
    """Simulate a slide in three dimensions, on the CPU.

    Args:
        scene: `scene3d.yaml` or its folder.
        out: folder of the run, maps, readings, rasters and page, and of the checkpoint from which a
            stopped call goes on; None: nothing is written.
        film: what kind of film is written to `out`, from above and in perspective.
        strengths_kpa: material -> cohesion, which is S_r where it liquefied [kPa].
        water: False takes pool and groundwater away.
        options: see above; progress is in seconds of motion, and cancel asked at every frame.

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
    from report.pictures.body_film import chosen_frames, save_body_film
    from report.pictures.video import check_video
    from report.simulation3d import FILES, RASTERS, write_simulation_3d

    own = Call.of(BodyOptions, options)
    watch = own.watch
    described = load_scene_3d(os.fspath(scene), spacing=spacing_m)
    described = described.changed(water=water, strengths_kpa=strengths_kpa)
    problem = problem_of(described)
    simulation = own.config.simulation
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
    watch.reach(0, seconds, words)
    with nullcontext() if folder is None else working_in(folder):
        run = solve(
            problem,
            simulation,
            threads=own.threads,
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
    done = Simulation3d(described, problem, run, maps, readings, walls_reached(described, maps))
    if folder is not None:
        if moving is not None:
            chosen = chosen_frames(len(run.time))
            frames = [maps_of(described, problem, run, frame=frame) for frame in chosen]
            title, side = described.name, described.document.side
            save_body_film(moving, title, run.time[chosen], frames, side=side)
        write_simulation_3d(described, maps, readings, done.walls, folder, moving)
    return done


def back_analyse(
    case: Place | Case,
    *,
    out: Place | None = None,
    engine: str | None = None,
    model: Place | None = None,
    method: Literal["gauss_newton", "lbfgsb"] | None = None,
    quick: bool = False,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    use_constructed: bool = False,
    report: Literal["film", "page", "none"] = "none",
    evaluated: Evaluated | None = None,
    **options: Unpack[SectionOptions],
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

    Examples:
        >>> found = back_analyse("lower_san_fernando", spacing_m=3.0, quick=True, threads=1)
        >>> [(one.name, round(one.value)) for one in found.answer.parameters]
        [('residual_strength', 17)]
    """
    run = Call.of(SectionOptions, options, evaluated=evaluated)
    with run.folder(out) as folder:
        asked = load_question(
            case,
            settings=run.settings,
            method=method,
            quick=quick,
            measurement_set=measurement_set,
            spacing_m=spacing_m,
            use_constructed=use_constructed,
        )
        return answer(asked, choose_engine(asked, engine, model), folder, run, report=report)


def choose_engine(asked: Asked, engine: str | None = None, model: Place | None = None) -> Choice:
    """What answers a question; arguments as of `back_analyse`.

    Raises:
        InputError: no such engine or model, one that is not installed or cannot simulate the case.

    Examples:
        >>> asked = load_question("lower_san_fernando", spacing_m=2.0)
        >>> choose_engine(asked, "direct").engine.description
        'a learned model that predicts the deposit in one pass'
    """
    from inversion.back_analysis.by_engine import chosen_engine

    return chosen_engine(asked, engine, None if model is None else os.fspath(model))


def answer(
    asked: Asked,
    choice: Choice,
    folder: Path,
    run: Call,
    *,
    report: Literal["film", "page", "none"] = "none",
) -> Result:
    """Answer a question that was read, by an engine that was chosen; see `back_analyse`."""
    from inversion.back_analysis.by_engine import back_analysis_by
    from inversion.back_analysis.result_files import answered

    watch = run.watch
    with working_in(folder):
        analysis = back_analysis_by(
            choice.engine, asked, run.store(folder), watch, choice.model, folder
        )
        with analysis.store.workers():
            result = answered(analysis, folder)
        if report != "none":
            watch.say("writing the report")
            _write_back_analysis(analysis, result, folder, film=report == "film")
    return result


def load_question(
    case: Place | Case,
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

    Examples:
        >>> asked = load_question("la_marquesa", spacing_m=1.0)
        >>> [one.name for one in asked.setup.parameters.specs]
        ['residual_strength_1', 'residual_strength_2', 'residual_strength_6']
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
    found = Call(settings=settings).case(case)
    return inversion_case(replace(found, config=_chosen(found.config, method, quick)), **chosen)


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
    case: Place | Case | Asked,
    *,
    out: Place | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    measurement_set: str | None = None,
    use_constructed: bool = False,
    **options: Unpack[SectionOptions],
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
        options: see above; the group `posterior` of the settings has the numbers of runs and draws.

    Returns:
        what `posterior.json` holds; strengths in kPa, lengths in m.

    Raises:
        InputError: bad input.
        WorkFailed: most of the simulations fail.
        Cancelled: the caller asked for it.
    """
    from inversion.back_analysis.asked import Asked as Question
    from inversion.back_analysis.by_engine import untrained_engine
    from inversion.posterior.infer import Inference
    from inversion.posterior.runs import CaseModel
    from inversion.posterior.summary import save_all
    from inversion.posterior.varied_case import varied_case
    from report.posterior import write_report as write_posterior

    require("posterior", "a posterior")
    run = Call.of(SectionOptions, options)
    with run.folder(out) as folder:
        asked = (
            case
            if isinstance(case, Question)
            else load_question(
                case,
                settings=run.settings,
                measurement_set=measurement_set,
                spacing_m=spacing_m,
                use_constructed=use_constructed,
            )
        )
        chosen = untrained_engine(asked, engine)
        store = chosen.store_of(asked.folder, asked.setup, run.store(folder))
        varied = varied_case(asked, store.refused)
        solver = CaseModel(varied, run.store(folder)) if chosen.is_learned else None
        inference = Inference(
            CaseModel(varied, store, chosen),
            asked.setup.targets,
            asked.config.posterior,
            run.watch,
        )
        with working_in(folder):
            with store.workers():
                document = save_all(inference.run(), folder, solver)
            write_posterior(folder)
            return document


def joint(
    cases: Sequence[Place | Case],
    *,
    out: Place | None = None,
    weights: Mapping[str, float] | None = None,
    **options: Unpack[JointOptions],
) -> JointDocument:
    """One relation of the ratio S_r / sigma'_v0 over several slides, from their own results.

    Args:
        cases: sections whose results are in `results_folder` of the settings: a back-analysis or
            a posterior, with a diagnosis where one was made; of a slide from a few numbers its
            posterior alone. Nothing is simulated.
        out: `joint.json` and `report.html` are written there.
        weights: quality of some cases by name, in (0, 1]: their variance is divided by it.
        options: settings; the group `posterior` has the numbers of draws and live points.

    Returns:
        what `joint.json` holds.

    Raises:
        InputError: bad input, or a case without results.
    """
    from inversion.joint.build import document_of, save, slide_of
    from report.joint import write_report as write_joint

    require("posterior", "a relation of several slides")
    run, quality = Call.of(JointOptions, options), dict(weights or {})
    read = [run.case(case) for case in cases]
    _check_weights(quality, [case.name for case in read])
    slides = []
    for case in read:
        place = Path(run.config.results_folder) / case.name
        found = slide_of(case, place)
        # A verdict on the median section of a family is none on the slide.
        factor, verdict = _worth(place / "diagnosis" if found.drawn else None)
        slides.append(found.widened(factor, verdict).weighed(quality.get(case.name, 1.0)))
    if out is None:
        return document_of(slides, run.config)
    with working_in(Path(out)):
        document = save(slides, run.config, Path(out))
        write_joint(Path(out))
        return document


def _check_weights(weights: Mapping[str, float], names: Sequence[str]) -> None:
    for name, weight in weights.items():
        if name not in names:
            raise InputError(f"--weight {name}: is not among the cases; these are {names}")
        if not 0.0 < weight <= 1.0:
            raise InputError(f"--weight {name}={weight:g}: greater than 0, at most 1")


def _worth(folder: Path | None) -> tuple[float, str]:
    """Within which factor nine of ten strengths lay, by the verdict on a model.

    Args:
        folder: of a diagnosis; None: none counts.

    Returns:
        the factor, and the verdict; empty: there is no diagnosis, and the factor is the mean of
        all verdicts.
    """
    from diagnosis.track_record import factor_of
    from diagnosis.verdict.verdict import FILE_NAME, load_verdict

    if folder is None or not (folder / FILE_NAME).is_file():
        return factor_of(None), ""
    verdict = load_verdict(folder).verdict
    return factor_of(verdict), verdict


def predict(
    case: Place | Case,
    strengths: Sequence[str | KnownStrength] = (),
    *,
    ratios: Sequence[str] = (),
    posterior: Place | None = None,
    joint: Place | None = None,
    out: Place | None = None,
    zones: Sequence[str] = (),
    distribution: Literal["lognormal", "normal"] = "lognormal",
    thicker_than_m: Sequence[float] = (),
    through_m: float | None = None,
    samples: int = 20_000,
    seeds: int | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    **options: Unpack[SectionOptions],
) -> dict[str, Any]:
    """The distribution of the runout that follows from that of the residual strength.

    Args:
        case: with a section, at least; or a body in three dimensions: `scene3d.yaml` or its folder.
        strengths: mean and standard deviation [kPa] such as "18+-5", of some zones "1,6=4+-1".
            Empty: `ratios`, `posterior` or `joint`.
        ratios: of further zones, S_r over the vertical effective stress before failure, written
            alike: "0.12+-0.03"; that of each point follows from its own stress.
        posterior: in place of strengths: `out` of a `posterior`, whose draws are the strengths.
        joint: in place of strengths: `out` of a `joint`, whose relation over other slides gives the
            ratio of a dam without a slide.
        out: `prediction.json` and its page are written there, of a body exceedance maps as well.
        zones: of a single strength; empty: those whose strength `inversion.yaml` seeks, else the
            liquefied ones.
        distribution: of strengths that are given as text.
        thicker_than_m: of a body: thicknesses of the deposit [m] of which the probability is
            mapped; empty: that from which soil counts as a deposit.
        through_m: of a section: x of the line through which the released volume passes [m]; None:
            the foot of the side to which it slides. Of a body: the lines of its `scene3d.yaml`.
        samples: drawn from the strengths, at least 100.
        seeds: jitter seeds that measure the numerical noise, 0: none; None: 3, of a body 0.
        engine: see above; None: "mpm", of a body "mpm3d".

    Returns:
        what `prediction.json` holds (docs/files.md).

    Raises:
        InputError: bad input.
        WorkFailed: the simulations fail.
        Cancelled: the caller asked for it.
    """
    from geometry.case import Case
    from geometry.scenes3d.scene3d import is_body

    run = Call.of(SectionOptions, options)
    read = _strengths(strengths, ratios, posterior, joint, zones, distribution)
    for name, value, least in (("samples", samples, 100), ("seeds", seeds, 0)):
        if value is not None and value < least:
            raise InputError(f"--{name} {value}: at least {least}")
    with run.folder(out) as folder:
        if not isinstance(case, Case) and is_body(case):
            if engine not in (None, "mpm", "mpm3d"):
                raise InputError(f"--engine {engine}: not in three dimensions ({case})")
            if through_m is not None:
                raise InputError("--through: of a section; a scene3d.yaml names its lines")
            return _predict_body(
                case,
                read,
                zones,
                thicker_than_m,
                samples,
                SEEDS_3D if seeds is None else seeds,
                spacing_m,
                folder,
                run,
            )
        if thicker_than_m:
            raise InputError("--thicker-than: only in three dimensions, of a scene3d.yaml")
        return _predict_section(
            case,
            read,
            zones,
            through_m,
            samples,
            SEEDS if seeds is None else seeds,
            engine or "mpm",
            spacing_m,
            folder,
            run,
        )


def _predict_section(
    case: Place | Case,
    read: Sequence[KnownStrength],
    zones: Sequence[str],
    through_m: float | None,
    samples: int,
    seeds: int,
    engine: str,
    spacing_m: float | None,
    folder: Path,
    run: Call,
) -> dict[str, Any]:
    from inversion.engines.registry import untrained
    from inversion.prediction import predict as prediction
    from inversion.prediction.known_strength import placed
    from inversion.prediction.prediction_case import prediction_case
    from inversion.prediction.prediction_document import document_of
    from inversion.prediction.volumes import release, volume_entries
    from pipeline.files import write_json
    from report.prediction import write_report as write_page

    section = prediction_case(run.case(case), spacing_m=spacing_m)
    known = placed(read, list(zones) or section.default_zones, section.scene)
    chosen, setup = untrained(engine), section.setup(known)
    store = chosen.store_of(section.folder, setup, run.store(folder))
    volumes = [one for one in volume_entries(section, through_m) if chosen.reads(one)]
    if through_m is not None and not volumes:
        raise InputError(f"--through: the engine {chosen.name} predicts the deposit alone")
    run.watch.plan({"simulating": (1 + seeds) * 7})
    with working_in(folder):
        with run.watch.stage("simulating"):
            cells = section.cells_by(chosen, store, setup)
            forward, also = chosen.made(store), tuple(volumes)
            setup = replace(setup, also_read=also)
            jittered = [
                replace(section.setup(known, jitter_seed=seed), also_read=also)
                for seed in range(1, seeds + 1)
            ]
            found = prediction.predict(
                forward, setup, known, cells=cells, jittered=jittered, samples=samples
            )
            released = None
            if also:
                released = release(
                    forward, setup, known, cells=cells, jittered=jittered, samples=samples
                )
        sections = prediction.envelope(found, spacing=section.scene.spacing, ground=section.ground)
        document = document_of(section, known, found, sections, released)
        document = {**document, "engine": chosen.name}
        write_json(folder / PREDICTION, document)
        _write_hydrographs(document, folder)
        write_page(section.scene, document, folder)
        return document


def _write_hydrographs(document: Mapping[str, Any], folder: Path) -> None:
    """The table of what passes the lines over time, where there are any."""
    from inversion.prediction.hydrograph import hydrograph_csv
    from pipeline.files import write_text

    if document["hydrographs"]:
        write_text(folder / HYDROGRAPH, hydrograph_csv(document["hydrographs"]))


def _predict_body(
    scene: Place,
    read: Sequence[KnownStrength],
    zones: Sequence[str],
    thicker_than_m: Sequence[float],
    samples: int,
    seeds: int,
    spacing_m: float | None,
    folder: Path,
    run: Call,
) -> dict[str, Any]:
    from geometry.scenes3d.scene3d import load_scene_3d
    from inversion.engines.registry import engine_named
    from inversion.prediction.in_plan import predict_in_plan, prediction_setup
    from inversion.prediction.known_strength import placed
    from inversion.prediction.response import design
    from pipeline.files import write_json
    from report.prediction3d import write_report as write_page

    if any(not 0.0 < thickness < float("inf") for thickness in thicker_than_m):
        raise InputError("--thicker-than: thicknesses must be greater than 0 m")
    described = load_scene_3d(os.fspath(scene), spacing=spacing_m)
    soil, simulation = described.soil, run.config.simulation
    liquefied = [z.name for z in soil.zones if soil.materials[z.material].liquefied]
    known = placed(read, list(zones) or liquefied, soil)
    if described.document.duration_s is not None:
        simulation = simulation.model_copy(update={"duration_s": described.document.duration_s})
    setup, chosen = prediction_setup(described, simulation, known), engine_named("mpm3d")
    store = chosen.store_of(Path(scene), setup, run.store(folder))
    jitter = run.config.inversion.noise_jitter
    run.watch.plan({"simulating": len(design(len(known))) + 3 * seeds})
    with working_in(folder):
        with run.watch.stage("simulating"):
            found = predict_in_plan(
                chosen.made(store),
                store,
                setup,
                known,
                thicker_than_m=sorted(thicker_than_m) or [setup.before.least],
                jittered=[setup.jittered(jitter, seed) for seed in range(1, seeds + 1)],
                samples=samples,
            )
        write_json(folder / PREDICTION, found.document)
        _write_hydrographs(found.document, folder)
        write_page(found, folder)
        return found.document


def _strengths(
    strengths: Sequence[str | KnownStrength],
    ratios: Sequence[str],
    posterior: Place | None,
    joint: Place | None,
    zones: Sequence[str],
    distribution: Literal["lognormal", "normal"],
) -> Sequence[KnownStrength]:
    """The strengths of a prediction as they are given, or as a posterior or a relation has them."""
    from inversion.prediction.known_strength import (
        OPTIONS,
        drawn_strengths,
        parse_strength,
        ratio_of_relation,
    )
    from inversion.problem.question import STRENGTH_RATIO

    if sum((bool(strengths or ratios), posterior is not None, joint is not None)) != 1:
        raise InputError("predict: give strengths, a posterior or a joint relation, one of them")
    if posterior is not None:
        read: Sequence[KnownStrength] = drawn_strengths(os.fspath(posterior))
    elif joint is not None:
        read = [ratio_of_relation(os.fspath(joint))]
    else:
        read = [parse_strength(s, distribution) if isinstance(s, str) else s for s in strengths]
        read += [parse_strength(text, distribution, STRENGTH_RATIO) for text in ratios]
    if zones and read[0].zones:
        raise InputError(f"--zones: {OPTIONS[read[0].property]} names its zones already")
    return read


def predict_from_blow_counts(
    case: Place | Case,
    *,
    zones: Sequence[str] = (),
    out: Place | None = None,
    engine: str = "mpm",
    spacing_m: float | None = None,
    **options: Unpack[SectionOptions],
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
    from inversion.prediction import from_blow_counts
    from inversion.prediction.prediction_case import prediction_case
    from pipeline.files import write_json
    from report.from_blow_counts import write_report as write_page

    run = Call.of(SectionOptions, options)
    with run.folder(out) as folder:
        section = prediction_case(run.case(case), spacing_m=spacing_m)
        chosen = of_section(engine)
        run.watch.plan({"simulating": len(RELATIONS) * len(from_blow_counts.SCORES)})
        with working_in(folder):
            with run.watch.stage("simulating"):
                document = from_blow_counts.predict_from_blow_counts(
                    section, run.store(folder), zones=zones, engine=chosen
                )
            write_json(folder / BLOW_COUNT_PREDICTION, document)
            write_page(document, folder)
            return document


def classical(
    case: Place | Case,
    *,
    out: Place | None = None,
    run: Place | None = None,
    slide: str | None = None,
    judgement: Mapping[str, Any] | None = None,
    **options: Unpack[SurveyOptions],
) -> dict[str, Any]:
    """Find S_r by the classical methods on the sections before and after a slide.

    Args:
        case: with a section, a measured side, and a surface after the slide.
        out: `classical.json`, its page and a picture per slide are written there.
        run: trajectory whose deposit is the section after the slide; None: as surveyed.
        slide: the only one; None: every slide of the case.
        judgement: calls that replace those of `classical.yaml`, by name (docs/method/classical.md).
        options: see above; progress is in slides, and cancel asked between them.

    Returns:
        what `classical.json` holds.

    Raises:
        InputError: bad input, or a slide that cannot be analysed.
        Cancelled: the caller asked for it.

    Examples:
        >>> (slide,) = classical("lower_san_fernando", slide="upstream")["analyses"]
        >>> first = slide["methods"][0]
        >>> first["title"], round(first["value_kpa"])
        ('Kinetics (Olson 2001)', 24)
    """
    own = Call.of(SurveyOptions, options)
    with own.folder(out) as folder, working_in(folder):
        return analysed_classically(own.case(case), own, run, slide, judgement).save(folder)


@dataclass(frozen=True)
class ClassicalAnswers:
    """What the classical methods say of a case.

    Attributes:
        sections: before and after its slides.
        analyses: of the slides.
        refused: why others could not be analysed.
    """

    sections: CaseSections
    analyses: Sequence[Analysis]
    refused: Sequence[str]

    def table(self, analysis: Analysis, *, every_option: bool) -> str:
        """One slide as text."""
        from inversion.classical.document import table

        return table(self.sections, analysis, every_option=every_option)

    def save(self, folder: Path) -> dict[str, Any]:
        """Write document, pictures and page; the document."""
        from report.classical import save_all

        return save_all(self.sections, self.analyses, self.refused, folder)


def analysed_classically(
    case: Case,
    own: Call,
    run: Place | None = None,
    slide: str | None = None,
    judgement: Mapping[str, Any] | None = None,
) -> ClassicalAnswers:
    """The classical methods on a case that was read; arguments as of `classical`."""
    from inversion.classical.sections_of_case import case_sections
    from inversion.classical.slides import analyse_slides

    sections = case_sections(case, run=None if run is None else os.fspath(run))
    analyses, refused = analyse_slides(
        sections, slide=slide, changes=judgement, on_slide=own.watch.reach
    )
    return ClassicalAnswers(sections, analyses, refused)


@contextmanager
def open_session(
    what: str,
    case: Place | Case | BodyCase | Session,
    *,
    out: Place | None = None,
    hypothesis: str | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    ranked: Ranked | None = None,
    **options: Unpack[DiagnosisOptions],
) -> Iterator[Session]:
    """A session of a diagnosis, for the length of a `with` block; one that is open stays so.

    Args:
        what: the stage, for the progress.
        case: with a section, measurements and a question; or a body, as of `back_analyse`.
        out: None: the results are not kept.
        engine: None: "mpm", of a body "mpm3d".
        ranked: called with the ranking of the hypotheses as it grows; None: nobody watches.
        options: see above; the total of the progress is what such a question usually takes.

    Raises:
        InputError: bad input.

    Examples:
        >>> with open_session("diagnosis", "la_marquesa", spacing_m=1.0) as session:
        ...     on_trial = session.model.candidates
        >>> [one.name for one in on_trial if one.family == "water"][1:4]
        ['pool_level', 'no_water', 'water_as_weight']
    """
    from diagnosis.session import Session, open_session

    if isinstance(case, Session):
        yield case
        return
    run = Call.of(DiagnosisOptions, options)
    with run.folder(out) as folder:
        found, chosen = _to_diagnose(case, run, engine)
        session = open_session(
            found,
            out=folder,
            hypothesis=hypothesis,
            spacing_m=spacing_m,
            engine=chosen,
            threads=run.threads,
            say=run.watch.say,
            on_run=run.watch.run_done,
            ranked=ranked,
        )
        run.watch.plan({what: session.usual_runs(what)})
        with working_in(session.folder), run.watch.stage(what):
            yield session


def _to_diagnose(
    case: Place | Case | BodyCase, run: Call, engine: str | None
) -> tuple[Case | BodyCase, Engine]:
    """A section or a body, and what predicts it.

    Raises:
        InputError: bad input, or what three dimensions do not have.
    """
    from geometry.case import Case
    from geometry.scenes3d.scene3d import is_body
    from inversion.back_analysis.body_case import BodyCase
    from inversion.back_analysis.by_engine import untrained_engine
    from inversion.engines.registry import REFERENCE, of_section

    if not isinstance(case, BodyCase) and (isinstance(case, Case) or not is_body(case)):
        return run.case(case), of_section(engine or REFERENCE)
    body: Any = case
    if not isinstance(case, BodyCase):
        body = load_question(case, settings=run.settings)
    for option, given in (("effects", run.effect_files), ("measurements", run.measurement_files)):
        if given:
            raise InputError(f"{option} of your own: not in three dimensions ({body.folder})")
    return body, untrained_engine(body, engine)


def _timed(found: Answer, session: Session, question: str) -> Answer:
    """What was found, when the time that it took is written as well."""
    session.write_timing(question)
    return found


def diagnose(
    case: Place | Case | BodyCase | Session,
    *,
    out: Place | None = None,
    hypothesis: str | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    ranked: Ranked | None = None,
    **options: Unpack[DiagnosisOptions],
) -> Verdict:
    """Say whether the model of a case explains its measurements, and which effect it lacks if not.

    Args:
        case: with a section or a body, measurements and a question; or what `open_session` gives,
            which has everything else already.
        out: `verdict.json`, `sections.npz` and the hypotheses are written there.
        ranked: called with all hypotheses looked at so far, the best first, whenever the ranking
            has changed (`diagnosis.ranking.Standing`); of a session that is open its own is called.
        options: see above; the total of the progress is what such a question usually takes.

    Returns:
        what `verdict.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.
    """
    from diagnosis.answers import diagnosed

    with open_session(
        "diagnosis",
        case,
        out=out,
        hypothesis=hypothesis,
        engine=engine,
        spacing_m=spacing_m,
        ranked=ranked,
        **options,
    ) as session:
        return _timed(diagnosed(session), session, "run")


def compare(
    case: Place | Case | BodyCase | Session,
    *,
    out: Place | None = None,
    hypothesis: str | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    **options: Unpack[DiagnosisOptions],
) -> CompareDocument:
    """Calibrate the model of a case, and test whether it explains the measurements.

    Args:
        case: with a section or a body, measurements and a question; or what `open_session` gives,
            which has everything else already.
        out: `compare.json`, `sections.npz` and the hypothesis are written there.
        options: see above; the total of the progress is what such a question usually takes.

    Returns:
        what `compare.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.

    Examples:
        >>> judged = compare("lower_san_fernando", out="lsf", spacing_m=3.0, threads=1)
        >>> judged.alarm
        'alarm'
    """
    from diagnosis.answers import compared

    with open_session(
        "comparison",
        case,
        out=out,
        hypothesis=hypothesis,
        engine=engine,
        spacing_m=spacing_m,
        **options,
    ) as session:
        return _timed(compared(session), session, "compare")


def explain(
    case: Place | Case | BodyCase | Session,
    *,
    out: Place | None = None,
    hypothesis: str | None = None,
    engine: str | None = None,
    spacing_m: float | None = None,
    ranked: Ranked | None = None,
    **options: Unpack[DiagnosisOptions],
) -> ExplainDocument:
    """Rank the effects that would explain the misfit of a case, and say what cannot be told apart.

    Args:
        case: with a section or a body, measurements and a question; or what `open_session` gives,
            which has everything else already.
        out: `explain.json` and `sections.npz` are written there.
        ranked: called with all hypotheses looked at so far, the best first, whenever the ranking
            has changed (`diagnosis.ranking.Standing`); of a session that is open its own is called.
        options: see above; the total of the progress is what such a question usually takes.

    Returns:
        what `explain.json` holds.

    Raises:
        InputError: bad input.
        WorkFailed: no run of the base model could be read.
        Cancelled: the caller asked for it.
    """
    from diagnosis.answers import explained

    with open_session(
        "explanation",
        case,
        out=out,
        hypothesis=hypothesis,
        engine=engine,
        spacing_m=spacing_m,
        ranked=ranked,
        **options,
    ) as session:
        return _timed(explained(session), session, "explain")


def extend(session: Session, add: str, notes: str = "") -> Extended:
    """Add an effect to the model of a session; its model file and step are written."""
    from diagnosis.answers import extended

    done = extended(session, add, notes)
    return _timed(done, done.asked, "extend")


def track(session: Session) -> Track:
    """The error over the models of a session so far. Nothing is simulated.

    Examples:
        >>> with open_session("comparison", "lower_san_fernando", out="lsf", spacing_m=3.0) as one:
        ...     judged = compare(one)
        ...     steps = track(one).steps
        >>> [(step.hypothesis, step.dof) for step in steps]
        [('00_base', 3)]
    """
    from diagnosis.answers import tracked

    return tracked(session)


def suggest(session: Session, count: int) -> Verdict:
    """The verdict, with the `count` measurements that would tell most; it is not written."""
    from diagnosis.answers import suggested

    return _timed(suggested(session, count), session, "suggest")


def write_report(
    folder: Place,
    *,
    case: Place | None = None,
    film: bool = True,
) -> Path:
    """Write the page of what was answered in a folder again, with its pictures next to it.

    Args:
        folder: `out` of `back_analyse`, `posterior`, `joint` or `diagnose`.
        case: folder of the case, of a back-analysis; None: the one of that name that ships.
        film: of a back-analysis: make a new film; False: show the one that is there, if any.

    Returns:
        The page, `report.html`: one file that needs nothing else.

    Raises:
        InputError: the folder holds no result, posterior, joint relation or verdict.
    """
    from report.back_analysis import write_report as write_back_analysis
    from report.data.back_analysis import load_back_analysis
    from report.of_folder import answered

    folder = Path(folder)
    if (known := answered(folder)) is not None:
        return known.write()

    return write_back_analysis(
        load_back_analysis(folder, None if case is None else os.fspath(case)), film=film
    )


def write_pdf(page: Place) -> Path:
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
