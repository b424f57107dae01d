"""The classical methods on every slide of a case.

In: `CaseSections`; perhaps the name of one slide, and judgement calls that replace those of the
case. Out: an `Analysis` for each slide, and why others could not be analysed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from geometry.scenes.scene import document_error
from inversion.classical.analysis import Analysis, analyse
from inversion.classical.judgement import FILE_NAME, Judgement, load_judgements
from inversion.classical.sections_of_case import CaseSections
from pipeline.cli import InputError


def analyse_slides(
    case: CaseSections,
    *,
    slide: str | None = None,
    changes: Mapping[str, Any] | None = None,
    on_slide: Callable[[int, int, str], None] = lambda done, of, words: None,
) -> tuple[list[Analysis], list[str]]:
    """Every slide of a case, and why others could not be analysed.

    Without a `classical.yaml` nobody has said that these sections make a slide, so sections that do
    not belong together are a finding and no error.

    Args:
        case: its sections.
        slide: name of the only one; None: all.
        changes: field of a `Judgement` -> value, for every slide.
        on_slide: called as `on_slide(done, of, words)` before each slide, and at the end.

    Raises:
        InputError: what the file or the arguments ask for cannot be.
    """
    asked = (case.folder / FILE_NAME).is_file() or slide is not None or bool(changes)
    analyses: list[Analysis] = []
    refused: list[str] = []
    try:
        found = judgements(case, slide=slide, changes=changes)
    except InputError as problem:
        if asked:
            raise
        return [], [str(problem)]
    for number, judgement in enumerate(found):
        on_slide(number, len(found), f"classical methods, {judgement.name} slide")
        try:
            analyses.append(analyse(case, judgement))
        except InputError as problem:
            if asked:
                raise
            refused.append(str(problem))
    on_slide(len(found), len(found), "classical methods")
    return analyses, refused


def judgements(
    case: CaseSections, *, slide: str | None = None, changes: Mapping[str, Any] | None = None
) -> list[Judgement]:
    """The judgements of a case with the calls that are replaced.

    Raises:
        InputError: no such slide, or a call that cannot be.
    """
    found = load_judgements(case.folder, case.measurements)
    if slide is not None:
        names = [judgement.name for judgement in found]
        if slide not in names:
            raise InputError(f"--slide {slide}: the case has {', '.join(names)}")
        found = [judgement for judgement in found if judgement.name == slide]
    try:
        return [Judgement.model_validate(one.model_dump() | dict(changes or {})) for one in found]
    except ValidationError as error:
        raise InputError(document_error(error, f"{FILE_NAME} with the options given")) from None
