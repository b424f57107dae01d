"""Processes that simulate, one scene each at a time, for several threads that ask.

A batch of scenes of different lengths in one process leaves cores idle towards its end, and so does
a search that asks for one run after the other. Here every scene goes to the first process that is
free, whoever asked for it; those who ask for little are served first. The numbers of a run do not
depend on any of that.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future, as_completed
from contextlib import redirect_stdout
from functools import partial
from heapq import heappop, heappush
from itertools import count
from threading import RLock, Thread
from typing import TYPE_CHECKING

from pipeline.cli import WorkFailed
from pipeline.processes import process_pool

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.simulate import Wanted
    from mpm_taichi.trajectory import Run
    from pipeline.config import SimulationSettings

Job = Callable[[], None]

KILLED = (
    "a process that simulated was ended by the system, most often for want of memory: take fewer "
    "--threads or a larger --spacing; finished simulations are kept"
)
IDLE_S = 300
"""A process without work for so long ends; another one starts when there is work."""


class Workers:
    """Processes for simulations on the CPU; they start with the first simulation.

    Args:
        number: of processes, one thread each.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self._pool = process_pool(
            number, timeout=IDLE_S, initializer=_begin, initargs=(os.getpid(),)
        )
        self._waiting: list[tuple[int, int, Wanted, Future[Run]]] = []
        self._order, self._lock = count(), RLock()
        self._busy, self._stopped = 0, False

    def simulate(self, wanted: Sequence[Wanted]) -> Iterator[tuple[int, Run]]:
        """As `mpm_taichi.simulate.simulate_each`; may be called from several threads.

        Raises:
            CancelledError: the processes were stopped.
            WorkFailed: one of them was killed.
        """
        futures: dict[Future[Run], int] = {Future(): place for place in range(len(wanted))}
        with self._lock:
            if self._stopped:
                raise CancelledError
            for future, pair in zip(futures, wanted, strict=True):
                heappush(self._waiting, (len(wanted), next(self._order), pair, future))
            self._feed()
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            for future in futures:
                future.cancel()

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """Do jobs at the same time, each in a thread of its own.

        Raises:
            BaseException: what the first job that failed has raised; the others end at their next
                simulation.
        """
        ended: list[BaseException] = []

        def do(job: Job) -> None:
            try:
                job()
            except BaseException as error:
                ended.append(error)
                self.stop()

        threads = [Thread(target=do, args=(job,), daemon=True) for job in jobs]
        try:
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        except BaseException:
            self.stop()
            raise
        if ended:
            raise ended[0]

    def stop(self) -> None:
        """End the processes in the middle of what they do."""
        with self._lock:
            self._stopped = True
            for *_, future in self._waiting:
                future.cancel()
            self._waiting.clear()
        self._pool.shutdown(wait=False, kill_workers=True)

    def close(self) -> None:
        """End the processes, which have nothing more to do."""
        self._pool.shutdown()

    def _feed(self) -> None:
        """Give scenes to the processes that are free."""
        while self._waiting and self._busy < self.number:
            *_, (scene, settings), future = heappop(self._waiting)
            if future.set_running_or_notify_cancel():
                try:
                    run = self._pool.submit(_simulated, scene, settings)
                except BrokenExecutor:  # a process was killed while it had nothing to do
                    future.set_exception(WorkFailed(KILLED))
                    self._end_waiting(WorkFailed(KILLED))
                    return
                self._busy += 1
                run.add_done_callback(partial(self._pass_on, future))

    def _pass_on(self, future: Future[Run], run: Future[Run]) -> None:
        """Give what a process has found to who waits for it, and the process another scene."""
        error = CancelledError() if run.cancelled() else run.exception()
        with self._lock:
            self._busy -= 1
            if isinstance(error, BrokenExecutor):
                error = WorkFailed(KILLED)
                self._end_waiting(error)
            if not self._stopped:
                self._feed()
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(run.result())

    def _end_waiting(self, error: WorkFailed) -> None:
        """After the processes were killed: nobody gets another run."""
        self._stopped = True
        for *_, future in self._waiting:
            if future.set_running_or_notify_cancel():
                future.set_exception(error)
        self._waiting.clear()


def _begin(parent: int) -> None:
    """Leave an interrupt, which reaches all processes of a terminal, to the parent; end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """A parent that is killed can tell nobody."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _simulated(scene: Scene, settings: SimulationSettings) -> Run:
    """In a process: the run of a scene."""
    from mpm_taichi.simulate import simulate

    with redirect_stdout(sys.stderr):  # where Taichi says that it starts
        return simulate([scene], settings, threads=1)[0]
