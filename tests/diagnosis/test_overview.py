"""The one picture of a diagnosis: its numbers are those of the document, and nothing overlaps."""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from diagnosis.track_record import worth_of
from diagnosis.verdict.verdict import Verdict
from report.charts.overview import overview_figure, shown_range
from report.data.diagnosis import DiagnosisData, Document
from report.data.overview import MOST_MEASUREMENTS, Overview, overview
from report.sentences.diagnosis import refuted_sentence
from tests.diagnosis.verdict_case import (
    STRENGTH,
    adequate,
    ambiguous,
    compared,
    explained,
    identified,
    least,
    unknown,
)

LONG = "settlement of the crest above the old river channel at the second marker"


def data_of(document: Document) -> DiagnosisData:
    return DiagnosisData(Path(), document)


def rows_of(document: Document) -> Overview:
    return overview(data_of(document))


def with_measurements(count: int) -> Verdict:
    """A verdict with so many measurements of one number each, and long names."""
    found = ambiguous()
    single = [m for m in found.measurements if m.measurement == "crest"][0]
    lines, asked = [], [one for one in found.base.asked if one.measurement == "crest"][0]
    for number in range(count):
        off = {"residual_base": 0.3 * number - 9.0, "residual_final": math.sin(number)}
        name = {"name": f"{number} {LONG}", "measurement": f"{number} {LONG}"}
        lines.append(single.model_copy(update={**name, **off}))
    every = [asked.model_copy(update={"measurement": line.name}) for line in lines]
    stages = {
        key: getattr(found, key).model_copy(update={"asked": every}) for key in ("base", "final")
    }
    return found.model_copy(update={"measurements": lines, **stages})


def with_two_strengths() -> Verdict:
    """A verdict that seeks two strengths, of which the second is like the first."""
    made = ambiguous().model_dump(mode="json")
    made["parameters"].append({**made["parameters"][0], "name": "second", "words": "S_r of a clay"})
    stages = [made["base"], made["final"]]
    for stage in stages:
        stage["asked"] += [{**one, "parameter": "second"} for one in stage["asked"]]
    sets = [*made["answer"]["set_90"], *made["quoted"][STRENGTH]["models"]]
    for one in [*stages, *sets]:
        for key in ("values", "interval_95"):
            one[key]["second"] = one[key][STRENGTH]
    made["quoted"]["second"] = made["quoted"][STRENGTH]
    return Verdict.model_validate(made)


def as_bound() -> Verdict:
    """A slope that stood: a lower bound is all that is quoted."""
    found = adequate()
    used = found.quoted[STRENGTH].model_copy(update={"at_least": 18.0})
    return found.model_copy(update={"quoted": {STRENGTH: used}})


# --- its numbers ---


def test_residuals_are_those_of_the_document_by_measurement_and_role():
    found = identified()
    rows = rows_of(found).measurements
    assert {(row.name, row.role) for row in rows} == {
        (m.measurement, m.role) for m in found.measurements if m.role != "constructed"
    }
    for row in rows:
        own = [m for m in found.measurements if (m.measurement, m.role) == (row.name, row.role)]
        assert row.off == [[m.residual_base for m in own], [m.residual_final for m in own]]
        squares = [m.residual_base**2 for m in own]
        assert row.sizes[0] == pytest.approx(math.sqrt(np.mean(squares)))
    assert all(len(row.off) == 1 for row in rows_of(compared()).measurements), "there is no after"


def test_what_a_measurement_asks_for_is_that_of_the_document():
    found = identified()
    for row in rows_of(found).measurements:
        before, after = row.asked[STRENGTH]
        for stage, asked in ((found.base, before), (found.final, after)):
            own = [
                one for one in stage.asked if (one.measurement, one.role) == (row.name, row.role)
            ]
            assert asked == (None if not own else (own[0].value, *own[0].interval_95))


def test_all_measurements_are_counted_where_there_is_no_room_for_each():
    found = with_measurements(60)
    *rows, others = rows_of(found).measurements
    assert len(rows) == MOST_MEASUREMENTS and others.joined == 60 - MOST_MEASUREMENTS
    numbers = [off for row in [*rows, others] for off in row.off[0]]
    assert sorted(numbers) == sorted(m.residual_base for m in found.measurements)
    assert min(row.sizes[0] for row in rows) >= max(map(abs, others.off[0])), "the worst are shown"
    assert len(rows_of(with_measurements(3)).measurements) == 3


