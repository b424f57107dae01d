"""All baselines on the judged slides of an opened set, slide by slide.

A slide that was looked at is kept under `baselines/` of the set's folder and not diagnosed again;
its answers are made anew, which takes seconds. The diagnosis itself is asked for what it knows, not
for a verdict: that is read as it was given.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.generated_pages import ROOT
from benchmarks.hidden_effects.baselines.answers import aic, bic, nearest_signature, own_answer
from benchmarks.hidden_effects.baselines.classifier import classify
from benchmarks.hidden_effects.baselines.curve import OWN, Row, draw, page
from benchmarks.hidden_effects.baselines.discrepancy import discrepancy
from benchmarks.hidden_effects.baselines.slide import Slide, slide_of
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.make import OnCase, sealed_cases
from benchmarks.hidden_effects.run import METHOD, Part
from benchmarks.hidden_effects.scoring.digest import load_digest
from benchmarks.hidden_effects.scoring.opened import add_slides, load_slides
from benchmarks.hidden_effects.scoring.records import read_truth
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.hidden_effects.strangers import KEPT
from diagnosis.case import diagnosis_case
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from pipeline.cli import InputError
from pipeline.config import Config, validate_settings
from pipeline.files import read_json, write_json

FOLDER = "baselines"
RECORD = ROOT / "benchmarks" / "hidden_effects" / "baselines_results.json"
PICTURE = ROOT / "docs" / "images" / "baselines.png"
METHODS = {
    "nearest": nearest_signature,
    "aic": aic,
    "bic": bic,
    "classifier": classify,
    "discrepancy": discrepancy,
}


def looked_at(folder: Path, name: str, store: RunStore, config: Config) -> Slide:
    """Diagnose a slide as the method does, and keep what the baselines need."""
    from diagnosis.diagnose import diagnose  # scipy takes its time

    case = diagnosis_case(load_case(folder, config))
    model = case.model(store)
    return slide_of(name, diagnose(model, case.options(model)))


def judged_cases(places: Places) -> list[str]:
    """Names of the cases with a verdict of the method.

    Raises:
        InputError: there is none, or the truth of one is not open.
    """
    names = [sealed["name"] for sealed in sealed_cases(places)]
    names = [name for name in names if places.verdict(name, METHOD).is_file()]
    if not names:
        raise InputError(f"{places.out}: no case has been diagnosed; the step `run` does that")
    if not all(places.truth(name).is_file() for name in names):
        raise InputError(f"{places.out}: is sealed: baselines are held against open truths")
    return names


def run_baselines(
    places: Places,
    config: Config,
    of: str,
    *,
    part: Part = Part(),  # noqa: B008 - frozen
    threads: int | None = None,
    runs: str | Path | None = None,
    on_case: OnCase = lambda done, total, words: None,
) -> list[Row]:
    """All answers on every judged slide.

    Args:
        places: of the benchmark.
        config: settings of the diagnosis, those by which it was judged.
        of: words for the set.
        part: which cases.
        threads: CPU threads; None: all.
        runs: folder of the simulations; None: in memory.
        on_case: called for each case.

    Raises:
        InputError: there is no such set, no verdict, or its truths are not open.
    """
    mine = judged_cases(places)[part.k :: part.n]
    rows = []
    for number, name in enumerate(mine, start=1):
        slide = _slide(places, name, RunStore(runs, threads=threads), config)
        truth = read_truth(places.truth(name))
        own = own_answer(Judged(truth, load_digest(places.verdict(name, METHOD))))
        answers = {OWN: own} | {method: answer(slide) for method, answer in METHODS.items()}
        kept = {key: value for key, value in truth.items() if key in KEPT}
        rows.append(Row(of=of, truth=kept, answers=answers))
        words = ", ".join(f"{key} {' + '.join(one.names) or '-'}" for key, one in answers.items())
        on_case(number, len(mine), f"{name}: {words}")
    return rows


def _slide(places: Places, name: str, store: RunStore, config: Config) -> Slide:
    """As it is kept, else from a diagnosis."""
    path = places.out / FOLDER / f"{name}.json"
    if path.is_file():
        return validate_settings(Slide, read_json(path), origin=str(path))
    slide = looked_at(places.case(name), name, store, config)
    write_json(path, slide.model_dump(mode="json"))
    return slide


def load_answers(path: Path) -> list[Row]:
    """A record of several sets; see `scoring.opened.load_slides`."""
    return load_slides(Row, path)


def save_answers(found: list[Row], path: Path) -> None:
    """Add slides to a record; of one that is there the newer answers stay."""
    add_slides(Row, found, path)


def baselines_page() -> str:
    """The part of docs/records/hidden-effects.md, and its picture."""
    rows = load_answers(RECORD)
    if rows:
        draw(PICTURE, rows)
    return page(rows)
