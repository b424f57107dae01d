"""The solver behind the sliders in a process of its own: `Live`, asked over a pipe.

A kernel of the solver holds the interpreter until it ends. In the server's process it would hold
every other request as well: saving, the list of jobs, other tabs. `Forecaster` has one as well.
"""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Lock, Thread
from typing import Any

from flowslide.studio.forecast import Forecaster
from flowslide.studio.live import Live, Question
from geometry.case import Case
from pipeline.cli import InputError, WorkFailed
from pipeline.processes import python_command, python_environment

#: Seconds that the process gets to end by itself.
PATIENCE_S = 2.0
END = "end"


class LiveProcess:
    """As `Live`. A process that has ended, whatever the reason, is started again when it is asked.

    Args:
        threads: CPU threads; None: all.
        kind: "solver" or "forecast", what is asked.
    """

    def __init__(self, threads: int | None = None, kind: str = "solver") -> None:
        self.threads, self.kind = threads, kind
        self._changing = Lock()
        self._numbers, self._askers = count(), count()
        self._known: dict[object, int] = {}
        self._asked: dict[int, Future[Any]] = {}
        self.process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None

    def warm(self, case: Case) -> Future[Any]:
        """Have the kernels compiled before the first question."""
        return self._send("warm", case)

    def ask(self, asked: Question, asker: object = None) -> Future[bytes | None]:
        """Answer a question; None where a newer one of the same asker has taken its place.

        The future raises InputError and WorkFailed.

        Args:
            asked: the question.
            asker: who asks, such as a page; those of others go on.
        """
        with self._changing:
            number = self._known.setdefault(asker, next(self._askers))
        return self._send("ask", asked, number)

    def stop(self, asker: object = None) -> None:
        """Stop what is computed for an asker."""
        with self._changing:
            number = self._known.pop(asker, None)
        if number is not None and self.process is not None:
            self._send("stop", number)

    def close(self) -> None:
        """End the process, also one that computes."""
        with self._changing:
            if self._pipe is None or self.process is None:
                return
            with suppress(OSError):
                self._pipe.send((0, END))
            self._pipe = None
            process = self.process
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _send(self, *words: Any) -> Future[Any]:
        answer: Future[Any] = Future()
        with self._changing:
            pipe = self._running()
            number = next(self._numbers)
            self._asked[number] = answer
            with suppress(OSError):  # it has just ended: who listens to it says so
                pipe.send((number, *words))
        return answer

    def _running(self) -> Connection:
        """The pipe to the process, which is started where none runs."""
        if self._pipe is not None and self.process is not None and self.process.poll() is None:
            return self._pipe
        if self.process is not None:
            self.process.kill()  # it has ended, or nobody hears it any more
            self.process.wait()
        self._pipe, far = Pipe()
        self.process = subprocess.Popen(
            python_command("-m", __name__, far.fileno(), self.threads or 0, self.kind),
            env=python_environment({"OMP_NUM_THREADS": self.threads} if self.threads else None),
            pass_fds=[far.fileno()],
            start_new_session=True,  # Ctrl-C is the server's
            stdin=subprocess.DEVNULL,
        )
        far.close()
        self._asked = {}
        Thread(target=self._listen, args=(self._pipe, self._asked), daemon=True).start()
        return self._pipe

    def _listen(self, pipe: Connection, asked: dict[int, Future[Any]]) -> None:
        """Pass answers on until the process ends; what it then owes is said to have failed."""
        with suppress(EOFError, OSError):
            while True:
                number, found, error = pipe.recv()
                _settle(asked.pop(number), found, error)
        with self._changing:  # nobody asks it any more
            if self._pipe is pipe:
                self._pipe = None
        for answer in asked.values():
            _settle(answer, None, WorkFailed("the solver has ended; the next question starts it"))


def _settle(answer: Future[Any], found: Any, error: BaseException | None) -> None:
    """Give an answer to who still waits for it."""
    if not answer.set_running_or_notify_cancel():
        return
    if error is None:
        answer.set_result(found)
    else:
        answer.set_exception(error)


def serve(pipe: Connection, threads: int | None, kind: str) -> None:
    """Answer what comes through a pipe until it is told to end, or nobody is there any more."""
    live, sending = (Live if kind == "solver" else Forecaster)(threads), Lock()

    def answer(number: int, done: Future[Any]) -> None:
        error = done.exception()
        if error is not None and not isinstance(error, InputError | WorkFailed):
            error = RuntimeError(repr(error))  # its own type may not pass a pipe
        found = None if error is not None else done.result()
        with sending, suppress(OSError):
            pipe.send((number, found if isinstance(found, bytes) else None, error))

    with suppress(EOFError):
        while True:
            number, word, *what = pipe.recv()
            if word == END:
                break
            if word == "stop":
                live.stop(*what)
                done: Future[Any] = Future()
                done.set_result(None)
            else:
                done = getattr(live, word)(*what)
            done.add_done_callback(partial(answer, number))
    os._exit(0)  # also where a kernel still runs


if __name__ == "__main__":
    serve(Connection(int(sys.argv[1])), int(sys.argv[2]) or None, sys.argv[3])
