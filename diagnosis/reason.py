"""Why a model is not accepted, or not the answer: the condition that fails, with its numbers.

`report.sentences.finding` has the words.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from pipeline.documents import StrictDocument


class Reason(StrictDocument):
    """A condition that a model fails."""

    kind: Literal[
        "unread",
        "small_fall",
        "small_gain",
        "at_bound",
        "by_chance",
        "tests_fail",
        "misfit_left",
        "held_out_rises",
        "held_out_left",
        "others_would_do",
        "too_often_wrong",
        "told",
    ] = Field(description="the condition; told: in words, in files of earlier versions")
    of: str = Field("", description="the test that fails most, or what rests on its bound")
    numbers: list[float] = Field(
        default_factory=list,
        description="what was found and what was asked for; before and after; combined p; the "
        "share that is left",
    )


def _of_earlier_files(raw: Any) -> Any:
    """A reason that an earlier version has put into words, empty where there was none."""
    return {"kind": "told", "of": raw} if raw and isinstance(raw, str) else raw or None


WhyNot = Annotated[Reason | None, BeforeValidator(_of_earlier_files)]
"""The condition that fails; None: none does."""
