"""The report of a back-analysis: one page that needs no other file, with its pictures beside it.

In: a `ReportData`. Out: `report.html`, and each picture as a file of its own. The answer comes
first, then what it rests on, what is not known, and how it was found. A part that has nothing to
show is left out.
"""

from __future__ import annotations

from pathlib import Path

from inversion.catalogue.catalogue import answers_of, load_catalogue, load_strengths
from report.back_analysis import sentences as words
from report.back_analysis import tables as tables
from report.back_analysis.data import ReportData, load_report
from report.page import Folded, Paragraph, Picture, Section, Table, write_page
from report.pictures.answer_film import LARGEST_BYTES, known_film, save_film
from report.two_strengths import two_strengths_parts

PAGE = "report.html"
Part = Paragraph | Table | Picture | Folded
WIDE_PX = 820
"""Width below which a section is not shrunk on a phone; it is moved sideways instead."""


def write_report(
    folder: str | Path, case_folder: str | Path | None = None, *, film: bool = True
) -> Path:
    """Write page, pictures and film of a back-analysis.

    Args:
        folder: with `result.json`; page and pictures are written beside it.
        case_folder: of the case; None: the one of that name in `case_histories`, if there is one.
        film: make the film anew; False: show the one that is there, if any.

    Returns:
        The page.

    Raises:
        InputError: no result, or a file that cannot be read; one line.
    """
    data = load_report(folder, case_folder)
    moving = save_film(data) if film else known_film(data.folder)
    page = data.folder / PAGE
    lead = f"{words.answer_sentence(data)} {words.misfit_sentence(data)}"
    write_page(page, f"{data.result.title}: back-analysis", sections(data, moving), lead=lead)
    return page


def sections(data: ReportData, film: Path | None) -> list[Section]:
    """Every part that has something to show, in reading order."""
    made = [
        _answer(data),
        _section(data),
        _methods(data),
        _measured(data),
        _not_determined(data),
        _sensitivities(data),
        _variants(data),
        _search(data),
        _catalogue(data),
        _film(data, film),
        _made(data),
    ]
    return [section for section in made if section.parts]


def _answer(data: ReportData) -> Section:
    return Section(
        "Answer",
        [
            *map(Paragraph, words.meaning_sentences(data)),
            tables.answer_table(data),
            *map(Paragraph, words.surrogate_sentences(data)),
            *two_strengths_parts(data.folder),
        ],
    )


def _section(data: ReportData) -> Section:
    title = "The section before and after"
    if data.case is None or data.run is None:
        return Section(title)
    from mpm_taichi.comparison import read_deposit
    from report.pictures.case_history import save_case_picture

    path = data.folder / "section.png"
    save_case_picture(data.case, data.run, read_deposit(data.case, data.run), path)
    told = "; ".join(words.toe_words(data))
    see = f"Simulated with the strengths found, {told}." if told else ""
    parts: list[Part] = [Paragraph(see)] if see else []
    if constructed := words.constructed_sentence(data):
        parts.append(Paragraph(constructed))
    parts.append(
        Picture(
            path,
            "Two sections, coloured by material: before the slide, and the simulated deposit with "
            "the measured surface and the measured and simulated toe.",
            "Dotted: constructed, not surveyed. White bar: stated range of the toe.",
            least_width_px=WIDE_PX,
        )
    )
    return Section(title, parts)


def _methods(data: ReportData) -> Section:
    from report.charts.methods import draw_methods

    path = draw_methods(data, data.folder / "methods.svg")
    if path is None:
        return Section("The strength by every method")
    see = (
        "The diamond is this analysis with one standard deviation (bar) and 95 % (line); below it "
        "the same question read otherwise (hollow). Bars of the other methods are the ranges over "
        "their judgement calls, or as published; hollow: recalled, unverified."
    )
    picture = Picture(path, "Bars of the residual strength in kPa, one row for each method.")
    notes = list(map(Paragraph, tables.classical_notes(data)))
    return Section(
        "The strength by every method",
        [
            Paragraph(see),
            picture,
            *_given(tables.engine_table(data)),
            *notes,
            *_folded("The same in numbers", tables.method_tables(data)),
        ],
    )


def _measured(data: ReportData) -> Section:
    from report.charts.measured import draw_measured

    parts: list[Part] = [Paragraph(words.misfit_sentence(data))]
    parts += map(Paragraph, words.variant_sentences(data))
    path = draw_measured(data, data.folder / "measured.svg")
    if path is None:
        return Section("Measured against predicted")
    parts.append(
        Paragraph(
            "Each mark is a measurement: at 0 the prediction is exact. Only what is called fitted "
            "entered the search; held-out data judge it; constructed data were drawn and judge "
            "nothing. Nothing is subtracted from a prediction: 'before the slide' is what it would "
            "read had nothing moved. The toe is where the smoothed height of the connected mass "
            "falls below a threshold; the toe by the naked eye is the outermost connected point."
        )
    )
    parts.append(Picture(path, "Differences of all measurements in standard deviations."))
    parts += tables.measured_tables(data)
    parts += _folded("Profiles and histories, value by value", tables.series_tables(data))
    return Section("Measured against predicted", parts)


