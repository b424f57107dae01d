"""The process of a job: `python -m flowslide.studio.job_process FOLDER` of `flowslide.studio.jobs`.

It calls the function of `flowslide` that the job names, with a folder of the job as `out`, and says
in `state.json` how far it is, which values a search has tried, and in the end what was found.
"""

from __future__ import annotations

import errno
import math
import os
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from diagnosis.ranking import Standing
from flowslide.studio.jobs import JOB, RESULTS, STATE, Job, Kind, joint_of
from pipeline.cli import InputError, WorkFailed
from pipeline.files import make_folder, read_json, write_json

NO_ROOM = os.strerror(errno.ENOSPC)
#: Seconds between two states.
OFTEN = 0.3
#: Reports over which the time that is left is reckoned: simulations that are found in the store
#: again take none, and the next stage may take longer.
LOOKED_AT = 30
#: Hypotheses of a ranking that are shown.
MOST_RANKED = 8


class Told:
    """What a job says of itself, in its `state.json`.

    Args:
        folder: of the job.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.began, self.last = time.time(), 0.0
        self.steps: deque[tuple[float, int]] = deque(maxlen=LOOKED_AT)
        self.said: dict[str, Any] = {"state": "running", "process": os.getpid(), "history": []}

    def report(self, done: int, total: int, message: str) -> None:
        """Progress, as `flowslide` reports it."""
        self.said.update(done=done, total=total, message=message or self.said.get("message", ""))
        self.said["left_s"] = self._left(done, total)
        if time.time() - self.last > OFTEN:
            self.last = time.time()
            with suppress(OSError):  # the work itself says what is wrong with the disk
                self._write(self.said)

    def _left(self, done: int, total: int) -> float | None:
        """About how long it will take [s]; None: too few simulations are done to tell."""
        if not self.steps or done > self.steps[-1][1]:
            self.steps.append((time.time(), done))
        (since, before), (now, reached) = self.steps[0], self.steps[-1]
        if len(self.steps) < 4 or total <= done:
            return None
        return round((now - since) / (reached - before) * (total - done), 1)

    def evaluated(self, runs: int, values: Mapping[str, float], loss: float) -> None:
        """Values that a search has tried, as `flowslide` reports them."""
        self.said["history"].append(
            {"runs": runs, "values": dict(values), "loss": loss if math.isfinite(loss) else None}
        )

    def ranked(self, standings: Sequence[Standing]) -> None:
        """How the hypotheses of a diagnosis stand, as `flowslide` reports it.

        What was calibrated again stands before what was merely promised, each in the order of all.
        """
        calibrated = [one for one in standings if one.refitted is not None]
        promised = [one for one in standings if one.refitted is None]
        chosen = [*calibrated, *promised][:MOST_RANKED]
        self.said["ranking"] = [
            {"words": one.words, "promised": one.promised, "refitted": one.refitted}
            for one in chosen
        ]
        self.said["looked_at"] = len(standings)

    def end(self, found: Mapping[str, Any]) -> None:
        """The last word."""
        kept = {k: v for k, v in self.said.items() if k not in ("process", "left_s")}
        self._write({**kept, **found})

    def _write(self, said: Mapping[str, Any]) -> None:
        seconds = round(time.time() - self.began, 1)
        write_json(self.folder / STATE, {**said, "seconds": seconds})


def main(folder: Path) -> int:
    """Run the job of a folder; the exit code is 0 where it is done."""
    job = Job.model_validate(read_json(folder / JOB))
    told = Told(folder)
    told.report(0, 0, "starting")
    end: dict[str, Any] = {
        "state": "failed",
        "message": "ended by an error of the program: log.txt",
    }
    try:
        end = {"state": "done", "message": "", **_work(job, folder, told)}
    except (InputError, WorkFailed) as error:
        end = {"state": "failed", "message": str(error)}
    except (OSError, RuntimeError) as error:  # a full disk, and the like
        words = _of_disk(error)
        if not words:
            raise
        end = {"state": "failed", "message": f"{folder}: {words}"}
    finally:
        told.end(end)
    return 0 if end["state"] == "done" else 1


def _of_disk(error: OSError | RuntimeError) -> str:
    """What the system says of a file; empty: it says nothing. HDF5 gives no number, but words."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return NO_ROOM if NO_ROOM in str(error) else ""


