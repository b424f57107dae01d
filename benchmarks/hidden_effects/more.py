"""`blind more`: with a sparse survey, do two suggested measurements help more than two random ones?

Each case is diagnosed from its sparse survey. Then two measurements are added, once those that
the diagnosis suggests, once two drawn at random from all that it could have suggested, each read
on the slide of the truth with an independent error; and both surveys are diagnosed again.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Benchmark, Places
from benchmarks.hidden_effects.making.by_other_codes import hidden_of, slide_again, survey_error
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.make import OnCase
from benchmarks.hidden_effects.making.sections import normal
from benchmarks.hidden_effects.making.surveys import PROFILE_FILE
from benchmarks.hidden_effects.making.truth import slide_of
from benchmarks.hidden_effects.run import METHOD, RANDOM, SUGGESTED, diagnosed
from benchmarks.hidden_effects.scoring.digest import Digest, digest_of, load_digest
from benchmarks.hidden_effects.scoring.records import read_truth
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.possible_measurements import possible_measurements
from geometry.case import load_case
from geometry.survey.measured import Deposit, Measured
from geometry.survey.profiles import load_profile
from inversion.engines.run_store import RunStore
from pipeline.config import Config
from pipeline.files import read_yaml, write_json, write_text, yaml_text
from pipeline.random_numbers import Stream, number_of

#: Measurements that are added.
COUNT = 2


def run_more(
    benchmark: Benchmark,
    places: Places,
    names: Sequence[str],
    config: Config,
    laboratory: Laboratory,
    *,
    variants: Sequence[str] = (SUGGESTED, RANDOM),
    on_case: OnCase = lambda done, total, words: None,
) -> None:
    """Diagnose sealed cases as they are, with suggested and with random measurements.

    Args:
        benchmark: of the cases; their slides are simulated again.
        places: of its files.
        names: of the cases.
        config: settings of the diagnosis.
        laboratory: of slides by the judge's solver.
        variants: which measurements are added, of SUGGESTED and RANDOM.
        on_case: called for each case.
    """
    for number, name in enumerate(names, start=1):
        words = "was there"
        if not all(places.verdict(name, v).is_file() for v in (METHOD, *variants)):
            words = _one(name, benchmark, places, config, laboratory, variants)
        on_case(number, len(names), f"{name}: {words}")


def doubted(places: Places, names: Sequence[str]) -> list[str]:
    """The cases whose verdict is there and is not adequate: those that ask for measurements."""
    files = {name: places.verdict(name, METHOD) for name in names}
    return [
        name
        for name, file in files.items()
        if file.is_file() and load_digest(file).verdict != "adequate"
    ]


def _one(
    name: str,
    benchmark: Benchmark,
    places: Places,
    config: Config,
    laboratory: Laboratory,
    variants: Sequence[str],
) -> str:
    # The truth is opened to read more of its slide; the diagnosis still sees measurements alone.
    truth = read_truth(places.truth(name))
    section = benchmark.section(truth)
    store = RunStore(None, threads=laboratory.threads)
    digest, chosen, possible = suggested(places.case(name), store, config)
    if not places.verdict(name, METHOD).is_file():  # what was judged blind stays
        write_json(places.verdict(name, METHOD), digest.model_dump(mode="json"))
    stream = Stream(benchmark.plan.seed, number_of("more"), number_of(name))
    if "source" in truth:
        deposit, hidden = slide_again(benchmark, truth, laboratory.threads), hidden_of(truth)
    else:
        laboratory.forget()
        deposit, hidden = slide_of(truth, section, laboratory), []
    line = surveys.with_values(section, truth["survey"], np.array(truth["places"]), None)
    readable = [k for k, entry in enumerate(possible) if _can_be_read(entry, deposit)]
    words = [digest.verdict]
    picks = {
        SUGGESTED: [k for k in chosen if k in readable][:COUNT],
        RANDOM: drawn(readable, COUNT, stream),
    }
    for variant, picked in picks.items():
        # Both are made even where one is judged: their errors come from one stream.
        folder = places.out / "more" / variant / name
        entries = [possible[k] for k in picked]
        errors = [survey_error(hidden, [entry], line) for entry in entries]
        add_measurements(places.case(name), folder, entries, deposit, stream, errors)
        if variant not in variants:
            continue
        digest = diagnosed(folder, METHOD, store, config)
        write_json(places.verdict(name, variant), digest.model_dump(mode="json"))
        words.append(f"{variant} {digest.verdict} {' + '.join(digest.effects)}".strip())
    return ", ".join(words)


def suggested(
    folder: Path, store: RunStore, config: Config
) -> tuple[Digest, list[int], list[Measured]]:
    """The verdict on a case, places of what it suggests next, and all that could be measured."""
    from diagnosis.diagnose import diagnose, next_measurements
    from diagnosis.verdict.verdict_builder import verdict_document

    case = diagnosis_case(load_case(folder, config))
    model = case.model(store)
    found = diagnose(model, case.options(model))
    verdict = verdict_document(found, case=case.name, title=case.title)
    possible = possible_measurements(case.setup)
    firsts = {proposal.index: number for number, proposal in enumerate(model.proposals)}
    # A few more than are wanted: one that cannot be read on the slide gives way to the next.
    best = next_measurements(found, COUNT + 3)
    return digest_of(verdict), [firsts[one.proposal.index] for one in best], possible


def drawn(cards: Sequence[int], count: int, stream: Stream) -> list[int]:
    """This many different cards at random."""
    left, found = list(cards), []
    while left and len(found) < count:
        found.append(left.pop(stream.integer(0, len(left) - 1)))
    return found


def add_measurements(
    old: Path,
    new: Path,
    entries: Sequence[Measured],
    deposit: Deposit,
    stream: Stream,
    errors: Sequence[np.ndarray],
) -> None:
    """A copy of a case folder with more measurements, read on a deposit with errors.

    Args:
        old: folder of the case.
        new: where the copy is to be.
        entries: what is measured in addition.
        deposit: of the slide.
        stream: of their random errors.
        errors: of the survey as a whole in each of them.
    """
    shutil.rmtree(new, ignore_errors=True)
    shutil.copytree(old, new)
    document = read_yaml(new / "measurements.yaml")
    (survey,) = document["sets"].values()
    profile = load_profile(new / PROFILE_FILE)
    points = dict(zip(profile.x.tolist(), profile.y.tolist(), strict=True))
    for entry, error in zip(entries, errors, strict=True):
        values = entry.observe(deposit) + error
        values = values + entry.std * np.array([normal(stream) for _ in values])
        if entry.files:  # a place on the surface: one more row of the survey's profile
            points[float(entry.along.place[0])] = float(values[0])
        else:
            _join(survey, filled(entry, values))
    rows = [f"{x:.2f},{y:.3f}" for x, y in sorted(points.items())]
    write_text(new / PROFILE_FILE, "\n".join(["x_m,y_m", *rows]) + "\n")
    text = yaml_text(document, width=100, default_flow_style=None)
    write_text(new / "measurements.yaml", text)


def _join(survey: list[dict[str, Any]], entry: dict[str, Any]) -> None:
    """Put an entry into a survey; times of one toe become one history."""
    same = [one for one in survey if one["name"] == entry["name"]]
    if not same:
        survey.append(entry)
        return
    (one,) = same
    pairs = sorted(zip(one["times_s"] + entry["times_s"], one["values_m"] + entry["values_m"],
                       strict=True))  # fmt: skip
    one["times_s"], one["values_m"] = ([pair[k] for pair in pairs] for k in (0, 1))


def filled(entry: Measured, values: np.ndarray) -> dict[str, Any]:
    """The document of an entry with its values put in."""
    numbers = np.array([round(float(value), 3) for value in values])
    return entry.with_values(numbers).model_dump(mode="json", exclude_none=True)


def _can_be_read(entry: Measured, deposit: Deposit) -> bool:
    return bool(np.all(np.isfinite(entry.reading(deposit).values)))
