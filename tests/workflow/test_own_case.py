"""A folder made by `flowslide new` is a target like those that ship."""

from __future__ import annotations

from pathlib import Path

import pytest

from flowslide.command_line import main

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


@pytest.mark.slow
def test_a_new_case_is_a_target(bench):
    folder = bench.folder / "case_histories" / "road_embankment"
    section, survey = EXAMPLES / "road_embankment.csv", EXAMPLES / "road_embankment_after.csv"
    main(["new", str(folder), "--section", str(section), "--profile", str(survey)])
    assert bench.planned("invert_road_embankment") == {"invert_case": 1, "classical_case": 1}
    assert bench.planned("simulate_road_embankment") == {"simulate_case": 1}


@pytest.mark.slow
def test_a_slide_from_numbers_enters_a_relation_by_its_posterior(bench):
    numbers = EXAMPLES / "lower_san_fernando_dimensions.yaml"
    main(["new", str(bench.folder / "case_histories" / "few"), "--dimensions", str(numbers)])
    bench.settings["joint"] = {"cases": ["lower_san_fernando", "few"]}
    assert bench.planned("joint") == {
        "classical_case": 1, "invert_case": 1, "diagnose_case": 1, "posterior_case": 1, "joint": 1,
    }  # fmt: skip
    assert bench.planned("invert_few") == {"invert_case": 1}
    jobs = bench.planned("everything")
    assert (jobs["posterior_case"], jobs["invert_case"], jobs["diagnose_case"]) == (1, 1, 1)
