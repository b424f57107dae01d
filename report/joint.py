"""The page of a relation over several slides, and the text of a terminal.

In: a folder with `joint.json`. Out: `report.html`, `summary.txt`, each picture as a file.
"""

from __future__ import annotations

from pathlib import Path

from inversion.joint.document import JointDocument, load_joint
from pipeline.files import write_text
from report.charts.joint import draw_blow_counts, draw_slides
from report.page import PageSection, folded, said, shown, tabulated, write_page
from report.sentences import joint as sentences
from report.table import plain
from report.tables import joint as tables

PAGE, SUMMARY = "report.html", "summary.txt"
TITLE = "One relation over several slides"


def write_report(folder: str | Path) -> Path:
    """Write page, pictures and summary of a relation into its folder; the page."""
    folder = Path(folder)
    document = load_joint(folder)
    write_text(folder / SUMMARY, summary(document) + "\n")
    lead = " ".join([sentences.answer_sentence(document), sentences.slope_sentence(document)])
    write_page(folder / PAGE, TITLE, _sections(document, folder), lead=lead)
    return folder / PAGE


def summary(document: JointDocument) -> str:
    """The answer for a terminal or a log."""
    words = [
        sentences.answer_sentence(document),
        sentences.scatter_sentence(document),
        sentences.slope_sentence(document),
        *sentences.bound_sentences(document),
        sentences.left_out_sentence(document),
        sentences.literature_sentence(document),
        sentences.check_sentence(document),
        *document.remarks,
    ]
    parts = [
        tables.slide_table(document).text(folded=True),
        tables.relation_table(document).text(),
        tables.left_out_table(document).text(),
        "\n".join(map(plain, words)),
    ]
    return "\n\n".join(part for part in parts if part)


def _sections(document: JointDocument, folder: Path) -> list[PageSection]:
    made = [
        PageSection(
            "Slides and relation",
            [
                *shown(
                    draw_slides(document, folder / "slides.svg"),
                    "Ratio of each slide with its interval, the relation, and what others found.",
                    "Each slide alone, as wide as its verdict says, and with the others. Bars "
                    "below: 95 % of the relation's median, of a dam without a slide, of the median "
                    "before, and of a lognormal through the ranges of a secondary source. "
                    "Triangle: it stood, and its ratio is larger.",
                ),
                *tabulated(tables.slide_table(document), tables.relation_table(document)),
                *said([sentences.scatter_sentence(document), *document.remarks]),
            ],
        ),
        PageSection(
            "Slopes that stood",
            [
                *said(sentences.bound_sentences(document)),
                *tabulated(tables.explanation_table(document)),
            ],
        ),
        PageSection(
            "Each slide from the others",
            [
                *said([sentences.left_out_sentence(document)]),
                *tabulated(tables.left_out_table(document)),
            ],
        ),
        PageSection(
            "Blow count and published relations",
            [
                *said([sentences.slope_sentence(document)]),
                *shown(
                    draw_blow_counts(document, folder / "blow_counts.svg"),
                    "Ratio against blow count with published relations.",
                    "Hollow: the blow count is recalled and unverified.",
                ),
                *said([sentences.literature_sentence(document)]),
                *folded("Published relations", tables.published_table(document)),
                *folded("Strengths that others found", tables.author_table(document)),
            ],
        ),
        PageSection(
            "How it was made",
            said(
                [
                    "Before: " + "; ".join(f"{k} {v}" for k, v in document.priors.items()) + ".",
                    sentences.check_sentence(document),
                ]
            ),
        ),
    ]
    return [section for section in made if section.parts]
