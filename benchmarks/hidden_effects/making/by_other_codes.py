"""Making cases whose truth is another code's slide (`benchmarks.hidden_effects.foreign`).

Each code gets its share of the cases of each kind; families and the things of a family are dealt
in turn. How well a thing can be seen is measured on the slide: lambda, the chi2 that the best base
model leaves of it, in a covariance with the code's own error. What is seen less than `VISIBLE` is
drawn again; of at most `slides` of the plan the one in which it is seen best becomes the case.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, get_args

import numpy as np

from benchmarks.hidden_effects.foreign.hidden import FAMILIES, THINGS, Hidden
from benchmarks.hidden_effects.foreign.slide import Slide, source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.base_model import BaseModel
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places
from benchmarks.hidden_effects.making.detectability import refit
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.make import (
    OnCase,
    base_models,
    seal_all,
    skip,
    write_case,
)
from benchmarks.hidden_effects.making.plan import Deck, Kind, Planned
from benchmarks.hidden_effects.making.seal import SALT, salt_of
from benchmarks.hidden_effects.making.sections import Section, normal
from benchmarks.hidden_effects.making.sight import is_slide
from benchmarks.hidden_effects.making.truth import Made
from diagnosis.question import source_errors
from geometry.scenes.scene import Scene
from geometry.survey.measured import Measured
from inversion.estimation.covariance import SourceError, source_covariance
from pipeline.cli import InputError, WorkFailed
from pipeline.files import write_json
from pipeline.random_numbers import Stream, number_of

#: Spacing of a slide over that of the judge, between these.
FINER = (0.55, 0.65)
#: Frames per second of a slide; drawings of a case that may fail.
FRAMES_PER_S, DRAWS = 2.0, 2
#: Lambda from which a thing can well be seen.
VISIBLE = 25.0


@dataclass(frozen=True)
class PlannedByCode(Planned):
    """A case to be made by another code; its bin has no meaning.

    Attributes:
        source: name of the code.
    """

    source: str = ""


def plan_by_codes(benchmark: Benchmark) -> list[PlannedByCode]:
    """The row of cases; any prefix of it is balanced."""
    wanted = benchmark.plan
    stream = Stream(wanted.seed, number_of("plan by codes"))
    kinds = Deck(wanted.kinds, stream)
    shares = [code for code, one in wanted.sources.items() for _ in range(one.share)]
    codes = {kind: Deck(shares, stream) for kind in get_args(Kind)}
    families = Deck(FAMILIES, stream)
    decks: dict[Any, Deck] = {}

    @cache  # which makes the sections on the ground of a code
    def places(code: str, *names: str) -> list[str]:
        return _places(benchmark, code, *names)

    def dealt(key: Any, cards: Sequence[Any]) -> Any:
        return decks.setdefault(key, Deck(cards, stream)).deal()

    def of_next_family(code: str, able: Sequence[str], *deck: Any) -> str:
        if not any(THINGS[name].families for name in able):
            beside = f" that can stand beside {', '.join(deck)}" if deck else ""
            raise InputError(f"{code}: hides nothing of a family{beside}")
        family = families.deal()
        while not (members := [n for n in able if family in THINGS[n].families]):
            family = families.deal()
        return dealt((code, family, *deck), members)

    found = []
    for k in range(wanted.cases):
        kind: Kind = kinds.deal()
        code = codes[kind].deal()
        effects: tuple[str, ...] = ()
        able = [
            name for name in source(code).hides if _dealt(benchmark, name) and places(code, name)
        ]
        if kind in ("single", "pair"):
            effects = (of_next_family(code, able),)
        if kind == "pair":
            others = [
                name
                for name in able
                if not THINGS[name].families & THINGS[effects[0]].families
                and places(code, *effects, name)
            ]
            effects = (*effects, of_next_family(code, others, *effects))
        elif kind == "outside":
            effects = (dealt((code, "stranger"), [n for n in able if THINGS[n].stranger]),)
        where = places(code, *effects)
        section = dealt((kind, tuple(where)), where)
        survey = dealt((kind, "survey"), wanted.surveys)
        found.append(PlannedByCode(f"case_{k + 1:04d}", kind, effects, section, survey, 0, code))
    return found


def _dealt(benchmark: Benchmark, name: str) -> bool:
    """The plan may hide it: what it names, or all that was there for the first sets."""
    things = benchmark.plan.things
    return name in things if things else not THINGS[name].later


def _places(benchmark: Benchmark, code: str, *names: str) -> list[str]:
    """Sections of a code on which things can act."""
    return [
        section
        for section, one in benchmark.sections_of(code).items()
        if not any(THINGS[name].applies(one.scene) for name in names)
    ]


def make_by_codes(
    benchmark: Benchmark,
    places: Places,
    laboratory: Laboratory,
    *,
    part: tuple[int, int] = (0, 1),
    on_case: OnCase = lambda done, total, words: None,
) -> None:
    """Make the cases that are not there yet; seal them when all are.

    Args:
        benchmark: what to make.
        places: where to.
        laboratory: of the judge's solver, that measures how well a slide can be imitated.
        part: (k, n): every n-th case from the k-th on, for several jobs side by side.
        on_case: called for each case.

    Raises:
        InputError: a code is not installed.
    """
    for name in benchmark.plan.sources:
        if source(name).missing:
            raise InputError(source(name).missing)
    row = plan_by_codes(benchmark)
    base = base_models(laboratory)
    mine = row[part[0] :: part[1]]
    for number, planned in enumerate(mine, start=1):
        words = "was there"
        if not places.truth(planned.name).is_file():
            began = time.perf_counter()
            section = benchmark.sections_of(planned.source)[planned.section]
            made, words = _make(benchmark, planned, section, base, laboratory.threads)
            if made is None:
                skip(planned, places)
            else:
                plan = benchmark.plan
                wanted = plan.sources[planned.source]
                write_case(section, planned, made, places, plan.duration_s, wanted, plan.stated)
                write_json(places.truth(planned.name), made.truth)
            words = f"{words}: {time.perf_counter() - began:.1f} s"
        on_case(number, len(mine), f"{planned.name}: {words}")
    if all(places.truth(planned.name).is_file() for planned in row):
        seal_all(row, places)


def _make(
    benchmark: Benchmark,
    planned: PlannedByCode,
    section: Section,
    base: Callable[[Section], BaseModel],
    threads: int | None,
) -> tuple[Made | None, str]:
    """A case and what was done; None where no drawing gave a slide that can be surveyed."""
    stream = Stream(benchmark.plan.seed, number_of(planned.name))
    found: list[Made] = []
    words = ""
    slides = benchmark.plan.slides
    for _ in range(slides + DRAWS):
        try:
            found.append(_draw(benchmark, planned, section, base(section), stream, threads))
        except (WorkFailed, InputError, ValueError) as error:
            words = str(error)
            continue
        seen = found[-1].truth["lambda"]
        if planned.kind == "null" or seen >= VISIBLE or len(found) == slides:
            break
    if not found:
        return None, f"skipped: {words}"
    best = max(found, key=lambda made: made.truth["lambda"])
    return best, f"made by {planned.source}, slide {len(found)}, lambda {best.truth['lambda']:.1f}"


def _draw(
    benchmark: Benchmark,
    planned: PlannedByCode,
    section: Section,
    base: BaseModel,
    stream: Stream,
    threads: int | None,
) -> Made:
    """One drawing of a case.

    Raises:
        WorkFailed, ValueError: it gives no flow slide that comes to rest and can be surveyed.
    """
    plan = benchmark.plan
    values = np.round(section.draw(stream), 6)  # as they are written down
    things = [THINGS[name] for name in planned.effects]
    things = [replace(one, sizes=plan.sizes.get(one.name, one.sizes)) for one in things]
    hidden = [one.draw(section.scene, stream) for one in things]
    factor, seed = round(stream.uniform(*FINER), 3), stream.seed()
    scene, slide = _simulated(
        benchmark, planned.source, section, values, hidden, factor, seed, threads
    )
    deposit = slide.deposit(scene)
    if not slide.at_rest or not is_slide(section, deposit):
        raise WorkFailed("no flow slide that comes to rest")
    where = surveys.profile_places(section, surveys.toe_of(section, deposit))
    entries = surveys.with_values(section, planned.survey, where, None)
    exact = surveys.reading(entries, deposit) + survey_error(hidden, entries)
    lower = np.linalg.cholesky(surveys.covariance_of(entries))
    error = lower @ np.array([normal(stream) for _ in exact])
    measured = np.round(exact + error, 3)
    known = source_errors(plan.sources[planned.source].error)
    truth = {
        "name": planned.name, "kind": planned.kind, "source": planned.source,
        "section": planned.section, "survey": planned.survey,
        "effects": {one.name: one.entry for one in hidden},
        "parameters": dict(zip(section.parameters.names, values.tolist(), strict=True)),
        **_left(base, planned.survey, section, slide, scene, values, hidden, known),
        "area_kept": round(slide.area_kept, 4),
        "spacing_factor": factor, "jitter_seed": seed,
        "measured": measured.tolist(), "places": where.tolist(),
        SALT: salt_of(plan.seed, planned.name),
    }  # fmt: skip
    documents = surveys.documents(section, planned.survey, measured, where)
    profile = np.column_stack([where, measured[: len(where)]])
    return Made(truth, documents, profile)


def _simulated(
    benchmark: Benchmark, code: str, section: Section, values: np.ndarray,
    hidden: Sequence[Hidden], factor: float, seed: int, threads: int | None,
) -> tuple[Scene, Slide]:  # fmt: skip
    """The section with its parameters (p,), and its slide by a code."""
    duration = benchmark.plan.duration_s
    scene = section.parameters.scene(section.scene, values)
    scene = scene.changed(spacing=round(factor * section.scene.spacing, 4))
    slide = source(code).simulate(
        scene, hidden, duration_s=duration, frames=int(FRAMES_PER_S * duration),
        seed=seed, threads=threads,
    )  # fmt: skip
    return scene, slide


def survey_error(
    hidden: Sequence[Hidden], entries: Sequence[Measured], line: Sequence[Measured] = ()
) -> np.ndarray:
    """What errors of the survey that are hidden add to the numbers, (m,), in their units.

    Args:
        hidden: all that is.
        entries: to which it is added.
        line: measurements between whose ends the levelling line runs; empty: `entries`.
    """
    rise = np.concatenate([
        np.zeros(len(one.values)) if one.datum is None else one.datum.rise for one in entries
    ])  # fmt: skip
    place, ends = _levelled(entries), _levelled(line or entries)
    levelled = np.isfinite(place)
    total = np.zeros(len(rise))
    if not levelled.any():
        return total
    first, last = np.nanmin(ends), np.nanmax(ends)
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    share = np.clip((np.where(levelled, place, middle) - middle) / half, -1.0, 1.0)
    for one in hidden:
        act = THINGS[one.name].survey
        if act is not None:
            total = total + rise * act(one, share)
    return total


def _levelled(entries: Sequence[Measured]) -> np.ndarray:
    """Where on the levelling line each number was taken, x (m,) [m]; NaN: not levelled."""
    return np.concatenate([
        np.full(len(one.values), np.nan) if one.datum is None else one.datum.x for one in entries
    ])  # fmt: skip


def _left(
    base: BaseModel, survey: str, section: Section, slide: Slide, scene: Scene, values: np.ndarray,
    hidden: Sequence[Hidden], errors: Mapping[str, SourceError],
) -> dict[str, Any]:  # fmt: skip
    """What the refitted base model leaves of the slide without the survey's random error.

    Returns:
        `lambda`: chi2. `fails`: of each series (profile, toe in time), its measurement, axis,
        places and what is left there in standard deviations of the judge.
    """
    deposit = slide.deposit(scene)
    toe = surveys.toe_of(section, deposit)
    where = base.places(survey, toe)
    entries = surveys.with_values(section, survey, where, None)
    try:
        read = surveys.reading(entries, deposit) + survey_error(hidden, entries)
        curve = base.curve(survey, toe).corrected
        curve = replace(curve, survey=curve.survey + source_covariance(entries, errors))
    except ValueError:
        return {"lambda": 0.0, "fails": []}
    found = refit(np.array([read, read]), curve, *base.split(values))
    ends = np.cumsum([len(entry.values) for entry in entries])[:-1]
    fails = [
        {"measurement": entry.name, "axis": entry.along.axis,
         "place": np.round(entry.along.place, 2).tolist(), "left": np.round(left, 2).tolist()}
        for entry, left in zip(entries, np.split(found.left, ends), strict=True)
        if entry.along is not None and entry.along.series
    ]  # fmt: skip
    return {"lambda": round(found.seen, 3), "fails": fails}
