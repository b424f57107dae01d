"""The report of a posterior: one page, its pictures, and the text of a terminal.

In: a folder with `posterior.json` and `posterior.nc`. Out: `report.html`, and each picture as a
file of its own.
"""

from __future__ import annotations

from pathlib import Path

from inversion.engines.registry import engine_named
from inversion.posterior.document import PosteriorDocument, PredictedNumber, load_posterior
from inversion.posterior.draws import Draws, load_draws
from report.charts.corner import draw_corner
from report.charts.hidden_section import draw_hidden_section
from report.charts.posterior import draw_before_after, draw_predicted, draw_shares
from report.numbers import number, plural, with_unit
from report.page import PageSection, folded, said, shown, tabulated, write_page
from report.sentences.small_cells import cells_words
from report.table import plain
from report.tables import posterior as tables

PAGE = "report.html"
#: Least distance of a prediction from what was measured that a sentence mentions, in std.
FAR = 2.0


def write_report(folder: str | Path) -> Path:
    """Write page and pictures of a posterior into its folder; the page."""
    folder = Path(folder)
    document, draws = load_posterior(folder), load_draws(folder)
    page = folder / PAGE
    lead = f"{answer_sentence(document)} {misfit_sentence(document)} {_by(document)}".strip()
    write_page(page, f"{document.title}: posterior", _sections(document, draws, folder), lead=lead)
    return page


def summary(document: PosteriorDocument) -> str:
    """The answer for a terminal or a log."""
    coarse = document.coarse_spacing_m
    runs, of = document.runs, f" with coarse runs at {coarse:g} m" if coarse else ""
    by = engine_named(document.engine).said
    of += f" {by}" if by else ""
    heading = (
        f"{document.title}: posterior at {document.spacing_m:g} m{of}, measurements "
        f"{document.measurement_set!r}\n{_runs_words(document)}; "
        f"{runs.simulated_now} simulated now, {sum(document.timings.values()):.0f} s"
    )
    parts = [
        heading,
        tables.parameter_table(document).text(),
        tables.predicted_table(document).text(without=["before the data"]),
        *(table.text() for table in tables.share_tables(document)),
        tables.nuisance_table(document).text(without=["prior"]),
        tables.confirmation_table(document).text() if document.confirmation else "",
        "\n".join(map(plain, [evidence_sentence(document), *_cells(document), *document.remarks])),
    ]
    return "\n\n".join(part for part in parts if part)


def _cells(document: PosteriorDocument) -> list[str]:
    """What the cells make of its strengths."""
    cells = document.small_cells
    return [] if cells is None or not cells.known else [cells_words(cells)]


def _by(document: PosteriorDocument) -> str:
    by = engine_named(document.engine).said
    return f"Predicted {by}." if by else ""


def answer_sentence(document: PosteriorDocument) -> str:
    """Every parameter with its 95 % interval, a strength with its ratio."""
    parts = []
    for one in document.parameters:
        low, high = one.after.interval_95
        ratio = ""
        if one.strength_kpa is not None:
            lower, upper = one.strength_kpa.interval_95
            mean = number(one.strength_kpa.median)
            ratio = f" (mean S_r {mean} kPa, {number(lower)} to {number(upper)})"
        elif one.ratio is not None:
            lower, upper = one.ratio.interval_95
            ratio = f" (S_r/σ'_v0 = {one.ratio.median:.3f}, {lower:.3f} to {upper:.3f})"
        value = with_unit(one.after.median, one.unit)
        within = f"95 % between {number(low)} and {with_unit(high, one.unit)}"
        parts.append(f"{one.label}: {value}, {within}{ratio}")
    return f"{'; '.join(parts)}."


def misfit_sentence(document: PosteriorDocument) -> str:
    """What the posterior does not predict within its own and the survey's errors."""
    far = [
        f"{one.name} (measured {'< ' * one.censored}{with_unit(one.measured, one.unit)}, predicted "
        f"{with_unit(one.after.mean, one.unit)})"
        for one in document.numbers
        if one.role != "constructed" and _off(one) > FAR
    ]
    return f"Not reproduced: {', '.join(far)}." if far else ""


