"""Errors of the survey as candidates: what they move, and where they make no sense."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from diagnosis.case import diagnosis_case
from diagnosis.hypotheses import section
from diagnosis.hypotheses.survey import survey_errors
from geometry.case import load_case
from inversion.problem.question import ZoneBoundary
from pipeline.cli import InputError

TOP = {"name": "Top of the sand", "kind": "zone_boundary",
       "vertices": [{"at": [10.0, 5.0], "move": [2.0, 1.0]},
                    {"at": [44.0, 5.0], "move": [0.0, 1.0]}]}  # fmt: skip


def errors_of(folder) -> tuple[list[str], dict]:
    targets = diagnosis_case(load_case(folder)).setup.targets
    return targets.names, {error.candidate.name: error for error in survey_errors(targets)}


def test_a_shifted_datum_lifts_every_elevation_and_nothing_else(embankment):
    names, errors = errors_of(embankment)
    change = dict(zip(names, errors["datum_shift"].direction, strict=True))
    assert change["toe"] == 0.0 and change["toe in time at 3 s"] == 0.0
    assert change["surface at x 40 m"] == change["surface at x -6.27 m"] == 1.0
    assert change["marker 1 dx"] == 0.0 and change["marker 1 dy"] == 1.0
    candidate = errors["datum_shift"].candidate
    assert candidate.free and candidate.family == "survey" and candidate.two_signed
    assert candidate.ladder == (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # the survey's std is 0.5 m
    assert (candidate.low, candidate.high) == (-2.0, 2.0)


def test_a_tilt_lifts_one_end_and_lowers_the_other(embankment):
    names, errors = errors_of(embankment)
    change = dict(zip(names, errors["datum_tilt"].direction, strict=True))
    assert change["surface at x 40 m"] == 1.0 and change["surface at x -33.26 m"] == -1.0
    middle = 0.5 * (40.0 - 33.26)
    assert change["marker 2 dy"] == pytest.approx((18.0 - middle) / (40.0 - middle))
    assert change["marker 2 dx"] == change["toe"] == 0.0


def test_a_crest_falls_by_the_datum_and_a_freeboard_knows_none(embankment):
    path = embankment / "measurements.yaml"
    document = yaml.safe_load(path.read_text())
    about = {"std_m": 0.5, "confidence": "published", "source": "a test"}
    document["sets"]["survey"] += [
        {"name": "crest", "type": "crest_settlement", "at": "initial_crest_x", "x_m": 29.0,
         "value_m": 5.0, **about},
        {"name": "board", "type": "freeboard", "water_level_m": 3.0, "value_m": 1.0, **about},
    ]  # fmt: skip
    path.write_text(yaml.safe_dump(document))
    names, errors = errors_of(embankment)
    change = dict(zip(names, errors["datum_shift"].direction, strict=True))
    assert change["crest"] == -1.0 and change["board"] == 0.0


def test_few_elevations_have_no_datum(root):
    case = diagnosis_case(
        load_case(root / "case_histories" / "lower_san_fernando_paper"), spacing_m=4
    )
    # Its profile is constructed; a crest alone is what the crest's own std is for.
    assert survey_errors(case.setup.targets) == []


def test_a_boundary_moves_in_standard_deviations(embankment):
    setup = diagnosis_case(load_case(embankment)).setup
    scene = setup.scene
    (place,), left_out = section.assumptions(setup, [ZoneBoundary(**TOP)])
    candidate = place.candidate
    assert candidate.name == "boundary_top_of_the_sand" and not left_out
    assert (candidate.prior_mean, candidate.prior_std, candidate.free) == (0.0, 1.0, False)
    assert candidate.ladder == (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)
    sand = place.change(setup, 1.5).scene.zones[0]
    assert (13.0, 6.5) in sand.polygon and (44.0, 6.5) in sand.polygon
    assert np.array_equal(scene.zones[0].polygon[2], (44.0, 5.0))


def test_a_boundary_is_bounded_by_what_there_is_a_section_for(embankment):
    setup = diagnosis_case(load_case(embankment)).setup
    high = {**TOP, "vertices": [{"at": [44.0, 5.0], "move": [0.0, -3.0]}]}
    (place,), _ = section.assumptions(setup, [ZoneBoundary(**high)])
    # At +2 the vertex lies below the ground, at -1 on the surface of the fill.
    assert place.candidate.ladder == (-0.5, 0.5, 1.0)
    assert (place.candidate.low, place.candidate.high) == (-0.5, 1.0)
    one_way = {**TOP, "sides": "minus"}
    (place,), _ = section.assumptions(setup, [ZoneBoundary(**one_way)])
    assert place.candidate.ladder == (-2.0, -1.0, -0.5)
    assert (place.candidate.low, place.candidate.high) == (-2.0, 0.0)
    far = {**TOP, "vertices": [{"at": [44.0, 5.0], "move": [0.0, -99.0]}], "sides": "plus"}
    assert section.assumptions(setup, [ZoneBoundary(**far)]) == (
        [],
        {"boundary_top_of_the_sand": "at 1 m spacing no section has it moved"},
    )
    wrong = {**TOP, "vertices": [{"at": [99.0, 5.0], "move": [0.0, 1.0]}]}
    with pytest.raises(InputError, match="no zone has a vertex at"):
        section.assumptions(setup, [ZoneBoundary(**wrong)])
