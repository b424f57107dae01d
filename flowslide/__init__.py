"""The face of the tool: what notebooks, web pages and the command line call.

In: case folders and settings. Out: scenes, runs, answers, verdicts and reports.

    import flowslide

    result = flowslide.back_analyse("lower_san_fernando", spacing_m=3.0, quick=True)

`flowslide.api` has the functions and what they share; nothing heavy is imported before one of them
is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flowslide.api import *  # noqa: F403


def __getattr__(name: str) -> Any:
    api = import_module("flowslide.api")
    if name == "__all__" or name in api.__all__:
        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(import_module("flowslide.api").__all__)