def test_the_chance_of_an_answer_is_shared_by_its_explanations():
    found = ambiguous()
    *named, base, other = rows_of(found).explanations
    shares = [one.probability for one in found.answer.set_90]
    assert [row.names for row in named] == [one.names for one in found.answer.set_90]
    for row, one in zip(named, found.answer.set_90, strict=True):
        assert row.chance == pytest.approx(found.answer.chance * one.probability / sum(shares))
        assert row.strengths[STRENGTH] == (one.values[STRENGTH], *one.interval_95[STRENGTH])
    assert base.chance is None and base.note == "its tests fail"
    assert sum(row.chance for row in [*named, other]) == pytest.approx(1.0)
    middle = math.sqrt(math.prod(found.quoted[STRENGTH].intervals["95%"]))
    span = worth_of("ambiguous").span(middle)
    assert other.strengths[STRENGTH] == (None, *span)


@pytest.mark.parametrize("made", [adequate, unknown])
def test_where_nothing_explains_the_record_says_how_often_something_was_hidden(made):
    found = made()
    base, other = rows_of(found).explanations[-2:]
    worth = worth_of(found.verdict)
    assert other.chance == pytest.approx(worth.hidden / worth.slides)
    assert base.chance == pytest.approx(1.0 - other.chance)
    assert base.strengths[STRENGTH] == (
        found.base.values[STRENGTH],
        *found.base.interval_95[STRENGTH],
    )


def test_what_was_tried_in_vain_has_its_strength_and_no_chance():
    found, tried = unknown(), ambiguous().answer.set_90
    used = found.quoted[STRENGTH].model_copy(update={"models": tried})
    found = found.model_copy(update={"quoted": {STRENGTH: used}})
    named = rows_of(found).explanations[:-2]
    assert {tuple(row.names) for row in named} == {tuple(one.names) for one in tried}
    assert all(row.chance is None and row.note == "does not suffice" for row in named)
    assert all(row.strengths for row in named)


def test_a_chance_that_is_not_known_is_not_drawn():
    found = identified()
    answer = found.answer.model_copy(update={"chance": None})
    rows = rows_of(found.model_copy(update={"answer": answer})).explanations
    assert all(row.chance is None for row in rows)
    bound = rows_of(as_bound())
    assert all(row.chance is None for row in bound.explanations), "none on record stood still"
    assert bound.bands[STRENGTH] == (18.0, math.inf)
    written = [text for text, _ in texts(as_bound())]
    assert written.count("no chance known") == 2


def test_the_band_is_what_is_quoted_and_on_the_axis():
    for found in (identified(), unknown(), adequate()):
        shown = rows_of(found)
        assert shown.bands[STRENGTH] == found.quoted[STRENGTH].intervals["95%"]
        low, high = shown_range(shown, STRENGTH)
        assert low <= shown.bands[STRENGTH][0] < shown.bands[STRENGTH][1] <= high
    base = compared().base.interval_95[STRENGTH]
    assert rows_of(compared()).bands[STRENGTH] == base


# --- its looks ---


def texts(document: Document) -> list[tuple[str, Bbox]]:
    """What is written, and where, in pixels; and that all of it is within the picture."""
    figure = overview_figure(data_of(document))
    figure.canvas.draw()
    for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)):
        low, high = sorted(axis.get_view_interval())
        for tick in axis.get_major_ticks():  # matplotlib draws none beyond the ends
            tick.set_visible(low <= tick.get_loc() <= high)
            tick.label1.set_visible(tick.get_visible())
    found = []
    for one in figure.findobj(Text):
        box = one.get_window_extent()
        if one.get_visible() and one.get_text().strip() and box.width > 0:
            found.append((one.get_text(), box))
            assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, one.get_text()
            assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1, one.get_text()
    return found


@pytest.mark.parametrize(
    "made",
    [
        identified, adequate, ambiguous, unknown, least, compared, with_two_strengths, as_bound,
        lambda: with_measurements(3), lambda: with_measurements(60),
    ],
)  # fmt: skip
def test_no_text_overlaps_another_or_is_cut(made):
    found = texts(made())
    assert found
    for (one, a), (other, b) in combinations(found, 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        up = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert across <= 1.0 or up <= 2.5, (one, other)


def test_how_it_could_be_refuted_is_written_under_it():
    written = " ".join(text for text, _ in texts(ambiguous()))
    sentence = refuted_sentence(ambiguous())
    assert sentence and " ".join(sentence.split()) in " ".join(written.split())


def test_a_document_without_measurements_and_explanations_has_no_picture():
    assert overview_figure(data_of(explained())) is None
