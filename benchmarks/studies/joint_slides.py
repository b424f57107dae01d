"""The relation of the slides at hand, as `docs/method/joint.md` has it.

    python -m benchmarks.studies.joint_slides [--results FOLDER]

What each slide says is kept in `joint_slides.json`, so that the table of the page is made again in
seconds from the evidence alone. With `--results`, the folder of `flowslide invert` and `flowslide
posterior` of all six, it is read anew. The verdicts are those of `docs/records/diagnosed-dams.md`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from diagnosis.track_record import Verdicts, factor_of
from geometry.case import load_case
from inversion.joint.build import document_of, slide_of
from inversion.joint.document import JointDocument
from inversion.joint.evidence import BlowCountOfSlide, SlideEvidence
from inversion.posterior.document import Spread
from pipeline.config import load_config
from pipeline.files import read_json, write_json
from report.charts.joint import draw_slides

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "method" / "joint.md"
PICTURE = ROOT / "docs" / "images" / "joint.png"
CASES = ROOT / "case_histories"
VERDICTS: dict[str, Verdicts] = {
    "lower_san_fernando": "unknown_effect",
    "la_marquesa": "adequate",
    "upper_san_fernando": "adequate",
}
FROM_NUMBERS = ("wachusett", "sheffield", "fort_peck")
#: Fort Peck's runout is the farthest that any of it ran: the weight of a reading of its own.
FARTHEST, ITS_WEIGHT = "fort_peck", 0.25
DIGITS = 4


def collect(results: Path) -> list[dict[str, Any]]:
    """What each slide says, by its results and its verdict."""
    slides = []
    for name in (*VERDICTS, *FROM_NUMBERS):
        verdict = VERDICTS.get(name)
        found = slide_of(load_case(CASES / name), results / name)
        found = replace(found, source=f"results/{name}").widened(factor_of(verdict), verdict or "")
        kept = {"centres": found.centres.round(DIGITS), "weights": found.weights.round(2 * DIGITS)}
        slides.append(asdict(found) | {key: value.tolist() for key, value in kept.items()})
    return slides


def slides_of(record: Sequence[dict[str, Any]]) -> list[SlideEvidence]:
    """The evidence that is kept."""
    return [_slide(dict(one)) for one in record]


def _slide(kept: dict[str, Any]) -> SlideEvidence:
    count = kept.pop("blow_count")
    weights = np.array(kept.pop("weights"))
    return SlideEvidence(
        **kept
        | {key: tuple(kept[key]) for key in ("zones", "fitted", "recalled")}
        | {"centres": np.array(kept["centres"]), "weights": weights / weights.sum()},
        blow_count=None if count is None else BlowCountOfSlide(**count),
    )


def readings(slides: Sequence[SlideEvidence]) -> dict[str, JointDocument]:
    """The relation of the drawn slides, of all, and of all with the farthest at its weight."""
    config = load_config(None)
    some = {
        "three drawn": [one for one in slides if one.drawn],
        "all six": list(slides),
        f"the same, Fort Peck at `--weight` {ITS_WEIGHT:g}": [
            one.weighed(ITS_WEIGHT) if one.case == FARTHEST else one for one in slides
        ],
    }
    return {words: document_of(those, config) for words, those in some.items()}


def words_of(document: JointDocument) -> list[tuple[str, str]]:
    """Rows of the table: what it is, and the figure."""
    (bound,) = document.bounds
    factors = [math.exp(one) for one in _three(document.relation.scatter)]
    return [
        ("median", "{:.3f} ({:.3f} to {:.3f})".format(*_three(document.relation.median))),
        ("scatter, a factor", "{:.2f} ({:.2f} to {:.2f})".format(*factors)),
        ("of the scatter's variance went", f"{100 * document.scatter_narrowed:.0f} %"),
        ("a dam without a slide", "{:.3f} ({:.3f} to {:.3f})".format(*_three(document.ratio))),
        ("evidence with a slope over that without", f"{document.slope.bayes_factor:.2g}"),
        ("Upper San Fernando stands as the others predict", f"{100 * bound.probability:.0f} %"),
        (
            "another zone than the one drawn liquefied there (50 % before)",
            f"{100 * bound.zone_doubt:.0f} %",
        ),
    ]


def _three(spread: Spread) -> tuple[float, float, float]:
    return (spread.median, *spread.interval_95)


def relation_table(documents: Mapping[str, JointDocument]) -> str:
    """As Markdown."""
    found = {words: words_of(document) for words, document in documents.items()}
    rows = [
        [name, *(cells[place][1] for cells in found.values())]
        for place, (name, _) in enumerate(next(iter(found.values())))
    ]
    return table(["", *found], rows)


def main(argv: Sequence[str] | None = None) -> None:
    """Renew the page and its picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, help="folder of results that are read anew")
    chosen = parser.parse_args(argv)
    if chosen.results is not None:
        write_json(RECORD, collect(chosen.results))
    found = readings(slides_of(read_json(RECORD)))
    renew(PAGE, relation=relation_table(found))
    draw_slides(found["all six"], PICTURE)


if __name__ == "__main__":
    main()
