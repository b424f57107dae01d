"""The solver in a process of its own: the same answers, and a server that it does not hold."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from starlette.testclient import TestClient

from flowslide.studio.app import studio
from flowslide.studio.live import Asked, Live, question
from flowslide.studio.live_process import LiveProcess
from pipeline.cli import InputError, WorkFailed
from tests.studio.messages import unpack

pytestmark = pytest.mark.slow
PORT, TOKEN = 8321, "the-token"


@pytest.fixture
def solver():
    found = LiveProcess(threads=1)
    yield found
    found.close()


def asked(workspace, value=8.0, **more):
    changes = {"strengths_kpa": {"loose": value}}
    return question(Asked(type="run", changes=changes, **more), workspace.case("small"))


def test_it_answers_as_it_would_in_this_process(workspace, solver):
    own = Live(threads=1)
    first = unpack(own.ask(asked(workspace)).result(120))
    own.close()
    other = unpack(solver.ask(asked(workspace)).result(120))
    assert other[0]["readings"] == first[0]["readings"]
    assert np.array_equal(other[1]["positions"], first[1]["positions"])
    assert unpack(solver.ask(asked(workspace)).result(120))[0]["cached"]


def test_the_newest_question_of_a_page_wins_and_those_of_others_go_on(workspace, solver):
    pages = object(), object()
    solver.warm(workspace.case("small").resolved()).result(120)
    answers = [solver.ask(asked(workspace, 5.0 + k), pages[k > 0]) for k in range(5)]
    found = [one.result(120) is not None for one in answers]
    assert found == [True, False, False, False, True]


def test_a_question_that_cannot_be_answered_is_said(workspace, solver):
    case = asked(workspace)
    effects = {**case.case.scene.effects, "no_such_effect": 1.0}
    scene = case.case.scene.model_copy(update={"effects": effects})
    bad = type(case)(1, type(case.case)(**{**vars(case.case), "scene": scene}), False)
    with pytest.raises(InputError, match="no_such_effect"):
        solver.ask(bad).result(120)
    assert solver.ask(case).result(120) is not None


def test_the_server_answers_while_the_solver_stands_still(workspace, solver):
    app = studio(workspace, solver, token=TOKEN)
    address = f"http://127.0.0.1:{PORT}"
    with TestClient(app, base_url=address, follow_redirects=False) as browser:
        browser.get("/", params={"token": TOKEN})
        solver.warm(workspace.case("small").resolved()).result(120)
        os.kill(solver.process.pid, signal.SIGSTOP)
        try:
            answer = solver.ask(asked(workspace))
            assert browser.get("/api/cases/small").status_code == 200
            assert not answer.done()
        finally:
            os.kill(solver.process.pid, signal.SIGCONT)
        assert answer.result(120) is not None


def test_a_solver_that_was_killed_is_started_again(workspace, solver):
    solver.warm(workspace.case("small").resolved()).result(120)
    process = solver.process
    os.kill(process.pid, signal.SIGSTOP)
    answer = solver.ask(asked(workspace))
    process.kill()
    with pytest.raises(WorkFailed, match="the solver has ended"):
        answer.result(120)
    assert solver.ask(asked(workspace)).result(120) is not None
    assert solver.process is not process


def test_it_ends_with_the_server_also_where_it_computes(workspace):
    solver = LiveProcess(threads=1)
    solver.warm(workspace.case("small").resolved()).result(120)
    os.kill(solver.process.pid, signal.SIGSTOP)  # it hears of nothing
    solver.close()
    assert solver.process.returncode == -signal.SIGKILL
    second = LiveProcess(threads=1)
    second.warm(workspace.case("small").resolved()).result(120)
    second.close()
    assert second.process.returncode == 0
