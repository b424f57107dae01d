"""Parts of pages that studies write are what their kept records make."""

from __future__ import annotations

import pytest

from benchmarks.generated_pages import around
from benchmarks.studies import hidden_sections, posterior_calibration, slide_widths, two_spacings
from inversion.posterior.calibration import Coverage
from pipeline.files import read_json, read_text


def widths(record):
    """The part of finished slides."""
    slides = record["slides"].values()
    return slide_widths.page([one for one in slides if "true" in one and "imitated" in one])


@pytest.mark.parametrize(
    ("study", "part", "made"),
    [
        (posterior_calibration, "ranks", posterior_calibration.table),
        (hidden_sections, "hidden_sections", hidden_sections.table),
        (two_spacings, "fidelity", lambda record: two_spacings.page(record)["fidelity"]),
        (two_spacings, "cells", lambda record: two_spacings.page(record)["cells"]),
        (slide_widths, "slides", widths),
    ],
)
def test_the_page_is_what_its_record_makes(study, part, made):
    before, after = around(study.PAGE, part)
    kept = read_text(study.PAGE)[len(before) : -len(after)]
    assert kept.strip() == made(read_json(study.RECORD)).strip()


def test_unknowns_outside_their_band_have_a_row_of_their_own():
    def share(covered):
        return [Coverage(nominal=0.5, covered=covered, low=0.4, high=0.6)]

    found = {"S_r": share(0.51), "a": share(0.42), "b": share(0.7), "c": share(0.58)}
    rows = posterior_calibration.coverage_rows(found, digits=0)
    assert rows[:2] == ["| S_r | 51 % |", "| b | 70 % (outside) |"]
    assert rows[2] == "| 2 others, least to most | 42 to 58 % |"


def test_groups_that_agree_are_joined():
    def group(name, numbers, rms, largest, beyond=0):
        return {"group": name, "numbers": numbers, "rms": rms, "largest": largest, "beyond": beyond}

    groups = [group("answer", 2, 0.1, 0.2), group("x", 1, 0.3, 0.3), group("y", 3, 0.1, 0.2)]
    *shown, others = two_spacings.shown_groups([*groups, group("far", 6, 0.4, 0.9, 1)])
    assert [one["group"] for one in shown] == ["answer", "far"]
    assert others["numbers"] == 4 and others["largest"] == 0.3
    assert others["rms"] == pytest.approx((0.12 / 4) ** 0.5)
