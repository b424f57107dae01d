"""How far a reader walks: `docs/architecture.md` has what `tests/walks.py` counts, and no more."""

from __future__ import annotations

import re

import pytest

from tests.walks import ROOT, Length, Step, faults, length, walks

# Files and crossings: as many as there are. A walk may become shorter; one that becomes longer gets
# its reason here. The layers of a session of the diagnosis (command, API, session, answers, loop)
# and the way from the model down to the solver and back, twice through `inversion`, are what is
# left: each has more than one caller, so leaving one out would write it twice.
MOST = {
    "a residual strength": (44, 14),
    "a measured number": (24, 12),
    "a hypothesis": (54, 23),
}


@pytest.mark.parametrize("name", MOST)
def test_a_walk_follows_the_code(name):
    assert list(faults(walks()[name])) == []


@pytest.mark.parametrize("name", MOST)
def test_a_walk_is_no_longer_than_it_was(name):
    counted, most = length(walks()[name]), MOST[name]
    assert counted.files <= most[0] and counted.crossings <= most[1], counted


def test_the_architecture_has_the_figures():
    text = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (a [\w ]+) \| (\d+) \| (\d+) \| (\d+) \|$", text, re.MULTILINE)
    written = {name: Length(*map(int, figures)) for name, *figures in rows}
    assert written == {name: length(steps) for name, steps in walks().items()}


def test_what_is_counted():
    steps = [
        Step(0, "flowslide/a.py", "run", "run"),
        Step(1, "inversion/b.py", "first", "first"),
        Step(2, "inversion/b.py", "second", "second"),
        Step(1, "flowslide/a.py", "last", "last"),
    ]
    assert length(steps) == Length(files=2, stays=3, crossings=2)


def test_a_wrong_line_is_named():
    calls = Step(0, "tests/walks.py", "length", "length")
    assert list(faults([calls, Step(1, "tests/walks.py", "Length", "Length")])) == []
    for wrong, complaint in (
        (Step(1, "tests/walks.py", "walks", "walks"), "length does not name walks"),
        (Step(1, "tests/walks.py", "gone", "gone"), "has no gone"),
        (Step(1, "tests/gone.py", "walks", "walks"), "no such file"),
        (Step(2, "tests/walks.py", "Length", "Length"), "two levels below"),
    ):
        (line,) = faults([calls, wrong])
        assert complaint in line
