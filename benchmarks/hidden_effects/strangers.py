"""Strangers for nothing: opened slides judged once more by a library that lacks what is hidden.

A name is worth what it is worth where the true cause is on no list. Slides with strangers are few;
but take what was hidden, and all that looks like it, off the list, and every opened slide is one.
Each is judged twice, by the whole library and without: so many right names, so many that were
explained away, on the same slides. Both verdicts share their simulations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import Field

from benchmarks.generated_pages import ROOT, table
from benchmarks.hidden_effects.foreign.hidden import THINGS
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.make import OnCase, sealed_cases
from benchmarks.hidden_effects.run import Part
from benchmarks.hidden_effects.scoring.by_other_codes import gives_name, is_right
from benchmarks.hidden_effects.scoring.calibration import covers
from benchmarks.hidden_effects.scoring.digest import Digest, digest_of
from benchmarks.hidden_effects.scoring.opened import SlideRow, add_slides, load_slides
from benchmarks.hidden_effects.scoring.records import read_truth
from benchmarks.hidden_effects.scoring.score import INSEPARABLE, Judged
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.model import Candidate
from diagnosis.selection.explain import Explanation
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from pipeline.cli import InputError
from pipeline.config import Config, validate_settings
from pipeline.files import read_json, write_json

FOLDER = "strangers"
RECORD = ROOT / "benchmarks" / "hidden_effects" / "strangers_results.json"
#: What a row keeps of a truth; what was measured is in the record of its set.
KEPT = ("name", "kind", "source", "section", "survey", "effects", "parameters", "lambda")


class Twice(SlideRow):
    """A slide and its two verdicts: a row of the record."""

    forbidden: list[str] = Field(description="candidates that the second library lacks")
    whole: Digest = Field(description="by the whole library")
    without: Digest | None = Field(description="without them; null: nothing was to be explained")

    @property
    def by_whole(self) -> Judged:
        """The first verdict with the truth."""
        return Judged(self.truth, self.whole)

    @property
    def by_rest(self) -> Judged | None:
        """The second."""
        return None if self.without is None else Judged(self.truth, self.without)


def stands_for(truth: Mapping[str, Any], candidates: Sequence[Candidate]) -> set[str]:
    """Candidates that are right for what was hidden, by name or by a family other than physics."""
    names: set[str] = set()
    for hidden in truth["effects"]:
        thing = THINGS.get(hidden) if "source" in truth else None
        if thing is None:
            names.add(hidden)
            continue
        families = thing.families - {"physics"}
        names |= thing.right
        names |= {one.name for one in candidates if one.family in families}
    return names & {one.name for one in candidates}


def judge_twice(
    folder: Path, truth: Mapping[str, Any], of: str, store: RunStore, config: Config
) -> Twice:
    """Both verdicts on one slide.

    Args:
        folder: of the case.
        truth: what was hidden.
        of: words for its set.
        store: of the simulations.
        config: settings of the diagnosis.
    """
    from diagnosis.diagnose import diagnose  # scipy takes its time
    from diagnosis.verdict.verdict_builder import verdict_document

    case = diagnosis_case(load_case(folder, config))
    candidates = case.model(store).candidates

    def judged(forbidden: Sequence[str]) -> tuple[Digest, Explanation]:
        model = case.model(store)  # anew: a diagnosis adds the places that it has sought
        options = case.options(model)
        found = diagnose(model, replace(options, forbidden=(*options.forbidden, *forbidden)))
        document = verdict_document(found, case=case.name, title=case.title)
        return digest_of(document), found.explanation

    whole, explanation = judged(())
    own = stands_for(truth, candidates)
    forbidden: list[str] = []
    if own and whole.verdict != "adequate":
        tested = [name for name in explanation.names if name in own]
        alike = {other for name in tested for other in explanation.alike(name, INSEPARABLE)}
        forbidden = sorted((own | alike) & {one.name for one in candidates})
    return Twice(
        of=of,
        truth={key: value for key, value in truth.items() if key in KEPT},
        forbidden=forbidden,
        whole=whole,
        without=judged(forbidden)[0] if forbidden else None,
    )


def run_twice(
    places: Places,
    config: Config,
    of: str,
    *,
    part: Part = Part(),  # noqa: B008 - frozen
    threads: int | None = None,
    runs: str | Path | None = None,
    on_case: OnCase = lambda done, total, words: None,
) -> list[Twice]:
    """Judge every opened slide with one hidden thing twice; those that are judged are read.

    Raises:
        InputError: there is no such set, or its truths are not open.
    """
    mine = single_things(places)[part.k :: part.n]
    found = []
    for number, name in enumerate(mine, start=1):
        path = places.out / FOLDER / f"{name}.json"
        if path.is_file():
            twice = validate_settings(Twice, read_json(path), origin=str(path))
            words = "was there"
        else:
            store = RunStore(runs, threads=threads)
            twice = judge_twice(
                places.case(name), read_truth(places.truth(name)), of, store, config
            )
            write_json(path, twice.model_dump(mode="json"))
            words = "; without: ".join(
                f"{one.verdict} {' + '.join(one.effects)}".strip()
                for one in (twice.whole, twice.without)
                if one is not None
            )
        found.append(twice)
        on_case(number, len(mine), f"{name}: {words}")
    return found


def single_things(places: Places) -> list[str]:
    """Names of the opened cases in which one thing of the library is hidden.

    Raises:
        InputError: the truths are not open.
    """
    names = [sealed["name"] for sealed in sealed_cases(places)]
    if not all(places.truth(name).is_file() for name in names):
        raise InputError(f"{places.out}: is sealed: only an opened set has strangers for nothing")
    return [name for name in names if read_truth(places.truth(name)).get("kind") == "single"]


def load_twice(path: Path) -> list[Twice]:
    """A record of several sets; see `scoring.opened.load_slides`."""
    return load_slides(Twice, path)


def save_twice(found: Sequence[Twice], path: Path) -> None:
    """Add slides to a record; of one that is there the newer verdicts stay."""
    add_slides(Twice, found, path)


HEADER = (
    "library",
    "slides",
    "a name",
    "right",
    "several causes",
    "no name",
    "S_r within its 95 %",
)


def rows_of(found: Sequence[Twice]) -> list[list[str]]:
    """What the whole library said of the slides that were judged twice, and one without."""
    both = [(one.by_whole, one.by_rest) for one in found if one.by_rest is not None]
    rows = []
    for words, cases in (
        ("with what is hidden", [whole for whole, _ in both]),
        ("without it", [rest for _, rest in both]),
    ):
        named = [one for one in cases if gives_name(one)]
        several = [one for one in cases if one.attributed and not gives_name(one)]
        rows.append([
            words, str(len(cases)), str(len(named)), str(sum(map(is_right, named))),
            str(len(several)), str(len(cases) - len(named) - len(several)),
            str(sum(covers(one, "95%") for one in cases)),
        ])  # fmt: skip
    return rows


EXPLAINED = ("set", "hidden", "named without it", "S_r off by: before", "by the answer")


def explained(found: Sequence[Twice]) -> list[list[str]]:
    """What was named where the truth could not be, and what it made of the strength."""
    rows = []
    for one in found:
        if one.by_rest is None or not gives_name(one.by_rest):
            continue
        off = [math.expm1(one.by_rest.strength_error(stage)) for stage in ("base", "final")]
        hidden, named = ", ".join(one.truth["effects"]), " + ".join(one.by_rest.digest.effects)
        rows.append([one.of, hidden, named, *(f"{100.0 * share:+.0f} %" for share in off)])
    return rows


def strangers_page() -> str:
    """The tables of docs/records/hidden-effects.md."""
    found = load_twice(RECORD)
    if not found:
        return "No slide has been judged so yet."
    tables = [table(HEADER, rows_of(found), "lrrrrrr")]
    if named := explained(found):
        tables.append(table(EXPLAINED, named, "lllrr"))
    return "\n\n".join(tables)
