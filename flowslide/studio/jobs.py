"""Jobs: back-analysis, posterior, prediction, diagnosis; one at a time, each in its own process.

A job is a folder `.studio/<case>/jobs/<id>/`: `job.json` (what was asked), `state.json` (what its
process last said), `log.txt`, `case/` (its files as they were then, which later edits do not
reach), and a folder with the results as the command of the same name leaves them. The process runs
`flowslide.studio.job_process`, and lives on where the page is reloaded. All jobs of a case share
one store of finished simulations, so that a job that was stopped, or whose server was killed, goes
on where it was. Those that wait for the one before are known to this server alone: what a folder
from somewhere else says must start nothing.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from threading import RLock, Thread
from typing import Any, Literal

from pydantic import Field

from flowslide.studio import bodies
from flowslide.studio.bodies import Bodies
from flowslide.studio.case_documents import read_documents
from flowslide.studio.workspace import HIDDEN, JOINT, Workspace, revision_of
from geometry.scenes.scene import checked_document
from inversion.joint.document import load_joint
from inversion.prediction.known_strength import parse_strength
from inversion.problem.question import STRENGTH_RATIO
from pipeline.cli import InputError
from pipeline.documents import StrictDocument
from pipeline.files import make_folder, read_json, write_json
from pipeline.processes import python_command, python_environment
from report.pdf import write_pdf

Kind = Literal[
    "simulate",
    "back_analyse",
    "classical",
    "posterior",
    "predict",
    "from_blow_counts",
    "compare",
    "explain",
    "diagnose",
]
KINDS: dict[Kind, str] = {
    "simulate": "simulation with a film",
    "back_analyse": "back-analysis",
    "classical": "classical methods",
    "posterior": "posterior",
    "predict": "prediction",
    "from_blow_counts": "prediction from blow counts",
    "compare": "model against measurements",
    "explain": "which effects would explain it?",
    "diagnose": "diagnosis: what is missing?",
}
#: Folder of the results: as the command line and the workflow name it, for reports look for the
#: results of other methods under these names next to their own.
RESULTS: dict[Kind, str] = {
    "simulate": "simulation",
    "back_analyse": "inversion",
    "classical": "classical",
    "posterior": "posterior",
    "predict": "prediction",
    "from_blow_counts": "prediction",
    "compare": "diagnosis",
    "explain": "diagnosis",
    "diagnose": "diagnosis",
}
#: Done in seconds: they wait for nothing, and nothing waits for them.
LIGHT: tuple[Kind, ...] = ("classical",)
#: They look for the unknowns of `inversion.yaml`, whatever values the section has for them: with
#: those of an answer in the section, theirs are the same.
SEEKING: tuple[Kind, ...] = ("back_analyse", "posterior", "compare", "explain", "diagnose")
NO_LAST_WORD = "its process has ended without a last word: a full disk, too little memory"
JOB_PROCESS = "flowslide.studio.job_process"
JOB, STATE, LOG, CASE = "job.json", "state.json", "log.txt", "case"
#: Pages of results, of which a job has one.
PAGES = (
    "report.html",
    "compare.html",
    "explain.html",
    "prediction.html",
    "from_blow_counts.html",
    "classical.html",
)
#: Files that the page may open.
SHOWN = (".html", ".json", ".csv", ".png", ".txt", ".mp4", ".gif", ".nc", ".svg", ".bin")


class JobOptions(StrictDocument):
    """What a job may be asked in addition to its case."""

    spacing_m: float | None = Field(None, gt=0)
    quick: bool = Field(False, description="back-analysis: the answer alone")
    strengths: list[str] = Field(
        default_factory=list, description="prediction: zones=mean+-std, such as 1,6=4+-1 [kPa]"
    )
    ratios: list[str] = Field(
        default_factory=list, description="prediction: zones=mean+-std of S_r / sigma'_v0"
    )
    distribution: Literal["lognormal", "normal"] = Field(
        "lognormal", description="prediction: of these strengths"
    )
    posterior: str | None = Field(
        None, description="prediction: job whose draws are the strengths, in place of these"
    )
    joint: bool = Field(
        False, description="prediction: the ratio by `joint/` of the workspace, in place of these"
    )
    strengths_kpa: dict[str, float] = Field(
        default_factory=dict, description="simulation of a body: material -> cohesion, such as S_r"
    )
    thicker_than_m: list[float] = Field(
        default_factory=list, description="prediction of a body: thicknesses of the deposit"
    )

    @property
    def of_bodies(self) -> list[str]:
        """Options that are given and mean something of a body alone."""
        return [name for name in ("strengths_kpa", "thicker_than_m") if getattr(self, name)]


class Job(StrictDocument):
    """A job as it was asked for."""

    id: str
    kind: Kind
    case: str
    folder: str = Field(description="of the case as it was when the job was asked for")
    revision: str = Field("", description="of these files")
    kept: list[str] = Field(
        default_factory=list, description="revisions that differ by an answer that was kept alone"
    )
    threads: int | None = Field(None, description="of the CPU; null: all")
    body: bool = Field(False, description="in three dimensions: its `scene3d.yaml`")
    options: JobOptions


def joint_of(folder: Path) -> Path:
    """The joint relation of the workspace in which a job has its folder."""
    return folder.parents[3] / JOINT


class Jobs:
    """The jobs of a workspace.

    Args:
        workspace: of the cases.
        threads: CPU threads of each; None: all.
    """

    def __init__(self, workspace: Workspace, threads: int | None = None) -> None:
        self.workspace, self.threads = workspace, threads
        self.bodies = Bodies(workspace)
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._waiting: list[str] = []
        self._changing = RLock()

    def start(
        self, kind: str, case: str, options: dict[str, Any], *, body: bool = False
    ) -> dict[str, Any]:
        """Start a job, or have it wait for the one that runs: each takes all processor cores.

        Args:
            kind: of `KINDS`.
            case: its name.
            options: of `JobOptions`.
            body: of its `scene3d.yaml`.

        Raises:
            InputError: no such kind, case or option.
        """
        if kind not in KINDS:
            raise InputError(f"kind {kind!r}: one of {', '.join(KINDS)}")
        wanted = checked_document(JobOptions, options, "options", "flowslide/studio/jobs.py")
        if body:
            self._check_body(kind, case, wanted)
        else:
            self.workspace.ready(case)
            if wanted.of_bodies:
                raise InputError(f"{wanted.of_bodies[0]}: only in three dimensions")
        if kind == "predict":
            self._check_prediction(case, wanted, body)
        number = f"{time.strftime('%Y%m%d-%H%M%S')}-{os.urandom(3).hex()}"
        folder = make_folder(self._folder(case, number))
        try:
            source = (self.bodies if body else self.workspace).snapshot(case, folder / CASE)
            is_of = bodies.revision_of if body else lambda one: revision_of(read_documents(one))
            job = Job(
                id=number,
                kind=kind,
                case=case,
                folder=str(source),
                options=wanted,
                revision=is_of(source),
                threads=self.threads,
                body=body,
            )
            write_json(folder / JOB, job.model_dump(mode="json"))
            self._submit(folder, number)
        except BaseException:  # a full disk, or a file that is half written by somebody else
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return self.state(number)

    def keep(self, number: str, case: str, before: str, after: str) -> None:
        """A case has got the answer of a job, and no other change.

        That answer is of the case as before; unless it brings effects, so are those that look for
        the same values.

        Args:
            number: of the job.
            case: its name.
            before: revision of the case.
            after: its revision with the answer.

        Raises:
            InputError: there is no such job.
        """
        brings = read_json(self._find(number) / STATE).get("effects") is not None
        for path in self.workspace.hidden(case, "jobs").glob(f"*/{JOB}"):
            job = Job.model_validate(read_json(path))
            is_own = job.id == number or (job.kind in SEEKING and not brings)
            if is_own and before in (job.revision, *job.kept) and after not in job.kept:
                kept = [*job.kept, after]
                write_json(path, job.model_copy(update={"kept": kept}).model_dump(mode="json"))

    def _check_body(self, kind: Kind, case: str, options: JobOptions) -> None:
        """The kind is one of a body that has what it needs, and its points are not too many."""
        if kind not in bodies.ASKS:
            raise InputError(f"kind {kind!r}: not in three dimensions: {', '.join(bodies.ASKS)}")
        if reason := bodies.lacking(self.bodies.source(case), kind):
            raise InputError(f"{KINDS[kind]}: {reason}")
        filled = self.bodies.filled(case, options.spacing_m)
        filled.scene.changed(strengths_kpa=options.strengths_kpa)

    def _check_prediction(self, case: str, options: JobOptions, body: bool) -> None:
        """Strengths are given, a posterior of this case that is done, or other slides."""
        strengths = bool(options.strengths or options.ratios)
        given = (strengths, options.posterior is not None, options.joint)
        if sum(given) != 1:
            raise InputError("prediction: give strengths, a posterior or joint, one of them")
        if options.joint:
            load_joint(self.workspace.joint)
        for text in options.strengths:
            parse_strength(text, options.distribution)
        for text in options.ratios:
            parse_strength(text, options.distribution, STRENGTH_RATIO)
        if options.posterior is not None:
            drawn = self.state(options.posterior)
            own = (case, "posterior", "done", body)
            if (drawn["case"], drawn["kind"], drawn["state"], drawn["body"]) != own:
                raise InputError(f"prediction: {options.posterior} is no posterior of {case}")

    def _submit(self, folder: Path, number: str) -> None:
        """Launch a job, or put it last in the queue."""
        with self._changing:
            if read_json(folder / JOB)["kind"] in LIGHT or not self._is_busy():
                self._launch(folder, number)
            else:
                write_json(folder / STATE, {"state": "waiting"})
                self._waiting.append(number)

    def _is_busy(self) -> bool:
        """A job runs that others wait for: of this server, or of one that was killed."""
        for path in self.workspace.folder.glob(f".studio/*/jobs/*/{JOB}"):
            state = path.parent / STATE
            said = read_json(state) if state.is_file() else {}
            if said.get("state") == "running" and read_json(path)["kind"] not in LIGHT:
                if self._lives(path.parent.name, said.get("process")):
                    return True
        return False

    def _next(self) -> None:
        """Launch who waits, where nothing runs any more."""
        with self._changing:
            while self._waiting and not self._is_busy():
                number = self._waiting.pop(0)
                with suppress(InputError, OSError):  # its case was removed, or the disk is full
                    self._launch(self._find(number), number)

    def _watch(self, process: subprocess.Popen[bytes]) -> None:
        process.wait()  # an ended process is waited for
        self._next()

    def _launch(self, folder: Path, number: str) -> None:
        own = self.workspace.folder / HIDDEN
        for path in folder.iterdir():  # a folder from somewhere else may bring jobs along
            if not path.resolve().is_relative_to(own):
                raise InputError(f"job {number}: {path} is a link that leads elsewhere")
        with (folder / LOG).open("ab") as log:
            process = subprocess.Popen(
                python_command("-m", JOB_PROCESS, folder),
                env=python_environment(),
                start_new_session=True,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        try:
            write_json(folder / STATE, {"state": "running", "process": process.pid})
        except BaseException:  # nobody would know of it
            process.kill()
            process.wait()
            raise
        self._running[number] = process
        Thread(target=self._watch, args=(process,), daemon=True).start()

    def again(self, number: str) -> dict[str, Any]:
        """Go on with a job that was stopped; its finished simulations are kept.

        Raises:
            InputError: there is none, or it runs or is done.
        """
        state = self.state(number)
        if state["state"] in ("running", "waiting", "done"):
            raise InputError(f"job {number}: is {state['state']}")
        self._submit(self._find(number), number)
        return self.state(number)

    def cancel(self, number: str) -> dict[str, Any]:
        """Stop a job; what it has simulated is kept.

        Raises:
            InputError: there is none.
        """
        folder = self._find(number)
        with self._changing:
            if number in self._waiting:
                self._waiting.remove(number)
                write_json(folder / STATE, {"state": "cancelled"})
        if self.state(number)["state"] == "running":
            process = read_json(folder / STATE).get("process")
            with suppress(ProcessLookupError):
                os.killpg(process, signal.SIGTERM)
            if number in self._running:
                self._running.pop(number).wait()
            write_json(folder / STATE, {"state": "cancelled"})
        return self.state(number)

    def refuse_while_busy(self, case: str) -> None:
        """The folder of a case stays where it is while a job works in it.

        Raises:
            InputError: one runs, or waits.
        """
        for job in self.all():
            if job["case"] == case and job["state"] in ("running", "waiting"):
                raise InputError(f"case {case!r}: a job is {job['state']}; cancel it first")

    def all(self) -> list[dict[str, Any]]:
        """Every job, the newest first."""
        self._next()  # where the job of a killed server has ended, nobody else has noticed
        found = self.workspace.folder.glob(f".studio/*/jobs/*/{JOB}")
        return [
            self.state(path.parent.name)
            for path in sorted(found, key=lambda path: path.parent.name, reverse=True)
        ]

    def state(self, number: str) -> dict[str, Any]:
        """A job and how far it is.

        Raises:
            InputError: there is none.
        """
        folder = self._find(number)
        job = read_json(folder / JOB)
        said: dict[str, Any] = {"state": "interrupted"}
        if (folder / STATE).is_file():
            said = read_json(folder / STATE)
        if said["state"] == "running" and not self._lives(number, said.get("process")):
            # It may have ended between the two looks.
            said = read_json(folder / STATE)
            if said["state"] == "running":
                said = {"state": "interrupted", "message": NO_LAST_WORD}
        if said["state"] == "waiting" and number not in self._waiting:
            said = {"state": "interrupted"}  # the server that knew of it is gone
        left = [folder / LOG, *(folder / RESULTS[job["kind"]]).glob("*")]
        files = sorted(path.name for path in left if path.suffix in SHOWN and path.is_file())
        return {
            **{key: job[key] for key in ("id", "kind", "case", "options")},
            "revision": job.get("revision", ""),
            "kept": job.get("kept", []),
            "body": job.get("body", False),
            "words": KINDS[job["kind"]],
            **{key: value for key, value in said.items() if key != "process"},
            "files": files,
            "page": next((name for name in PAGES if name in files), None),
        }

    def file(self, number: str, name: str) -> Path:
        """A file that a job has left.

        Raises:
            InputError: there is none of that name.
        """
        state = self.state(number)
        if name not in state["files"]:
            raise InputError(f"job {number}: has no file {name[:80]!r}")
        return self._find(number) / ("" if name == LOG else RESULTS[state["kind"]]) / name

    def pdf(self, number: str) -> Path:
        """The page of a job as PDF, printed when it is first asked for.

        Raises:
            InputError: the job has no page, or this machine no browser that prints it.
            WorkFailed: it could not be printed.
        """
        name = self.state(number)["page"]
        if name is None:
            raise InputError(f"job {number}: has no page")
        page = self.file(number, name)
        printed = page.with_suffix(".pdf")
        if not printed.is_file() or printed.stat().st_mtime < page.stat().st_mtime:
            write_pdf(page)
        return printed

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
        words = Path(f"/proc/{process}/cmdline").read_bytes()
        return JOB_PROCESS.encode() in words and number.encode() in words
    except OSError:
        return False