def _work(job: Job, folder: Path, told: Told) -> dict[str, Any]:
    """Answer; what was found, for the list of jobs."""
    import flowslide
    from flowslide.studio import diagnosis_answers, job_answers
    from report import diagnosis as pages

    out = make_folder(folder / RESULTS[job.kind])
    common: dict[str, Any] = {"out": out, "progress": told.report}
    if job.kind == "classical":
        return job_answers.classical(flowslide.classical(job.folder, **common))
    # One store of finished simulations for all jobs of a case.
    make_folder(folder.parent.parent / "runs")
    runs = out / "runs"
    if not runs.exists():
        runs.unlink(missing_ok=True)  # it led to where the case was before
        runs.symlink_to(Path("..", "..", "..", "runs"), target_is_directory=True)
    if job.body:
        from flowslide.studio import body_jobs

        return body_jobs.work(job, out, told.report, told.evaluated)
    common |= {"spacing_m": job.options.spacing_m, "threads": job.threads}
    match job.kind:
        case "simulate":
            return job_answers.simulation(flowslide.simulate(job.folder, film="gif", **common))
        case "back_analyse":
            if not job.options.quick:
                _classical(job, folder, told)
            _neighbour(job, folder, "diagnose")
            quick = job.options.quick
            result = flowslide.back_analyse(
                job.folder, quick=quick, evaluated=told.evaluated, **common
            )
            flowslide.write_report(out, case=job.folder)
            return job_answers.back_analysis(result)
        case "posterior":
            return job_answers.posterior(flowslide.posterior(job.folder, **common))
        case "predict":
            strengths, drawn = job.options.strengths, job.options.posterior
            found = flowslide.predict(
                job.folder,
                strengths,
                ratios=job.options.ratios,
                distribution=job.options.distribution,
                posterior=None if drawn is None else folder.parent / drawn / RESULTS["posterior"],
                joint=joint_of(folder) if job.options.joint else None,
                **common,
            )
            return job_answers.prediction(found)
        case "from_blow_counts":
            found = flowslide.predict_from_blow_counts(job.folder, **common)
            return job_answers.from_blow_counts(found)
        case "compare":
            compared = flowslide.compare(job.folder, **common)
            pages.write_compare(out)
            return diagnosis_answers.comparison(compared)
        case "explain":
            explained = flowslide.explain(job.folder, ranked=told.ranked, **common)
            pages.write_explain(out)
            return diagnosis_answers.explanation(explained)
        case "diagnose":
            _neighbour(job, folder, "back_analyse")
            verdict = flowslide.diagnose(job.folder, ranked=told.ranked, **common)
            flowslide.write_report(out)
            return diagnosis_answers.verdict(verdict)
    raise InputError(f"kind {job.kind!r}: nobody does it")


def _classical(job: Job, folder: Path, told: Told) -> None:
    """The classical methods next to a back-analysis, where the case has what they need."""
    import flowslide

    if not _neighbour(job, folder, "classical"):
        with suppress(InputError):
            out = folder / RESULTS["classical"]
            flowslide.classical(job.folder, out=out, progress=told.report)


def _neighbour(job: Job, folder: Path, kind: Kind) -> bool:
    """Put the newest results of another job on the same files of the case next to the job's own."""
    place = folder / RESULTS[kind]
    if any(place.glob("*.json")):
        return True
    for other in sorted(folder.parent.glob(f"*/{JOB}"), reverse=True):
        state = other.parent / STATE
        asked = Job.model_validate(read_json(other))
        if (asked.kind, asked.revision) != (kind, job.revision) or not state.is_file():
            continue
        if read_json(state)["state"] == "done":
            place.symlink_to(Path("..") / asked.id / RESULTS[kind], target_is_directory=True)
            return True
    return False


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
