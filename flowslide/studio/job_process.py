"""The process of a job: `python -m flowslide.studio.job_process FOLDER` of `flowslide.studio.jobs`.

It calls the function of `flowslide` that the job names with the job's folder as `out`, and says in
`state.json` how far it is.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

from flowslide.studio.jobs import JOB, STATE, Job
from pipeline.cli import InputError, WorkFailed
from pipeline.files import make_folder, read_json, write_json

#: Seconds between two states.
OFTEN = 0.3


def main(folder: Path) -> int:
    """Run the job of a folder; the exit code is 0 where it is done."""
    job = Job.model_validate(read_json(folder / JOB))
    began, last = time.time(), 0.0
    said: dict[str, Any] = {"state": "running", "process": os.getpid()}

    def report(done: int, total: int, message: str) -> None:
        nonlocal last
        said.update(done=done, total=total, message=message or said.get("message", ""))
        if time.time() - last > OFTEN:
            last = time.time()
            write_json(folder / STATE, {**said, "seconds": round(last - began, 1)})

    report(0, 0, "starting")
    end = {"state": "failed", "message": "ended by an error of the program: log.txt"}
    try:
        _work(job, folder, report)
        end = {"state": "done", "message": ""}
    except (InputError, WorkFailed) as error:
        end = {"state": "failed", "message": str(error)}
    finally:
        said.pop("process")
        write_json(folder / STATE, {**said, **end, "seconds": round(time.time() - began, 1)})
    return 0 if end["state"] == "done" else 1


def _work(job: Job, folder: Path, report: Any) -> None:
    import flowslide

    # One store of finished simulations for all jobs of a case.
    store = make_folder(folder.parent.parent / "runs")
    runs = folder / "runs"
    if not runs.exists():
        runs.symlink_to(store.resolve(), target_is_directory=True)
    common: dict[str, Any] = {"out": folder, "progress": report, "spacing_m": job.options.spacing_m}
    match job.kind:
        case "simulate":
            flowslide.simulate(job.folder, film="gif", **common)
        case "back_analyse":
            flowslide.back_analyse(job.folder, quick=job.options.quick, **common)
            flowslide.write_report(folder, case=job.folder)
        case "posterior":
            flowslide.posterior(job.folder, **common)
        case "predict":
            flowslide.predict(job.folder, job.options.strengths, **common)
        case "from_blow_counts":
            flowslide.predict_from_blow_counts(job.folder, **common)
        case "diagnose":
            flowslide.diagnose(job.folder, **common)
            flowslide.write_report(folder)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
