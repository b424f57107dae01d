"""A bar on a terminal, few plain lines in a log, nothing when quiet."""

from __future__ import annotations

import io
import os
import socket
from contextlib import suppress
from threading import Event

import pytest

from pipeline.progress import TERMINAL, Cancelled, Progress, Watch


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


def test_work_in_stages_counts_against_a_plan_that_learns():
    told = []
    watch = Watch(lambda *call: told.append(call))
    watch.plan({"answer": 10, "seeds": 4})
    with watch.stage("answer"):
        watch.run_done(1, 2)
        watch.run_done(2, 2)
        watch.say("found")
    with watch.stage("seeds"):
        for done in range(6):
            watch.run_done(done + 1, 6)
    assert told[0] == (0, 14, "answer (1 of 2)")
    assert told[3] == (2, 14, "found")
    assert told[4] == (2, 6, "seeds (2 of 2)")  # the first stage took 2 runs, not 10
    assert told[-1] == (8, 8, "seeds (2 of 2)")


@pytest.mark.parametrize("kind", ["event", "function"])
def test_a_watch_stops_the_work(kind):
    event = Event()
    watch = Watch(cancel=event if kind == "event" else event.is_set)
    watch.run_done()
    event.set()
    for call in (watch.run_done, lambda: watch.say(""), lambda: watch.reach(1, 2, "")):
        with pytest.raises(Cancelled):
            call()


def test_a_report_in_a_log_has_each_message_once_and_a_line_at_times():
    stream = io.StringIO()
    with Progress(0, "dam", stream=stream, log_interval_s=0.0) as progress:
        for done, message in enumerate(["answer", "answer", "found", "answer"]):
            progress.report(done, 3, message)
    assert stream.getvalue().splitlines() == [
        "answer",
        "dam: 1/3, 0 s, about 0 s left, answer",
        "found",
        "dam: 3/3, 0 s, answer",
    ]


def test_the_bar_of_a_job_whose_errors_go_to_a_file_is_on_the_terminal(monkeypatch):
    leader, terminal = os.openpty()
    monkeypatch.setenv(TERMINAL, f"{socket.gethostname()}:{os.ttyname(terminal)}")
    log = io.StringIO()
    with Progress(0, "dam", stream=log) as progress:
        with Progress(0, "another", stream=io.StringIO()) as second:
            second.report(1, 2, "")  # the terminal is taken: no second bar
        progress.report(1, 2, "answer")
        progress.say("a line")
    os.close(terminal)
    shown = all_of(leader).decode()
    assert "dam" in shown and "1/2" in shown and "another" not in shown
    assert log.getvalue() == "answer\na line\n"


def all_of(leader: int) -> bytes:
    """What was written to a terminal that is closed; one read may return a part of it."""
    shown = b""
    with suppress(OSError), os.fdopen(leader, "rb", buffering=0) as stream:
        while part := stream.read(65536):
            shown += part
    return shown


@pytest.mark.parametrize("place", ["another-host:/dev/null", "HOST:/dev/null", "HOST:/none", ""])
def test_without_such_a_terminal_there_are_lines_alone(monkeypatch, place):
    monkeypatch.setenv(TERMINAL, place.replace("HOST", socket.gethostname()))
    log = io.StringIO()
    with Progress(1, "dam", stream=log) as progress:
        progress.advance()
    assert log.getvalue() == "dam: 1/1, 0 s\n"
