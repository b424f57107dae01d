"""Blow counts of a case: the file, and what is refused."""

from __future__ import annotations

import pytest
import yaml

from geometry.case import load_case
from geometry.survey.blow_counts import FILE_NAME, load_blow_counts
from pipeline.cli import InputError

GIVEN = {"confidence": "published", "source": "a boring"}


def written(folder, *layers: dict) -> None:
    (folder / FILE_NAME).write_text(
        yaml.safe_dump({"layers": [{**GIVEN, **layer} for layer in layers]})
    )


@pytest.fixture
def section(make_scene):
    return make_scene([[(0.0, 0.0), (10.0, 0.0), (5.0, 5.0)]], ground=[[-9.0, 0.0], [20.0, 0.0]])


def test_every_zone_of_a_layer_has_its_count(section, tmp_path):
    assert load_blow_counts(tmp_path, section) == {}
    (zone,) = [zone.name for zone in section.zones]
    written(tmp_path, {"zones": [zone], "n1_60": 11.5})
    count = load_blow_counts(tmp_path, section)[zone]
    assert count.of_kind(False) == count.of_kind(True) == 11.5
    assert count.is_other_kind(True) and not count.is_other_kind(False)
    written(tmp_path, {"zones": [zone], "n1_60": 11.5, "n1_60cs": 12.9})
    count = load_blow_counts(tmp_path, section)[zone]
    assert (count.of_kind(False), count.of_kind(True)) == (11.5, 12.9)
    assert not count.is_other_kind(True)


@pytest.mark.parametrize(
    ("layers", "complaint"),
    [
        ([{"zones": ["no_such"], "n1_60": 5}], "no zone 'no_such' in the scene; known are"),
        ([{"zones": ["a"]}], "n1_60, n1_60cs: give at least one of them"),
        ([{"zones": ["a"], "n1_60": 5}] * 2, "zone 'a' is given two blow counts"),
        ([{"zones": ["a"], "n1_60": -1}], "n1_60"),
        ([{"zones": ["a"], "n60": 5}], "n60"),
        ([], "layers"),
    ],
)
def test_what_does_not_hold_together_is_one_line(section, tmp_path, layers, complaint):
    written(tmp_path, *layers)
    with pytest.raises(InputError, match=complaint) as caught:
        load_blow_counts(tmp_path, section)
    assert str(caught.value).startswith(str(tmp_path)) and "\n" not in str(caught.value)


def test_shipped_blow_counts_fit_their_sections(root):
    named = [path.parent for path in (root / "case_histories").glob(f"*/{FILE_NAME}")]
    assert named
    for folder in named:
        assert load_case(folder).blow_counts