def _not_determined(data: ReportData) -> Section:
    from report.charts.equivalent_answers import draw_equally_good, papers_answer
    from report.charts.uncertainty import draw_before_after

    parts: list[Part] = list(map(Paragraph, words.undetermined_sentences(data)))
    path = draw_before_after(data, data.folder / "before_after.svg")
    see = (
        "Pale: what was known before (the prior, or all between the bounds). Dark: one standard "
        "deviation after the data; orange where the data have added nothing."
    )
    parts += [Paragraph(see), Picture(path, "Bars before and after the data for each parameter.")]
    path = draw_equally_good(data, data.folder / "equally_good.svg")
    if path is not None:
        see = (
            "Each line is a set of values that fits as well as the answer does: the data cannot "
            "choose among them."
        )
        if papers_answer(data) is not None:
            see += " Dashed: the paper's single answer, to its own measured runouts."
        parts.append(Paragraph(see))
        parts.append(
            Picture(path, "Lines across the parameters, one for each equally good answer.")
        )
        parts += _given(tables.equally_good_table(data))
    return Section("What the data do not determine", parts)


def _sensitivities(data: ReportData) -> Section:
    from report.charts.uncertainty import draw_tornado

    path = draw_tornado(data, data.folder / "sensitivities.svg")
    parts: list[Part] = []
    if path is not None:
        parts = [
            Paragraph(
                "Each bar is the answer found again with one assumption changed by one standard "
                "deviation, strongest on top: blue lowers the strength, orange raises it."
            ),
            Picture(path, "Tornado chart of the changes of the answer."),
        ]
    return Section(
        "What moves the answer",
        [*parts, *_folded("The same in numbers", tables.sensitivity_tables(data))],
    )


def _variants(data: ReportData) -> Section:
    table = tables.variant_table(data)
    if table is None:
        return Section("Other readings of the question")
    return Section(
        "Other readings of the question", [Paragraph(words.variant_sentence(data)), table]
    )


def _search(data: ReportData) -> Section:
    from report.charts.iterations import draw_history, draw_iterations

    result = data.result
    count = max(line.iteration for line in result.iterations)
    end = f"{result.answer.words} after {count} iterations and {result.runs_to_answer} simulations."
    parts: list[Part] = [Paragraph(end[0].upper() + end[1:])]
    path = draw_iterations(data, data.folder / "iterations.png")
    if path is not None:
        parts.append(
            Paragraph(
                "The simulated section at each iteration. Blue triangle: the simulated toe. Black "
                "triangle: the measured one, on its stated range. Dotted line: constructed."
            )
        )
        parts.append(
            Picture(
                path,
                "Sections one below the other, one for each iteration, with the measured toe.",
                least_width_px=WIDE_PX,
            )  # fmt: skip
        )
    path = draw_history(data, data.folder / "history.svg")
    parts.append(Picture(path, "Loss, values sought and fitted quantities at each look."))
    parts += _folded("Every step in numbers", [tables.history_table(data)])
    if (starts := tables.starts_table(data)) is not None:
        parts += [Paragraph("The same question from other first guesses:"), starts]
    return Section("How it was found", parts)


def _catalogue(data: ReportData) -> Section:
    answers = answers_of(data.result.model_dump(mode="json"))
    if not answers:
        return Section("Among other flow slides")
    from report.charts.catalogue import catalogue_figure
    from report.charts.style import save_figure

    figure = catalogue_figure(load_catalogue(), load_strengths(), answers)
    path = save_figure(figure, data.folder / "catalogue.svg")
    return Section(
        "Among other flow slides",
        [
            Paragraph(
                "The strength ratio of this analysis (letters) among published case histories and "
                "correlations. Hollow marks and dashed lines are recalled, unverified."
            ),
            Picture(
                path,
                "Strength ratio against blow count, with correlations and our answers.",
                least_width_px=640,
            ),
        ],
    )


def _film(data: ReportData, film: Path | None) -> Section:
    if film is None:
        return Section("The slide as a film")
    if film.stat().st_size > LARGEST_BYTES:
        size = film.stat().st_size / 1e6
        told = f"The film ({size:.1f} MB) lies beside this page: {film.name}."
        return Section("The slide as a film", [Paragraph(told)])
    words_ = "Film of the simulated slide with the strengths found, and the measured surface."
    told = Paragraph(f"Also beside this page: {film.name}.")
    return Section("The slide as a film", [Picture(film, words_, least_width_px=WIDE_PX), told])


def _made(data: ReportData) -> Section:
    remarks = [Paragraph(f"Could not be had: {remark}") for remark in data.result.remarks]
    timings, *how = tables.made_tables(data)
    return Section(
        "How this was made", [*remarks, timings, *_folded("Settings, versions, machine", how)]
    )


def _folded(title: str, found: list[Table]) -> list[Part]:
    return [Folded(title, found)] if found else []


def _given(table: Table | None) -> list[Part]:
    return [] if table is None else [table]
