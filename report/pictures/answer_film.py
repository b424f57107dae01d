"""The answer as a film, through the pictures of `mpm_taichi`.

In: a `BackAnalysisData`. Out: `runout.mp4`, or `runout.gif` where the extra for mp4 is missing.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.cli import InputError
from report.data.back_analysis import BackAnalysisData

NAME = "runout"


def save_film(data: BackAnalysisData) -> Path | None:
    """Save the film of the answer next to the page; None where there is no trajectory or case."""
    if data.run is None or data.case is None:
        return None
    from report.pictures.case_history import save_case_film
    from report.pictures.video import check_video

    path = data.folder / f"{NAME}.mp4"
    try:
        check_video(path)
    except InputError:  # no ffmpeg here: what needs nothing more
        path = path.with_suffix(".gif")
    save_case_film(data.case, data.run, path)
    return path


def known_film(folder: Path) -> Path | None:
    """The film an earlier report has left in a folder."""
    for suffix in (".mp4", ".gif"):
        path = folder / f"{NAME}{suffix}"
        if path.is_file():
            return path
    return None
