"""The page of a diagnosis: one file that needs no other, with its pictures beside it.

In: a folder with `verdict.json` (or `compare.json`, `explain.json`) and perhaps `sections.npz`.
Out: `report.html` (`compare.html`, `explain.html`, `track.html`) and each picture as a file of its
own. The verdict comes first, then what it rests on, and what remains unknown. A part that has
nothing to show is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from diagnosis.verdict.verdict import COMPARE_FILE, EXPLAIN_FILE, FILE_NAME, WaterfallStep
from report.diagnosis import sentences as words
from report.diagnosis import tables as tables
from report.diagnosis.data import ReportData, load_report
from report.page import Folded, KeyNumbers, Paragraph, Picture, Section, Table, write_page
from report.two_strengths import two_strengths_parts

PAGE, COMPARE_PAGE, EXPLAIN_PAGE, TRACK_PAGE = (
    "report.html", "compare.html", "explain.html", "track.html"
)  # fmt: skip
WIDEST_PX = 620
"""Charts are made for a phone; on a desk they are not blown up further."""
Part = Paragraph | Table | Picture | KeyNumbers | Folded


def write_report(folder: str | Path) -> Path:
    """Write the page of a verdict, with its pictures beside it.

    Args:
        folder: with `verdict.json`.

    Returns:
        The page.

    Raises:
        InputError: no verdict, or a file that cannot be read; one line.
    """
    return _write(load_report(folder, FILE_NAME), PAGE, "missing physics")


def write_compare(folder: str | Path) -> Path:
    """The smaller page of `compare`: is the base model adequate, and where does it fail?"""
    return _write(load_report(folder, COMPARE_FILE), COMPARE_PAGE, "model against measurements")


def write_explain(folder: str | Path) -> Path:
    """The smaller page of `explain`: ranked effects, what looks alike, what could hide."""
    return _write(load_report(folder, EXPLAIN_FILE), EXPLAIN_PAGE, "which effect could be missing")


def write_track(
    folder: str | Path, title: str, steps: Sequence[WaterfallStep], *, by_hand: Collection[str] = ()
) -> Path:
    """The page of `track`: the error over the steps so far, those of a person marked.

    Args:
        folder: page and picture are written there.
        title: of the case.
        steps: models in the order in which they were made.
        by_hand: names of the models that a person has added.
    """
    folder = Path(folder)
    page = folder / TRACK_PAGE
    count = len(steps)
    lead = f"{count} model{'' if count == 1 else 's'} so far."
    if count > 1:
        fall = [
            words.root_mean_square(step.chi2, max(step.dof, 1)) for step in (steps[0], steps[-1])
        ]
        lead += (
            f" Root mean square misfit of the fitted data: {fall[0]:.1f} standard deviations by "
            f"the first, {fall[1]:.1f} by the last; noise alone has 1."
        )
    section = Section("The error over the steps", _steps(folder, steps, by_hand))
    write_page(page, f"{title}: the error so far", [section] if steps else [], lead=lead)
    return page


def _write(data: ReportData, name: str, about: str) -> Path:
    page = data.folder / name
    write_page(page, f"{data.document.title}: {about}", sections(data), lead=words.lead(data))
    return page


def sections(data: ReportData) -> list[Section]:
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
        _made(data),
    ]
    return [section for section in made if section.parts]


def _answer(data: ReportData) -> Section:
    told = [
        *words.answer_sentences(data),
        words.fall_sentence(data),
        words.transfer_sentence(data),
        words.tested_sentence(data),
    ]
    return Section("In short", [tables.key_numbers(data), *_said(told), *_remarks(data)])


def _remarks(data: ReportData) -> list[Part]:
    if not data.document.runs.cut_short:
        return []
    count = len(data.document.runs.cut_short)
    told = (
        f"The allowance of forward runs ended before all was done: {count} "
        f"step{'' if count == 1 else 's'} of the search {'is' if count == 1 else 'are'} listed "
        "at the foot of the page."
    )
    return [Paragraph(told)]


def _profile(data: ReportData) -> Section:
    from report.charts.profile import draw_profile

    title = "Measured against modelled"
    path = draw_profile(data, data.folder / "profile.svg")
    parts: list[Part] = []
    if path is not None:
        see = (
            "The band is two total standard deviations (survey and model) to either side of the "
            "model: where the model lacks nothing, 95 of 100 marks lie within it."
        )
        parts += [
            Paragraph(see),
            _picture(path, "Measured and modelled surface, base model and model of the answer."),
        ]
    path = draw_profile(data, data.folder / "histories.svg", axis="time_s")
    if path is not None:
        parts.append(_picture(path, "What was measured in time, base model and model after."))
    parts += _single_numbers(data)
    if not parts:
        return Section(title)
    parts += _said([words.role_sentence(data)])
    parts += _folded("Every number", tables.measurements_table(data))
    return Section(title, parts)


def _single_numbers(data: ReportData) -> list[Part]:
    from report.charts.residuals import draw_singles

    path = draw_singles(data, data.folder / "singles.svg")
    if path is None:
        return []
    picture = _picture(path, "Single measurements: residuals before and after.")
    return [picture, *tables.singles_table(data)]


def _where(data: ReportData) -> Section:
    from report.charts.residuals import draw_groups, draw_residuals

    parts: list[Part] = []
    if data.measurements:
        told = [words.alarm_sentence(data), words.window_sentence(data.base.window, "base model")]
        if data.final is not None:
            told.append(words.window_sentence(data.final.window, "model of the answer"))
        parts += _said(told)
        path = draw_residuals(data, data.folder / "residuals.svg")
        if path is not None:
            see = (
                "Residuals: measured minus modelled, in total standard deviations; within the "
                "grey band lie 95 of 100 when the model lacks nothing. Yellow: the worst stretch."
            )
            parts += [Paragraph(see), _picture(path, "Standardised residuals with the worst part.")]
        path = draw_groups(data, data.folder / "groups.svg")
        if path is not None:
            see = (
                "By measurement: how far the sum of squared residuals lies above that of noise, in "
                "standard deviations of noise (in brackets: how many numbers were fitted)."
            )
            parts += [Paragraph(see), _picture(path, "Bars of the misfit of each measurement.")]
        numbers = [*tables.tests_table(data), *tables.groups_table(data)]
        parts += _folded("Tests and groups in numbers", numbers)
    return Section("Where it fails", parts)


def _fall(data: ReportData) -> Section:
    if data.verdict is None or len(data.verdict.steps) < 2:
        return Section("How far the error falls")
    return Section("How far the error falls", _steps(data.folder, data.verdict.steps, ()))


def _steps(folder: Path, steps: Sequence[WaterfallStep], by_hand: Collection[str]) -> list[Part]:
    from report.charts.error_steps import draw_steps

    path = draw_steps(steps, folder / "steps.svg", by_hand=by_hand)
    if path is None:
        return []
    see = (
        "Bar: root mean square residual of the fitted data, per degree of freedom; pale: that of "
        "the step before. Diamond: held-out data, which no fit has seen. Dashed: noise alone, with "
        "the range of 95 of 100 data sets."
    )
    return [
        Paragraph(see),
        _picture(path, "Bars of the error, one for each step, against the noise."),
        *_folded("Every step in numbers", tables.steps_table(steps, by_hand)),
    ]


def _effects(data: ReportData) -> Section:
    from report.charts.effects import draw_effects

    path = draw_effects(data, data.folder / "effects.svg")
    if path is None:
        return Section("Which effects would explain it")
    see = (
        "Pale: the fall of chi² that the score promises. Dark: the fall when parameters and "
        "amplitude were fitted anew. Beside the bar: the amplitude, and the chance that noise "
        "gives any of the candidates so high a score."
    )
    numbers = [
        *tables.refits_table(data), *tables.candidates_table(data), *tables.left_out_table(data)
    ]  # fmt: skip
    parts: list[Part] = [
        *_said([words.candidate_sentence(data)]),
        Paragraph(see),
        _picture(path, "Bars of the expected and achieved fall, one row for each effect."),
        *tables.answers_table(data),
        *_folded("Scores, refits and what was not tested", numbers),
    ]
    return Section("Which effects would explain it", parts)


def _fingerprints(data: ReportData) -> Section:
    from report.charts.fingerprints import draw_fingerprints

    path = draw_fingerprints(data, data.folder / "fingerprints.svg")
    if path is None:
        return Section("Fingerprints")
    see = (
        "What each effect would change in each measurement once the parameters have imitated all "
        "they can, every row on its own scale. An effect whose row looks like the residual "
        "explains it; cos is 1 where they are alike and 0 where they have nothing in common."
    )
    return Section(
        "Fingerprints",
        [Paragraph(see), _picture(path, "Heat map of effects against measurements.")],
    )


def _confounding(data: ReportData) -> Section:
    from report.charts.confounding import draw_confounding

    title = "What cannot be told apart"
    path = draw_confounding(data, data.folder / "confounding.svg")
    if path is None:
        return Section(title)
    see = "Likeness of the fingerprints, |cos|, for every pair; like stands beside like."
    return Section(
        title,
        [*_said([*words.confounding_sentences(data), see]),
         _picture(path, "Triangle of the likeness of each pair of effects.")],
    )  # fmt: skip


def _strength(data: ReportData) -> Section:
    from report.charts.strength import draw_strength

    if data.verdict is None:
        return Section("The strength by two questions", two_strengths_parts(data.folder))
    path = draw_strength(data, data.folder / "strength.svg")
    picture = _picture(path, "Each parameter with two standard deviations, before and after.")
    title = "The strength before and after" if data.final is not None else "The strength"
    beside = two_strengths_parts(data.folder)
    return Section(title, [*_said(words.strength_sentences(data)), picture, *beside])


def _hidden(data: ReportData) -> Section:
    from report.charts.strength import draw_hidden

    path = draw_hidden(data, data.folder / "hidden.svg")
    if path is None:
        return Section("What could be hidden in it")
    see = (
        "Each bar: how far the calibrated value would be off if this effect acted just too weakly "
        "to be found with these data, and nobody knew. Shown whatever the verdict."
    )
    parts: list[Part] = [
        *_said([words.hidden_sentence(data), see]),
        _picture(path, "Bars of the shift that each undetected effect hides."),
        *_folded("The same in numbers", tables.hidden_table(data)),
    ]
    return Section("What could be hidden in it", parts)


def _curve(data: ReportData) -> Section:
    title = "What the unknown effect looks like"
    if data.verdict is None or data.verdict.unknown_curve is None:
        return Section(title)
    from report.charts.strength_curve import draw_curve

    curve = data.verdict.unknown_curve
    path = draw_curve(curve, data.folder / "curve.svg")
    see = (
        f"No effect of the list passes. A strength that depends on {curve.words} as drawn here "
        "would explain the measurements best among the variables that were tried. It is a clue to "
        "what is missing, not a law, and no residual strength is reported from it."
    )
    return Section(
        title, [Paragraph(see), _picture(path, "Multiplier of the strength with its band.")]
    )


def _next(data: ReportData) -> Section:
    found = tables.next_table(data)
    if not found:
        return Section("What to measure next")
    see = (
        "Measurements that would best tell the surviving explanations apart, the best first. Gain: "
        "expected squared separation, in variances of the new measurement and of the models."
    )
    return Section("What to measure next", [Paragraph(see), *found])


def _made(data: ReportData) -> Section:
    runs = data.document.runs
    now = "" if runs.computed is None else f", {runs.computed} of them simulated now"
    told = f"{runs.asked} forward runs{now}."
    numbers = tables.made_tables(data)
    return Section(
        "How this was made", [Paragraph(told), *_folded("Runs, seeds, hashes, settings", numbers)]
    )


def _picture(path: Path, description: str) -> Picture:
    return Picture(path, description, most_width_px=WIDEST_PX)


def _said(sentences: Sequence[str]) -> list[Part]:
    return [Paragraph(sentence) for sentence in sentences if sentence]


def _folded(title: str, found: list[Table]) -> list[Part]:
    return [Folded(title, found)] if found else []
