"""The command again in several processes that learn together, on one machine.

What `torchrun --standalone` does, with the command's own errors and exit codes: the first process
speaks for all, and if one ends with an error, the others are ended too.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import IO

from pipeline.processes import python_command, python_environment

LOOK_EVERY_S = 0.1
GRACE_S = 10.0
"""Time after one process has failed until the others are asked to end [s]. After PATIENCE_S they
are killed."""
PATIENCE_S = 60.0
LINES_TOLD = 20
"""Last lines that are shown of a process that failed where the first did not."""


def use_threads(number: int | None) -> None:
    """Let torch use this many CPU threads in this process; None: as many as it takes itself."""
    if number is not None:
        import torch

        torch.set_num_threads(number)


def check_device(device: str) -> None:
    """Refuse a device that this machine lacks.

    Raises:
        InputError: there is none.
    """
    import torch

    from pipeline.cli import InputError

    if device == "cuda" and not torch.cuda.is_available():
        raise InputError("--device cuda: this machine has no CUDA device; use cpu")


def in_processes(number: int, arguments: Sequence[str]) -> int:
    """Run `python -m ARGUMENTS` in several processes at once.

    Args:
        number: of processes.
        arguments: module and options; each process finds its rank in the environment.

    Returns:
        the exit code of the first process, or that of another one that failed while it did not.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    threads = max(len(os.sched_getaffinity(0)) // number, 1)
    common = {
        "WORLD_SIZE": number,
        "LOCAL_WORLD_SIZE": number,
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": port,
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", threads),
    }
    with ExitStack() as open_files:
        said = [open_files.enter_context(tempfile.TemporaryFile()) for _ in range(1, number)]
        return _together(arguments, common, said)


def _together(
    arguments: Sequence[str], common: Mapping[str, object], said: Sequence[IO[bytes]]
) -> int:
    """`in_processes`; `said` takes what all processes but the first print as errors."""
    processes = []
    for rank, errors in enumerate([None, *said]):
        own = {**common, "RANK": rank, "LOCAL_RANK": rank}
        processes.append(
            subprocess.Popen(
                python_command("-m", *arguments),
                env=python_environment(own),
                stderr=errors,
            )
        )

    def ask(*_: object) -> None:
        for process in processes:
            if process.poll() is None:
                process.terminate()

    before = signal.signal(signal.SIGTERM, ask)
    try:
        _watch(processes, ask)
    except KeyboardInterrupt:
        ask()
        _watch(processes, ask)
        raise
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
            process.wait()
        signal.signal(signal.SIGTERM, before)
    if processes[0].returncode <= 0:  # it was well, or ended from outside: it has not said why
        _tell_of_another(processes, said)
    codes = [process.returncode for process in processes]
    return next((code for code in (*filter(_by_itself, codes), *codes) if code), 0)


def _by_itself(code: int) -> bool:
    """A process that ended with an error of its own, not by a signal."""
    return code > 0


def _tell_of_another(processes: Sequence[subprocess.Popen], said: Sequence[IO[bytes]]) -> None:
    """Print the end of what a process but the first has said that failed by itself."""
    for rank, (process, file) in enumerate(zip(processes[1:], said, strict=True), start=1):
        if _by_itself(process.returncode):
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()[-LINES_TOLD:]
            print(f"process {rank} of {len(processes)} failed:", *lines, sep="\n", file=sys.stderr)
            return


def _watch(processes: Sequence[subprocess.Popen], ask) -> None:
    """Until all have ended; once one has failed, the others are asked to, and then left alone."""
    failed_at, asked = None, False
    while any(process.poll() is None for process in processes):
        if failed_at is None and any(process.poll() for process in processes):
            failed_at = time.monotonic()
        if failed_at is not None:
            waited = time.monotonic() - failed_at
            # Those that fail by themselves for the same reason have a better message than a signal.
            if waited > GRACE_S and not asked:
                ask()
                asked = True
            if waited > PATIENCE_S:
                return
        time.sleep(LOOK_EVERY_S)
