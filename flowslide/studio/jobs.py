"""Jobs: back-analysis, posterior, prediction, diagnosis, each in a process of its own.

A job is a folder `.studio/<case>/jobs/<id>/`: `job.json` (what was asked), `state.json` (what its
process last said), `log.txt`, and the results as the command of the same name leaves them. The
process runs `flowslide.studio.job_process`, and lives on where the page is reloaded. All jobs of a
case share one store of finished simulations, so that a job that was stopped, or whose server was
killed, goes on where it was.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, Literal

from pydantic import Field

from flowslide.studio.workspace import Workspace
from geometry.scenes.scene import checked_document
from pipeline.cli import InputError
from pipeline.documents import StrictDocument
from pipeline.files import make_folder, read_json, write_json

Kind = Literal[
    "simulate", "back_analyse", "posterior", "predict", "from_blow_counts", "diagnose"
]  # fmt: skip
KINDS: dict[Kind, str] = {
    "simulate": "simulation with a film",
    "back_analyse": "back-analysis",
    "posterior": "posterior",
    "predict": "prediction",
    "from_blow_counts": "prediction from blow counts",
    "diagnose": "diagnosis: what is missing?",
}
JOB, STATE, LOG = "job.json", "state.json", "log.txt"
#: Files that the page may open.
SHOWN = (".html", ".json", ".csv", ".png", ".txt", ".mp4", ".gif", ".nc", ".svg")


class JobOptions(StrictDocument):
    """What a job may be asked in addition to its case."""

    spacing_m: float | None = Field(None, gt=0)
    quick: bool = Field(False, description="back-analysis: the answer alone")
    strengths: list[str] = Field(default_factory=list, description="prediction: 18+-5")


class Job(StrictDocument):
    """A job as it was asked for."""

    id: str
    kind: Kind
    case: str
    folder: str = Field(description="of the case")
    options: JobOptions


class Jobs:
    """The jobs of a workspace.

    Args:
        workspace: of the cases.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, kind: str, case: str, options: dict[str, Any]) -> dict[str, Any]:
        """Start a job.

        Raises:
            InputError: no such kind, case or option.
        """
        if kind not in KINDS:
            raise InputError(f"kind {kind!r}: one of {', '.join(KINDS)}")
        wanted = checked_document(JobOptions, options, "options", "flowslide/studio/jobs.py")
        source = self.workspace.source(case)
        number = f"{time.strftime('%Y%m%d-%H%M%S')}-{os.urandom(3).hex()}"
        job = Job(id=number, kind=kind, case=case, folder=str(source), options=wanted)
        folder = make_folder(self._folder(case, number))
        write_json(folder / JOB, job.model_dump(mode="json"))
        self._launch(folder, number)
        return self.state(number)

    def _launch(self, folder: Path, number: str) -> None:
        with (folder / LOG).open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "flowslide.studio.job_process", str(folder)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        self._running[number] = process
        Thread(target=process.wait, daemon=True).start()  # an ended process is waited for
        write_json(folder / STATE, {"state": "running", "process": process.pid})

    def again(self, number: str) -> dict[str, Any]:
        """Go on with a job that was stopped; its finished simulations are kept.

        Raises:
            InputError: there is none, or it runs or is done.
        """
        state = self.state(number)
        if state["state"] in ("running", "done"):
            raise InputError(f"job {number}: is {state['state']}")
        self._launch(self._find(number), number)
        return self.state(number)

    def cancel(self, number: str) -> dict[str, Any]:
        """Stop a job; what it has simulated is kept.

        Raises:
            InputError: there is none.
        """
        folder = self._find(number)
        if self.state(number)["state"] == "running":
            process = read_json(folder / STATE).get("process")
            with suppress(ProcessLookupError):
                os.killpg(process, signal.SIGTERM)
            if number in self._running:
                self._running.pop(number).wait()
            write_json(folder / STATE, {"state": "cancelled"})
        return self.state(number)

    def all(self) -> list[dict[str, Any]]:
        """Every job, the newest first."""
        found = self.workspace.folder.glob(f".studio/*/jobs/*/{JOB}")
        return [self.state(path.parent.name) for path in
                sorted(found, key=lambda path: path.parent.name, reverse=True)]  # fmt: skip

    def state(self, number: str) -> dict[str, Any]:
        """A job and how far it is.

        Raises:
            InputError: there is none.
        """
        folder = self._find(number)
        job = read_json(folder / JOB)
        said = read_json(folder / STATE) if (folder / STATE).is_file() else {"state": "interrupted"}
        if said["state"] == "running" and not self._lives(number, said.get("process")):
            # It may have ended between the two looks.
            said = read_json(folder / STATE)
            if said["state"] == "running":
                said = {"state": "interrupted"}
        left = (path for path in folder.iterdir() if path.suffix in SHOWN and path.is_file())
        files = sorted(path.name for path in left if path.name not in (JOB, STATE))
        return {
            **{key: job[key] for key in ("id", "kind", "case", "options")},
            "words": KINDS[job["kind"]],
            **{key: value for key, value in said.items() if key != "process"},
            "files": files,
        }

    def file(self, number: str, name: str) -> Path:
        """A file that a job has left.

        Raises:
            InputError: there is none of that name.
        """
        if name not in self.state(number)["files"]:
            raise InputError(f"job {number}: has no file {name[:80]!r}")
        return self._find(number) / name

    def _lives(self, number: str, process: int | None) -> bool:
        own = self._running.get(number)
        if own is not None:
            return own.poll() is None
        return process is not None and _is_job(process, number)

    def _folder(self, case: str, number: str) -> Path:
        return self.workspace.hidden(case, "jobs", number)

    def _find(self, number: str) -> Path:
        if number.replace("-", "").isalnum():
            for path in self.workspace.folder.glob(f".studio/*/jobs/{number}/{JOB}"):
                return path.parent
        raise InputError(f"job {number[:80]!r}: there is none")


def _is_job(process: int, number: str) -> bool:
    """A process of a server that was killed still works on this job."""
    try:
        return number.encode() in Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        return False
