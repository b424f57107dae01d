"""The page of a folder of results, whatever question it answers.

In: a folder with the document of a posterior, a joint relation or a diagnosis. Out: what a terminal
shows of it, and how its page is written again. Back-analyses are not among them: their page needs
the case as well (`report.back_analysis`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diagnosis.verdict.verdict import FILE_NAME, load_verdict
from inversion.joint.document import load_joint
from inversion.posterior.document import load_posterior
from report import diagnosis, joint, posterior


@dataclass(frozen=True)
class Answered:
    """A folder of results.

    Attributes:
        page: its page.
        summary: for a terminal.
        write: writes the page and its pictures again.
    """

    page: Path
    summary: Callable[[], str]
    write: Callable[[], Path]


def answered(folder: Path) -> Answered | None:
    """What is in a folder; None: none of these documents."""
    if (folder / "posterior.json").is_file():
        return Answered(
            folder / posterior.PAGE,
            lambda: posterior.summary(load_posterior(folder)),
            lambda: posterior.write_report(folder),
        )
    if (folder / "joint.json").is_file():
        return Answered(
            folder / joint.PAGE,
            lambda: joint.summary(load_joint(folder)),
            lambda: joint.write_report(folder),
        )
    if (folder / FILE_NAME).is_file():
        return Answered(
            folder / diagnosis.PAGE,
            lambda: diagnosis.summary(load_verdict(folder), folder),
            lambda: diagnosis.write_report(folder),
        )
    return None
