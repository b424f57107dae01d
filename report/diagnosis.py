"""The report of a diagnosis: one self-contained page, its pictures, and the text of a terminal.

In: a folder with `verdict.json` (or `compare.json`, `explain.json`) and perhaps `sections.npz`.
Out: `report.html` (`compare.html`, `explain.html`, `track.html`) and each picture as a file of its
own. The verdict comes first, then its evidence, and what remains unknown. A part that has nothing
to show is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from diagnosis.verdict.verdict import COMPARE_FILE, EXPLAIN_FILE, FILE_NAME, WaterfallStep
from pipeline.ties import ranked
from report.data.diagnosis import DiagnosisData, Document, load_diagnosis
from report.numbers import plural, root_mean_square
from report.page import PageSection, Part, folded, said, shown, tabulated, write_page
from report.sentences import diagnosis as words
from report.sentences.finding import candidate_sentence, headline, lead
from report.table import plain
from report.tables import checklist
from report.tables import diagnosis as tables
from report.two_strengths import two_strengths

PAGE, COMPARE_PAGE, EXPLAIN_PAGE, TRACK_PAGE = (
    "report.html",
    "compare.html",
    "explain.html",
    "track.html",
)
#: Measured numbers that a terminal lists; the document has all of them.
MOST_LINES = 40


def write_report(folder: str | Path) -> Path:
    """Write the page of a verdict and its pictures.

    Args:
        folder: with `verdict.json`.

    Returns:
        The page.

    Raises:
        InputError: no verdict, or a file that cannot be read; one line.
    """
    return _write(load_diagnosis(folder, FILE_NAME), PAGE, "missing physics")


def write_compare(folder: str | Path) -> Path:
    """The shorter page of `compare`: is the base model adequate, and where does it fail?"""
    return _write(load_diagnosis(folder, COMPARE_FILE), COMPARE_PAGE, "model against measurements")


def write_explain(folder: str | Path) -> Path:
    """The shorter page of `explain`: ranked effects, which are similar, which could be hidden."""
    return _write(load_diagnosis(folder, EXPLAIN_FILE), EXPLAIN_PAGE, "candidate effects")


def write_track(
    folder: str | Path, title: str, steps: Sequence[WaterfallStep], *, by_hand: Collection[str] = ()
) -> Path:
    """The page of `track`: the error of the models so far, with those of a person marked.

    Args:
        folder: page and picture are written into it.
        title: of the case.
        steps: models in the order in which they were made.
        by_hand: names of the models that a person has added.
    """
    folder = Path(folder)
    page = folder / TRACK_PAGE
    lead = f"{plural(len(steps), 'model')} so far."
    if len(steps) > 1:
        ends = [root_mean_square(step.chi2, max(step.dof, 1)) for step in (steps[0], steps[-1])]
        lead += (
            f" Root mean square misfit of the fitted data: {ends[0]:.1f} standard deviations with "
            f"the first, {ends[1]:.1f} with the last; noise alone has 1."
        )
    section = PageSection("The error over the steps", _steps(folder, steps, by_hand))
    write_page(page, f"{title}: the error so far", [section] if steps else [], lead=lead)
    return page


def _write(data: DiagnosisData, name: str, about: str) -> Path:
    page = data.folder / name
    write_page(page, f"{data.document.title}: {about}", sections(data), lead=lead(data))
    return page


# --- a terminal ---


def summary(document: Document, folder: str | Path) -> str:
    """A verdict, a comparison or an explanation in a folder, for a terminal or a log."""
    data = DiagnosisData(Path(folder), document)
    verdict, heading = data.verdict, headline(document)
    if verdict is not None:
        heading = f"{verdict.verdict.replace('_', ' ').upper()}. {heading}"
    parts = [heading]
    if data.measurements:
        parts += [tables.effects_table(data).text(), tables.answers_table(data).text()]
        parts += [tables.parameters_table(data).text(), words.bound_sentence(data)]
        parts.append(words.worth_sentence(data))
        parts += [two_strengths(folder).text()]
    if verdict is None:
        parts += [table.text() for table in (tables.tests_table(data), tables.groups_table(data))]
        parts += [words.window_sentence(data.base.window, "base model"), _held_out(data)]
    parts += [
        table.text()
        for table in (
            tables.candidates_table(data),
            tables.refits_table(data),
            tables.left_out_table(data),
        )
    ]
    parts += [" ".join(words.confounding_sentences(data)), measurements_text(data.measurements)]
    if verdict is not None:
        parts += [tables.steps_table(verdict.steps).text(), words.validation_sentence(data)]
        parts.append(tables.next_table(verdict.next_measurement).text())
        parts.append(words.refuted_sentence(verdict))
        parts.append(tables.outcomes_table(words.foreseen(verdict)).text())
    parts.append(words.error_sentence(data))
    if document.runs.cut_short:
        skipped = ", ".join(document.runs.cut_short)
        parts.append(f"Skipped because the run budget was exhausted: {skipped}.")
    return "\n\n".join(plain(part) for part in parts if part)


def measurements_text(lines: Sequence) -> str:
    """Measured against modelled, the worst first; constructed data are left out."""
    surveyed = [line for line in lines if line.role != "constructed"]
    worst = ranked(surveyed, lambda line: abs(line.residual_base or 0.0))
    left = len(surveyed) - MOST_LINES
    more = "" if left <= 0 else f"\n... and {left} more with smaller residuals"
    return tables.measurements_table(worst[:MOST_LINES]).text() + more


def _held_out(data: DiagnosisData) -> str:
    held = data.base.held_out
    if not hasattr(data.document, "alarm"):
        return ""
    return f"Held out: chi2 {held.chi2:.1f} of {held.n} numbers." if held.n else "Held out: none."


# --- the page ---


def sections(data: DiagnosisData) -> list[PageSection]:
    """Every part that has something to show, in reading order."""
    made = [
        _answer(data),
        _profile(data),
        _where(data),
        _fall(data),
        _effects(data),
        _curve(data),
        _fingerprints(data),
        _confounding(data),
        _next(data),
        _strength(data),
        _hidden(data),
        _checklist(data),
        _made(data),
    ]
    return [section for section in made if section.parts]


def _answer(data: DiagnosisData) -> PageSection:
    from report.charts.overview import draw_overview

    caption = (
        "How far each measurement is off (of several numbers their root mean square), and the S_r "
        "that would suit it best if it were the only one."
    )
    if data.verdict is not None:
        caption += (
            " What explains the measurements, with the chance by slides whose truth is known; "
            "dashed: where S_r lay in nine of ten of those with this verdict."
        )
    parts = shown(
        draw_overview(data, data.folder / "overview.svg", data.folder / "overview.png"),
        "The diagnosis in one picture: how far each measurement is off, the S_r that it asks for, "
        f"what explains it, and the S_r that follows. {words.refuted_sentence(data.verdict)}",
        caption=caption,
        least_width_px=700,
    )
    skipped = len(data.document.runs.cut_short)
    remark = (
        f"The run budget was exhausted: {plural(skipped, 'step')} of the search "
        f"{'is' if skipped == 1 else 'are'} listed at the foot of the page."
    )
    sentences = [
        *words.answer_sentences(data),
        words.worth_sentence(data),
        words.bound_sentence(data),
        words.validation_sentence(data),
        words.tested_sentence(data),
        remark if skipped else "",
    ]
    return PageSection("In short", [tables.key_numbers(data), *parts, *said(sentences)])


def _profile(data: DiagnosisData) -> PageSection:
    from report.charts.profile import draw_profile

    title = "Measured against modelled"
    parts = shown(
        draw_profile(data, data.folder / "profile.svg"),
        "Measured and modelled surface, base model and model of the answer.",
        "The band is two total standard deviations (survey and model) on either side of the "
        "model: 95 % of the marks lie within it if the model is adequate.",
    )
    parts += shown(
        draw_profile(data, data.folder / "histories.svg", axis="time_s"),
        "Measured histories, base model and model of the answer.",
    )
    if any(m.predicted_base is not None for m in data.measurements):
        parts += said([words.role_sentence(data)])
        parts += folded("Every number", tables.measurements_table(data.measurements))
    return PageSection(title, parts)


def _where(data: DiagnosisData) -> PageSection:
    from report.charts.residuals import draw_residuals

    title = "Where it fails"
    if not data.measurements:
        return PageSection(title)
    parts = said(
        [words.alarm_sentence(data), words.window_sentence(data.base.window, "base model")]
    )
    if data.final is not None:
        parts += said([words.window_sentence(data.final.window, "model of the answer")])
    parts += shown(
        draw_residuals(data, data.folder / "residuals.svg"),
        "Standardised residuals with the worst stretch.",
        "Residuals: measured minus modelled, in total standard deviations; 95 % lie within the "
        "grey band if the model is adequate. Yellow: the worst stretch.",
    )
    numbers = tables.tests_table(data), tables.groups_table(data)
    return PageSection(title, [*parts, *folded("Tests and groups in numbers", *numbers)])


def _fall(data: DiagnosisData) -> PageSection:
    steps = [] if data.verdict is None else data.verdict.steps
    parts = _steps(data.folder, steps, ()) if len(steps) > 1 else []
    return PageSection("How far the error falls", parts)


def _steps(folder: Path, steps: Sequence[WaterfallStep], by_hand: Collection[str]) -> list[Part]:
    from report.charts.error_steps import draw_steps

    parts = shown(
        draw_steps(steps, folder / "steps.svg", by_hand=by_hand),
        "Bars of the error, one for each step, against the noise.",
        "Bar: root mean square residual of the fitted data, per degree of freedom; pale: that of "
        "the step before. Diamond: held-out data, which were not fitted. Dashed: noise alone, with "
        "its 95 % range.",
    )
    return parts + folded("Every step in numbers", tables.steps_table(steps, by_hand))


def _effects(data: DiagnosisData) -> PageSection:
    from report.charts.effects import draw_effects

    title = "Which effects would explain it"
    parts = shown(
        draw_effects(data, data.folder / "effects.svg"),
        "Bars of the expected and achieved reduction, one row for each effect.",
        candidate_sentence(data) if data.verdict else "",  # of an explanation it leads the page
        "Pale: the reduction of chi² expected from the score. Dark: the reduction after refitting "
        "parameters and amplitude. Next to the bar: the amplitude, and the probability that noise "
        "gives any of the candidates so high a score.",
    )
    if not parts:
        return PageSection(title)
    rivals = tables.answers_table(data)
    numbers = [
        tables.refits_table(data),
        tables.candidates_table(data),
        tables.left_out_table(data),
    ]
    return PageSection(
        title,
        [
            *parts,
            *(tabulated(rivals) if len(rivals.rows) > 1 else []),
            *folded("Scores, refits and what was not tested", *numbers),
        ],
    )


def _fingerprints(data: DiagnosisData) -> PageSection:
    from report.charts.fingerprints import draw_fingerprints

    parts = shown(
        draw_fingerprints(data, data.folder / "fingerprints.svg"),
        "Heat map of effects against measurements.",
        "What each effect would change in each measurement after refitting the parameters, every "
        "row on its own scale. An effect whose row resembles the residual explains it; cos is 1 if "
        "they are alike and 0 if they have nothing in common.",
    )
    return PageSection("Fingerprints", parts)


def _confounding(data: DiagnosisData) -> PageSection:
    from report.charts.confounding import draw_confounding

    parts = shown(
        draw_confounding(data, data.folder / "confounding.svg"),
        "Triangle of the similarity of each pair of effects.",
        *words.confounding_sentences(data),
        "Similarity of the fingerprints, |cos|, by pairs, with similar effects together; of many "
        "effects those that look most like another, the best scores first.",
    )
    return PageSection("What cannot be distinguished", parts)


def _strength(data: DiagnosisData) -> PageSection:
    title = "The strength before and after" if data.final is not None else "The strength"
    both = two_strengths(data.folder).parts()
    if data.verdict is None:
        return PageSection(title, both)
    told = [*said(words.strength_sentences(data)), *tabulated(tables.parameters_table(data))]
    return PageSection(title, [*told, *both])


def _hidden(data: DiagnosisData) -> PageSection:
    from report.charts.hidden import draw_hidden

    parts = shown(
        draw_hidden(data, data.folder / "hidden.svg"),
        "Bars of the shift that each undetected effect could cause.",
        words.hidden_sentence(data),
        "Each bar: the error of the calibrated value if this effect acted just too weakly to be "
        "detected with these data. Shown whatever the verdict.",
    )
    if parts:
        parts += folded("The same in numbers", tables.hidden_table(data))
    return PageSection("What could be hidden in it", parts)


def _curve(data: DiagnosisData) -> PageSection:
    title = "What the unknown effect looks like"
    if data.verdict is None or data.verdict.unknown_curve is None:
        return PageSection(title)
    from report.charts.strength_curve import draw_curve

    curve = data.verdict.unknown_curve
    parts = shown(
        draw_curve(curve, data.folder / "curve.svg"),
        "Multiplier of the strength with its band.",
        "No effect of the list passes. Of the variables that were tried, a strength that depends "
        f"on {curve.words} as drawn here would explain the measurements best. It is a clue to "
        "what is missing, not a law, and no residual strength is reported from it.",
    )
    return PageSection(title, parts)


def _next(data: DiagnosisData) -> PageSection:
    title = "What to measure next"
    found = [] if data.verdict is None else data.verdict.next_measurement
    error = "" if data.verdict is None else words.error_sentence(data)
    if not found:
        return PageSection(title, said([error]))
    see = (
        "Measurements that would best distinguish the remaining explanations, the best first. "
        "Gain: expected squared separation by it and all above it, in variances of the new "
        "measurements and of the models."
    )
    refuted = words.refuted_sentence(data.verdict)
    shown = [*tabulated(tables.next_table(found)), *said([refuted])]
    readings = tables.outcomes_table(words.foreseen(data.verdict))
    return PageSection(
        title,
        [*said([see]), *shown, *(tabulated(readings) if readings.rows else []), *said([error])],
    )


def _checklist(data: DiagnosisData) -> PageSection:
    table = checklist.diagnosis_checklist(data)
    if not table.rows:
        return PageSection(checklist.TITLE)
    return PageSection(checklist.TITLE, [*said([checklist.unchecked(table)]), *tabulated(table)])


def _made(data: DiagnosisData) -> PageSection:
    runs = data.document.runs
    now = "" if runs.computed is None else f", {runs.computed} of them simulated now"
    settings = folded("Runs, seeds, hashes, settings", tables.provenance_table(data))
    return PageSection(
        "How this was made", [*said([f"{runs.asked} forward runs{now}."]), *settings]
    )
