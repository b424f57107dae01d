"""A bar on a terminal, few plain lines in a log, nothing when quiet."""

from __future__ import annotations

import io

import pytest

from pipeline.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_log_gets_plain_lines(capsys):
    with Progress(3, "drawing scenes", log_interval_s=0.0) as progress:
        progress.advance()
        progress.advance(2, note="1 drawn again")
    captured = capsys.readouterr()
    assert captured.out == ""
    first, last = captured.err.splitlines()
    assert first.startswith("drawing scenes: 1/3, 0 s, about 0 s left")
    assert last == "drawing scenes: 3/3, 0 s, 1 drawn again"


def test_a_log_is_not_flooded():
    stream = io.StringIO()
    with Progress(1000, "runs", stream=stream) as progress:
        for _ in range(1000):
            progress.advance()
    assert stream.getvalue().splitlines() == ["runs: 1000/1000, 0 s"]


def test_quiet_is_silent():
    stream = io.StringIO()
    with Progress(1, "runs", quiet=True, stream=stream) as progress:
        progress.advance()
    assert stream.getvalue() == ""


def test_a_terminal_gets_a_bar():
    stream = Terminal()
    with Progress(2, "runs", stream=stream) as progress:
        progress.advance(2, note="fine")
    assert "runs" in stream.getvalue() and "2/2" in stream.getvalue()


def test_an_interrupted_log_says_how_far_it_came():
    stream = io.StringIO()
    with pytest.raises(RuntimeError), Progress(5, "runs", stream=stream) as progress:
        progress.advance(2)
        raise RuntimeError
    assert stream.getvalue().splitlines()[-1].startswith("runs: 2/5")
