"""The report of a back-analysis: one self-contained page, its pictures, and the text of a terminal.

In: a result, its folder and its case. Out: `report.html`, and each picture as a file of its own.
The answer comes first, then its evidence, what is unknown, and how it was found. A part that has
nothing to show is left out.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from inversion.catalogue.catalogue import answers_of, load_catalogue, load_strengths
from inversion.engines.registry import engine_named
from pipeline.extras import has
from report.data.back_analysis import MANY, BackAnalysisData
from report.page import PageSection, Paragraph, filmed, folded, said, shown, tabulated, write_page
from report.sentences import back_analysis as words
from report.sentences import implied_strengths as implied
from report.table import plain
from report.tables import back_analysis as tables
from report.tables import checklist
from report.two_strengths import two_strengths

PAGE, FILM = "report.html", "runout"
CHANGE_PICTURE, MAP_PICTURE = "change.png", "map.png"
"""Of a slide in plan (`report.back_analysis3d`)."""
WIDE_PX = 820
"""Width below which a section is not shrunk on a phone but scrolls sideways."""


def write_report(data: BackAnalysisData, *, film: bool = True) -> Path:
    """Write page, pictures and film of a back-analysis into its folder.

    Args:
        data: of the back-analysis.
        film: make a new film; False: show the existing one, if any.

    Returns:
        The page.
    """
    moving = save_film(data) if film else known_film(data.folder)
    page = data.folder / PAGE
    lead = f"{words.answer_sentence(data)} {words.misfit_sentence(data)} {words.doubted(data)}"
    write_page(page, f"{data.result.title}: back-analysis", sections(data, moving), lead=lead)
    return page


def summary(data: BackAnalysisData) -> str:
    """The answer for a terminal or a log."""
    result = data.result
    answer = result.answer
    end = "" if answer.reached else "NOT FITTED: "
    unit = " m²" if answer.loss_unit == "m2" else ""
    iterations = max(line.iteration for line in result.iterations)
    heading = (
        f"{result.title}: back-analysis by {engine_named(result.engine).label} at "
        f"{result.spacing_m:g} m, measurements {result.measurement_set!r}\n"
        f"{end}{answer.words}; loss {answer.loss:.3g}{unit} after {iterations} iterations and "
        f"{result.runs_to_answer} simulations ({result.runs} in all, "
        f"{result.timings.get('in all', 0):.0f} s)"
    )
    for line in (words.first_line(data), words.doubted(data)):
        heading = f"{plain(line)}\n{heading}" if line else heading
    strengths = data.answers
    lines = [m for m in result.measurements if m.role != "constructed"]
    counts = Counter(m.group for m in lines)
    maps = {name for name, count in counts.items() if count > MANY}
    lines = [m for m in lines if m.group not in maps]
    # A terminal is narrower than a page: what the page alone shows is left out.
    narrow = [
        (tables.answer_table(data), ["σ'_v0 (kPa)", "equally good", "first guess (bounds)"]),
        (tables.measured_table(data, lines), ["by eye", "before the slide"]),
        (tables.whole_series_table(data, maps), []),
        (tables.engine_table(data), []),
        *((table, []) for table in tables.method_tables(data)),
        *((table, ["scatter"]) for table in tables.relation_tables(data)),
        (tables.variant_table(data), ["predicted", "loss"]),
        (tables.waterfall_table(data), []),
        *((table, []) for table in tables.sensitivity_tables(data, strengths)),
        (tables.starts_table(data), []),
        (tables.equally_good_table(data), ["loss"]),
    ]
    parts = [heading, *(table.text(without=left_out, folded=True) for table, left_out in narrow)]
    parts += [two_strengths(data.folder).text()]
    parts += [
        "\n".join(
            map(
                plain,
                [
                    *words.undetermined_sentences(data),
                    *tables.left_out_notes(data),
                    *words.hand_check_sentences(data),
                    *words.spacing_sentences(data),
                    *result.remarks,
                ],
            )
        )
    ]
    return "\n\n".join(part for part in parts if part)


def sections(data: BackAnalysisData, film: Path | None) -> list[PageSection]:
    """Every part that has something to show, in reading order."""
    made = [
        _answer(data),
        _section(data),
        _methods(data),
        _measured(data),
        _implied(data),
        _not_determined(data),
        _sensitivities(data),
        _variants(data),
        _waterfall(data),
        _search(data),
        _catalogue(data),
        _checklist(data),
        _film(film),
        _made(data),
    ]
    return [section for section in made if section.parts]


def _answer(data: BackAnalysisData) -> PageSection:
    before = [*words.meaning_sentences(data), *words.hand_check_sentences(data)]
    after = words.surrogate_sentences(data)
    return PageSection(
        "Answer",
        [
            *said(before),
            *tabulated(tables.answer_table(data)),
            *said(after),
            *two_strengths(data.folder).parts(),
        ],
    )


def _section(data: BackAnalysisData) -> PageSection:
    title = "The section before and after"
    if data.case is None or data.run is None:
        return _map(data)
    from mpm_taichi.comparison import read_deposit
    from report.pictures.case_history import save_case_picture

    path = data.folder / "section.png"
    readings = read_deposit(data.case, data.run)
    save_case_picture(data.case, data.run, readings, path)
    toes = "; ".join(words.toe_words(data))
    return PageSection(
        title,
        shown(
            path,
            "Two sections, coloured by material: before the slide, and the simulated deposit with "
            "the measured surface and the measured and simulated toe.",
            f"Simulated with the calibrated strengths: {toes}." if toes else "",
            words.without_steps(data, {one.name: one.simulated for one in readings}),
            words.constructed_sentence(data),
            caption="Dotted: constructed, not surveyed. White bar: stated range of the toe.",
            least_width_px=WIDE_PX,
        ),
    )


def _map(data: BackAnalysisData) -> PageSection:
    """What a slide left in plan, where that was fitted; the pictures are there."""
    pictures = [data.folder / name for name in (CHANGE_PICTURE, MAP_PICTURE)]
    if not all(path.is_file() for path in pictures):
        return PageSection("The map, measured and simulated")
    return PageSection(
        "The map, measured and simulated",
        [
            *shown(
                pictures[0],
                "Plans of the change of the surface: measured, simulated, and the difference",
                "Blue sank, red rose. Blue line: edge of the simulated deposit, dashed before the "
                "slide; orange: places on the measured edge, and lines of the scene.",
            ),
            *shown(
                pictures[1],
                "Plan with the thickness of the simulated deposit, and sections along the paths",
            ),
        ],
    )


def _methods(data: BackAnalysisData) -> PageSection:
    from report.charts.methods import draw_methods

    title = "The strength by every method"
    path = draw_methods(data, data.folder / "methods.svg")
    if path is None:
        return PageSection(title)
    parts = shown(
        path,
        "Bars of the residual strength in kPa, one row for each method.",
        "The diamond is this analysis with one standard deviation (bar) and its 95 % interval "
        "(line); hollow circles below it are variants of the question. Bars of the other methods "
        "are the ranges over their judgement calls, or as published; hollow: quoted from memory. "
        "A triangle is a lower bound (95 %), its bar the limit of flow. "
        "Relations with blow count (orange) have a bar of one standard deviation, and a line from "
        "the weakest to the strongest layer.",
    )
    return PageSection(
        title,
        [
            *parts,
            *tabulated(tables.engine_table(data)),
            *said([*tables.classical_notes(data), *tables.left_out_notes(data)]),
            *tabulated(*tables.relation_tables(data)),
            *folded("The same in numbers", *tables.method_tables(data)),
        ],
    )


def _measured(data: BackAnalysisData) -> PageSection:
    from report.charts.measured import draw_measured

    title = "Measured against predicted"
    path = draw_measured(data, data.folder / "measured.svg")
    if path is None:
        return PageSection(title)
    single = tables.singles(data)
    parts = shown(
        path,
        "Differences of all measurements in standard deviations.",
        words.misfit_sentence(data),
        *words.variant_sentences(data),
        "Each mark is a measurement; at 0 the prediction is exact. Only fitted measurements "
        "entered the search. Held-out data test the answer; constructed data test nothing. "
        "Nothing is subtracted from a prediction: 'before the slide' is the reading of the "
        "undeformed section. The toe is where the smoothed height of the connected mass falls "
        "below a threshold; 'by eye' is the outermost connected point.",
    )
    parts += tabulated(tables.measured_table(data, single), tables.source_table(single))
    parts += folded("Profiles and histories, value by value", *tables.series_tables(data))
    return PageSection(title, parts)


def _implied(data: BackAnalysisData) -> PageSection:
    from report.charts.implied_strengths import draw_implied_strengths

    return PageSection(
        "Which measurement asks for which strength",
        [
            *shown(
                draw_implied_strengths(data, data.folder / "implied_strengths.svg"),
                "A row for each measurement with the strength that would meet it, and the answer "
                "as a band.",
                *implied.how_sentences(data.result),
                "Where two bars do not overlap, no strength meets both measurements: something "
                "else is missing, or one of them is wrong. Triangle: beyond the runs; cross: no "
                "strength meets it; hollow: a second strength that does.",
            ),
            *folded("The same in numbers", *tables.implied_tables(data)),
        ],
    )


def _not_determined(data: BackAnalysisData) -> PageSection:
    from report.charts.uncertainty import draw_before_after, draw_equally_good, papers_answer

    parts = shown(
        draw_before_after(data, data.folder / "before_after.svg"),
        "Bars before and after the data for each parameter.",
        *words.undetermined_sentences(data),
        "Pale: known before the fit (the prior, or the whole range between the bounds). Dark: one "
        "standard deviation after the fit, or all above a lower bound; orange where the data added "
        "nothing.",
    )
    paper = (
        ""
        if papers_answer(data) is None
        else (" Dashed: the paper's single answer, fitted to its own measured runouts.")
    )
    parts += shown(
        draw_equally_good(data, data.folder / "equally_good.svg"),
        "Lines across the parameters, one for each equally good answer.",
        "Each line is a set of values that fits as well as the answer; the data cannot "
        f"distinguish between them.{paper}",
    )
    parts += tabulated(tables.equally_good_table(data))
    return PageSection("What the data do not determine", parts)


def _sensitivities(data: BackAnalysisData) -> PageSection:
    from report.charts.uncertainty import draw_tornado

    parts = shown(
        draw_tornado(data, data.folder / "sensitivities.svg"),
        "Tornado chart of the changes of the answer.",
        "Each bar is the answer recalibrated with one assumption changed by one standard "
        "deviation, the largest change on top: blue lowers the strength, orange raises it.",
    )
    numbers = folded(
        "The same in numbers", *tables.sensitivity_tables(data, data.result.answer.parameters)
    )
    parts += said(words.spacing_sentences(data))
    return PageSection("What moves the answer", [*parts, *numbers])


def _variants(data: BackAnalysisData) -> PageSection:
    found = tabulated(tables.variant_table(data))
    sentence = said([words.variant_sentence(data)]) if found else []
    return PageSection("Variants of the question", [*sentence, *found])


def _waterfall(data: BackAnalysisData) -> PageSection:
    from report.charts.waterfall import draw_waterfall

    parts = shown(
        draw_waterfall(data, data.folder / "waterfall.svg"),
        "Bars of the strength, one for each change on the way from another reading to the answer.",
        words.waterfall_sentence(data),
        "Each bar goes from the value before a change to the one after it, fitted to the same "
        "measurement: blue lowers the strength, orange raises it. A change stays for the rows "
        "below.",
    )
    parts += tabulated(tables.waterfall_table(data))
    return PageSection("From another reading to this answer", parts)


def _search(data: BackAnalysisData) -> PageSection:
    from report.charts.iterations import draw_history, draw_iterations

    result = data.result
    count = max(line.iteration for line in result.iterations)
    end = f"{result.answer.words} after {count} iterations and {result.runs_to_answer} simulations."
    parts = said([end[0].upper() + end[1:]])
    parts += shown(
        draw_iterations(data, data.folder / "iterations.png"),
        "Sections one below the other, one for each iteration, with the measured toe.",
        "The simulated section at each iteration. Blue triangle: simulated toe. Black triangle: "
        "measured toe, on its stated range. Dotted line: constructed.",
        least_width_px=WIDE_PX,
    )
    parts += shown(
        draw_history(data, data.folder / "history.svg"),
        "Loss, unknowns and fitted quantities at each evaluation.",
    )
    parts += folded("Every step in numbers", tables.history_table(data))
    if starts := tabulated(tables.starts_table(data)):
        parts += [Paragraph("The same question from other first guesses:"), *starts]
    return PageSection("How it was found", parts)


def _catalogue(data: BackAnalysisData) -> PageSection:
    title = "Among other flow slides"
    answers = answers_of(data.result.model_dump(mode="json"))
    if not answers:
        return PageSection(title)
    from report.charts.catalogue import catalogue_figure
    from report.style import save_figure

    figure = catalogue_figure(load_catalogue(), load_strengths(), answers)
    return PageSection(
        title,
        shown(
            save_figure(figure, data.folder / "catalogue.svg"),
            "Strength ratio against blow count, with correlations and our answers.",
            "The strength ratio of this analysis (letters) among published case histories and "
            "correlations. Hollow marks are quoted from memory and unverified.",
            least_width_px=640,
        ),
    )


def _checklist(data: BackAnalysisData) -> PageSection:
    table = checklist.back_analysis_checklist(data)
    return PageSection(checklist.TITLE, [*said([checklist.unchecked(table)]), *tabulated(table)])


def _film(film: Path | None) -> PageSection:
    description = "Film of the simulated slide, and the measured surface."
    return PageSection("The slide as a film", filmed(film, description, least_width_px=WIDE_PX))


def _made(data: BackAnalysisData) -> PageSection:
    remarks = said(
        f"{remark[:1].upper()}{remark[1:].rstrip('.')}." for remark in data.result.remarks
    )
    settings = folded("Settings, versions, machine", tables.provenance_table(data))
    return PageSection(
        "How this was made", [*remarks, *tabulated(tables.timing_table(data)), *settings]
    )


def save_film(data: BackAnalysisData) -> Path | None:
    """Save the film of the answer next to the page; None where there is no trajectory or case."""
    if data.run is None or data.case is None:
        return None
    from report.pictures.case_history import save_case_film

    # A gif needs nothing more.
    path = data.folder / f"{FILM}{'.mp4' if has('video') else '.gif'}"
    save_case_film(data.case, data.run, path)
    return path


def known_film(folder: Path) -> Path | None:
    """The film an earlier report has left in a folder."""
    for suffix in (".mp4", ".gif"):
        path = folder / f"{FILM}{suffix}"
        if path.is_file():
            return path
    return None
