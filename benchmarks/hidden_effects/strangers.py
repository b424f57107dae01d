"""Strangers for nothing: opened slides judged once more by a library that lacks what is hidden.

A name is worth what it is worth where the true cause is on no list. Slides with strangers are few;
but take what was hidden, and all that looks like it, off the list, and every opened slide is one.
Each is judged twice, by the whole library and without: so many right names, so many that were
explained away, on the same slides. Both verdicts share their simulations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.generated_pages import ROOT, table
from benchmarks.hidden_effects.foreign.hidden import THINGS
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.make import OnCase, sealed_cases
from benchmarks.hidden_effects.run import Part
from benchmarks.hidden_effects.scoring.by_other_codes import ByCode
from benchmarks.hidden_effects.scoring.calibration import covers
from benchmarks.hidden_effects.scoring.digest import Digest, digest_of
from benchmarks.hidden_effects.scoring.records import read_truth
from benchmarks.hidden_effects.scoring.score import INSEPARABLE, Judged
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.model import Candidate
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from pipeline.cli import InputError
from pipeline.config import Config, validate_settings
from pipeline.files import read_json, write_json, write_text

FOLDER = "strangers"
RECORD = ROOT / "benchmarks" / "hidden_effects" / "strangers_results.json"
#: What a row keeps of a truth; what was measured is in the record of its set.
KEPT = ("name", "kind", "source", "section", "survey", "effects", "parameters", "lambda")
WHOLE, WITHOUT = "whole", "without"


@dataclass(frozen=True)
class Twice:
    """A slide and its two verdicts.

    Attributes:
        of: words for its set.
        whole: by the whole library.
        without: by one that lacks what was hidden; None: nothing was to be explained.
        forbidden: candidates that it lacks.
    """

    of: str
    whole: Judged
    without: Judged | None
    forbidden: tuple[str, ...]

    @property
    def row(self) -> dict[str, Any]:
        """As a record has it."""
        without = None if self.without is None else self.without.digest.model_dump(mode="json")
        return {
            "set": self.of,
            "truth": {key: value for key, value in self.whole.truth.items() if key in KEPT},
            "forbidden": list(self.forbidden),
            WHOLE: self.whole.digest.model_dump(mode="json"),
            WITHOUT: without,
        }


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

    def judged(forbidden: tuple[str, ...]) -> tuple[Judged, Any]:
        model = case.model(store)  # anew: a diagnosis adds the places that it has sought
        options = case.options(model)
        found = diagnose(model, replace(options, forbidden=(*options.forbidden, *forbidden)))
        digest = digest_of(verdict_document(found, case=case.name, title=case.title))
        return Judged(truth, digest), found.explanation

    whole, explanation = judged(())
    own = stands_for(truth, candidates)
    if not own or whole.digest.verdict == "adequate":
        return Twice(of, whole, None, ())
    tested = [name for name in explanation.names if name in own]
    alike = {other for name in tested for other in explanation.alike(name, INSEPARABLE)}
    known = {one.name for one in candidates}
    forbidden = tuple(sorted((own | alike) & known))
    return Twice(of, whole, judged(forbidden)[0], forbidden)


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
            twice, words = from_row(read_json(path), str(path)), "was there"
        else:
            store = RunStore(runs, threads=threads)
            twice = judge_twice(
                places.case(name), read_truth(places.truth(name)), of, store, config
            )
            write_json(path, twice.row)
            verdicts = [one.digest for one in (twice.whole, twice.without) if one is not None]
            words = "; without: ".join(
                f"{one.verdict} {' + '.join(one.effects)}".strip() for one in verdicts
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


def from_row(row: Mapping[str, Any], source: str) -> Twice:
    """A slide from its row.

    Raises:
        InputError: not of this form.
    """
    truth, without = row["truth"], row[WITHOUT]
    digests = [
        None if one is None else validate_settings(Digest, one, origin=source)
        for one in (row[WHOLE], without)
    ]
    assert digests[0] is not None
    second = None if digests[1] is None else Judged(truth, digests[1])
    return Twice(row["set"], Judged(truth, digests[0]), second, tuple(row["forbidden"]))


def load_twice(path: Path) -> list[Twice]:
    """A record of several sets; empty where there is none."""
    return [from_row(row, str(path)) for row in read_json(path)] if path.is_file() else []


def save_twice(found: Sequence[Twice], path: Path) -> None:
    """Add slides to a record, one line for each; of one that is there the newer verdicts stay."""
    rows = {(one.of, one.whole.truth["name"]): one.row for one in load_twice(path)}
    rows |= {(one.of, one.whole.truth["name"]): one.row for one in found}
    lines = [json.dumps(rows[key], separators=(",", ":"), allow_nan=False) for key in sorted(rows)]
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


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
    both = [one for one in found if one.without is not None]
    rows = []
    for words, cases in (
        ("with what is hidden", [one.whole for one in both]),
        ("without it", [one.without for one in both if one.without is not None]),
    ):
        named = [one for one in cases if _names(one)]
        several = [one for one in cases if one.attributed and not _names(one)]
        rows.append([
            words, str(len(cases)), str(len(named)), str(sum(map(_right, named))),
            str(len(several)), str(len(cases) - len(named) - len(several)),
            str(sum(covers(one, "95%") for one in cases)),
        ])  # fmt: skip
    return rows


EXPLAINED = ("set", "hidden", "named without it", "S_r off by: before", "by the answer")


def explained(found: Sequence[Twice]) -> list[list[str]]:
    """What was named where the truth could not be, and what it made of the strength."""
    return [
        [
            one.of, ", ".join(one.whole.hidden), " + ".join(one.without.digest.effects),
            *(f"{100.0 * math.expm1(one.without.strength_error(stage)):+.0f} %"
              for stage in ("base", "final")),
        ]
        for one in found
        if one.without is not None and _names(one.without)
    ]  # fmt: skip


def strangers_page() -> str:
    """The tables of docs/records/hidden-effects.md."""
    found = load_twice(RECORD)
    named = explained(found)
    tables = [table(HEADER, rows_of(found), "lrrrrrr")]
    return "\n\n".join(tables + ([table(EXPLAINED, named, "lllrr")] if named else []))


def _names(one: Judged) -> bool:
    return ByCode(one).answers if "source" in one.truth else one.named is not None


def _right(one: Judged) -> bool:
    return ByCode(one).right if "source" in one.truth else one.right
