"""Records that a command leaves next to its answer: the clock and the machine."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from diagnosis.hypotheses.hypothesis_file import BASE
from diagnosis.session import TIMING, Session


@pytest.fixture
def session(tmp_path):
    told = []
    made = Session(None, None, tmp_path, None, BASE, None, told.append)
    made.model = SimpleNamespace(runs=3, computed=2)
    made.told = told
    return made


def test_each_command_has_its_own_times(session):
    session.write_timing("compare")
    session.write_timing("run")
    found = json.loads((session.folder / TIMING).read_text())
    assert list(found) == ["compare", "run"] and found["run"]["runs_asked"] == 3
    assert session.told == []


def test_the_runs_left_are_those_that_a_question_usually_takes(session):
    """Not the allowance, which a diagnosis uses a third of."""
    session.config = SimpleNamespace(diagnosis=SimpleNamespace(max_runs=1400))
    session.model.candidates = range(60)
    found = [session.usual_runs(what) for what in ("comparison", "explanation", "diagnosis")]
    assert found == [40, 190, 440]
    session.config.diagnosis.max_runs = 70
    assert session.usual_runs("diagnosis") == 70


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"[1, 2]", "must be a mapping of commands, not list"),
        (b'{"run": ', "line 1: not valid JSON"),
        (b"\xff\xfe", "not a UTF-8 text file"),
    ],
)
def test_times_that_cannot_be_read_are_reported_and_written_again(session, content, complaint):
    path = session.folder / TIMING
    path.write_bytes(content)
    session.write_timing("run")
    (line,) = session.told
    assert line.startswith(f"{path}: ") and complaint in line and "rewritten" in line
    assert list(json.loads(path.read_text())) == ["run"]