def _off(one: PredictedNumber) -> float:
    """How far a prediction is from what was measured [std]; 0 while a limit is kept."""
    return max(-one.difference_in_std, 0.0) if one.censored else abs(one.difference_in_std)


def evidence_sentence(document: PosteriorDocument) -> str:
    """Evidence and information."""
    found = document.evidence
    return (
        f"Evidence of this model: ln Z = {found.log_evidence:.2f} ± {found.log_evidence_std:.2f}; "
        f"the data narrow what was known by {found.information_nats:.1f} nats."
    )


def _runs_words(document: PosteriorDocument) -> str:
    runs = document.runs
    found = f"{runs.coarse} runs over the whole prior, {runs.refined} where the posterior is"
    if runs.fine:
        found += f", {plural(runs.fine, 'pair')} of a coarse and a fine run there"
    return f"{found}; {plural(runs.failed, 'run')} could not be read" if runs.failed else found


def _sections(document: PosteriorDocument, draws: Draws, folder: Path) -> list[PageSection]:
    shares = draw_shares(document, folder / "shares.svg")
    made = [
        PageSection(
            "Answer",
            [
                *tabulated(tables.parameter_table(document)),
                *shown(
                    draw_corner(document, draws, folder / "corner.png"),
                    "Histograms of the parameters and joint densities of each pair.",
                    "Each panel off the diagonal shows two unknowns together: regions with 50, 80 "
                    "and 95 % of the probability. On the diagonal each of them alone: filled, "
                    "after the data; line, before.",
                ),
                *said([evidence_sentence(document)]),
            ],
        ),
        PageSection(
            "Measured against predicted",
            [
                *shown(
                    draw_predicted(document, draws, folder / "predicted.svg"),
                    "Distribution of each measured number before and after the data.",
                    misfit_sentence(document),
                    "Grey: as predicted from the prior. Coloured: from the posterior, errors of "
                    "the model included. The line is what was measured, with one standard "
                    "deviation of the survey to either side. Held-out and compared numbers took "
                    "no part in the fit.",
                ),
                *tabulated(tables.predicted_table(document)),
            ],
        ),
        PageSection(
            "What moves the strength",
            [
                *shown(
                    shares,
                    "Bars of the shares of the posterior variance, one row for each input.",
                    "Dark: the share of the posterior variance of the logarithm of the strength "
                    "(of an angle: of the angle) that would go if this became known (first order). "
                    "Pale: the share that would stay if everything else did (total). Shares of "
                    "inputs that depend on each other need not add up to 1.",
                ),
                *folded("The same in numbers", *tables.share_tables(document)),
            ],
        ),
        PageSection(
            "Sections",
            [
                *shown(
                    draw_hidden_section(document, draws, folder / "sections.svg"),
                    "Outlines of sections before and after the data.",
                    "Nobody drew the section: it is unknown as its dimensions are. Each outline "
                    "is one that these allow, shaded where it liquefied; the line at the left is "
                    "the measured toe. Below, each dimension with where its numbers come from.",
                )
            ],
        ),
        PageSection(
            "Before and after",
            [
                *shown(
                    draw_before_after(document, folder / "before_after.svg"),
                    "Bars before and after the data for each unknown.",
                    "Pale: 95 % before the data; dark: 95 % after; the tick is the median.",
                ),
                *tabulated(tables.unknown_table(document)),
            ],
        ),
        PageSection(
            "How it was made",
            [
                *said([f"{_runs_words(document)}.", *document.remarks]),
                *tabulated(
                    tables.emulator_table(document),
                    tables.other_ways_table(document),
                    tables.confirmation_table(document),
                ),
            ],
        ),
    ]
    return [section for section in made if section.parts]
