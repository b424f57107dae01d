from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flowslide.studio.yaml_edits import edited_yaml
from pipeline.files import parse_yaml, read_yaml

CASES = sorted((Path(__file__).resolve().parents[2] / "case_histories").glob("*/*.yaml"))
TEXT = """\
# Above all.
name: dam   # its name
zones:
  - name: shell     # the upper one
    polygon: [[0.0, 0.0], [10.0, 0.0], [5.0, 4.0]]
  # The core, of 1912.
  - name: core
    polygon: [[10.0, 0.0], [12.0, 0.0], [11.0, 4.0]]
water_level: null   # none was seen
"""

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    # Taichi has the processor take subnormal numbers for 0.
    | st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)
    | st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=12),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), inner, max_size=4)
    ),
    max_leaves=12,
)


@pytest.mark.parametrize("path", CASES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_is_not_changed_keeps_every_comment(path):
    text, document = path.read_text(), read_yaml(path)
    assert edited_yaml(text, document).count("#") == text.count("#")


def test_comments_stay_with_what_they_are_about():
    document = parse_yaml(TEXT, name="text")
    document["zones"].insert(0, {"name": "dike", "polygon": [[-3.0, 0.0], [0.0, 0.0], [-1.0, 2.0]]})
    document["zones"][1]["polygon"][2] = [5.5, 4.0]
    del document["name"]
    found = edited_yaml(TEXT, document)
    assert parse_yaml(found, name="found") == document
    lines = found.splitlines()
    (shell,) = (line for line in lines if "name: shell" in line)
    assert "# the upper one" in shell
    assert "[[0.0, 0.0], [10.0, 0.0], [5.5, 4.0]]" in found, "numbers stay as they were written"
    assert "water_level: null   # none was seen" in found


def test_a_text_that_cannot_be_edited_is_written_again():
    for text in ("", "- 1\n", "a: &x {b: 1}\nc: *x\n", "a: [", "just words"):
        document = {"a": {"b": 2}, "c": {"b": 1}}
        assert parse_yaml(edited_yaml(text, document), name="found") == document


@given(st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), plain, max_size=5), plain)
def test_the_content_is_always_the_wanted_one(before, value):
    from pipeline.files import yaml_text

    wanted = deepcopy(before)
    wanted["changed"] = value
    for key in list(wanted)[::3]:
        wanted[key] = value
    text = "# a comment\n" + yaml_text(before, default_flow_style=None)
    assert parse_yaml(edited_yaml(text, wanted), name="found") == wanted
